"""What a conversion is asked for: read, checked, and written as words of the command line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from numbers import Real
from typing import TYPE_CHECKING, Any

from pidemu.card.load import Card
from pidemu.conversion.modes import Modes, read_mode
from pidemu.conversion.rounding import checked_digits
from pidemu.errors import ScanError, SettingError
from pidemu.formatting import exactly
from pidemu.plausible import INTERVAL, LEVEL, number, plausible, shown
from pidemu.process.text import written
from pidemu.settings.action import Action, read_action
from pidemu.settings.parse import signal_range
from pidemu.settings.ranges import RANGES, SignalRange, option_of, read_range

if TYPE_CHECKING:
    from pidemu.process.process import Process


@dataclass(frozen=True)
class Request:
    """What a conversion was asked for beside source and target; the arguments of `convert`.

    Attributes
    ----------
    options, given : mapping
        Options and dials of the target that were named.
    scan : tuple of float or None
        Intervals at which source and target are executed [s].
    pace : tuple of float
        These intervals per those that the algorithms compute with.
    mode, action, match, tag
        As in `convert`.
    to_pv_range, to_op_range : SignalRange or None
        Ranges of the target's measurement and output.
    process : Process or None
        The process.
    digits : int or None
        Digits to round to.
    bias : float or None
        Output at SP = PV of a loop without integral action [% of the output span], where it was stated.
    limits : tuple of float or None
        Output limits of the source, where they were stated [%, or the units that its card computes in].
    compensate, allow_approximate, assume : bool
        As in `convert`.
    undeclared : bool
        Whether only the real intervals were stated, so that they are taken to be computed with.
    """

    options: Mapping[str, object] = field(default_factory=dict)
    given: Mapping[str, object] = field(default_factory=dict)
    scan: tuple[float, float] | None = None
    pace: tuple[float, float] = (1.0, 1.0)
    mode: Modes = "both"
    action: Action | None = None
    match: str | None = None
    to_pv_range: SignalRange | None = None
    to_op_range: SignalRange | None = None
    process: Process | None = None
    digits: int | None = None
    bias: float | None = None
    limits: tuple[float, float] | None = None
    compensate: bool = False
    allow_approximate: bool = False
    assume: bool = False
    tag: str = ""
    undeclared: bool = False

    @property
    def declared(self) -> tuple[float, float] | None:
        """The intervals that source and target compute with [s], to twelve digits."""
        if self.scan is None:
            return None
        source, target = (float(f"{_ratio(h, pace):.12g}") for h, pace in zip(self.scan, self.pace, strict=True))
        return source, target

    @property
    def runs_every(self) -> tuple[float, float] | None:
        """The intervals at which both are executed, where these are others than those they compute with [s]."""
        return self.scan if self.pace != (1.0, 1.0) else None

    def to_dict(self) -> dict[str, Any]:
        """Return what was asked for as plain values for JSON, by the names of the arguments of `convert`."""
        return {
            "options": {n: str(x) for n, x in self.options.items()},
            "given": {n: float(x) if isinstance(x, Real) else str(x) for n, x in self.given.items()},
            "scan": self.declared and list(self.declared),
            "runs_every": self.runs_every and list(self.runs_every),
            "mode": self.mode,
            "action": self.action,
            "to_pv_range": self.to_pv_range and self.to_pv_range.argument,
            "to_op_range": self.to_op_range and self.to_op_range.argument,
            "match": self.match,
            "process": self.process and written(self.process),
            "compensate": self.compensate,
            "digits": self.digits,
            "bias": self.bias,
            "limits": self.limits and list(self.limits),
            "allow_approximate": self.allow_approximate,
            "assume": self.assume,
            "tag": self.tag,
        }

    def words(self) -> Iterator[str]:
        """Yield what is asked for as words of ``pidemu convert``, to stand behind ``--to CARD``."""
        for name, value in {**self.options, **self.given}.items():
            yield from ("--set", f"{name}={exactly(value) if isinstance(value, float) else value}")
        if self.declared is not None:
            yield from ("--scan", _intervals(self.declared))
        if self.runs_every is not None:
            yield from ("--runs-every", _intervals(self.runs_every))
        if self.mode != "both":
            yield from ("--mode", self.mode)
        for name, given in zip(RANGES, (self.to_pv_range, self.to_op_range), strict=True):
            if given is not None:
                yield f"{option_of(name, target=True)}={read_range(given).argument}"
        if self.match is not None:
            yield from ("--match", self.match)
        if self.action is not None:
            yield from ("--action", self.action)
        if self.process is not None:
            yield from ("--process", written(self.process))
        if self.digits not in (None, DIGITS):
            yield from ("--digits", str(self.digits))
        if self.bias is not None:
            yield from ("--bias", exactly(self.bias))
        if self.limits is not None:
            yield f"--limits={','.join(map(exactly, self.limits))}"
        if self.tag:
            yield from ("--tag", self.tag)
        flags = {"--compensate": self.compensate, "--assume": self.assume, "--allow-approximate": self.allow_approximate}
        yield from (flag for flag, wanted in flags.items() if wanted)


_OUTPUT = (-10.0, 110.0)
"""Between these an output lies [% of span]: the usual limits leave 5 to 10 % beyond the range."""
DIGITS = 5
"""Significant digits that the command line and the page print."""


def _intervals(both: tuple[float, ...]) -> str:
    return ",".join(exactly(h) for h in dict.fromkeys(both))


def read_request(
    card: Card,
    *,
    options: Mapping[str, object] | None = None,
    given: Mapping[str, object] | None = None,
    scan: object = None,
    runs_every: object = None,
    mode: object = "both",
    action: object = None,
    match: str | None = None,
    to_pv_range: object = None,
    to_op_range: object = None,
    process: Process | None = None,
    digits: object = None,
    bias: float | None = None,
    limits: tuple[float, float] | None = None,
    compensate: bool = False,
    allow_approximate: bool = False,
    assume: bool = False,
    tag: str = "",
) -> Request:
    """Return what is asked for, checked; see `convert` for the arguments.

    An option among the dials is taken for the option that it is.

    Raises
    ------
    SettingError
        A name comes twice, or a range, mode, action or number of digits cannot be read.
    ScanError
        A scan interval is not a positive number.
    ProcessError
        The process has its gain in other units than %/%.
    """
    named: dict[str, object] = {}
    for name, value in [*(options or {}).items(), *(given or {}).items()]:
        if any(str(name).casefold() == other.casefold() for other in named):
            raise SettingError(f"{card.id}: {name} is given twice; give it once")
        if value is not None:
            named[str(name)] = value
    spelled = {o.casefold(): o for o in card.options}
    chosen = {spelled.get(n.casefold(), n): x for n, x in named.items() if n.casefold() in spelled or n in (options or {})}
    dials = {n: x for n, x in named.items() if n.casefold() not in spelled and n not in (options or {})}
    real, pace = _intervals_of(scan, runs_every)
    if compensate and real is None:
        raise SettingError("compensate makes up for the scan intervals, which were not given; add --scan (scan= from Python)")
    if process is not None:
        process.check_percent()
    return Request(
        options=chosen,
        given=dials,
        scan=real,
        pace=pace,
        mode=read_mode(mode),
        action=read_action(action),
        match=match,
        to_pv_range=signal_range(card, "to_pv_range", to_pv_range),
        to_op_range=signal_range(card, "to_op_range", to_op_range),
        process=process,
        digits=checked_digits(digits),
        bias=_checked_bias(bias),
        limits=_checked_limits(limits),
        compensate=compensate,
        allow_approximate=allow_approximate,
        assume=assume,
        tag=tag,
        undeclared=scan is None and runs_every is not None,
    )


def _intervals_of(scan: object, runs_every: object) -> tuple[tuple[float, float] | None, tuple[float, float]]:
    """Return the intervals at which both are executed [s], and these per the intervals they compute with.

    An interval that is stated once only is taken for both. The target is timed rightly unless its own real interval is given with
    its scan interval: a scan interval that is not stated is the real one.
    """
    declared, real = (_one_or_two(x, name) for x, name in ((scan, "scan"), (runs_every, "runs_every")))
    if real is None:
        return (None if declared is None else (declared[0], declared[-1])), (1.0, 1.0)
    if declared is None:
        return (real[0], real[-1]), (1.0, 1.0)
    source = declared[0]
    target = declared[1] if len(declared) == 2 else real[0]
    target_real = real[1] if len(real) == 2 else target
    return (real[0], target_real), (_ratio(real[0], source), _ratio(target_real, target))


def _checked_bias(bias: float | None) -> float | None:
    if bias is None:
        return None
    (low, high), found = _OUTPUT, plausible("bias", bias, LEVEL, SettingError)
    if not low <= found <= high:
        raise SettingError(f"bias is {found:g} %; it is the output at SP = PV, between {low:g} and {high:g} % of its span")
    return found


def _checked_limits(limits: tuple[float, float] | None) -> tuple[float, float] | None:
    if limits is None:
        return None
    try:
        low, high = limits
    except (TypeError, ValueError):
        raise SettingError(f"limits are {shown(limits)}; give two numbers, such as (0, 100)") from None
    found = tuple(plausible("limits", x, LEVEL, SettingError) for x in (low, high))
    if not found[0] < found[1]:
        raise SettingError(f"limits are {found[0]:g} and {found[1]:g}; give the lower limit first, such as 0,100")
    return found[0], found[1]


def _ratio(real: float, declared: float) -> float:
    """Return a quotient of two numbers as they were typed: 0.02 over 0.2 is 0.1."""
    return float(Fraction(repr(real)) / Fraction(repr(declared)))


def _one_or_two(given: object, name: str) -> tuple[float, ...] | None:
    """Return one or two intervals [s]."""
    if given is None:
        return None
    found: tuple[float, ...] = ()
    try:
        if isinstance(given, tuple | list):
            found = tuple(number(h) for h in given)
            found = found if len(found) == 2 else ()
        else:
            found = (number(given),)
    except ValueError:
        found = ()
    if not found or not all(math.isfinite(h) and h > 0 for h in found):
        raise ScanError(f"{name} is {shown(given)}; it is a positive interval in seconds, or two: (1.0, 0.5)")
    return tuple(plausible(name, h, INTERVAL, ScanError) for h in found)
