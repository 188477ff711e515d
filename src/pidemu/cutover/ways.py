"""The ways to cut over that a card's transfer leaves, and the best of them (specs/equations.md, section 6)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from pidemu.controller.controller import Controller
from pidemu.cutover.takeover import Takeover
from pidemu.cutover.trials import Cut, Way, before, cut_over, factors, is_none, proportional, term
from pidemu.errors import SettingError
from pidemu.program.ir import StateRole


def best_way(new: Takeover) -> tuple[Way, Cut]:
    """Return the first way without a bump, or the one with the smallest, and what it comes to."""
    tried = []
    for way in ways(new):
        cut = cut_over(new, way)
        if is_none(new, cut):
            return way, cut
        tried.append((way, cut))
    return min(tried, key=lambda pair: abs(pair[1].bump))


def simple_way(new: Takeover) -> Way:
    """Return what happens without a plan: the output is entered and the controller switched on, the setpoint as it is."""
    return Way(new.sp, new.op, waits=new.entry is not None, prepared=False)


def ways(new: Takeover) -> Iterator[Way]:
    """Yield the ways that leave the valve alone in manual: with the setpoint as it is first, then with it at the measurement.

    An integral that the transfer does not set (`keep`, `zero`, `running`) is set by hand in every way, whether the card says how or
    not; one that is loaded with the output is given another number only where the card says that it can be.
    """
    setpoints = (new.pv,) if new.a.setpoint.tracks else tuple(dict.fromkeys((new.sp, new.pv)))
    for sp in setpoints:
        plain = Way(sp, new.entry)
        ctl, _ = before(new, plain)
        if StateRole.INTEGRAL in ctl.state and new.a.transfer.way.can_preset:
            yield replace(plain, integral=_integral(new, ctl, sp))
            continue
        yield plain
        left = new.op - proportional(ctl, new, sp)
        if new.a.transfer.way.loads_output and StateRole.INTEGRAL in ctl.state and new.preset == "output":
            yield replace(plain, load=left)
        if new.is_bare and new.a.transfer.without_integral == "kept" and StateRole.INTEGRAL not in ctl.state and _fits(new, left):
            yield replace(plain, bias=left)


def _integral(new: Takeover, ctl: Controller, sp: float) -> float:
    """Return the integral's state that makes the output, with the derivative at rest."""
    gain, time = factors(new.a, ctl)
    return (new.op / gain - term(ctl, new, sp)) * time


def _fits(new: Takeover, bias: float) -> bool:
    """Tell whether a bias is in the range of its dial, where there is one."""
    try:
        new.controller(bias)
    except SettingError:
        return False
    return True
