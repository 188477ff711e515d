"""The cut-over from the old controller to the new one: what to set, and in which order, so that the valve does not jump."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import copysign, isfinite
from typing import Any, Final

import numpy as np

from pidemu.algorithm import Algorithm
from pidemu.canonical import default_scan
from pidemu.card.base import Rule
from pidemu.emulator import Controller
from pidemu.errors import ScanError, SettingError
from pidemu.plain import json_safe
from pidemu.running import Running
from pidemu.scan.build import Action
from pidemu.settings import Settings, Value
from pidemu.units import FULL, Role, from_canonical, parse_unit

_NO_BUMP: Final = 1e-9
"""Moves of the output below this [% of span] are rounding in float64."""
_LONGEST: Final = 2**18
"""Scans after which filters that have not settled are left alone."""
_UNLIMITED: Final = (-1e30, 1e30)
_RESTLESS: Final = frozenset({"I", "u", "own", "inner", "Ir", "Dr"})
"""States that need not come to rest before the transfer: integral and output are set by it, remainders go round."""
_STARTS: Final = {
    "bumpless": "sets its integral so that the output stays",
    "load-output": "loads its integral with the output, and the other terms come on top",
    "tracked": "has an integral that followed the output in manual, and goes on from there",
    "keep": "has the integral that it had",
    "zero": "starts with an integral of zero",
    "running": "goes on from what it has computed meanwhile: it has no manual",
}
"""What the first automatic scan finds, by `transfer.start`."""
_LOADED_APART: Final = re.compile(r"loads the integral with the last output only where that is passed")
"""A card's own words where the value that the integral is loaded with is an argument, and not the output at the valve."""
_SETS_INTEGRAL: Final = re.compile(r"(\bcan set\b|\bload\b|\bkeeps\b).*\bintegral\b|_start\b")
"""A card's own words on how its integral can be set."""


