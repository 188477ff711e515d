"""Converting settings from one card to another, with the certificate that says how near they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pidemu.card.base import Form
from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.certificate.models import Certificate, Rounded, Verdict
from pidemu.certificate.sentence import sentence
from pidemu.certificate.setpoint_filter import SetpointFilter, setpoint_filter
from pidemu.conversion.advice import warnings_for
from pidemu.conversion.aim import Match, read_aim
from pidemu.conversion.choices import Attempt, attempts
from pidemu.conversion.issue import full_certificate
from pidemu.conversion.match import NoMatchError
from pidemu.conversion.request import Request
from pidemu.conversion.solve import Solver
from pidemu.conversion.target import Target, is_computed
from pidemu.errors import ConversionRefusedError, ScanError, SettingError
from pidemu.plain import json_safe
from pidemu.settings import Settings, Value, limits
from pidemu.units import Role, is_reciprocal, parse_unit

if TYPE_CHECKING:
    from pidemu.cutover.plan import TransferPlan
    from pidemu.loop.process import Process


_SCAN_RULES: Final = ("integral.rule", "derivative.rule", "derivative.filter.rule")


@dataclass(frozen=True)
class Textbook:
    """What the rule in manuals would have given, shown beside the default.

    Attributes
    ----------
    settings : Settings or None
        The settings; ``None`` where the rule has no answer or the target refuses it.
    certificate : Certificate or None
        Its figures.
    reason : str
        Why there is no answer.
    """

    settings: Settings | None
    certificate: Certificate | None
    reason: str = ""


@dataclass(frozen=True)
class Conversion:
    """Settings of a target that stand for those of a source.

    Attributes
    ----------
    source, settings : Settings
        The source's and the target's settings.
    match : str
        How they were found: exact, low-frequency, textbook, frequency, loop or constrained.
    certificate : Certificate
        How near they are.
    textbook : Textbook
        What the textbook rule would have given.
    warnings : tuple of str
        What the target does differently, in words.
    refusal : str
        Why the target refused, where these are only the nearest settings.
    chosen : dict of str to str
        Options of the target that were chosen here, because nobody gave them, and are not as the card delivers them.
    ranking : tuple of Attempt
        The choices of the options that were looked at, the best first.
    factor : float
        What the source's gain was multiplied by for new signal ranges; negative where the action changes.
    scan : tuple of float or None
        Scan intervals of source and target [s].
    process : Process or None
        The process, where it was given.
    request : Request
        What was asked for.
    """

    source: Settings
    settings: Settings
    match: Match
    certificate: Certificate
    textbook: Textbook
    warnings: tuple[str, ...]
    refusal: str = ""
    chosen: Mapping[str, str] = field(default_factory=dict)
    ranking: tuple[Attempt, ...] = ()
    factor: float = 1.0
    scan: tuple[float, float] | None = None
    process: Process | None = None
    request: Request = field(default_factory=Request)

    @property
    def verdict(self) -> Verdict:
        """``exact``, ``exact-feedback`` or ``approximate``."""
        return self.certificate.verdict

    @property
    def sentence(self) -> str:
        """The verdict in one sentence for whoever stands at the loop."""
        return sentence(self.certificate)

    @property
    def setpoint_filter(self) -> SetpointFilter | None:
        """The setpoint filter that would make the setpoint paths agree; ``None`` where they do, or where no filter can."""
        return setpoint_filter(self.source.law(), self.settings.law(), self.factor)

    def transfer_plan(self, sp: float, pv: float, op: float) -> TransferPlan:
        """Return what to set, and in which order, so that the cut-over to the target does not bump.

        Parameters
        ----------
        sp, pv, op : float
            Setpoint, measurement and output at the cut-over [engineering units where the ranges are given, else %].
        """
        from pidemu.cutover.plan import transfer_plan

        return transfer_plan(self.settings, sp, pv, op, scan=self.scan[1] if self.scan else None)

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What the result rests on without anybody having said so; what makes the law first."""
        found = [(a, f"{s.card.id}: {a}") for s in (self.source, self.settings) for a in s.assumptions()]
        law = [text for a, text in found if a.makes_the_law]
        return tuple(dict.fromkeys(law + [text for a, text in found if not a.makes_the_law]))

    @property
    def law_assumptions(self) -> tuple[str, ...]:
        """Those of `assumptions` that the settings rest on: what makes the law and, where these make up for scans, scan rules."""
        cost = self.certificate.scan_cost
        rules = _SCAN_RULES if cost is not None and cost.compensated else ()
        found = [(s, a) for s in (self.source, self.settings) for a in s.assumptions() if a.makes_the_law or a.path in rules]
        return tuple(dict.fromkeys(f"{s.card.id}: {a}" for s, a in found))

    @property
    def inferences(self) -> tuple[str, ...]:
        """What of the two equations is inferred from something documented, not itself stated."""
        found = [f"{s.card.id}: {a}" for s in (self.source, self.settings) for a in s.inferences()]
        return tuple(dict.fromkeys(found))

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, the form of ``pidemu convert --json``."""
        plain = {
            "from": self.source.to_dict(),
            "to": self.settings.to_dict(),
            "match": self.match,
            "verdict": self.verdict,
            "sentence": self.sentence,
            "chosen": dict(self.chosen),
            "certificate": self.certificate.to_dict(),
            "textbook": {
                "to": self.textbook.settings.to_dict() if self.textbook.settings else None,
                "certificate": self.textbook.certificate.to_dict() if self.textbook.certificate else None,
                "reason": self.textbook.reason,
            },
            "scan": list(self.scan) if self.scan else None,
            "gain_factor": self.factor,
            "process": str(self.process) if self.process else None,
            "setpoint_filter": self.setpoint_filter.to_dict() if self.setpoint_filter else None,
            "warnings": list(self.warnings),
            "notes": [*self.source.notes, *self.settings.notes],
            "assumptions": list(self.assumptions),
            "inferences": list(self.inferences),
        }
        safe: dict[str, Any] = json_safe(plain)
        return safe


def convert(
    source: Settings,
    target: str | Path | Card,
    *,
    options: Mapping[str, object] | None = None,
    given: Mapping[str, object] | None = None,
    scan: float | tuple[float, float] | None = None,
    match: str | None = None,
    allow_approximate: bool = False,
    pv_range: tuple[float, float] | None = None,
    op_range: tuple[float, float] | None = None,
    round_dials: bool = False,
    process: Process | None = None,
    compensate: bool = True,
    all_options: bool = False,
    emulate: bool = True,
) -> Conversion:
    """Convert settings to another card.

    Parameters
    ----------
    source : Settings
        The settings.
    target : str, path or Card
        The card to convert to, its id, or its file.
    options : mapping, optional
        Options of the target. Those not named are chosen so that the verdict is best, the card's defaults where these are as good.
    given : mapping, optional
        Dials of the target that shall have these values, such as a filter factor or a setpoint weight.
    scan : float or tuple of float, optional
        Scan interval of both, or of source and target [s]: the settings make up for intervals and rules that differ, and
        certificate and verdict are about the laws at these scans.
    match : str, optional
        How to match: ``"exact"``, ``"low-frequency"``, ``"textbook"``, ``"frequency:0.02rad/s"``, ``"frequency"`` (at the crossover
        with the process), ``"loop"`` (with a process: the load response changes least), ``"constrained"`` (the largest deviation in
        the loop band is least); by default exact where possible, else low-frequency.
    allow_approximate : bool
        Where the target refuses, return the nearest settings instead of raising.
    pv_range, op_range : tuple of float, optional
        Signal ranges of the target [engineering units]; by default the source's. Where they differ, gains are rescaled for
        the same effect in engineering units.
    round_dials : bool
        Round the dials to the target's resolution; the certificate states the effect.
    process : Process, optional
        The process, for the figures of the closed loop before and after, and to place the loop band.
    compensate : bool
        Whether the settings make up for scan intervals and rules that differ; otherwise they are those of the continuous law.
    all_options : bool
        Try every choice of the options, also where the card's defaults are exact: see `Conversion.ranking`.
    emulate : bool
        Whether the certificate emulates both controllers; without it the linear figures alone are stated, sooner.

    Returns
    -------
    Conversion
        The target's settings, the certificate and what to watch for.

    Raises
    ------
    ConversionRefusedError
        The target cannot do what the source does; the error holds the nearest settings and what they would cost.
    SettingError, CardError
        The target, the match, an option or a given dial is unknown, or a range of the source is missing.
    ScanError
        A scan interval is no positive number, or a filter is unstable at it.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("generic/series").settings(K=2, Ti=15, Td=5)
    >>> conv = pidemu.convert(s, "generic/standard")
    >>> conv.verdict, round(conv.settings["K"].value, 4), conv.settings["Ti"].value, conv.settings["Td"].value
    ('exact', 2.6667, 20.0, 3.75)
    """
    aim = read_aim(match)
    if process is None and aim.frequency is None and aim.match in ("frequency", "loop"):
        other = " or a frequency, frequency:0.02rad/s" if aim.match == "frequency" else ""
        raise SettingError(
            f"the match '{aim.match}' needs the process{other}; give process=, or --process gain=...,lag=...,delay=..."
        )
    card = target if isinstance(target, Card) else load_card(target)
    _refuse_recursions(source, card)
    factor = _rescaling(source, pv_range, op_range)
    scans = _scans(scan)
    same = source.card.id == card.id
    taken = {**(source.options if same else {}), **_named_as(card, options or {})}
    fixed = {**_shared(source, card), **(given or {})}
    if scans is not None:
        source.law(scans[0])  # refuses an interval that is none

    def solver(named: Mapping[str, object]) -> Solver:
        goal = Target(card, named, fixed, pv_range or source.pv_range, op_range or source.op_range)
        goal.reject_missing()
        sign = -1 if _is_negative(source, goal) else 1
        return Solver(source, goal, sign * factor, scans, process, compensate=compensate)

    ranking = attempts(card, taken, solver, aim, every=all_options)
    best = ranking[0]
    work, settings, how, refusal = best.solver, best.settings, best.match, ""
    if settings is None or work is None:
        first = min(ranking, key=lambda a: len(a.changed))
        if first.solver is None or first.error is None or isinstance(first.error, ScanError):
            raise first.error or ConversionRefusedError(f"{card.id} has no options left to try")
        work = first.solver
        settings, refusal = work.refused(first.error)
        refusal += _other_options(attempts(card, {}, solver, aim, every=False)[0], taken) if options else ""
        if settings is None:
            raise ConversionRefusedError(refusal)
        best, how = first, "constrained"
    exact_dials = settings
    if round_dials:
        settings, rounded = _rounded(settings)
    certificate = full_certificate(work, settings, emulate=emulate)
    if round_dials and rounded:
        before = work.certify(exact_dials).feedback
        certificate = replace(certificate, dials=rounded, feedback_before_rounding=before)
    request = Request(
        options or {}, given or {}, scans, match, pv_range, op_range, process, compensate, allow_approximate, round_dials
    )
    book, chosen = _textbook(work), dict(best.changed)
    conversion = Conversion(
        source, settings, how, certificate, book, (), refusal, chosen, ranking, work.factor, scans, process, request
    )
    conversion = replace(conversion, warnings=tuple(warnings_for(conversion)))
    if refusal and not allow_approximate:
        raise ConversionRefusedError(refusal, conversion)
    return conversion


def _other_options(attempt: Attempt, taken: Mapping[str, object]) -> str:
    """Return which options, instead of those that the user chose, would do; empty where none would."""
    if attempt.settings is None:
        return ""
    chosen = attempt.settings.options
    words = {
        n: chosen[n] for n in chosen if n in attempt.changed or (n in taken and str(taken[n]).casefold() != chosen[n].casefold())
    }
    text = " ".join(f'--set "{n}={c}"' if " " in c else f"--set {n}={c}" for n, c in words.items())
    return f"; other options would do: {text}: {attempt.verdict}"


def _refuse_recursions(source: Settings, target: Card) -> None:
    for card in (source.card, target):
        if card.data.form is Form.DAHLIN:
            raise ConversionRefusedError(
                f"{card.id} cancels the pole of a process model and has no PID settings; tune the other card for that process "
                f"instead"
            )


def _scans(scan: float | tuple[float, float] | None) -> tuple[float, float] | None:
    """Return the scan intervals of source and target [s]."""
    if scan is None:
        return None
    try:
        pair = (float(scan), float(scan)) if isinstance(scan, Real) else tuple(float(h) for h in scan)  # type: ignore[union-attr]
    except (TypeError, ValueError):
        pair = ()
    if len(pair) != 2 or not all(math.isfinite(h) and h > 0 for h in pair):
        raise ScanError(f"scan is {scan!r}; it is a positive interval in seconds, or two: (1.0, 0.5)")
    return pair[0], pair[1]


def _named_as(card: Card, options: Mapping[str, object]) -> dict[str, object]:
    """Return options under the card's own spelling of their names."""
    names = {o.casefold(): o for o in card.options}
    return {names.get(o.casefold(), o): choice for o, choice in options.items()}


