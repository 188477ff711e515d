"""Migrations worked out by hand: what pidemu types, asks, says and refuses."""

from __future__ import annotations

import math

import pytest

import pidemu
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.result import Conversion
from tests.conversion.migrations import CASES, Migration, Typed


def converted(case: Migration) -> Conversion:
    return pidemu.convert(pidemu.load_card(case.source).settings(case.given), case.target, **case.arguments)


def is_typed(c: Conversion, typed: Typed) -> bool:
    s = c.settings
    dials = all(math.isclose(s[n].value, x, rel_tol=typed.within, abs_tol=1e-9) for n, x in typed.dials.items())
    return dials and all(s.options[n] == x for n, x in typed.options.items())


def everything_said(c: Conversion) -> str:
    return "\n".join(
        [c.sentence, *c.warnings, *map(str, c.beside), *(f"{x} {x.spread}" for x in c.conditions), *c.at_the_loop, *c.source.notes]
    )


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.tag)
def test_pidemu_types_what_an_engineer_would(case: Migration) -> None:
    if case.asked:
        with pytest.raises(QuestionError) as asked:
            converted(case)
        question = next(q for q in asked.value.questions if q.about == case.about)
        assert question.kind == case.asked
        assert len(asked.value.questions) == 1
        assert case.typed is not None
        answers = [a.conversion for a in question.readings if a.conversion is not None]
        assert any(is_typed(c, case.typed) for c in answers)
        return
    if case.refused:
        with pytest.raises(ConversionRefusedError) as refusal:
            converted(case)
        assert not isinstance(refusal.value, QuestionError)
        assert any(case.refused in text for text in refusal.value.alternatives)
        return
    found = converted(case)
    assert case.typed is not None
    assert any(is_typed(found, typed) for typed in (case.typed, *case.accepted)), found.settings.summary
    said = everything_said(found)
    assert [words for words in case.says if words not in said] == []
    assert not (case.not_exact and found.verdict == "exact")