@dataclass(frozen=True, slots=True)
class Step:
    """One thing to do at the cut-over.

    Attributes
    ----------
    do : str
        What, in a sentence for the technician.
    set : mapping of str to float
        What is set, by name with its unit in brackets; empty where only a mode changes or time passes.
    """

    do: str
    set: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class TransferPlan:
    """What to do at the cut-over, in order, and what that is worth.

    Attributes
    ----------
    steps : tuple of Step
        What to do.
    bump : float
        What the output moves by in the first automatic scan where the plan is followed, by emulation [% of output span]. The
        increment that the integral adds in that scan (``ki h e``, where the card integrates in it at all) is control and not
        counted.
    without_plan : float
        The same where the controller is simply switched to automatic, with output and setpoint as they are [% of output span]. A
        controller without manual is then in its first scan of all.
    resolution : float
        Up to which a bump is none: the rounding of the card's arithmetic [% of output span].
    notes : tuple of str
        What the plan rests on, and what cannot be avoided and why.
    """

    steps: tuple[Step, ...]
    bump: float
    without_plan: float
    notes: tuple[str, ...]
    resolution: float = _NO_BUMP

    @property
    def is_bumpless(self) -> bool:
        """Whether the output does not move but for the rounding of the card's arithmetic."""
        return abs(self.bump) <= self.resolution

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, for JSON."""
        plain = {
            "steps": [{"do": s.do, "set": dict(s.set)} for s in self.steps],
            "bump": self.bump,
            "without_plan": self.without_plan,
            "is_bumpless": self.is_bumpless,
            "resolution": self.resolution,
            "notes": list(self.notes),
        }
        safe: dict[str, Any] = json_safe(plain)
        return safe


def transfer_plan(
    target: Settings,
    sp: float,
    pv: float,
    op: float,
    *,
    scan: float | None = None,
    action: Action = "reverse",
    output_limits: tuple[float, float] | None = None,
) -> TransferPlan:
    """Return what to set on the target, and in which order, so that the cut-over does not move the output.

    Every way that the card's transfer leaves is emulated (specs/equations.md, sections 5 and 6), and of those that leave the valve
    alone until the controller is in automatic the first without a bump is taken, or else the one with the smallest.

    Parameters
    ----------
    target : Settings
        The settings of the controller that takes over.
    sp, pv : float
        Setpoint and measurement at the cut-over [engineering units where the settings have a `pv_range`, else % of span].
    op : float
        Output at the cut-over, where the valve stands [engineering units where the settings have an `op_range`, else % of span].
    scan : float, optional
        Scan interval [s]; by default the card's.
    action : {"reverse", "direct"}
        Control action in the ISA sense, as for `Controller`.
    output_limits : tuple of float, optional
        Low and high output limit [as `op`]; by default the card's.

    Raises
    ------
    ScanError
        A signal is not a finite number, the output is outside its limits, or the controller cannot be run so.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("simple-pid/simple-pid").settings(Kp=2, Ki=0.1)
    >>> plan = transfer_plan(s, sp=50, pv=48, op=43)
    >>> plan.without_plan, plan.bump, plan.is_bumpless
    (4.0, 0.0, True)
    >>> plan.steps[2].do
    'load the integral with 39 %, and not with the output of 43 %: the proportional term of 4 % comes on top'
    """
    bench = _bench(target, (sp, pv, op), scan, action, output_limits)
    way, cut = _best(bench)
    simple = _Way(bench.sp, bench.op, waits=bench.entry is not None, prepared=False)
    bare = _cut(bench, simple)
    return TransferPlan(
        steps=tuple(_steps(bench, way, cut)),
        bump=bench.out.percent(cut.bump),
        without_plan=bench.out.percent(bare.bump),
        notes=tuple(_notes(bench, way, cut)),
        resolution=bench.resolution(cut),
    )


@dataclass(frozen=True, slots=True)
class _Range:
    """A signal's range: between the units that it is given in and the controller's own."""

    low: float
    span: float
    rescaled: bool
    unit: str

    def own(self, x: float) -> float:
        """Return a value in the controller's own units."""
        return (x - self.low) * (100 / self.span) if self.rescaled else x

    def given(self, x: float) -> float:
        """Return a value of the controller's in the units that the signal is given in."""
        return self.low + self.move(x) if self.rescaled else x

    def other_than(self, x: float) -> float:
        """Return the low end of the range, or the high one where that is `x` [own units]."""
        low, high = self.own(self.low), self.own(self.low + self.span)
        return high if x == low else low

    def move(self, x: float) -> float:
        """Return a change in the units that the signal is given in."""
        return x * (self.span / 100) if self.rescaled else x

    def percent(self, x: float) -> float:
        """Return a change in percent of span."""
        return x if self.rescaled else x * (100 / self.span)

    def text(self, own: float) -> str:
        """Return a value of the controller's with the unit that the signal is given in."""
        return f"{self.given(own):.6g} {self.unit}"


def _range(settings: Settings, given: tuple[float, float] | None) -> _Range:
    low, high = given or (0.0, 100.0)
    rescaled = settings.equation.signals == "percent" and given is not None
    return _Range(low, high - low, rescaled, "%" if given is None else "eu")


