"""On which unverified facts a result rests, and how far off it could be: the conditions of a verdict (specs, section 9)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from pidemu.card.load import Statement
from pidemu.card.model.base import Form, Reference, Status
from pidemu.card.model.card_file import Equation
from pidemu.card.model.terms import Filter
from pidemu.card.references import is_active
from pidemu.certificate.figures import percent
from pidemu.conversion.request import DIGITS
from pidemu.errors import PidemuError
from pidemu.formatting import number
from pidemu.settings.settings import Settings
from pidemu.units import Role

if TYPE_CHECKING:
    from pidemu.conversion.result import Conversion

_RATIOS: Final = (0.05, 0.2)
"""Usual filter times per derivative time, from which a fact that is only assumed is varied."""
_USUAL: Final = 0.1


@dataclass(frozen=True)
class Condition:
    """An unverified fact that a result rests on.

    Attributes
    ----------
    card : str
        The card whose fact it is.
    path : str
        The field of the card, such as ``derivative.filter.ratio``.
    status : str
        ``assumed`` or ``inferred``.
    text : str
        The fact, to stand behind "if".
    why : str
        What the card says of it.
    spread : str
        What else the result would be, over the usual values; empty where that is not known.
    headline : bool
        Whether the verdict itself rests on it.
    """

    card: str
    path: str
    status: str
    text: str
    why: str = ""
    spread: str = ""
    headline: bool = True

    def __str__(self) -> str:
        return f"{self.text} ({self.status})"

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON."""
        return {
            "card": self.card, "path": self.path, "status": self.status, "text": self.text, "why": self.why, "spread": self.spread,
            "headline": self.headline,
        }  # fmt: skip


def conditions_of(c: Conversion) -> tuple[Condition, ...]:
    """Return the conditions of a conversion's verdict, what is assumed before what is inferred."""
    if c.source.card.id == c.settings.card.id and c.source.options == c.settings.options:
        return ()  # whatever the facts are, they are those of both
    names = [_name(c.source), _name(c.settings)]
    if names[0] == names[1] and c.source.card.id != c.settings.card.id:
        names = [c.source.card.id, c.settings.card.id]
    found = [*_of(c, c.source, names[0], is_source=True), *_of(c, c.settings, names[1], is_source=False)]
    seen = {x.text: x for x in reversed(found)}
    ordered = [x for x in found if seen[x.text] is x]
    return tuple(sorted(ordered, key=lambda x: (not x.headline, x.status != Status.ASSUMED)))


def _of(c: Conversion, s: Settings, name: str, *, is_source: bool) -> Iterator[Condition]:
    if s.card.data.kind == "equation":
        return
    a = s.algorithm()
    found: dict[str, tuple[int, Statement, str]] = {}
    for statement in s.variant.statements:
        evidence = statement.evidence
        if evidence is None or evidence.status not in (Status.ASSUMED, Status.INFERRED) or statement.path not in _MATTER:
            continue
        if statement.path.startswith("derivative") and not a.kd:
            continue
        words = _in_words(statement, s, name)
        rank = _MATTER.index(statement.path)
        if words is not None and (statement.key not in found or rank < found[statement.key][0]):
            found[statement.key] = rank, statement, words
    for _, statement, words in found.values():
        assert statement.evidence is not None
        yield Condition(
            s.card.id, statement.path, statement.evidence.status.value, words, statement.evidence.note or "",
            _spread(c, s, statement, is_source=is_source), headline=statement.is_assumed or not statement.path.endswith(_MINOR),
        )  # fmt: skip


_LONG: Final = 24
_MATTER: Final = (
    "derivative.filter.ratio", "derivative.filter.gain", "derivative.filter.time", "form", "proportional.on", "derivative.on",
    "derivative.filter.applies-to", "cascade.proportional.on",
)  # fmt: skip
"""Fields that make the law and that a verdict may rest on; of those with one evidence the first is named."""


_MINOR: Final = (".on", ".applies-to")
"""What a verdict does not name in its sentence where it is inferred from something documented."""


def _name(s: Settings) -> str:
    """Return what to call a controller in a sentence: its product where that is one and short, else the card."""
    product = s.card.data.product.split(" (")[0]
    return product if len(product) < _LONG and "," not in product else s.card.id


