"""A controller on a bench: at a setpoint, a measurement and an output, with limits and action."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pidemu.controller.controller import Controller
from pidemu.settings.action import Action
from pidemu.settings.ranges import PERCENT, UNLIMITED, Limits, are_limits
from pidemu.settings.settings import Settings


@dataclass(frozen=True, slots=True)
class Bench:
    """What a controller is given before it runs, in the units that it computes in.

    Attributes
    ----------
    settings : Settings
        Its settings.
    scan : float or None
        Scan interval [s]; ``None``: the card's.
    sp, pv, op : float
        Setpoint, measurement and output.
    limits : tuple of float
        Output limits; by default none.
    action : {"reverse", "direct"}
        Control action, as in ``Controller(action=)``.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("arduino/pid").settings(Kp=2, Ki=0.02, op_range=(0, 255))
    >>> bench = Bench.in_percent(s, 1.0, op=40.0)
    >>> bench.op, bench.at_rest().scan(50.0, 50.0)
    (102.0, 102.0)
    """

    settings: Settings
    scan: float | None
    sp: float
    pv: float
    op: float
    limits: Limits = UNLIMITED
    action: Action = "reverse"

    @classmethod
    def in_percent(
        cls,
        settings: Settings,
        scan: float | None,
        *,
        sp: float = 50.0,
        pv: float = 50.0,
        op: float = 50.0,
        limits: Limits = UNLIMITED,
        action: Action = "reverse",
    ) -> Bench:
        """Return the bench with signals and limits that are given in percent of their ranges."""
        own = settings.own_ranges
        signals = own.pv.from_percent(sp), own.pv.from_percent(pv), own.op.from_percent(op)
        return cls(settings, scan, *signals, own.op.limits_from_percent(limits), action)

    @property
    def is_biased(self) -> bool:
        """Whether the output is held by a bias that it is given: nothing integrates, and the settings have none of their own."""
        a = self.settings.algorithm()
        return not (a.ki or a.velocity or a.dahlin or a.transfer.way.loads_output or a.bias) and self.op != 0

    def before_first_scan(self, bias: float | None = None) -> Controller:
        """Return the controller with the output that it has before its first scan, which will be a transfer.

        Parameters
        ----------
        bias : float, optional
            Its output at zero error; by default the output, where it is held by a bias.
        """
        if bias is None:
            bias = self.op if self.is_biased else 0.0
        return Controller(self.settings, self.scan, self.action, self.limits, bias=bias, initial_output=self.op)

    def at_rest(self, bias: float | None = None) -> Controller:
        """Return the controller as if it had been in automatic with these signals and this output for ever.

        What is held by a bias has this output at zero error, and another one as soon as a term without integral sees the signals.
        """
        controller = self.before_first_scan(bias)
        controller.rest(self.sp, self.pv, self.op)
        return controller

    def balanced(self) -> Controller:
        """Return the controller at rest, with such a bias where it is held by one that its output stays where it is."""
        if not self.is_biased:
            return self.at_rest()
        first = replace(self, limits=UNLIMITED).at_rest().scan(self.sp, self.pv)
        return self.at_rest(bias=2 * self.op - first)


def limits_in_percent(settings: Settings, given: Limits | None, instead: Limits = PERCENT.ends) -> Limits:
    """Return output limits [%]: the given ones, else the card's own, or `instead` where the card has none."""
    if given is not None:
        return given
    delivered = settings.equation.output.limits
    return settings.own_ranges.op.limits_in_percent(delivered) if are_limits(delivered) else instead