@dataclass(frozen=True, slots=True)
class _Bench:
    """The target at the cut-over, in its own units.

    Attributes
    ----------
    gain : float
        What the operator's number is multiplied by in manual; 0: the output is 0 there.
    """

    settings: Settings
    a: Algorithm
    scan: float
    action: Action
    limits: tuple[float, float]
    sp: float
    pv: float
    op: float
    measured: _Range
    out: _Range
    gain: float = 1.0

    @property
    def entry(self) -> float | None:
        """What is entered in manual for the output; ``None``: there is no manual, the controller computes and is not used."""
        if self.a.start == "running":
            return None
        return self.op / self.gain + 0.0 if self.gain else self.op

    def controller(self, bias: float | None) -> Controller:
        """Return the target before its first scan, with a bias [own output units] on the dial that it has, or behind the block."""
        settings, behind = self.settings, bias or 0.0
        if bias is not None and (dial := settings.by_role(Role.BIAS)) is not None:
            settings, behind = settings.changed({dial.name: self.on_dial(dial, bias)}), 0.0
        return Controller(settings, self.scan, self.action, self.limits, bias=behind, initial_output=self.op)

    def on_dial(self, dial: Value, bias: float) -> float:
        """Return the value on a dial that makes a bias [own output units]."""
        engineering = self.settings.equation.signals == "engineering"
        return from_canonical(Role.BIAS, bias, parse_unit(dial.unit), FULL if engineering else self.settings.spans)

    @property
    def increments(self) -> bool:
        """Whether the output counts from the last one."""
        return self.a.velocity or self.a.dahlin is not None

    @property
    def is_bare(self) -> bool:
        """Whether there is neither an integral nor an increment, so that the output rests on a bias."""
        return not (self.a.ki or self.increments)

    @property
    def unit(self) -> str:
        """The unit of what the integral's state holds (section 6)."""
        given = "%" if self.settings.equation.signals == "percent" else self.out.unit
        other = "%" if self.settings.equation.signals == "percent" else self.measured.unit
        return {"ki e": given, "e/Ti": other, "e": f"{other} s"}[self.a.holds]

    def resolution(self, cut: _Cut) -> float:
        """Return the rounding of the arithmetic [% of output span] (section 7)."""
        size = abs(self.op) + 2 * abs(cut.proportional) + abs(cut.increment)
        part = {"float64": 1e-14, "float32": 2.0**-21, "integer": 0.0}[self.a.precision]  # some operations, half a bit each
        step = self.a.resolution + (1 / self.a.counts if self.a.precision == "integer" else 0.0)
        return max(_NO_BUMP, self.out.percent(part * size + step))

    def is_none(self, cut: _Cut) -> bool:
        """Tell whether a bump is none."""
        return self.out.percent(abs(cut.bump)) <= self.resolution(cut)


@dataclass(frozen=True, slots=True)
class _Way:
    """One way to cut over, in the controller's own units.

    Attributes
    ----------
    sp : float
        The setpoint up to the first automatic scan.
    entry : float or None
        What is entered in manual; without it the controller computes unused.
    waits : bool
        Whether it has been in manual, or computing unused, until its filters have settled.
    prepared : bool
        Whether the setpoint is set there only, and was another one before.
    bias, integral, load : float or None
        What is set as bias; what the integral's state is set to; what it is loaded with in place of the output.
    """

    sp: float
    entry: float | None
    waits: bool = True
    prepared: bool = True
    bias: float | None = None
    integral: float | None = None
    load: float | None = None


@dataclass(frozen=True, slots=True)
class _Cut:
    """What a way comes to, by emulation, in the controller's own units.

    Attributes
    ----------
    bump : float
        The move of the output in the first automatic scan, less the integral's increment.
    increment : float
        What the integral adds per scan.
    proportional : float
        The proportional term in that scan.
    waited : int or None
        Scans until the filters had settled; ``None``: they had not.
    kick : float
        What the output moves by in the next scan, in which the setpoint is given back.
    """

    bump: float
    increment: float
    proportional: float
    waited: int | None
    kick: float


