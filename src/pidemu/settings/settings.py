"""Dial values on one card, and what they amount to in canonical units."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

from pidemu.card.load import Card, Variant
from pidemu.card.model.card_file import Equation, Setting
from pidemu.card.model.signals import SignalFilter
from pidemu.errors import ScanError
from pidemu.part import part
from pidemu.plausible import INTERVAL, plausible
from pidemu.settings.ranges import PERCENT, SignalRange, SignalRanges
from pidemu.units import DEGREES, FULL, Role, Spans, convert_unit, from_canonical, parse_unit, to_canonical

if TYPE_CHECKING:
    from pidemu.algorithm.model import Algorithm
    from pidemu.law.law import Law


_ROLES: Final = {role.value: role for role in Role}


@part(frozen=True, slots=True)
class Value:
    """One dial and its value.

    Attributes
    ----------
    name : str
        The dial.
    setting : Setting
        What the card says of it.
    value : float
        The dial's value, in `unit`.
    unit : str
        The card's unit.
    spans : Spans
        Signal spans and, where dials of the card count in scans, the scan interval.
    given : bool
        Whether the user gave it; otherwise it is the card's default.
    active : bool
        Whether the chosen options use it.
    note : str
        How what was given became `value`; empty if it was given so.
    typed : str or float or None
        What the user gave, with its unit where one was written; ``None`` where nothing was, or where the value is another since.
    unclear : bool
        Whether what was given can be read in two ways: a time for a dial that counts repeats per time.
    """

    name: str
    setting: Setting
    value: float
    unit: str
    spans: Spans = FULL
    given: bool = True
    active: bool = True
    note: str = ""
    typed: str | float | None = None
    unclear: bool = False

    @property
    def role(self) -> Role:
        """What the dial sets."""
        return _ROLES[self.setting.sets]

    @property
    def off(self) -> bool:
        """Whether the value switches its term off."""
        return self.value in off_values(self.setting)

    @property
    def canonical(self) -> float:
        """The value in canonical units; 0 for a term that is off (see `pidemu.units`)."""
        if self.off and self.role in (Role.INTEGRAL, Role.DERIVATIVE, Role.GAIN, Role.FILTER_TIME):
            return 0.0
        return to_canonical(self.role, self.value, parse_unit(self.unit), self.spans)

    def to(self, unit: str) -> float:
        """Return the value in another unit.

        Parameters
        ----------
        unit : str
            Any unit that fits the dial, such as ``"s/repeat"``.

        Raises
        ------
        UnitError
            The unit is unknown or has the wrong dimension.
        """
        wanted = parse_unit(unit)
        if self.off:
            return from_canonical(self.role, 0.0, wanted, self.spans)
        return convert_unit(self.role, self.value, parse_unit(self.unit), wanted, self.spans)


def off_values(setting: Setting) -> tuple[float, ...]:
    """Return the values that switch a dial's term off."""
    if setting.off is None:
        return ()
    return tuple(setting.off) if isinstance(setting.off, list) else (setting.off,)


def limits(setting: Setting) -> tuple[float, float]:
    """Return the smallest and largest value of a dial [its unit]: the card's, or 0 to infinity."""
    return setting.range if setting.range is not None else (0.0, math.inf)


