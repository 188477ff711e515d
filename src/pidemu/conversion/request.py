"""What a conversion is asked for: read, checked, and written as words of the command line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import TYPE_CHECKING

from pidemu.card.load import Card
from pidemu.errors import ScanError, SettingError
from pidemu.loop.text import written
from pidemu.plain import exactly
from pidemu.ranges import RANGES, SignalRange, option_of, read_range
from pidemu.reading import signal_range

if TYPE_CHECKING:
    from pidemu.loop.process import Process


@dataclass(frozen=True)
class Request:
    """What a conversion was asked for beside source and target; the arguments of `convert`.

    Attributes
    ----------
    options, given : mapping
        Options and dials of the target that were named.
    scan : tuple of float or None
        Scan intervals of source and target [s].
    match : str or None
        The match asked for.
    to_pv_range, to_op_range : SignalRange or None
        Ranges of the target's measurement and output.
    process : Process or None
        The process.
    compensate, allow_approximate, round_dials : bool
        As in `convert`.
    """

    options: Mapping[str, object] = field(default_factory=dict)
    given: Mapping[str, object] = field(default_factory=dict)
    scan: tuple[float, float] | None = None
    match: str | None = None
    to_pv_range: SignalRange | None = None
    to_op_range: SignalRange | None = None
    process: Process | None = None
    compensate: bool = True
    allow_approximate: bool = False
    round_dials: bool = False

    def words(self) -> Iterator[str]:
        """Yield what is asked for as words of ``pidemu convert``, to stand behind ``--to CARD``."""
        for name, value in {**self.options, **self.given}.items():
            yield from ("--set", f"{name}={exactly(value) if isinstance(value, float) else value}")
        if self.scan is not None:
            yield from ("--scan", ",".join(exactly(h) for h in dict.fromkeys(self.scan)))
        for name, given in zip(RANGES, (self.to_pv_range, self.to_op_range), strict=True):
            if given is not None:
                yield f"{option_of(name, target=True)}={read_range(given).argument}"
        if self.match is not None:
            yield from ("--match", self.match)
        if self.process is not None:
            yield from ("--process", written(self.process))
        flags = {
            "--no-compensation": not self.compensate,
            "--round": self.round_dials,
            "--allow-approximate": self.allow_approximate,
        }
        yield from (flag for flag, wanted in flags.items() if wanted)


def read_request(
    card: Card,
    options: Mapping[str, object] | None,
    given: Mapping[str, object] | None,
    scan: object,
    match: str | None,
    to_pv_range: object,
    to_op_range: object,
) -> Request:
    """Return what is asked for, checked; see `convert` for the arguments.

    An option among the dials is taken for the option that it is.

    Raises
    ------
    SettingError
        A name comes twice, or a range is not one.
    ScanError
        A scan interval is no positive number.
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
    pv, op = signal_range(card, "to_pv_range", to_pv_range), signal_range(card, "to_op_range", to_op_range)
    return Request(chosen, dials, _scans(scan), match, pv, op)


def _scans(scan: object) -> tuple[float, float] | None:
    """Return the scan intervals of source and target [s]."""
    if scan is None:
        return None
    pair: tuple[float, ...] = ()
    try:
        if isinstance(scan, Real) and not isinstance(scan, bool):
            pair = (float(scan), float(scan))
        elif not isinstance(scan, bool):
            pair = tuple(float(h) for h in scan)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        pair = ()
    if len(pair) != 2 or not all(math.isfinite(h) and h > 0 for h in pair):
        raise ScanError(f"scan is {scan!r}; it is a positive interval in seconds, or two: (1.0, 0.5)")
    return pair[0], pair[1]
