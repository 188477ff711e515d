"""Converting settings from one card to another, with the certificate that says how near they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.certificate.models import Rounded
from pidemu.conversion.asking import (
    action_questions,
    ask,
    missing_ranges,
    mode_is_open,
    scale_questions,
    taken_for_granted,
)
from pidemu.conversion.certify import full_certificate
from pidemu.conversion.match.moments import check_optimiser
from pidemu.conversion.match_method import Aim, read_aim
from pidemu.conversion.options import Attempt
from pidemu.conversion.refusals import (
    forgotten_output,
    refuse_positive_feedback,
    refuse_recursions,
    refuse_two_intervals,
    what_holds,
)
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.request import Request, read_request
from pidemu.conversion.result import Conversion
from pidemu.conversion.rounding import rounded
from pidemu.conversion.search import make_search, nearest_attempt
from pidemu.conversion.unstated import unstated
from pidemu.errors import ScanError, SettingError
from pidemu.settings.ranges import RangeGiven
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from pidemu.process.process import Process


def convert(
    source: Settings,
    target: str | Path | Card,
    *,
    options: Mapping[str, object] | None = None,
    given: Mapping[str, object] | None = None,
    scan: float | tuple[float, float] | None = None,
    runs_every: float | tuple[float, float] | None = None,
    mode: str = "both",
    action: str | None = None,
    to_pv_range: RangeGiven | None = None,
    to_op_range: RangeGiven | None = None,
    match: str | None = None,
    process: Process | None = None,
    compensate: bool = False,
    digits: int | None = None,
    bias: float | None = None,
    limits: tuple[float, float] | None = None,
    allow_approximate: bool = False,
    assume: bool = False,
    emulate: bool = True,
    tag: str = "",
) -> Conversion:
    """Convert settings to another card.

    Parameters
    ----------
    source : Settings
        The settings.
    target : str, path or Card
        The card to convert to, its id, or its file.
    options : mapping, optional
        Options of the target. Those not named are chosen as an engineer would: the same terms see the setpoint, the better verdict,
        the same form, the source's own numbers, what is documented (specs/equations.md, section 9).
    given : mapping, optional
        Dials of the target that shall have these values, such as a filter factor or a setpoint weight.
    scan : float or tuple of float, optional
        Scan interval that both, or source and target, compute with [s]: the certificate states what they cost.
    runs_every : float or tuple of float, optional
        Interval at which the source, or source and target, are really executed, where that is another one [s]. All times of an
        algorithm that is executed every `H` and computes with `h` are `H/h` times those on its dials.
    mode : {"both", "auto", "cascade"}
        Which setpoint counts: the operator's, a remote one, or both.
    action : {"reverse", "direct"}, optional
        The control action, reverse: the output falls when the measurement rises (error SP - PV). The size of the dials does not
        depend on it; where the sign of the target's gain is the action, the gain gets that sign. Where that of the source's is, it
        is known without.
    to_pv_range, to_op_range : tuple or str, optional
        Ranges of the target's measurement and output with their unit, ``(0, 1000, "degF")``; by default the source's. Another
        range of the same quantity rescales the gain for the same effect in its units; the same signal on another scale, such as
        counts, does not (see `pidemu.settings.range_relation.relation`).
    match : str, optional
        How to match: ``"exact"``, ``"same-numbers"`` (the source's own), ``"low-frequency"``, ``"textbook"``,
        ``"frequency:0.02rad/s"``, ``"frequency"`` (at the crossover with the process), ``"loop"`` (with a process: the load
        response changes least), ``"constrained"`` (the largest deviation in the loop band is least); by default the first of these
        that is near enough.
    process : Process, optional
        The process, for the figures of the closed loop before and after, and to place the loop band.
    compensate : bool
        Whether the settings make up for scan intervals and rules that differ; otherwise they are those of the continuous law.
    digits : int, optional
        Round the dials to their resolution or, where the card states none, to so many significant digits: the certificate is about
        these numbers. By default they are not rounded.
    bias : float, optional
        Output of the old controller at SP = PV [% of the output span], for a loop without integral action; without it the answer
        lists it as open.
    limits : tuple of float, optional
        Output limits that the source is set to [%, or the units that its card computes in]: the answer states those of the target.
    allow_approximate : bool
        Where the target refuses, return the nearest settings instead of raising.
    assume : bool
        Take the cards' defaults for everything that would be asked; the sentence then begins with what was assumed.
    emulate : bool
        Whether the certificate emulates both controllers; without it the linear figures alone are stated, sooner.
    tag : str
        The loop's name, for the certificate.

    Returns
    -------
    Conversion
        The target's settings, the certificate and what to watch for.

    Raises
    ------
    QuestionError
        Something was not stated, and the result depends on it; the error holds the questions with what each answer would give.
    ConversionRefusedError
        The target cannot do what the source does; the error holds the nearest settings and what they would cost.
    SettingError, CardError
        The target, the match, an option or a given dial is unknown.
    ScanError
        A scan interval is not a positive number, or a filter is unstable at it.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("generic/series").settings(K=2, Ti=15, Td=5)
    >>> conv = pidemu.convert(s, "generic/standard")
    >>> conv.verdict, round(conv.settings["K"].value, 4), conv.settings["Ti"].value, conv.settings["Td"].value
    ('exact', 2.6667, 20.0, 3.75)
    """
    if not isinstance(source, Settings):
        raise SettingError(f"source is {source!r}; give settings, such as load_card('fisher/provox').settings(GAIN=2, RESET=4)")
    card = target if isinstance(target, Card) else load_card(target)
    request = read_request(
        card, options=options, given=given, scan=scan, runs_every=runs_every, mode=mode, action=action, match=match,
        to_pv_range=to_pv_range, to_op_range=to_op_range, process=process, digits=digits, bias=bias, limits=limits,
        compensate=compensate,
        allow_approximate=allow_approximate, assume=assume, tag=tag,
    )  # fmt: skip
    return converted(source, card, request, emulate=emulate)


def converted(source: Settings, card: Card, request: Request, *, emulate: bool = True) -> Conversion:
    """Return the conversion that a request asks for; see `convert`."""
    aim = _aim(request.match, request.process)
    refuse_recursions(source, card)
    opens = tuple(unstated(source))
    source = _paced(source, request).at_scan(request.declared[0] if request.declared else None)
    open_questions = [o.question for o in opens if o.asked]
    scales = scale_questions(source, request)
    ask([*action_questions(source, request), *open_questions, *scales], source, card, request)
    refuse_positive_feedback(source, request)
    search = make_search(source, card, request, aim)
    ranking = search.ranking()
    modes = search.mode_question() if mode_is_open(source, ranking, request) else []
    if modes:
        ask(modes, source, card, request)
        request = replace(request, mode="auto")
        ranking = search.ranking("auto")
    best, refusal, settings = ranking[0], "", ranking[0].settings
    if settings is None:
        best, refusal, settings = nearest_attempt(ranking)
        refusal += search.other_options()
        if settings is None:
            raise ConversionRefusedError(refusal)
    ranges = missing_ranges(source, settings)
    ask(ranges, source, card, request)
    opens = (*opens, *taken_for_granted([*scales, *modes, *ranges], source))
    refuse_two_intervals(source, settings, request)
    shift = "" if refusal else forgotten_output(source, settings, request, search.factor)
    conversion = _concluded(best, settings, refusal, source, request, ranking, emulate=emulate)
    conversion = replace(conversion, opens=opens)
    if shift:
        conversion = replace(conversion, refusal=shift, certificate=replace(conversion.certificate, shifts_for_good=True))
    if conversion.refusal and not request.allow_approximate:
        raise ConversionRefusedError(conversion.refusal, conversion, what_holds(settings) if shift else ())
    return conversion


def again(c: Conversion, source: Settings | None = None, **changes: Any) -> Conversion:
    """Return a conversion with something else asked for, of its source or of another reading of that; its linear figures alone.

    Parameters
    ----------
    c : Conversion
        The conversion.
    source : Settings, optional
        What is converted in place of its source.
    **changes
        What of its `Request` is another.
    """
    read = replace(c.source if source is None else source, pace=1.0)
    return converted(read, c.settings.card, replace(c.request, **{"assume": True, **changes}), emulate=False)


def _concluded(
    best: Attempt,
    settings: Settings,
    refusal: str,
    source: Settings,
    request: Request,
    ranking: Sequence[Attempt],
    *,
    emulate: bool,
) -> Conversion:
    """Return the conversion with its certificate, about the dials as they are printed."""
    work, found = best.solver, best.found
    assert work is not None  # there are settings
    assert found is not None
    unrounded = settings
    dials: tuple[Rounded, ...] = ()
    if request.digits is not None:
        settings, dials = rounded(settings, request.digits, request.given)
    stated = None if request.limits is None else source.own_ranges.op.limits_in_percent(request.limits)
    certificate = full_certificate(
        work.yardstick,
        settings,
        unrounded if dials else settings,
        compensated=found.compensated,
        limits=stated,
        emulate=emulate,
    )
    if dials:
        certificate = replace(certificate, dials=dials)
    return Conversion(
        source=source,
        settings=settings,
        unrounded=unrounded,
        match=found.match,
        certificate=certificate,
        refusal=refusal,
        chosen=_chosen(settings, request),
        ranking=ranking,
        solver=work,
        factor=work.yardstick.factor,
        scan=request.scan,
        process=request.process,
        request=request,
    )


def _paced(source: Settings, request: Request) -> Settings:
    """Return the source as it really runs, where its interval is not the one it computes with."""
    pace = request.pace[0]
    if pace == 1:
        return source
    if source.equation.scan.interval == "measured":
        raise ScanError(
            f"{source.card.id} measures its interval, so it computes with the one at which it runs; leave out --runs-every"
        )
    return replace(source, pace=pace)


def _chosen(settings: Settings, request: Request) -> dict[str, str]:
    """Return the options of the target that were not stated and are not as the card delivers them."""
    stated = {name.casefold() for name in request.options}
    delivered = settings.card.variant({}).chosen
    return {n: c for n, c in settings.options.items() if n.casefold() not in stated and c != delivered[n]}


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