def _in_words(statement: Statement, s: Settings, name: str) -> str | None:
    """Return the fact in words; ``None`` where the result does not depend on it."""
    e, a = s.equation, s.algorithm()
    filt = e.derivative.filter
    rate = next((n for n, v in s.items() if v.role is Role.DERIVATIVE and v.active), "the derivative time")
    match statement.path:
        case "form":
            return f"{name} is of {e.form.value} form" if a.kd else None
        case "derivative.filter.ratio" if filt is not None and isinstance(filt.ratio, float | int):
            return f"{name}'s derivative filter is {_base(e, filt, rate)}/{number(1 / filt.ratio)}"
        case "derivative.filter.gain" if filt is not None and isinstance(filt.gain, float | int):
            return f"{name}'s derivative filter is {_base(e, filt, rate)}/{number(filt.gain)}"
        case "derivative.filter.time" if filt is not None and isinstance(filt.time, float | int):
            return f"{name}'s derivative filter is {number(filt.time)} s"
        case "derivative.filter.applies-to" if filt is not None:
            return f"{name}'s derivative filter is {_PLACES[filt.applies_to]}"
        case "derivative.on" if filt is None and statement.key == "derivative" and statement.is_assumed:
            return f"{name} has no derivative filter"
        case "proportional.on" if a.kp:
            return f"P of {name} acts on the {_ON[e.proportional.on]}"
        case "derivative.on" if a.kd:
            return f"D of {name} acts on the {_ON[e.derivative.on]}"
        case "cascade.proportional.on":
            return f"P of {name} acts on the {_ON[e.cascade.proportional.on]} in cascade" if e.cascade else None
    return None


def _base(e: Equation, filt: Filter[Reference], rate: str) -> str:
    """Return what a filter's ratio or gain refers to."""
    gain = next((n for n, s in e.settings.items() if s.sets == Role.GAIN.value and is_active(e, n, s)), "the gain")
    return f"({rate}/{gain})" if filt.of == "derivative-time" and e.form is Form.PARALLEL else rate


_PLACES: Final = {
    "term": "on the derivative term alone", "lead-lag": "the lag of a lead-lag", "measurement": "on the whole measurement",
    "output": "on the output",
}  # fmt: skip
_ON: Final = {"error": "error", "pv": "measurement", "weighted": "weighted error", "none": "nothing"}


def _spread(c: Conversion, s: Settings, statement: Statement, *, is_source: bool) -> str:
    """Return what else would come out over the usual values of a fact."""
    if statement.path == "form":
        other = Form.SERIES if s.equation.form is Form.STANDARD else Form.STANDARD
        if s.equation.form is Form.PARALLEL:
            return ""
        found = _result(c, s, f"if it is {_FORMS[other]}", lambda e: replace(e, form=other), is_source=is_source)
        return "; ".join(filter(None, (found, _bump_test(s, other) if is_source else "")))
    if statement.path == "derivative.filter.ratio":
        texts = [
            _result(c, s, f"with {ratio:g}", lambda e, r=ratio: _with_filter(e, ratio=r), is_source=is_source)  # type: ignore[misc]
            for ratio in _RATIOS
        ]
        return "; ".join(t for t in texts if t)
    if statement.path == "derivative.on" and s.equation.derivative.filter is None and statement.is_assumed:
        return _result(
            c,
            s,
            f"with a filter of {_USUAL:g} of the derivative time",
            lambda e: _with_filter(e, ratio=_USUAL),
            is_source=is_source,
        )
    return ""


def _bump_test(s: Settings, other: Form) -> str:
    """Return the test on the old controller that tells two forms apart: what a PV step leaves beside the integral."""
    varied = replace(s, variant=replace(s.variant, equation=replace(s.equation, form=other)))
    jumps = [number(abs(x.law().moments()[1]), 4) for x in (s, varied)]
    return (
        f"a bump test tells: once the derivative has died out, a PV step of 1 % has moved the old output by {jumps[0]} % "
        f"({s.equation.form.value}) or {jumps[1]} % ({other.value}), besides the ramp"
    )


_FORMS: Final = {Form.SERIES: "interacting (series)", Form.STANDARD: "noninteracting (standard)"}


def _with_filter(e: Equation, ratio: float) -> Equation:
    filt = e.derivative.filter
    new: Filter[Reference] = Filter(applies_to="term", ratio=ratio) if filt is None else replace(filt, ratio=ratio)
    return replace(e, derivative=replace(e.derivative, filter=new))


def _result(c: Conversion, s: Settings, when: str, change: Callable[[Equation], Equation], *, is_source: bool) -> str:
    """Return the dials that another fact of the source leads to, or how far off the dials are with another one of the target."""
    varied = replace(s, variant=replace(s.variant, equation=change(s.equation)))
    try:
        if not is_source:
            work = c.ranking[0].solver
            if work is None:
                return ""
            return f"{when} the two differ by {percent(work.yardstick.continuous_deviation(varied))} in the loop band"
        from pidemu.conversion.convert import again

        options, digits = dict(c.settings.options), c.request.digits or DIGITS
        other = again(c, varied, options=options, allow_approximate=True, digits=digits, process=None)
    except PidemuError:
        return ""
    dials = [
        f"{n} {number(v.value, 4)}"
        for n, v in other.settings.items()
        if v.active and number(v.value, 4) != number(c.settings[n].value, 4)
    ]
    if dials:
        return f"{when}: {', '.join(dials)}"
    return f"{when}: the same dials, {percent(other.certificate.feedback.loop_band.max_deviation)} in the loop band"
