"""Verifying a signed certificate: it is computed again from what was asked, and compared with what it says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

import pidemu
from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.conversion.changes import changes, not_compared
from pidemu.conversion.comparison import Change
from pidemu.conversion.convert import convert
from pidemu.conversion.document import card_versions
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.result import Conversion
from pidemu.conversion.schema import AsGiven, Asked
from pidemu.conversion.signed import Signed, read_signed
from pidemu.errors import CardNotFoundError, CertificateError, PidemuError

SHORT: Final = 12
"""Digits of a card's version in print."""


@dataclass(frozen=True)
class Verification:
    """What came of computing a certificate again.

    Attributes
    ----------
    name : str
        The file.
    signed : Signed
        The certificate.
    conversion : Conversion or None
        The conversion as it is today; ``None`` where it is refused, or where something is asked now.
    changes : tuple of Change
        What is not as the certificate says.
    cards : dict of str to str
        Versions of the cards today.
    """

    name: str
    signed: Signed
    conversion: Conversion | None
    changes: tuple[Change, ...]
    cards: Mapping[str, str]

    @property
    def unchanged(self) -> bool:
        """Whether everything is still as the certificate says, but for what is `not_compared`."""
        return not self.changes

    @property
    def not_compared(self) -> tuple[str, ...]:
        """What of the certificate is not held against anything."""
        return not_compared(self.signed, self.cards)

    @property
    def title(self) -> str:
        """What was verified, in one line."""
        s = self.signed
        tag = f"{s.request.tag}: " if s.request.tag else ""
        return f"{tag}{s.request.source.card} -> {s.request.to}, certificate of {s.date} by pidemu {s.pidemu}"

    @property
    def versions(self) -> tuple[str, ...]:
        """What has another version than on the certificate."""
        found = [
            f"{card} is another version: {self.signed.cards[card][:SHORT]} on the certificate, {digest[:SHORT]} now"
            for card, digest in self.cards.items()
            if digest != self.signed.cards[card]
        ]
        if self.signed.pidemu != pidemu.__version__:
            found.append(f"pidemu is another version: {self.signed.pidemu} on the certificate, {pidemu.__version__} now")
        return tuple(found)

    @property
    def because(self) -> tuple[str, ...]:
        """What can have caused the changes; empty where there are none."""
        if self.unchanged:
            return ()
        edited = (
            "cards and pidemu have the versions of the certificate: the file was edited after pidemu wrote it, or this pidemu was"
        )
        return self.versions or (edited,)

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON."""
        s = self.signed
        return {
            "unchanged": self.unchanged,
            "changes": [asdict(c) for c in self.changes],
            "because": list(self.because),
            "not_compared": list(self.not_compared),
            "date": s.date,
            "pidemu": {"certificate": s.pidemu, "now": pidemu.__version__},
            "cards": {card: {"certificate": s.cards[card], "now": digest} for card, digest in self.cards.items()},
        }


def verify(certificate: str | Path | Mapping[str, Any], vendors: Sequence[str | Path] = ()) -> Verification:
    """Compute a signed certificate again, and say what is not as it says.

    Parameters
    ----------
    certificate : str, path or mapping
        The file that ``pidemu convert --json`` wrote, or `Conversion.to_dict`.
    vendors : sequence of path, optional
        Folders of the user's own cards, searched before the built-in ones.

    Returns
    -------
    Verification
        Whether everything is unchanged, and otherwise what changed and which card or pidemu has another version. Dials are compared
        to 1e-6, figures to 1e-4 of their size: what computing on another machine may move. What is not compared is named.

    Raises
    ------
    CertificateError
        The file is not a certificate, not a whole one, or has another form; or one of its cards is not there.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4)
    >>> signed = pidemu.convert(s, "emerson/deltav").to_dict()
    >>> pidemu.verify(signed).unchanged
    True
    >>> signed["to"]["settings"]["GAIN"]["value"] = 3.0
    >>> print(pidemu.verify(signed).changes[0])
    dial GAIN: 3 %/% on the certificate, 2 %/% now
    """
    name, signed = read_signed(certificate)
    source, target = (_card(name, place, card, vendors) for place, card in _cards(signed))
    versions = {source.id: source.digest, target.id: target.digest}
    with np.errstate(all="ignore"):  # a file may hold any number
        try:
            found = _again(signed, source, target)
        except PidemuError as error:
            return Verification(name, signed, None, (Change("conversion", "", signed.verdict, _outcome(error)),), versions)
        return Verification(name, signed, found, tuple(changes(signed, found)), versions | card_versions(found))


def _cards(signed: Signed) -> tuple[tuple[str, str], tuple[str, str]]:
    return ("request.from.card", signed.request.source.card), ("request.to", signed.request.to)


def _card(name: str, place: str, card: str, vendors: Sequence[str | Path]) -> Card:
    if card.endswith((".yaml", ".yml")):
        raise CertificateError(f"{name}: {place}: '{card}' is a file, not the id of a card; write the certificate again")
    try:
        return load_card(card, vendors)
    except CardNotFoundError as error:
        if not str(error).startswith("no card "):
            raise
        raise CertificateError(
            f"{name}: {place}: there is no card '{card}'; name the folder that it lies in with --vendors DIR"
        ) from None


def _again(signed: Signed, source: Card, target: Card) -> Conversion:
    """Return the conversion that the certificate is of, computed today."""
    asked, figures = signed.request, signed.certificate
    emulate = figures.get("scan_by_scan") is not None or bool(figures.get("not_emulated"))
    settings = replace(source.settings(_given(asked.source)), lag=asked.source.lag_on_pv)
    try:
        return convert(settings, target, emulate=emulate, **_arguments(asked))
    except ConversionRefusedError as error:
        if signed.refusal and error.nearest is not None:  # the nearest settings of a refusal were signed
            return error.nearest
        raise


def _given(source: AsGiven) -> dict[str, object]:
    ranges = {"pv_range": source.pv_range, "op_range": source.op_range}
    return {**source.options, **source.settings, **{n: r for n, r in ranges.items() if r is not None}}


def _arguments(asked: Asked) -> dict[str, Any]:
    """Return the arguments of `convert`."""
    found = {name: getattr(asked, name) for name in type(asked).model_fields if name not in ("source", "to")}
    if asked.process is not None:
        from pidemu.process.process import parse_process

        found["process"] = parse_process(asked.process)
    return found


def _outcome(error: PidemuError) -> str:
    if isinstance(error, QuestionError):
        return f"a question: {error}"
    if isinstance(error, ConversionRefusedError):
        return f"refused: {error}"
    return f"an error: {error}"