def _is_negative(source: Settings, target: Target) -> bool:
    """Whether the source has negative gains only, and the target no place for them: then the action changes instead."""
    a, gain = source.algorithm(), target.dial(Role.GAIN)
    return max(a.kp, a.ki, a.kd) <= 0 > min(a.kp, a.ki, a.kd) and gain is not None and limits(gain[1])[0] >= 0


def _shared(source: Settings, target: Card) -> dict[str, object]:
    """Return what stays as it is within one card: whatever a conversion does not compute, and settings that many loops share."""
    if source.card.id != target.id:
        return {}
    return {
        n: v.value
        for n, v in source.items()
        if v.active and (v.setting.scope == "module" or not is_computed(source.equation, n, v.role))
    }


def _textbook(solver: Solver) -> Textbook:
    """Return what the textbook rule gives, with its figures."""
    try:
        book = solver.forms.textbook()
        return Textbook(book, solver.certify(book))
    except (NoMatchError, SettingError) as error:
        return Textbook(None, None, str(error))


def _rescaling(source: Settings, pv: tuple[float, float] | None, op: tuple[float, float] | None) -> float:
    """Return the factor on the percent gain for new ranges (specs/equations.md, section 3, rescaling)."""
    factor = 1.0
    for name, new, old, power in (("pv_range", pv, source.pv_range, 1), ("op_range", op, source.op_range, -1)):
        if new is not None and old is None and new != (0.0, 100.0):
            raise SettingError(f"{source.card.id}: the target's {name} is given, the source's is not; give both")
        if new is not None and old is not None:
            factor *= ((new[1] - new[0]) / (old[1] - old[0])) ** power
    return factor


def _rounded(settings: Settings) -> tuple[Settings, tuple[Rounded, ...]]:
    """Round every dial that has a resolution."""
    values = {name: _round(value) for name, value in settings.items()}
    dials = tuple(Rounded(n, settings[n].value, v.value) for n, v in values.items() if v.value != settings[n].value)
    return replace(settings, values_by_name=values), dials


def _round(value: Value) -> Value:
    step = value.setting.resolution
    if step is None or not value.active or value.off:
        return value
    low, high = limits(value.setting)
    new = float(f"{min(max(round(value.value / step) * step, low), high):.12g}")
    if new == 0 and is_reciprocal(value.role, parse_unit(value.unit)):
        new = step  # zero would be infinite action
    return replace(value, value=new)
