"""Searching the choices of a target's options: what every choice gives, the best first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from pidemu.card.load import Card
from pidemu.card.model.card_file import default_scan
from pidemu.conversion.asking import mode_question
from pidemu.conversion.command import set_words
from pidemu.conversion.match_method import Aim
from pidemu.conversion.modes import MODES, Mode
from pidemu.conversion.options import Attempt, Ranking, ranking
from pidemu.conversion.questions import Question
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.request import Request
from pidemu.conversion.solver.solver import Solver, make_solver
from pidemu.conversion.spans import rescaling
from pidemu.conversion.target.computed import is_computed
from pidemu.conversion.target.prepare import prepare_target
from pidemu.conversion.target.target import Target
from pidemu.errors import ScanError
from pidemu.law.exact import as_typed
from pidemu.settings.action import Action, switch_position
from pidemu.settings.settings import Settings, Value, limits
from pidemu.units import Role, from_canonical, parse_unit

_PAIRED: Final = (None, "exact", "same-numbers")
"""Matches for which a filter of the measurement is carried over, not absorbed into the dials."""


@dataclass(frozen=True)
class Search:
    """One conversion: its source, card and request, from which solvers for any choice of the options are made.

    Attributes
    ----------
    source : Settings
        What to convert, as it really runs.
    card : Card
        The card to convert to.
    request : Request
        What is asked for.
    aim : Aim
        The match that is asked for.
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    fixed : mapping
        Dials of the target that are not computed.
    taken : mapping
        Options of the target that stay.
    source_lag : float or None
        The lag with which the source filters its measurement [s], where the target is to have it too.
    """

    source: Settings
    card: Card
    request: Request
    aim: Aim
    factor: float
    fixed: Mapping[str, object]
    taken: Mapping[str, object]
    source_lag: float | None

    def ranking(self, mode: Mode | None = None, taken: Mapping[str, object] | None = None) -> Ranking:
        """Return the choices of the options, the best first."""
        search = self if mode is None else replace(self, request=replace(self.request, mode=mode))
        stay = self.taken if taken is None else taken
        asked = self.request
        return ranking(self.card, stay, self.source, search._solver, self.aim, wanted=asked.given, rules_matter=asked.compensate)

    def _solver(self, options: Mapping[str, object]) -> Solver:
        """Return what solves for the settings with these options."""
        source, request = self.source, self.request
        target = prepare_target(
            self.card,
            options,
            self.fixed,
            (request.to_pv_range or source.pv_range, request.to_op_range or source.op_range),
            pace=request.pace[1],
            scan=request.declared[1] if request.declared else None,
            source_lag=self.source_lag,
            idle_gain=_idle_gain(source),
        )
        turned = _is_negative(source, target) or _becomes_negative(source, self.card, request.action)
        factor = -self.factor if turned else self.factor
        return make_solver(source, target, factor, request.scan, request.process, compensate=request.compensate, mode=request.mode)

    def mode_question(self) -> list[Question]:
        """Return the question for the mode, where the answers lead to other settings."""
        best = [self.ranking(mode)[0].settings for mode in MODES]
        if best[0] == best[1]:
            return []
        return [mode_question(self.source)]

    def other_options(self) -> str:
        """Return which options, instead of those that the user chose, would do; empty where none would."""
        if not self.request.options:
            return ""
        attempt = self.ranking(taken={})[0]
        if attempt.settings is None:
            return ""
        chosen = attempt.settings.options
        words = {
            n: chosen[n]
            for n in chosen
            if n in attempt.changed or (n in self.taken and str(self.taken[n]).casefold() != chosen[n].casefold())
        }
        return f"; other options would do: {set_words(words)}: {attempt.verdict}"


def make_search(source: Settings, card: Card, request: Request, aim: Aim) -> Search:
    """Return the search for a conversion; for the arguments see `Search`.

    Raises
    ------
    ScanError
        A filter of the source is unstable at its scan interval.
    """
    search = Search(
        source,
        card,
        request,
        aim,
        factor=float(rescaling(source, request.to_pv_range, request.to_op_range).factor),
        fixed={**_shared(source, card), **request.given},
        taken={**(source.options if source.card.id == card.id else {}), **request.options},
        source_lag=_measurement_lag(source, request) if aim.match in _PAIRED else None,
    )
    if request.scan is not None:
        source.law(request.scan[0])  # refuses an interval at which a filter of the source is unstable
    return search


def nearest_attempt(attempts: Sequence[Attempt]) -> tuple[Attempt, str, Settings | None]:
    """Return what is nearest to the source with the options as delivered or chosen by the user, and why the target refuses."""
    first = min(attempts, key=lambda a: len(a.changed))
    if first.solver is None or first.error is None or isinstance(first.error, ScanError):
        raise first.error or ConversionRefusedError("there are no options left to try")
    found, refusal = first.solver.refused(first.error)
    return replace(first, found=found), refusal, None if found is None else found.settings


def _measurement_lag(source: Settings, request: Request) -> float | None:
    """Return the time of the source's filter on the measurement [s]: of a share per scan that which the decimals as typed make."""
    h = request.scan[0] if request.scan else None
    lag = source.algorithm(scan=h).measurement.filter
    if lag is None or lag.factor is None:
        return None if lag is None else lag.time
    share = as_typed(lag.factor)
    return float(as_typed(default_scan(source.equation) if h is None else h) * (1 - share) / share)


def _idle_gain(source: Settings) -> float:
    """Return the gain that a target's times are scaled by where the source has no proportional term: that on the source's dial."""
    gain = source.by_role(Role.GAIN)
    return 1.0 if gain is None or source.algorithm().kp else gain.canonical or 1.0


def _is_negative(source: Settings, target: Target) -> bool:
    """Whether the source has negative gains only, and the target no place for them: then the action changes instead."""
    a, gain = source.algorithm(), target.dial(Role.GAIN)
    return max(a.kp, a.ki, a.kd) <= 0 > min(a.kp, a.ki, a.kd) and gain is not None and limits(gain[1])[0] >= 0


def _becomes_negative(source: Settings, target: Card, action: Action | None) -> bool:
    """Whether the source's switch stands at direct, and the target has none, so that its gain carries the sign."""
    switched = not source.equation.action.fixed and target.data.action.fixed
    return switched and action is not None and switch_position(source, action) == "direct"


def _shared(source: Settings, target: Card) -> dict[str, object]:
    """Return what stays as it is within one card: whatever a conversion does not compute, and settings that many loops share."""
    if source.card.id != target.id:
        return {}
    return {
        n: _as_it_runs(v, source)
        for n, v in source.items()
        if v.active and (v.setting.scope == "module" or not is_computed(source.equation, n, v.role))
    }


def _as_it_runs(v: Value, source: Settings) -> float:
    """Return a dial that is kept, for a controller that is executed at the interval it computes with: times grow by the pace."""
    if source.pace == 1 or v.off or parse_unit(v.unit).scans:
        return v.value
    power = 1 if v.role in (Role.FILTER_TIME, Role.TRACKING_TIME) else -1 if v.role in (Role.OUTPUT_RATE, Role.SETPOINT_RATE) else 0
    return from_canonical(v.role, v.canonical * source.pace**power, parse_unit(v.unit), source.spans) if power else v.value