@dataclass(frozen=True)
class Settings(Mapping[str, Value]):
    """Settings of one card: a read-only mapping from dial names to values.

    Attributes
    ----------
    variant : Variant
        The card with its options chosen.
    values_by_name : dict
        Value by dial.
    pv_range, op_range : SignalRange or None
        Ranges of measurement and output, where given.
    notes : tuple of str
        What was inferred or converted on the way in.
    defaulted : tuple of str
        Options that were not stated, so that the card's default was taken.
    pace : float
        Interval at which the algorithm is really executed per the interval it computes with. All its times are this much longer:
        integral and derivative time, filters, ramps; the gain stays (specs/equations.md, section 3).
    lag : float
        A first-order lag on the measurement in front of the block, which is not a dial of it [s]: what a conversion asks for where
        the source filters its measurement and the target cannot. 0 where there is none.
    scan : float or None
        Scan interval at which dials that count in scans are read [s], the card's unless stated; ``None`` where it has none.
    """

    variant: Variant
    values_by_name: Mapping[str, Value]
    pv_range: SignalRange | None = None
    op_range: SignalRange | None = None
    notes: tuple[str, ...] = field(default=(), compare=False)
    defaulted: tuple[str, ...] = field(default=(), compare=False)
    pace: float = 1.0
    lag: float = 0.0
    scan: float | None = field(default=None, compare=False)
    _algorithms: dict[tuple[bool, float | None], Algorithm] = field(default_factory=dict, init=False, repr=False, compare=False)
    _laws: dict[float | None, Law] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process is sent: all but what is worked out from it."""
        return {**self.__dict__, "_algorithms": {}, "_laws": {}}

    def __getitem__(self, name: str) -> Value:
        return self.values_by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.values_by_name)

    def __len__(self) -> int:
        return len(self.values_by_name)

    def __hash__(self) -> int:
        return hash((self.card.id, *self.options.values(), *(v.value for v in self.values())))

    def __repr__(self) -> str:
        return f"<Settings {self.summary}>"

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:  # noqa: ARG002  # IPython's and Hypothesis's way to print
        printer.text(repr(self))

    @property
    def summary(self) -> str:
        """Card, dials and options in one line."""
        dials = ", ".join(f"{n}={v.value:g} {v.unit}" for n, v in self.items() if v.active)
        chosen = "".join(f", {n}={c}" for n, c in self.options.items())
        return f"{self.card.id}: {dials}{chosen}"

    @property
    def card(self) -> Card:
        """The card."""
        return self.variant.card

    @property
    def options(self) -> dict[str, str]:
        """Choice by option."""
        return dict(self.variant.chosen)

    @property
    def equation(self) -> Equation:
        """The card's equation with the options overlaid."""
        return self.variant.equation

    @property
    def spans(self) -> Spans:
        """Signal spans; 100 where no range was given."""
        return spans_of(self.pv_range, self.op_range, self.scan)

    @property
    def counts_scans(self) -> bool:
        """Whether a dial at work counts in scans, so that the algorithm's numbers depend on the scan interval."""
        return any(parse_unit(v.unit).scans and v.active and not v.off for v in self.values())

    def at_scan(self, scan: float | None) -> Settings:
        """Return these settings with dials that count in scans read at a scan interval [s]; the same where there are none.

        A filter that is set as a share of the new sample per scan counts in scans too.
        """
        shares = any(v.role is Role.FILTER_FACTOR and v.active and v.value != 1 for v in self.values())
        if scan is None or (self.scan is None and not shares):
            return self
        values = {name: replace(v, spans=replace(v.spans, scan=scan)) for name, v in self.items()}
        return replace(self, values_by_name=values, scan=scan)

    @property
    def own_ranges(self) -> SignalRanges:
        """Ranges of measurement and output in the units that the card computes in: percent, or the ranges given, else 0 to 100."""
        if self.equation.signals == "percent":
            return SignalRanges(PERCENT, PERCENT)
        return SignalRanges(self.pv_range or PERCENT, self.op_range or PERCENT)

    def by_role(self, role: Role) -> Value | None:
        """Return the active dial that sets `role`, or ``None``."""
        return next((v for v in self.values() if v.role is role and v.active), None)

    def changed(self, values: Mapping[str, object]) -> Settings:
        """Return these settings with some changed, by name; options as well.

        Raises
        ------
        SettingError
            A setting is unknown or out of range.
        """
        new = {name.casefold() for name in values}
        given: dict[str, object] = {
            n: v.value if v.typed is None else v.typed for n, v in self.items() if v.given and n.casefold() not in new
        }
        given |= {n: c for n, c in self.options.items() if n.casefold() not in new and n not in self.defaulted}
        ranges = (("pv_range", self.pv_range), ("op_range", self.op_range))
        given |= {name: value for name, value in ranges if value is not None and name not in values}
        return replace(self.card.settings({**given, **values}).at_scan(self.scan), pace=self.pace, lag=self.lag)

    def algorithm(self, *, own_units: bool = False, scan: float | None = None) -> Algorithm:
        """Return the algorithm with its numbers.

        Parameters
        ----------
        own_units : bool
            For a card that computes in engineering units: leave the gains in those units, as the scan program needs them,
            instead of percent of span.
        scan : float, optional
            Scan interval, for dials that count in scans and filters that are set as a share per scan [s]; by default that of
            the settings, or the card's.

        Raises
        ------
        SettingError
            The settings do not make a controller: no gain to divide by, a filter of zero derivative gain.
        """
        from pidemu.algorithm.resolve import algorithm_of  # numbers are made from settings, not settings from numbers

        equation = self.equation
        filtered = (equation.setpoint, equation.measurement, equation.error) != (None, None, None)
        real, scan = scan, self.scan if scan is None else scan
        timed = filtered or self.counts_scans
        key = (own_units and equation.signals == "engineering", scan if timed else None)  # what makes a difference
        if key not in self._algorithms:
            declared = self.scan if real is None else real / self.pace
            found = algorithm_of(self, own_units=own_units, scan=declared).paced(self.pace)
            self._algorithms[key] = (
                found.filtered(SignalFilter(time=self.lag)) if self.lag and found.measurement.filter is None else found
            )
        return self._algorithms[key]

    def to_dict(self) -> dict[str, Any]:
        """Return card, active settings, options and the ranges given as plain values, for JSON."""
        ranges = (("pv_range", self.pv_range), ("op_range", self.op_range))
        return {
            "card": self.card.id,
            "settings": {n: {"value": v.value, "unit": v.unit} for n, v in self.items() if v.active},
            "options": dict(self.options),
            **{name: given.to_dict() for name, given in ranges if given is not None},
        }

    def without_use_for(self, signals: Iterable[str]) -> dict[str, str]:
        """Return why the card has no use for signals, by signal: ``"external_reset"`` and ``"feedforward"`` need a place to go."""
        a = self.algorithm()
        reasons = {}
        if "external_reset" in signals and not a.integral.windup.takes_external_reset:
            reasons["external_reset"] = f"{self.card.id} takes no external reset: its windup scheme is '{a.integral.windup.scheme}'"
        if "feedforward" in signals and a.feedforward is None:
            reasons["feedforward"] = f"{self.card.id} states no feedforward input"
        return reasons

    def law(self, scan: float | None = None) -> Law:
        """Return the linear law (specs/equations.md, section 2).

        Parameters
        ----------
        scan : float, optional
            Scan interval [s], for the discrete law; without it the continuous one.

        Raises
        ------
        ScanError
            The interval is not one at which a controller is executed, or a filter is unstable at it.
        """
        from pidemu.law.law import Law  # the law is made from settings, not settings from the law

        h = None if scan is None else plausible("scan interval", scan, INTERVAL, ScanError)
        if h not in self._laws:
            self._laws[h] = Law(self.algorithm(scan=h), h)
        return self._laws[h]


def spans_of(pv: SignalRange | None, op: SignalRange | None, scan: float | None = None) -> Spans:
    """Return the spans of signal ranges, 100 where none is given, with the scan interval [s] and the size of a degree."""
    return Spans((pv or PERCENT).span, (op or PERCENT).span, scan, DEGREES.get(pv.unit) if pv is not None else None)