def _bench(
    target: Settings, signals: tuple[float, float, float], scan: float | None, action: Action, limits: tuple[float, float] | None
) -> _Bench:
    """Check what is given and put it into the controller's own units."""
    name = target.card.id
    for what, x in zip(("setpoint", "measurement", "output"), signals, strict=True):
        if not isfinite(x):
            raise ScanError(f"{name}: the {what} {x} is not a finite number; give the one at the cut-over")
    measured, out = _range(target, target.pv_range), _range(target, target.op_range)
    sp, pv, op = measured.own(float(signals[0])), measured.own(float(signals[1])), out.own(float(signals[2]))
    low, high = target.equation.output.limits if limits is None else (out.own(limits[0]), out.own(limits[1]))
    rounding = 1e-12 * max(1.0, abs(op))  # a limit in engineering units is one in percent but for this
    if not low - rounding <= op <= high + rounding:
        raise ScanError(
            f"{name}: the output of {out.text(op)} is outside the output limits, {out.text(low)} to {out.text(high)}; "
            "bring it inside before the cut-over, or give the target's own limits as output_limits"
        )
    a = target.algorithm(own_units=True, scan=scan)
    h = default_scan(target.equation) if scan is None else float(scan)
    bench = _Bench(target, a, h, action, (low, high), sp, pv, op, measured, out)
    return replace(bench, gain=_gain_by_hand(bench))


def _gain_by_hand(bench: _Bench) -> float:
    """Return what the operator's number is multiplied by in manual (section 6)."""
    if bench.a.manual_output == "operator":
        return 1.0
    one = bench.controller(None).scan(bench.sp, bench.pv, auto=False, manual=1.0)
    return copysign(bench.a.kp, one) if one else 0.0


def _best(bench: _Bench) -> tuple[_Way, _Cut]:
    """Return the first way without a bump, or the one with the smallest."""
    tried = []
    for way in _ways(bench):
        cut = _cut(bench, way)
        if bench.is_none(cut):
            return way, cut
        tried.append((way, cut))
    return min(tried, key=lambda pair: abs(pair[1].bump))


def _ways(bench: _Bench) -> Iterator[_Way]:
    """Yield the ways that leave the valve alone in manual: with the setpoint as it is first, then with it at the measurement."""
    setpoints = (bench.pv,) if bench.a.sp_tracks else tuple(dict.fromkeys((bench.sp, bench.pv)))
    for sp in setpoints:
        plain = _Way(sp, bench.entry)
        ctl, _ = _before(bench, plain)
        if "I" in ctl.state and bench.a.start in ("keep", "zero", "running"):
            gain, time = _factors(bench.a, ctl)
            yield replace(plain, integral=(bench.op / gain - _term(ctl, bench, sp)) * time)
            continue
        yield plain
        left = bench.op - _proportional(ctl, bench, sp)
        if bench.a.start == "load-output" and "I" in ctl.state and _said(bench.settings, _LOADED_APART):
            yield replace(plain, load=left)
        if bench.is_bare and bench.a.keeps_integral and "I" not in ctl.state and _fits(bench, left):
            yield replace(plain, bias=left)


def _fits(bench: _Bench, bias: float) -> bool:
    """Tell whether a bias is in the range of its dial, where there is one."""
    try:
        bench.controller(bias)
    except SettingError:
        return False
    return True


def _before(bench: _Bench, way: _Way) -> tuple[Controller, int | None]:
    """Return the controller just before its first automatic scan, and how many scans it has been waiting."""
    ctl = bench.controller(way.bias)
    if not way.waits:
        return ctl, 0
    entry = bench.op if way.entry is None else way.entry
    if way.prepared:
        ctl.scan(bench.measured.other_than(way.sp), bench.pv, auto=False, manual=entry)
    waited = _settle(ctl, way.sp, bench.pv, entry)
    preset = {} if way.load is None else {"u": way.load}
    if way.integral is not None:
        preset = _preset(bench, ctl.state, way.integral)
    if preset:
        states = ctl.state | preset
        ctl = bench.controller(way.bias)
        ctl.start(**states)
    return ctl, waited


def _preset(bench: _Bench, state: Mapping[str, float], integral: float) -> dict[str, float]:
    """Return the states that go with an integral that is set: what the algorithm knows of its output is the output."""
    preset = {"I": integral} | {name: bench.op for name in ("own", "inner") if name in state}
    if bench.a.start == "zero":  # set after the transfer has cleared it, and the derivative with it
        preset |= {"on": 1.0}
        if bench.a.derivative_start == "zeroed":
            preset |= {name: 0.0 for name in ("x1", "x2", "x3", "D") if name in state}
    return preset


