"""The ways to cut over that a card's transfer leaves, and the best of them (specs/equations.md, section 6)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from pidemu.controller.controller import Controller
from pidemu.cutover.bench import Bench
from pidemu.cutover.trials import Cut, Way, before, cut_over, factors, is_none, proportional, term
from pidemu.errors import SettingError
from pidemu.program.ir import StateRole


def best_way(bench: Bench) -> tuple[Way, Cut]:
    """Return the first way without a bump, or the one with the smallest, and what it comes to."""
    tried = []
    for way in ways(bench):
        cut = cut_over(bench, way)
        if is_none(bench, cut):
            return way, cut
        tried.append((way, cut))
    return min(tried, key=lambda pair: abs(pair[1].bump))


def simple_way(bench: Bench) -> Way:
    """Return what happens without a plan: the output is entered and the controller switched on, the setpoint as it is."""
    return Way(bench.sp, bench.op, waits=bench.entry is not None, prepared=False)


def ways(bench: Bench) -> Iterator[Way]:
    """Yield the ways that leave the valve alone in manual: with the setpoint as it is first, then with it at the measurement.

    An integral that the transfer does not set (`keep`, `zero`, `running`) is set by hand in every way, whether the card says how or
    not; one that is loaded with the output is given another number only where the card says that it can be.
    """
    setpoints = (bench.pv,) if bench.a.setpoint.tracks else tuple(dict.fromkeys((bench.sp, bench.pv)))
    for sp in setpoints:
        plain = Way(sp, bench.entry)
        ctl, _ = before(bench, plain)
        if StateRole.INTEGRAL in ctl.state and bench.a.transfer.way.can_preset:
            yield replace(plain, integral=_integral(bench, ctl, sp))
            continue
        yield plain
        left = bench.op - proportional(ctl, bench, sp)
        if bench.a.transfer.way.loads_output and StateRole.INTEGRAL in ctl.state and bench.preset == "output":
            yield replace(plain, load=left)
        if (
            bench.is_bare
            and bench.a.transfer.without_integral == "kept"
            and StateRole.INTEGRAL not in ctl.state
            and _fits(bench, left)
        ):
            yield replace(plain, bias=left)


def _integral(bench: Bench, ctl: Controller, sp: float) -> float:
    """Return the integral's state that makes the output, with the derivative at rest."""
    gain, time = factors(bench.a, ctl)
    return (bench.op / gain - term(ctl, bench, sp)) * time


def _fits(bench: Bench, bias: float) -> bool:
    """Tell whether a bias is in the range of its dial, where there is one."""
    try:
        bench.controller(bias)
    except SettingError:
        return False
    return True
