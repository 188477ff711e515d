"""A conversion, a question or a refusal as plain values, the form of ``--json``: with its version, and all to compute it again.

``specs/conversion.schema.json`` states the form, made from the models in `pidemu.conversion.schema`.
"""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import pidemu
from pidemu.formatting import json_safe

if TYPE_CHECKING:
    from pidemu.conversion.refused import ConversionRefusedError, QuestionError
    from pidemu.conversion.result import Conversion
    from pidemu.settings.settings import Settings

SCHEMA: Final = "pidemu-conversion-1"
"""Name and version of the form; a change that breaks a reader counts the version up."""


def provenance(c: Conversion, date: datetime.date | None = None) -> dict[str, Any]:
    """Return what a certificate was made from: form, date, versions, and what was asked for.

    Parameters
    ----------
    c : Conversion
        The conversion.
    date : datetime.date, optional
        Date of the certificate; by default today.
    """
    return {
        "schema": SCHEMA,
        "pidemu": pidemu.__version__,
        "date": (date or datetime.date.today()).isoformat(),
        "cards": card_versions(c),
        "verification": {s.card.id: s.card.verification.class_ for s in (c.source, c.settings)},
        "request": {"from": source_as_given(c.source), "to": c.settings.card.id, **c.request.to_dict()},
    }


def card_versions(c: Conversion) -> dict[str, str]:
    """Return the SHA-256 of the file of each card, by id; the source's first."""
    return {s.card.id: s.card.digest for s in (c.source, c.settings)}


def source_as_given(s: Settings) -> dict[str, Any]:
    """Return the source as it was given: what is needed to make these settings again."""
    return {
        "card": s.card.id,
        "settings": {n: v.typed if isinstance(v.typed, str) else v.value for n, v in s.items() if v.given},
        "options": {n: x for n, x in s.options.items() if n not in s.defaulted},
        "pv_range": s.pv_range and s.pv_range.argument,
        "op_range": s.op_range and s.op_range.argument,
        "lag_on_pv": s.lag,
    }


def question_document(error: QuestionError, known: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return a question as plain values.

    Parameters
    ----------
    error : QuestionError
        The question.
    known : mapping, optional
        What is known of both sides: ``from`` and ``to``.
    """
    plain = {"schema": SCHEMA, **(known or {}), "verdict": "question", "questions": [q.to_dict() for q in error.questions]}
    safe: dict[str, Any] = json_safe(plain)
    return safe


def refusal_document(error: ConversionRefusedError, known: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return a refusal as plain values, with the nearest settings and what could do instead; see `question_document`."""
    plain = {
        "schema": SCHEMA,
        **(known or {}),
        "verdict": "refused",
        "reason": str(error),
        "nearest": None if error.nearest is None else error.nearest.to_dict(),
        "alternatives": list(error.alternatives),
    }
    safe: dict[str, Any] = json_safe(plain)
    return safe