def _settle(ctl: Controller, sp: float, pv: float, entry: float) -> int | None:
    """Scan in manual until filters and differences stand still, and return how often that was."""
    scans = 1
    ctl.scan(sp, pv, auto=False, manual=entry)
    while scans < _LONGEST:
        was = ctl.state
        ctl.scan(sp, pv, auto=False, manual=entry)
        now = ctl.state
        moving = (n for n in now.keys() - _RESTLESS if abs(now[n] - was[n]) > 1e-14 * max(1.0, abs(now[n])))
        if not any(moving):
            return scans
        more = 1 + scans // 4
        ctl.run(sp, np.full(more, pv), auto=False, manual=entry)
        scans += 1 + more
    return None


def _cut(bench: _Bench, way: _Way) -> _Cut:
    """Emulate a way: the first automatic scan, and the next with the setpoint given back."""
    ctl, waited = _before(bench, way)
    proportional = 0.0 if bench.increments else _proportional(ctl, bench, way.sp)
    at_once = _integrates_at_once(bench.a, ctl.state)
    increment = _increment(bench, way)
    u = ctl.scan(way.sp, bench.pv)
    cut = _Cut(u - bench.op, increment, proportional, waited, ctl.scan(bench.sp, bench.pv) - u)
    if bench.is_none(cut):  # nothing was integrated, as at a limit
        return cut
    return replace(cut, bump=u - min(max(bench.op + at_once * increment, bench.limits[0]), bench.limits[1]))


def _integrates_at_once(a: Algorithm, state: Mapping[str, float]) -> float:
    """Return the share of its increment that the integral adds in the first automatic scan (sections 4 and 6)."""
    if a.velocity or not a.ki or a.start == "bumpless" or a.integral_rule is Rule.FORWARD:
        return 0.0
    if state.get("begun", 1.0) == 0:  # the first scan of all
        waits = a.first_scan_holds if a.zero_power_up or a.start == "load-output" else True
        share = 0.5 if a.integral_from_zero and a.integral_rule is Rule.TRAPEZOIDAL else 1.0
        return 0.0 if waits else share
    return 0.0 if a.first_scan_holds and a.start not in ("running", "tracked") and not state.get("on") else 1.0


def _increment(bench: _Bench, way: _Way) -> float:
    """Return what the integral adds per scan away from all limits [own output units]."""
    if not bench.a.ki or bench.increments:
        return 0.0
    ctl, _ = _before(replace(bench, limits=_UNLIMITED), way)
    states = []
    for _ in range(3):  # the first may be a transfer
        ctl.scan(way.sp, bench.pv)
        states.append(ctl.state["I"])
    gain, time = _factors(bench.a, ctl)
    return gain * (states[2] - states[1]) / time


def _factors(a: Algorithm, ctl: Controller) -> tuple[float, float]:
    """Return the gain on the sum of the terms, and the integral time that the integral's state is divided by (section 6)."""
    if a.holds == "ki e":
        return 1.0, 1.0
    numbers = dict(zip((q.name for q in ctl.program.coefficients), ctl.program.values, strict=True))
    return numbers["kp"], numbers.get("Ti", 1.0) if a.holds == "e" else 1.0


def _term(ctl: Controller, bench: _Bench, sp: float) -> float:
    """Return what the program will compute as proportional term in its next scan, before a gain on the whole sum."""
    running = Running(lambda _h: ctl.program, ctl.interval)
    if not running.computes("P"):
        return 0.0
    for name, value in ctl.state.items():
        running[name] = value
    return running.would_be({"sp": sp, "pv": bench.pv, "auto": 1.0}, "P")


def _proportional(ctl: Controller, bench: _Bench, sp: float) -> float:
    return _factors(bench.a, ctl)[0] * _term(ctl, bench, sp)


