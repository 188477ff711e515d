"""Strategies of Hypothesis: any card, sensible settings of it, records of signals, processes. They shrink to plain numbers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal

from hypothesis import assume
from hypothesis import strategies as st

from pidemu.algorithm.model import Algorithm
from pidemu.card.library import card_files, load_card
from pidemu.card.load import Card
from pidemu.card.model.base import Rule
from pidemu.card.model.card_file import Setting
from pidemu.card.references import is_active
from pidemu.errors import SettingError
from pidemu.process.process import Process
from pidemu.settings.settings import Settings, limits, off_values
from pidemu.testing.record import ScanSignals, SignalRecord
from pidemu.units import Role, Spans, from_canonical, parse_unit

TestedMode = Literal["automatic", "manual", "changes"]

_SENSIBLE: Final[dict[Role, st.SearchStrategy[float]]] = {
    Role.GAIN: st.floats(0.05, 50),
    Role.MULTIPLIER: st.floats(0.1, 10),
    Role.INTEGRAL: st.floats(1, 3000).map(lambda seconds: 1 / seconds),
    Role.DERIVATIVE: st.just(0.0) | st.floats(0.1, 600),
    Role.FILTER_TIME: st.just(0.0) | st.floats(0.1, 100),
    Role.FILTER_RATIO: st.floats(0.01, 1),
    Role.FILTER_GAIN: st.floats(1, 30),
    Role.PROPORTIONAL_WEIGHT: st.sampled_from([0.0, 1.0]) | st.floats(0.01, 1),
    Role.DERIVATIVE_WEIGHT: st.sampled_from([0.0, 1.0]) | st.floats(0.01, 1),
    Role.TRACKING_TIME: st.floats(1, 3000),
    Role.FILTER_FACTOR: st.just(1.0) | st.floats(0.1, 1),
    Role.INTEGRAL_LIMIT: st.floats(5, 500),
    Role.WINDUP_LIMIT: st.floats(60, 120),
    Role.DEADBAND: st.just(0.0) | st.floats(0.1, 10),
    Role.GAP_GAIN: st.floats(0, 1),
    Role.LINEARITY: st.just(1.0) | st.floats(0.1, 1),
    Role.FEEDFORWARD_GAIN: st.floats(0, 2),
    Role.BIAS: st.floats(0, 100),
    Role.OUTPUT_RATE: st.floats(0.1, 100),
    Role.SETPOINT_RATE: st.floats(0.1, 100),
    Role.RESOLUTION: st.floats(0.01, 1),
    Role.PROCESS_GAIN: st.floats(0.1, 10),
    Role.PROCESS_TIME: st.floats(1, 600),
    Role.PROCESS_DELAY: st.floats(0, 60),
    Role.CLOSED_LOOP_TIME: st.floats(1, 600),
}
"""Canonical values by role (specs/equations.md, section 1)."""
_STEPS: Final = 64
"""Signals are multiples of this part of half their range: exact in binary, also in float32 and in counts."""


def cards(*ids: str) -> st.SearchStrategy[Card]:
    """Any of the built-in cards, or of those named; shrinks to the first.

    Parameters
    ----------
    *ids : str
        Ids to choose from; by default all.

    Examples
    --------
    >>> cards("generic/standard").example().id  # doctest: +SKIP
    'generic/standard'
    """
    return st.sampled_from(ids or tuple(sorted(card_files(), key=lambda i: (not i.startswith("generic/"), i)))).map(load_card)


def settings(card: str | Card, /, **fixed: object) -> st.SearchStrategy[Settings]:
    """Sensible settings of a card, under any choice of its options that it accepts.

    Gains lie between 0.05 and 50, integral times between 1 s and 3000 s, derivative times up to 600 s, and every dial within its
    range and at its resolution.

    Parameters
    ----------
    card : str or Card
        The card, or its id.
    **fixed
        Settings and options that are given; the others are drawn.
    """
    found = load_card(card) if isinstance(card, str) else card
    return dials_of(found, fixed).map(found.settings)


def records(
    scans: tuple[int, int] = (1, 60),
    *,
    pv_range: tuple[float, float] = (0.0, 100.0),
    output_range: tuple[float, float] = (0.0, 100.0),
    modes: Sequence[TestedMode] = ("automatic",),
    changes: st.SearchStrategy[Settings] | None = None,
) -> st.SearchStrategy[SignalRecord]:
    """A record of setpoint, measurement and mode; shrinks to few scans that stay in the middle of the range.

    Parameters
    ----------
    scans : tuple of int
        Least and largest number of scans.
    pv_range, output_range : tuple of float
        What setpoint and measurement, and the operator's output, lie within.
    modes : sequence of {"automatic", "manual", "changes"}
        What happens: with ``"manual"`` the loop is in manual now and then, with ``"changes"`` settings change while it runs.
    changes : strategy, optional
        Where the changed settings come from.
    """
    step = st.none() | st.integers(-_STEPS, _STEPS)
    row = st.tuples(step, step, _modes(modes), _changed(modes, changes))
    return st.lists(row, min_size=scans[0], max_size=scans[1]).map(lambda rows: _record(rows, pv_range, output_range))


def _record(rows: Sequence[tuple[Any, ...]], pv_range: tuple[float, float], output_range: tuple[float, float]) -> SignalRecord:
    """Return the record of steps away from the middle of the ranges; ``None`` leaves a signal where it is."""

    def level(ends: tuple[float, float], steps: int) -> float:
        return (ends[0] + ends[1]) / 2 + steps * (ends[1] - ends[0]) / 2 / _STEPS

    found, sp, pv = [], level(pv_range, 0), level(pv_range, 0)
    for to_sp, to_pv, mode, new in rows:
        sp = sp if to_sp is None else level(pv_range, to_sp)
        pv = pv if to_pv is None else level(pv_range, to_pv)
        by_hand = None if mode in (None, "held") else level(output_range, mode)
        found.append(ScanSignals(sp, pv, mode is None, by_hand, new))
    return SignalRecord(tuple(found))


def _modes(modes: Sequence[TestedMode]) -> st.SearchStrategy[Any]:
    """``None`` in automatic, ``"held"`` or a number of steps in manual."""
    return st.none() if "manual" not in modes else st.none() | st.none() | st.just("held") | st.integers(-_STEPS, _STEPS)


def _changed(modes: Sequence[TestedMode], changes: st.SearchStrategy[Settings] | None) -> st.SearchStrategy[Settings | None]:
    if "changes" not in modes or changes is None:
        return st.none()
    return st.integers(0, 7).flatmap(lambda n: changes if n == 7 else st.none())


_SIZES: Final = st.floats(0.02, 5)
_PAIRS: Final = st.builds(lambda size, z: size * complex(-z, math.sqrt(1 - z * z)), _SIZES, st.floats(0.05, 0.95))


def processes(
    *, delay: bool = False, integrating: bool = True, unstable: bool = False, gains: Sequence[int] = (1, -1)
) -> st.SearchStrategy[Process]:
    """Processes of up to four poles, with up to one complex pair.

    Parameters
    ----------
    delay : bool
        Whether there may be a dead time.
    integrating, unstable : bool
        Whether poles may be at zero, and one right of it.
    gains : sequence of int
        Signs that the gain may have.
    """
    left = _SIZES.map(lambda x: -x)
    real = st.lists(left | st.just(0.0) if integrating else left, min_size=1, max_size=2)
    right: st.SearchStrategy[list[float]] = (
        st.just([]) | st.just([]) | st.lists(st.floats(0.05, 1), min_size=1, max_size=1) if unstable else st.just([])
    )
    waits = st.just(0.0) | st.floats(0.01, 20) if delay else st.just(0.0)
    return _processes(real, left | _SIZES, right, waits, st.sampled_from(tuple(gains)))


@st.composite
def _processes(
    draw: st.DrawFn,
    real: st.SearchStrategy[list[float]],
    roots: st.SearchStrategy[float],
    right: st.SearchStrategy[list[float]],
    waits: st.SearchStrategy[float],
    signs: st.SearchStrategy[int],
) -> Process:
    upper, found = draw(st.lists(_PAIRS, max_size=1)), draw(real)
    zeros = draw(st.lists(roots, max_size=len(found) - 1))
    poles = [*found, *draw(right), *(x for p in upper for x in (p, p.conjugate()))]
    return Process(draw(_SIZES) * draw(signs), poles, zeros, draw(waits))


def option_combinations(card: Card, fixed: Mapping[str, object] | None = None) -> list[dict[str, str]]:
    """Every way to choose the card's options, of those that are not fixed."""
    said = {name.casefold(): str(choice) for name, choice in (fixed or {}).items()}
    choices = [(said[name.casefold()],) if name.casefold() in said else every for name, every in card.options.items()]
    return [dict(zip(card.options, some, strict=True)) for some in itertools.product(*choices)]


