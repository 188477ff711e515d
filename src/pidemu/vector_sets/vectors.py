"""Vectors of a controller: the standard cases, played."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import isnan, nan
from typing import Any, Final

import numpy as np

from pidemu.card.library import load_card
from pidemu.controller.controller import Controller
from pidemu.errors import PidemuError, UndefinedError
from pidemu.records.standard import scale_of
from pidemu.settings.action import Action
from pidemu.settings.ranges import infinite_where_none
from pidemu.settings.settings import Settings
from pidemu.units import Role
from pidemu.vector_sets.signals import CASES, CaseSignals, Places
from pidemu.vector_sets.vector_set import DialChange, VectorCase, VectorSet

_OPTIONAL: Final = ("manual", "cascade", "track", "external_reset", "feedforward", "interval")
_CHANGED: Final = (Role.GAIN, Role.MULTIPLIER, Role.INTEGRAL, Role.DERIVATIVE, Role.CLOSED_LOOP_TIME)
_WHEN: Final = (20, 40, 60, 85)
"""Before which scans dials change."""
_FACTORS: Final = (1.5, 0.5, 2.0)
"""What a dial is multiplied by; the first that its range and its steps allow."""
_HALVINGS: Final = 20
_SIZE: Final = 4.0
"""A small move, where nothing says how much the output moves with it [% of span]."""
_LARGEST: Final = 1000.0
"""Where there is no output limit, the output stays within this."""


def vectors(
    settings: Settings | str,
    scan: float | None = None,
    *,
    action: Action = "reverse",
    output_limits: tuple[float, float] | None = None,
    seed: int = 1,
) -> VectorSet:
    """Return test vectors of a controller: inputs, outputs, states and events of the standard cases.

    Parameters
    ----------
    settings : Settings or str
        Card and settings, or a card's id: the settings are those of its first example.
    scan : float, optional
        Scan interval [s]; by default the card's.
    action : {"reverse", "direct"}
        Control action.
    output_limits : tuple of float, optional
        Low and high output limit; by default the card's.
    seed : int
        Seed of the noise.

    Returns
    -------
    VectorSet
        The cases, with a hash of settings, inputs and outputs.

    Raises
    ------
    ScanError
        The settings cannot be run at the interval.

    Examples
    --------
    >>> import pidemu
    >>> found = pidemu.vectors("generic/standard", scan=1.0)
    >>> [case.name for case in found.cases][:3], len(found["linear"].outputs), len(found.hash)
    (['linear', 'saturation', 'manual'], 120, 64)
    """
    if not isinstance(settings, Settings):
        card = load_card(settings)
        settings = card.settings(card.data.examples[0].given)
    return _Player(settings, scan, action, output_limits, seed).vector_set()


class _Player:
    """Plays the cases to fresh controllers."""

    def __init__(
        self, settings: Settings, scan: float | None, action: Action, limits: tuple[float, float] | None, seed: int
    ) -> None:
        self._settings, self._action, self._seed = settings, action, seed
        self._given_limits = limits
        first = Controller(settings, scan, action, limits)
        self._scan, self._program = first.interval, first.program
        self._limits = infinite_where_none(settings.equation.output.limits if limits is None else limits)
        self._left_out: dict[str, str] = {}

    def vector_set(self) -> VectorSet:
        """Return the vectors."""
        places = self._unsaturated(self._places())
        cases = tuple(case for name in CASES if (case := self._case(name, places)) is not None)
        return VectorSet(
            self._settings, self._scan, self._action, self._limits, self._program.precision, self._seed, cases, self._left_out
        )

    def _places(self) -> Places:
        low, high = self._settings.own_ranges.pv.ends
        span = high - low
        bottom, top = (min(max(x, -_LARGEST), _LARGEST) for x in self._limits)
        if (bottom, top) == (-_LARGEST, _LARGEST):
            bottom, top = self._settings.own_ranges.op.ends
        try:
            _, size = scale_of(self._settings, self._scan)
        except UndefinedError:  # an algorithm without a continuous law
            size = _SIZE
        short = float(f"{size * span / 100:.2g}")  # the same on every machine
        around_zero = bottom == -top and self._settings.pv_range is None
        return Places(
            0.0 if around_zero else (low + high) / 2, short, 0.8 * span, bottom + 0.375 * (top - bottom), top - bottom, self._scan
        )

    def _unsaturated(self, places: Places) -> Places:
        """Return places with which the linear case stays between the output limits."""
        for _ in range(_HALVINGS):
            outputs = self._played(CASES["linear"][1](places, self._seed)).outputs
            if all(self._limits[0] < u < self._limits[1] for u in outputs[6:]):
                break
            places = replace(places, size=places.size / 2)
        return places

    def _case(self, name: str, places: Places) -> VectorCase | None:
        about, make = CASES[name]
        reason = self._no_use(name)
        if not reason:
            try:
                signals = make(places, self._seed)
                changes = self._changes() if name == "changed-settings" else ()
                return replace(self._played(signals, changes), name=name, about=about)
            except PidemuError as error:
                reason = str(error)
        self._left_out[name] = reason
        return None

    def _no_use(self, name: str) -> str:
        """Return why a card has no such case; empty where it has."""
        signal = name.replace("-", "_")
        unused = self._settings.without_use_for([signal]).get(signal, "")
        if name == "intervals" and self._settings.equation.scan.interval != "measured":
            return f"{self._settings.card.id} takes the scan interval as it is set"
        if name == "changed-settings" and not self._changes():
            return "no dial may be changed within its range"
        return unused

    def _changes(self) -> tuple[DialChange, ...]:
        """Return changes of the dials at work, one after the other, as their ranges and steps allow."""
        settings, found = self._settings, list[DialChange]()
        for name, value in self._settings.items():
            if value.role not in _CHANGED or not value.active or value.off or len(found) == len(_WHEN):
                continue
            for factor in _FACTORS:
                new = {name: float(f"{value.value * factor:.4g}")}
                try:
                    changed = settings.changed(new)
                    Controller(changed, self._scan, self._action, self._given_limits)
                except PidemuError:
                    continue
                if changed[name].value == new[name]:
                    settings = changed
                    found.append(DialChange(_WHEN[len(found)], new))
                    break
        return tuple(found)

    def _played(self, signals: CaseSignals, changes: tuple[DialChange, ...] = ()) -> VectorCase:
        controller = Controller(self._settings, self._scan, self._action, self._given_limits, engine="python")
        due = {change.scan: change.settings for change in changes}
        outputs, states = list[float](), list[dict[str, float]]()
        for n, now in enumerate(_scans(signals.columns)):
            if n in due:
                controller.change(due[n])
            with np.errstate(all="ignore"):
                outputs.append(controller.scan(**now))
            states.append(controller.state)
        names = dict.fromkeys(name for state in states for name in state)
        return VectorCase(
            name="",
            about="",
            inputs={name: tuple(column) for name, column in signals.columns.items()},
            outputs=tuple(outputs),
            states={name: tuple(state.get(name, nan) for state in states) for name in names},
            events=tuple(controller.events),
            changes=changes,
        )


def _scans(columns: Mapping[str, list[float]]) -> Iterator[dict[str, Any]]:
    """Yield the arguments of each scan; what is absent is left out."""
    for n in range(len(columns["sp"])):
        now: dict[str, Any] = {name: column[n] for name, column in columns.items()}
        now = {name: x for name, x in now.items() if name not in _OPTIONAL or not isnan(x)}
        yield now | {name: bool(now[name]) for name in ("auto", "hold") if name in now}
