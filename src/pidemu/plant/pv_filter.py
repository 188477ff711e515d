"""A filter of the measurement: how long it is, a source without it, and where a target would take it."""

from __future__ import annotations

from dataclasses import replace

from pidemu.card.load import Card
from pidemu.settings.settings import Settings
from pidemu.units import Role


def filter_time(settings: Settings) -> float:
    """Return the time of the filter of the measurement, in the block or in front of it [s]; 0 where there is none."""
    found = settings.algorithm().measurement.filter
    return 0.0 if found is None or found.time is None else float(found.time)


def without_filter(settings: Settings) -> Settings:
    """Return settings without a filter of the measurement."""
    dial = filter_dial(settings.card, settings.options)
    bare = replace(settings, lag=0.0)
    return bare.changed({dial: 0.0}) if dial is not None and settings[dial].value else bare


def filter_dial(card: Card, options: dict[str, str]) -> str | None:
    """Return the dial of a card that sets the time of a filter of the measurement; ``None`` where it has none."""
    equation = card.variant(options).equation
    filtered = equation.measurement.filter if equation.measurement is not None else None
    name = None if filtered is None else filtered.time
    if not isinstance(name, str) or equation.settings[name].sets != Role.FILTER_TIME.value:
        return None
    return name