@st.composite
def dial_values(draw: st.DrawFn, setting: Setting) -> float:
    """A value for one dial, in its unit: an off value now and then, otherwise a sensible one inside its range."""
    off = off_values(setting)
    if off and draw(st.integers(0, 7)) == 0:
        return draw(st.sampled_from(off))
    role = Role(setting.sets)
    sensible = draw(_SENSIBLE[role])
    sensible = 0.0 if abs(sensible) < 1e-9 else sensible  # no controller has a gain or a time of 1e-200
    value = from_canonical(role, sensible, parse_unit(setting.unit), Spans(scan=0.5))
    low, high = limits(setting)
    value = min(max(value, low), high)
    if setting.resolution is not None:
        value = min(max(round(value / setting.resolution) * setting.resolution, low), high)
    if math.isinf(value) and value not in off:  # a derivative of zero has no value on a dial that cannot show it
        value = from_canonical(role, 1.0, parse_unit(setting.unit), Spans(scan=0.5))
    return value


@st.composite
def dials_of(draw: st.DrawFn, card: Card, fixed: Mapping[str, object] | None = None) -> dict[str, object]:
    """Valid settings of a card, by name, under any choice of its options; choices that it refuses are left out."""
    chosen = dict(fixed or {})
    names = {n.casefold() for n in chosen}
    options = draw(st.sampled_from(option_combinations(card, chosen)))
    equation = card.variant(options).equation
    given: dict[str, object] = {n: c for n, c in options.items() if n.casefold() not in names} | chosen
    for name, setting in equation.settings.items():
        if (
            name.casefold() in names
            or not is_active(equation, name, setting)
            or (setting.default is not None and draw(st.integers(0, 4)) == 0)
        ):
            continue
        given[name] = draw(dial_values(setting))
    refused = False
    try:
        card.settings(given).algorithm()
    except SettingError as error:
        refused = "not defined" in str(error)
        if not refused:
            raise
    assume(not refused)
    return given


@st.composite
def scans_of(draw: st.DrawFn, algorithm: Algorithm) -> float:
    """A scan interval [s]; with a rule that rings or is unstable where the filter is faster than the scan, one below its time."""
    rules = (algorithm.derivative.rule, algorithm.filter_rule)
    rings = algorithm.Tf and any(rule in (Rule.FORWARD, Rule.TRAPEZOIDAL) for rule in rules)
    highest = min(10.0, algorithm.Tf) if rings else 10.0
    if algorithm.arithmetic.type == "integer":
        return draw(st.integers(1, 100)) / 10
    if algorithm.dahlin is not None:
        return draw(st.floats(max(0.05, algorithm.dahlin.delay / 30), 10))
    return draw(st.floats(min(0.05, highest / 2), highest))
