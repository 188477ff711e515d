"""The controller that takes over, and the signals at the cut-over, in the units that it computes in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import copysign, isfinite

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.card_file import default_scan
from pidemu.controller.bench import Bench
from pidemu.controller.controller import Controller
from pidemu.errors import ScanError
from pidemu.settings.action import Action, switch_position
from pidemu.settings.ranges import PERCENT, Limits, SignalRange
from pidemu.settings.settings import Settings, Value
from pidemu.units import FULL, Role, from_canonical, parse_unit


@dataclass(frozen=True, slots=True)
class ShownSignal:
    """A signal as it is shown to the operator, in the units that it is given in, and as the controller has it, in its own.

    Attributes
    ----------
    range : SignalRange
        The range that it is shown in: in percent where none is given.
    rescaled : bool
        Whether the controller computes in percent of it, so that the two units differ.
    """

    range: SignalRange
    rescaled: bool

    @property
    def unit(self) -> str:
        """The unit that the signal is given in: that of its range, ``eu`` where it states none, ``%`` without a range."""
        return self.range.unit or "eu"

    def own(self, x: float) -> float:
        """Return a value in the controller's own units."""
        return self.range.in_percent(x) if self.rescaled else x

    def own_limits(self, limits: Limits) -> Limits:
        """Return limits in the controller's own units."""
        return self.range.limits_in_percent(limits) if self.rescaled else limits

    def given(self, x: float) -> float:
        """Return a value of the controller's in the units that the signal is given in."""
        return self.range.from_percent(x) if self.rescaled else x

    def other_than(self, x: float) -> float:
        """Return the low end of the range, or the high one where that is `x` [own units]."""
        low, high = map(self.own, self.range.ends)
        return high if x == low else low

    def move(self, x: float) -> float:
        """Return a change in the units that the signal is given in."""
        return self.range.change_from_percent(x) if self.rescaled else x

    def percent(self, x: float) -> float:
        """Return a change in percent of span."""
        return x if self.rescaled else self.range.change_in_percent(x)

    def text(self, own: float) -> str:
        """Return a value of the controller's with the unit that the signal is given in."""
        return f"{self.given(own):.6g} {self.unit}"


def _shown(settings: Settings, given: SignalRange | None) -> ShownSignal:
    return ShownSignal(given or PERCENT, given is not None and settings.equation.signals == "percent")


@dataclass(frozen=True, slots=True)
class Takeover:
    """The target at the cut-over, in its own units.

    Attributes
    ----------
    settings : Settings
        Its settings.
    a : Algorithm
        The algorithm at the scan interval, in own units.
    scan : float
        Scan interval [s].
    action : {"reverse", "direct"}
        Control action in the ISA sense.
    limits : tuple of float
        Output limits.
    sp, pv, op : float
        Setpoint, measurement, and the output at which the valve stands.
    measured, out : ShownSignal
        Measurement and output as they are shown.
    gain : float
        What the operator's number is multiplied by in manual; 0: the output is 0 there.
    action_known : bool
        Whether `action` is the loop's; otherwise it is one of the two that the plan holds for.
    """

    settings: Settings
    a: Algorithm
    scan: float
    action: Action
    limits: Limits
    sp: float
    pv: float
    op: float
    measured: ShownSignal
    out: ShownSignal
    gain: float = 1.0
    action_known: bool = True

    @property
    def entry(self) -> float | None:
        """What is entered in manual for the output; ``None``: there is no manual, the controller computes and is not used."""
        if self.a.transfer.way.runs_on:
            return None
        return self.op / self.gain + 0.0 if self.gain else self.op

    @property
    def increments(self) -> bool:
        """Whether the output counts from the last one."""
        return self.a.velocity or self.a.dahlin is not None

    @property
    def is_bare(self) -> bool:
        """Whether there is neither an integral nor an increment, so that the output rests on a bias."""
        return not (self.a.ki or self.increments)

    @property
    def preset(self) -> str:
        """What the card says can be set at the transfer: its ``transfer.preset``."""
        return self.settings.equation.transfer.preset

    @property
    def unit(self) -> str:
        """The unit of what the integral's state holds (specs/equations.md, section 6)."""
        given = "%" if self.settings.equation.signals == "percent" else self.out.unit
        other = "%" if self.settings.equation.signals == "percent" else self.measured.unit
        return {"ki e": given, "e/Ti": other, "e": f"{other} s"}[self.a.integral.holds]

    def controller(self, bias: float | None) -> Controller:
        """Return the target before its first scan, with a bias [own output units] on the dial that it has, or behind the block.

        Raises
        ------
        SettingError
            The bias is outside the range of its dial.
        """
        settings, behind = self.settings, bias or 0.0
        if bias is not None and (dial := settings.by_role(Role.BIAS)) is not None:
            settings, behind = settings.changed({dial.name: self.on_dial(dial, bias)}), 0.0
        position = switch_position(settings, self.action)
        return Bench(settings, self.scan, self.sp, self.pv, self.op, self.limits, position).before_first_scan(behind)

    def on_dial(self, dial: Value, bias: float) -> float:
        """Return the value on a dial, in its unit, that makes a bias [own output units]."""
        engineering = self.settings.equation.signals == "engineering"
        return from_canonical(Role.BIAS, bias, parse_unit(dial.unit), FULL if engineering else self.settings.spans)


def takeover_of(
    target: Settings, signals: tuple[float, float, float], scan: float | None, action: Action, limits: Limits | None
) -> Takeover:
    """Check what is given and put it into the controller's own units.

    Parameters
    ----------
    target : Settings
        The settings of the controller that takes over.
    signals : tuple of float
        Setpoint, measurement and output [engineering units where the settings have the range, else % of span].
    scan : float or None
        Scan interval [s]; ``None``: the card's.
    action : {"reverse", "direct"}
        Control action in the ISA sense.
    limits : tuple of float or None
        Output limits [as the output]; ``None``: the card's.

    Raises
    ------
    ScanError
        A signal is not a finite number, or the output is outside its limits.
    """
    name = target.card.id
    for what, x in zip(("setpoint", "measurement", "output"), signals, strict=True):
        if not isfinite(x):
            raise ScanError(f"{name}: the {what} {x} is not a finite number; give the one at the cut-over")
    measured, out = _shown(target, target.pv_range), _shown(target, target.op_range)
    sp, pv, op = measured.own(float(signals[0])), measured.own(float(signals[1])), out.own(float(signals[2]))
    low, high = target.equation.output.limits if limits is None else out.own_limits(limits)
    rounding = 1e-12 * max(1.0, abs(op))  # a limit in engineering units is one in percent but for this
    if not low - rounding <= op <= high + rounding:
        raise ScanError(
            f"{name}: the output of {out.text(op)} is outside the output limits, {out.text(low)} to {out.text(high)}; "
            "bring it inside before the cut-over, or state the limits that are set (--limits on the command line, output_limits "
            "here)"
        )
    a = target.algorithm(own_units=True, scan=scan)
    h = default_scan(target.equation) if scan is None else float(scan)
    new = Takeover(target, a, h, action, (low, high), sp, pv, op, measured, out)
    return replace(new, gain=_gain_by_hand(new))


def _gain_by_hand(new: Takeover) -> float:
    """Return what the operator's number is multiplied by in manual (section 6)."""
    if new.a.transfer.manual_output == "operator":
        return 1.0
    one = new.controller(None).scan(new.sp, new.pv, auto=False, manual=1.0)
    return copysign(new.a.kp, one) if one else 0.0
