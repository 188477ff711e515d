"""What a conversion was asked for, and how to ask for it again on the command line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pidemu.loop.text import written
from pidemu.plain import exactly

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
    pv_range, op_range : tuple of float or None
        New signal ranges of the target.
    process : Process or None
        The process.
    compensate, allow_approximate, round_dials : bool
        As in `convert`.
    """

    options: Mapping[str, object] = field(default_factory=dict)
    given: Mapping[str, object] = field(default_factory=dict)
    scan: tuple[float, float] | None = None
    match: str | None = None
    pv_range: tuple[float, float] | None = None
    op_range: tuple[float, float] | None = None
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
        for name, ends in (("pv", self.pv_range), ("op", self.op_range)):
            if ends is not None:
                yield f"--to-{name}-range={exactly(ends[0])},{exactly(ends[1])}"
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
