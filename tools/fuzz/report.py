"""What a run found, in print."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from tools.fuzz.case import printable, write_files
from tools.fuzz.run import Group, Result


def summary(result: Result) -> Iterator[str]:
    """Yield a line per kind: inputs, time, failures, the slowest input."""
    yield f"seed {result.seed}"
    yield f"{'kind':<14}{'inputs':>12}{'CPU s':>10}{'failures':>10}  slowest"
    for name, t in result.tallies.items():
        seconds, which = t.slowest
        yield f"{name:<14}{t.count:>12,}{t.seconds:>10.1f}{len(t.failures):>10,}  {seconds:.2f} s {which}".rstrip()
    total = sum(t.count for t in result.tallies.values())
    failed = sum(len(t.failures) for t in result.tallies.values())
    yield f"{total:,} inputs, {failed:,} failures in {len(result.groups)} groups"


def described(group: Group, folder: Path) -> Iterator[str]:
    """Yield what is wrong with a group, and the commands that show it; the files of the smallest input are written to a folder."""
    f = group.failure
    times = "once" if group.count == 1 else f"{group.count:,} times"
    yield f"{group.kind.name}: {f.what} at {f.place}, {times}"
    if f.detail:
        yield f"  {printable(f.detail).replace(chr(10), ' | ')[:400]}"
    yield f"  python -m tools.fuzz --again {group.ticket}"
    case, place = group.smallest, folder / group.ticket.folder
    if not case.words:
        return
    if case.files or case.links:
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        write_files(case, place)
        yield f"  cd {place} && {case.command}"
    else:
        yield f"  {case.command}"
