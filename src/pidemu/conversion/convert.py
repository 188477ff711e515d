"""Converting settings from one card to another, with the certificate that says how near they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pidemu.card.base import Form
from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.conversion.advice import warnings_for
from pidemu.conversion.aim import Aim, read_aim
from pidemu.conversion.choices import Attempt, attempts
from pidemu.conversion.issue import full_certificate
from pidemu.conversion.match import NoMatchError
from pidemu.conversion.moments import check_optimiser
from pidemu.conversion.request import Request, read_request
from pidemu.conversion.result import Conversion, Textbook
from pidemu.conversion.rounding import rounded
from pidemu.conversion.solve import Solver
from pidemu.conversion.target import Target, is_computed
from pidemu.errors import ConversionRefusedError, ScanError, SettingError
from pidemu.settings import Settings, limits
from pidemu.units import Role

if TYPE_CHECKING:
    from pidemu.loop.process import Process

_SMALLEST, _LARGEST = 1e-120, 1e120
"""Gains beyond these are mistakes, and their squares leave the range of floating point."""


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
    aim = _aim(match, process)
    card = target if isinstance(target, Card) else load_card(target)
    _refuse_recursions(source, card)
    _refuse_absurd_gains(source)
    request = read_request(card, options, given, scan, match, pv_range, op_range)
    request = replace(request, process=process, compensate=compensate, allow_approximate=allow_approximate, round_dials=round_dials)
    source = source.at_scan(request.scan[0] if request.scan else None)
    factor = _rescaling(source, request)
    taken = {**(source.options if source.card.id == card.id else {}), **request.options}
    fixed = {**_shared(source, card), **request.given}
    if request.scan is not None:
        source.law(request.scan[0])  # refuses an interval at which a filter of the source is unstable

    def solver(named: Mapping[str, object]) -> Solver:
        ranges = (request.pv_range or source.pv_range, request.op_range or source.op_range)
        goal = Target(card, named, fixed, *ranges, request.scan[1] if request.scan else None)
        goal.reject_missing()
        sign = -1 if _is_negative(source, goal) else 1
        return Solver(source, goal, sign * factor, request.scan, process, compensate=compensate)

    ranking = attempts(card, taken, solver, aim, wanted=request.given, every=all_options)
    best, refusal, settings = ranking[0], "", ranking[0].settings
    if settings is None:
        best, refusal, settings = _nearest(ranking)
        refusal += _other_options(attempts(card, {}, solver, aim, wanted=request.given, every=False)[0], taken) if options else ""
        if settings is None:
            raise ConversionRefusedError(refusal)
    work = best.solver
    assert work is not None  # there are settings
    _refuse_two_intervals(source, settings, request)
    before = settings
    settings, dials = rounded(settings) if round_dials else (settings, ())
    certificate = full_certificate(work, settings, work.scan_cost(before, best.match), emulate=emulate)
    if dials:
        certificate = replace(certificate, dials=dials, feedback_before_rounding=work.certify(before).feedback)
    conversion = Conversion(
        source=source,
        settings=settings,
        match=best.match,
        certificate=certificate,
        textbook=_textbook(work),
        warnings=(),
        refusal=refusal,
        chosen=dict(best.changed),
        ranking=ranking,
        factor=work.factor,
        scan=request.scan,
        process=process,
        request=request,
    )
    conversion = replace(conversion, warnings=tuple(warnings_for(conversion)))
    if refusal and not allow_approximate:
        raise ConversionRefusedError(refusal, conversion)
    return conversion


def _aim(match: str | None, process: Process | None) -> Aim:
    """Read the match, and refuse one that lacks what it needs."""
    aim = read_aim(match)
    if process is None and aim.frequency is None and aim.match in ("frequency", "loop"):
        other = " or a frequency, frequency:0.02rad/s" if aim.match == "frequency" else ""
        raise SettingError(
            f"the match '{aim.match}' needs the process{other}; give process=, or --process gain=...,lag=...,delay=..."
        )
    if aim.match == "loop":
        check_optimiser()
    return aim


def _nearest(ranking: tuple[Attempt, ...]) -> tuple[Attempt, str, Settings | None]:
    """Return what is nearest to the source with the options as delivered or chosen by the user, and why the target refuses."""
    first = min(ranking, key=lambda a: len(a.changed))
    if first.solver is None or first.error is None or isinstance(first.error, ScanError):
        raise first.error or ConversionRefusedError("there are no options left to try")
    settings, refusal = first.solver.refused(first.error)
    return replace(first, match="constrained"), refusal, settings


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


def _refuse_absurd_gains(source: Settings) -> None:
    a = source.algorithm()
    for name, gain in (("proportional", a.kp), ("integral", a.ki), ("derivative", a.kd)):
        if gain and not _SMALLEST < abs(gain) < _LARGEST:
            raise SettingError(f"{source.card.id}: {gain:g} is no {name} gain that a controller has; check the settings")


def _refuse_two_intervals(source: Settings, settings: Settings, request: Request) -> None:
    """Refuse to guess two scan intervals, where dials of both controllers count in scans."""
    both = source.counts_scans and settings.counts_scans
    if request.scan is None and both and source.scan != settings.scan:
        cards = f"{source.card.id} and of {settings.card.id}"
        raise SettingError(f"dials of {cards} count in scans; give both scan intervals, --scan H,H2")


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


def _rescaling(source: Settings, request: Request) -> float:
    """Return the factor on the percent gain for new ranges (specs/equations.md, section 3, rescaling)."""
    factor = 1.0
    for name, new, old, power in (
        ("pv_range", request.pv_range, source.pv_range, 1), ("op_range", request.op_range, source.op_range, -1),
    ):  # fmt: skip
        if new is not None and old is None and new != (0.0, 100.0):
            raise SettingError(f"{source.card.id}: the target's {name} is given, the source's is not; give both")
        if new is not None and old is not None:
            factor *= ((new[1] - new[0]) / (old[1] - old[0])) ** power
    return factor