def _steps(bench: _Bench, way: _Way, cut: _Cut) -> Iterator[Step]:
    """Yield what to do, in order."""
    back = way.sp != bench.sp
    if not bench.a.sp_tracks:
        given = bench.measured.given(way.sp)
        why = ", the measurement" if back else ""
        yield Step(f"set the target's setpoint to {bench.measured.text(way.sp)}{why}", {f"SP [{bench.measured.unit}]": given})
    if way.bias is not None:
        yield _bias_step(bench, way.bias)
    yield _manual_step(bench, way)
    yield from _wait(bench, way, cut)
    if way.load is not None:
        text, op = bench.out.text(way.load), bench.out.text(bench.op)
        more = f"{bench.out.move(cut.proportional):.6g} {bench.out.unit}"
        yield Step(
            f"load the integral with {text}, and not with the output of {op}: the proportional term of {more} comes on top",
            {f"load [{bench.out.unit}]": bench.out.given(way.load)},
        )
    if way.integral is not None:
        yield _integral_step(bench, way.integral, cut)
    if way.entry is None or not bench.gain:
        yield Step("let its next output go to the valve", {})
    else:
        yield Step("switch the target to automatic", {})
    if back:
        moves = f"{bench.out.move(cut.kick):.6g} {bench.out.unit}"
        yield Step(
            f"after its first automatic scan give it the setpoint of {bench.measured.text(bench.sp)}: "
            f"the output then moves by {moves} in one scan",
            {f"SP [{bench.measured.unit}]": bench.measured.given(bench.sp)},
        )


def _wait(bench: _Bench, way: _Way, cut: _Cut) -> Iterator[Step]:
    """Yield how long it stays there, where one scan is not enough or is needed (section 6, tracked)."""
    how = "let it compute so" if way.entry is None else "leave it so"
    if cut.waited is None:
        yield Step(f"{how} until its filters and differences have settled, more than {_LONGEST * bench.scan:.6g} s", {})
    elif cut.waited > 1 or bench.a.start == "tracked":
        why = "its integral follows the output" if cut.waited == 1 else "its filters and differences settle"
        count = f"{cut.waited} scan{'s' * (cut.waited > 1)}"
        yield Step(f"{how} for at least {cut.waited * bench.scan:.6g} s ({count}), in which {why}", {})


def _manual_step(bench: _Bench, way: _Way) -> Step:
    """Return how the valve stays where it is until the transfer (section 6)."""
    op = bench.out.text(bench.op)
    if way.entry is None:
        return Step(
            f"hold the valve at {op} from outside, and let the target compute without using its output: it has no manual", {}
        )
    if not bench.gain:
        return Step(f"hold the valve at {op} from outside, and switch the target off: its output is then 0", {})
    if bench.a.manual_output == "gain-times-operator":
        return Step(
            f"put the target in manual and enter {way.entry:.6g}: its output is that times {bench.gain:.6g}, its gain: {op}",
            {f"manual entry [{bench.out.unit}]": way.entry},
        )
    return Step(f"put the target in manual with output {op}", {f"OP [{bench.out.unit}]": bench.out.given(bench.op)})


def _bias_step(bench: _Bench, bias: float) -> Step:
    dial, why = bench.settings.by_role(Role.BIAS), "the output less the proportional term"
    if dial is not None:
        value = bench.on_dial(dial, bias)
        return Step(f"set {dial.name}, the bias, to {value:.6g} {dial.unit}: {why}", {f"{dial.name} [{dial.unit}]": value})
    return Step(
        f"give the target a bias of {bench.out.text(bias)}, as manual reset or added behind the block: {why}",
        {f"bias [{bench.out.unit}]": bench.out.given(bias)},
    )


