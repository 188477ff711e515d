"""A certificate in a file, as ``pidemu convert --json`` wrote it: read and checked, whatever the file holds."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final, NoReturn

from pydantic import ValidationError
from pydantic_core import ErrorDetails

import pidemu
from pidemu.conversion.document import SCHEMA
from pidemu.conversion.schema import ConversionPart
from pidemu.errors import CertificateError
from pidemu.excerpt import quoted, visible
from pidemu.files.reading import Kind, read_text

LARGEST: Final = 16 * 2**20
"""Size of a file beyond which it is not read [bytes]; a certificate has some 50 kB."""
_MOST_DIGITS: Final = 400
"""More than the largest number has that a computer works with."""
_AGAIN: Final = "write the certificate again with 'pidemu convert ... --json'"
_KIND: Final = Kind("a certificate", _AGAIN, LARGEST)


class Signed(ConversionPart):
    """A whole certificate; a key that this pidemu does not know is refused, wherever it stands, as it could not be verified."""

    certificate: dict[str, Any]

    @property
    def plain(self) -> dict[str, Any]:
        """The certificate as plain values, as the file has it."""
        return self.model_dump(by_alias=True, exclude_unset=True)


def read_signed(source: str | Path | Mapping[str, Any]) -> tuple[str, Signed]:
    """Return a certificate with what to call it in messages.

    Parameters
    ----------
    source : str, path or mapping
        The file, or what it holds.

    Raises
    ------
    CertificateError
        The file cannot be read, is not a certificate or not a whole one, or has another form.
    """
    if isinstance(source, Mapping):
        return "certificate", _checked("certificate", dict(source))
    name = visible(str(source))
    return name, _checked(name, _parsed(name, read_text(source, CertificateError, _KIND, controls=False)))


def _parsed(name: str, text: str) -> Any:
    if not text.strip():
        raise CertificateError(f"{name}: the file is empty; {_AGAIN}")
    try:
        return json.loads(text, parse_int=_integer, parse_constant=_refuse, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        cut = error.pos >= len(text.rstrip()) or error.msg.startswith("Unterminated")
        what = "the file ends in the middle" if cut else f"not JSON: {error.msg[0].lower()}{error.msg[1:]}"
        raise CertificateError(f"{name}:{error.lineno}:{error.colno}: {what}; {_AGAIN}") from None
    except RecursionError:
        raise CertificateError(f"{name}: nested too deeply for a certificate; {_AGAIN}") from None
    except ValueError as error:
        raise CertificateError(f"{name}: {error}; {_AGAIN}") from None


def _integer(digits: str) -> int:
    if len(digits) > _MOST_DIGITS:
        raise ValueError(f"a number of {len(digits):,} digits")
    return int(digits)


def _refuse(word: str) -> NoReturn:
    raise ValueError(f"not JSON: {word} is not a number in JSON")


def _once(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"not JSON: the key '{quoted(key)}' stands twice in one place")
        found[key] = value
    return found


def _checked(name: str, plain: Any) -> Signed:
    form = plain.get("schema") if isinstance(plain, dict) else None
    if form is None:
        raise CertificateError(f'{name}: not a certificate, as it does not begin with "schema": "{SCHEMA}"; {_AGAIN}')
    if form != SCHEMA:
        raise CertificateError(
            f"{name}: schema: the form is '{quoted(form)}', and pidemu {pidemu.__version__} reads '{SCHEMA}'; verify it with "
            "the pidemu that wrote it, or convert again"
        )
    if plain.get("verdict") in ("question", "refused"):
        what = "a question that has to be answered first" if plain["verdict"] == "question" else "a refusal"
        raise CertificateError(f"{name}: verdict: this is {what}, not a certificate; convert again, and verify what that gives")
    try:
        signed = Signed.model_validate(plain)
    except ValidationError as error:
        raise CertificateError(f"{name}: {_fault(error.errors()[0], plain)}; {_AGAIN}") from None
    for card in (signed.request.source.card, signed.request.to):
        if card not in signed.cards:
            raise CertificateError(f"{name}: cards: the version of {card} is missing; {_AGAIN}")
    for card in signed.cards:
        if card not in (signed.request.source.card, signed.request.to):
            raise CertificateError(f"{name}: cards: '{quoted(card)}' has no part in this conversion; {_AGAIN}")
    return signed


def _fault(error: ErrorDetails, plain: Any) -> str:
    """Return the place and what is wrong there."""
    path, value = [], plain
    for step in error["loc"]:
        inside = (isinstance(value, dict) and step in value) or (
            isinstance(value, list) and isinstance(step, int) and step < len(value)
        )
        if inside:
            value = value[step]
            path.append(quoted(step))
    if error["type"] == "missing":
        return f"{'.'.join([*path, quoted(error['loc'][-1])])}: missing"
    place = ".".join(path)
    if error["type"] == "extra_forbidden":
        return f"{place}: an unknown key"  # of a later pidemu, or of nobody: it could not be verified
    message = error["msg"].removeprefix("Input ")
    return f"{place}: {message[0].lower()}{message[1:]}, and is {_shown(value)}"


def _shown(value: Any) -> str:
    if isinstance(value, dict | list):
        return "a list" if isinstance(value, list) else "a group of keys"
    return quoted(json.dumps(value))
