"""A card to convert to, with its options chosen: what a conversion may set on it, and its algorithm for any numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from pidemu.algorithm.model import Algorithm
from pidemu.card.load import Card, Variant
from pidemu.card.model.base import Form
from pidemu.card.model.card_file import Setting
from pidemu.conversion.target.computed import placeholder
from pidemu.conversion.target.filter import TargetFilter
from pidemu.conversion.target.numbers import Numbers
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings, off_values
from pidemu.units import Role, Spans


@dataclass(frozen=True)
class Target:
    """A card to convert to, with its options chosen and some dials perhaps given; nothing of it changes while a match is sought.

    Attributes
    ----------
    card : Card
        The card.
    variant : Variant
        The card with its options chosen.
    options : mapping
        Options by name.
    given : mapping
        Dials that are fixed, by the card's names.
    ranges : mapping
        Ranges of measurement and output that are known, by argument.
    spans : Spans
        What its units are measured by.
    pace : float
        Interval at which it is really executed per the one that it computes with; see `Settings.pace`.
    scan : float or None
        Scan interval that it computes with [s], for dials that count in scans; ``None``: the card's.
    lag : float
        A lag in front of the block [s].
    is_paired : bool
        Whether source and target filter the measurement alike, so that the rest is matched as if neither did.
    idle_gain : float
        Gain taken where there is no proportional term, so that the gain only scales the two times.
    multiplier : float
        Overall multiplier of all three terms.
    filter : TargetFilter
        The derivative's filter as the card delivers it or the user has given it, and whether it is free.
    """

    card: Card
    variant: Variant
    options: Mapping[str, object]
    given: Mapping[str, object]
    ranges: Mapping[str, SignalRange]
    spans: Spans
    pace: float = 1.0
    scan: float | None = None
    lag: float = 0.0
    is_paired: bool = False
    idle_gain: float = 1.0
    multiplier: float = 1.0
    filter: TargetFilter = field(default_factory=TargetFilter)

    @property
    def form(self) -> Form:
        """The form of its equation."""
        return self.variant.equation.form

    def dial(self, role: Role) -> tuple[str, Setting] | None:
        """Return the active dial that sets `role`."""
        return self.variant.dials.get(role.value)

    def is_free(self, name: str, setting: Setting) -> bool:
        """Whether the conversion may choose a dial."""
        return name not in self.given and setting.scope == "loop"

    def may_choose(self, role: Role) -> bool:
        """Whether the conversion may choose the dial that sets `role`: a setpoint weight, an overall multiplier."""
        dial = self.dial(role)
        return dial is not None and self.is_free(*dial)

    @property
    def has_proportional(self) -> bool:
        """Whether there is a proportional term on the measurement."""
        return self.variant.has_proportional

    @property
    def has_integral(self) -> bool:
        """Whether there is an integral term."""
        return self.variant.has_integral

    @property
    def has_derivative(self) -> bool:
        """Whether there is a derivative term."""
        return self.variant.has_derivative

    @property
    def percent_per_unit(self) -> float:
        """Percent gain that a gain of 1 in the card's own signals amounts to [%/%]."""
        return float(self.spans.ratio) if self.variant.equation.signals == "engineering" else 1.0

    @cached_property
    def shape(self) -> Algorithm:
        """The target's algorithm with placeholder numbers, for everything but its numbers."""
        found = self.template().algorithm()
        return found.filtered(None) if self.is_paired else found

    def template(self, **extra: object) -> Settings:
        """Return settings with placeholder numbers in the dials that a conversion computes."""
        values: dict[str, object] = {**self.given, **extra}
        for name, setting in self.variant.equation.settings.items():
            if name not in values and (setting.default is None or setting.sets in ("gain", "integral", "derivative")):
                undefined = setting.sets == "derivative" and self.form is Form.SERIES and not self.has_proportional
                values[name] = (*off_values(setting), 0.0)[0] if undefined else placeholder(setting)
        settings = self.card.settings({**self.variant.chosen, **values, **self.ranges})
        return replace(settings, pace=self.pace, lag=self.lag).at_scan(self.scan)

    def without_default(self) -> Iterator[tuple[str, Setting]]:
        """Yield the dials in use that the card has no default for."""
        for name, setting in self.variant.equation.settings.items():
            if setting.default is None and name in self.variant.active:
                yield name, setting

    def filter_base(self, n: Numbers) -> Any:
        """Return the derivative time that the filter's ratio or gain refers to [s], for numbers that may be arrays."""
        scale = self.multiplier if n.multiplier is None else n.multiplier
        parallel = self.form is Form.PARALLEL
        scale *= self.percent_per_unit
        of_dial = parallel and self.filter.of != "derivative-time"
        time = n.kd / scale if of_dial else _over(n.kd, n.K)
        effective = self.filter.of == "effective-derivative" and not _is_zero(time)
        return time / (1 + _over(time * n.ki, n.K)) if effective else time

    def algorithm_of(self, n: Numbers, filt: TargetFilter) -> Algorithm:
        """Return the algorithm for canonical numbers, which may be arrays, whether its dials can be set so or not.

        Parameters
        ----------
        n : Numbers
            The numbers.
        filt : TargetFilter
            The filter with its value, for numbers without a filter time of their own.
        """
        base = self.filter_base(n)
        Tf = n.Tf if n.Tf is not None else filt.time if filt.kind == "time" else filt.ratio * base
        if filt.kind != "time" and _is_zero(base):
            Tf = 0.0
        kd = n.kd - n.K * Tf if filt.lead_lag else n.kd
        b, c = (own if x is None else x for own, x in ((self.shape.b, n.b), (self.shape.c, n.c)))
        return replace(self.shape, kp=n.K if self.has_proportional else 0.0, ki=n.ki, kd=kd, Tf=Tf, b=b, c=c)


def _over(x: Any, y: Any) -> Any:
    """Return a quotient, 0 where there is nothing to divide by."""
    return 0.0 if _is_zero(y) else x / y


def _is_zero(x: Any) -> bool:
    return isinstance(x, float | int) and x == 0