def _integral_step(bench: _Bench, integral: float, cut: _Cut) -> Step:
    own = "% of span" if bench.out.rescaled else bench.out.unit
    held = {"ki e": "", "e/Ti": ", divided by the gain", "e": ", divided by the gain and times the integral time"}[bench.a.holds]
    after = "once it is on, and before its first scan, " if bench.a.start == "zero" else ""
    return Step(
        f"{after}set its integral to {integral:.6g} {bench.unit}: the output of {bench.op:.6g} {own} less the proportional term of "
        f"{cut.proportional:.6g} {own}{held}; the derivative is 0 at rest",
        {f"I [{bench.unit}]": integral},
    )


def _said(settings: Settings, words: re.Pattern[str]) -> list[str]:
    """Return the card's quirks that say something."""
    return [q.text for q in settings.card.data.quirks if words.search(q.text)]


def _notes(bench: _Bench, way: _Way, cut: _Cut) -> Iterator[str]:
    """Yield what the plan rests on, and what it cannot avoid."""
    card = bench.settings.card.id
    yield _what_starts(bench, way, card)
    yield from _evidence(bench)
    if bench.entry is None:
        yield "without the plan means that the first scan it ever makes goes to the valve"
    if way.integral is not None:
        yield f"{card} does not state where its integral is set; where that cannot be done, the output moves as without the plan"
        yield from (f"the card says: {text}" for text in _said(bench.settings, _SETS_INTEGRAL))
    if way.bias is not None and bench.settings.by_role(Role.BIAS) is None:
        yield f"{card} names no setting for a bias; without it the output moves as without the plan"
    if cut.increment:
        yield f"the integral adds {bench.out.percent(cut.increment):.6g} % of span per scan: that is control and no bump"
    if way.sp != bench.sp:
        follows = (
            "in manual its setpoint follows the measurement, and stays there" if bench.a.sp_tracks else "it starts at an error of 0"
        )
        yield f"{follows}; giving the setpoint back moves the output by {bench.out.percent(cut.kick):.6g} % of span in one scan"
    if cut.waited is None:
        yield f"its filters and differences have not settled after {_LONGEST} scans; the bump is that of then"
    if bench.a.precision != "float64":
        yield f"{bench.a.precision} arithmetic: {bench.resolution(cut):.2g} % of span is its rounding, and no bump"
    ranges = (bench.settings.pv_range, bench.settings.op_range)
    if bench.settings.equation.signals == "engineering" and None in ranges:
        yield f"{card} computes in engineering units, and not all ranges were given: spans not given are taken as 100"
    yield from _left(bench, cut, card)


def _what_starts(bench: _Bench, way: _Way, card: str) -> str:
    if bench.increments:
        return f"{card} adds increments to the last output, and makes none in the first automatic scan: there is nothing to preset"
    if bench.is_bare and way.integral is None and (bench.a.start != "load-output" or not bench.a.keeps_integral):
        return f"{card} has no integral action here: its output is P, D and a bias, whatever it was before"
    return f"at the transfer {card} {_STARTS[bench.a.start]}"


def _evidence(bench: _Bench) -> Iterator[str]:
    """Yield how sure the card is of its transfer, where it is not stated."""
    for s in bench.settings.variant.statements():
        if s.path == "transfer.start" and s.evidence is not None and (s.is_assumed or s.is_inferred):
            yield f"that is {s.evidence.status.value}, not stated: {s.evidence.note}"


def _left(bench: _Bench, cut: _Cut, card: str) -> Iterator[str]:
    """Yield why the output moves all the same."""
    if bench.is_none(cut):
        return
    bump = bench.out.percent(cut.bump)
    if bench.is_bare and not bench.a.keeps_integral:
        yield f"a bump of {bump:.6g} % of span remains: without integral action {card} keeps nothing that would hold the output; " \
            f"a constant of {-bench.out.move(cut.bump):.6g} {bench.out.unit} added behind it would"  # fmt: skip
    else:
        yield f"a bump of {bump:.6g} % of span remains: the output limits, the limits of the integral or the setpoint weights of " \
            f"{card} leave no room for what the output needs"  # fmt: skip
