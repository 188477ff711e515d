"""Preparing a target: its options chosen, the user's dials checked, and what is free to choose found out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final

from pidemu.card.load import Card, Variant
from pidemu.card.model.base import Rule
from pidemu.card.model.card_file import default_scan
from pidemu.conversion.target.computed import CORE, is_computed
from pidemu.conversion.target.filter import FilterKind, TargetFilter
from pidemu.conversion.target.target import Target
from pidemu.errors import SettingError
from pidemu.settings.ranges import RANGES, SignalRange
from pidemu.settings.settings import limits, spans_of
from pidemu.units import Role, Spans, from_canonical, parse_unit, to_canonical

_USUAL: Final = {"gain": 10.0, "ratio": 0.1}
"""Filter of a derivative where the card delivers none: a tenth of the derivative time."""


def prepare_target(
    card: Card,
    options: Mapping[str, object],
    given: Mapping[str, object],
    ranges: tuple[SignalRange | None, SignalRange | None],
    *,
    pace: float = 1.0,
    scan: float | None = None,
    source_lag: float | None = None,
    idle_gain: float = 1.0,
) -> Target:
    """Return a card to convert to.

    Parameters
    ----------
    card : Card
        The card.
    options : mapping
        Options by name.
    given : mapping
        Dials that the user has fixed.
    ranges : tuple of SignalRange or None
        Ranges of measurement and output.
    pace : float
        Interval at which the target is really executed per the one that it computes with; see `Settings.pace`.
    scan : float, optional
        Scan interval that it computes with [s], for dials that count in scans; by default the card's.
    source_lag : float, optional
        The lag with which the source filters its measurement [s], where the target is to have it too, in its own filter or in front
        of it; ``None``: whatever filters the target has are part of what is matched.
    idle_gain : float
        Gain taken where there is no proportional term.

    Raises
    ------
    SettingError
        A given dial is unknown, is what the conversion computes or is out of range; or a dial is neither computed nor given and
        has no default.
    """
    return _prepared(card.variant(options), tuple(options.items()), tuple(given.items()), ranges, pace, scan, source_lag, idle_gain)


@lru_cache(maxsize=512)
def _prepared(
    variant: Variant,
    options: tuple[tuple[str, object], ...],
    given: tuple[tuple[str, object], ...],
    ranges: tuple[SignalRange | None, SignalRange | None],
    pace: float,
    scan: float | None,
    source_lag: float | None,
    idle_gain: float,
) -> Target:
    """Return the target; many conversions to one card want the same."""
    spans = spans_of(*ranges, default_scan(variant.equation) if scan is None else scan)
    held, lag = dict(given), 0.0
    if source_lag is not None:
        held, lag = _with_a_measurement_filter(variant, held, source_lag, pace, spans)
    known = {n.casefold(): n for n in variant.equation.settings}
    target = Target(
        variant.card,
        variant,
        options=dict(options),
        given={known.get(n.casefold(), n): v for n, v in held.items()},
        ranges={k: v for k, v in zip(RANGES, ranges, strict=True) if v is not None},
        spans=spans,
        pace=pace,
        scan=scan,
        lag=lag,
        is_paired=source_lag is not None,
        idle_gain=idle_gain,
    )
    _check_given(target)
    target = replace(target, multiplier=_multiplier(target), filter=_filter(target))
    _reject_missing(target)
    return target


def _with_a_measurement_filter(
    variant: Variant, given: dict[str, object], lag: float, pace: float, spans: Spans
) -> tuple[dict[str, object], float]:
    """Return the given dials, the target's filter of the measurement set to a lag [s], and the lag left to stand in front."""
    measurement = variant.equation.measurement
    name = None if measurement is None or measurement.filter is None else measurement.filter.time
    if not isinstance(name, str):
        return given, lag
    if name.casefold() in {n.casefold() for n in given}:
        return given, 0.0
    unit = parse_unit(variant.equation.settings[name].unit)
    return {**given, name: from_canonical(Role.FILTER_TIME, lag / pace, unit, spans)}, 0.0


def _check_given(target: Target) -> None:
    for name in target.given:
        if name not in target.variant.equation.settings:
            target.template(**{name: target.given[name]})  # says what is wrong with the name
        elif Role(target.variant.equation.settings[name].sets) in CORE:
            raise SettingError(f"{target.card.id}: {name} is what the conversion computes; it cannot be given")


def _multiplier(target: Target) -> float:
    dial = target.dial(Role.MULTIPLIER)
    return target.template()[dial[0]].canonical if dial is not None else 1.0


def _filter(target: Target) -> TargetFilter:
    """Return the derivative's filter as the card delivers it or the user has given it."""
    derivative = target.variant.equation.derivative
    filt = derivative.filter
    if filt is None:
        return TargetFilter()
    kind: FilterKind = "ratio" if filt.ratio is not None else "gain" if filt.gain is not None else "time"
    given = filt.ratio if kind == "ratio" else filt.gain if kind == "gain" else filt.time
    needed = derivative.rule is Rule.LAGGED_DIFFERENCE
    shape: dict[str, Any] = {"lead_lag": filt.applies_to == "lead-lag", "of": filt.of, "needed": needed}
    pace = target.pace if kind == "time" else 1.0
    if not isinstance(given, str):
        return TargetFilter(kind, None, False, float(given or 0.0) * pace, **shape)
    setting = target.variant.equation.settings[given]
    role, unit = Role(setting.sets), parse_unit(setting.unit)
    low, high = (to_canonical(role, x, unit, target.spans) * pace for x in limits(setting))
    present, free = target.template()[given].canonical * pace, target.is_free(given, setting)
    if free and setting.default is None and kind != "time":
        present = min(max(_USUAL[kind], low), high)
    return TargetFilter(kind, given, free, present, low=low, high=high, **shape)


def _reject_missing(target: Target) -> None:
    """Refuse to go on where a dial is neither computed by a conversion nor given, and has no default."""
    equation = target.variant.equation
    idle = [n for n, s in target.without_default() if not is_computed(equation, n, Role(s.sets)) and n not in target.given]
    missing = [n for n in idle if equation.settings[n].sets != "multiplier"]
    if missing:
        raise SettingError(
            f"{target.card.id}: a conversion does not compute {' and '.join(missing)}, and the card has no default; "
            f"give {'it' if len(missing) == 1 else 'them'}, with --set {missing[0]}=VALUE"
        )
