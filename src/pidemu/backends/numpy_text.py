"""The text of the function that runs a block of loops with NumPy: buffers are given out once, none is made within the loop.

A value is computed into the buffer of an operand that is needed no more, or into a free one; what is recorded, into its row of the
records. At the end of a scan a state is wherever its last value is: names are bound anew, and nothing is copied.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pidemu.backends.numpy_values import Kind, ScanGraph, ScanValue

_LETTERS: Final = {"number": "n", "input": "x", "coefficient": "k", "late": "l", "start": "s"}
_END: Final = 1 << 30


@dataclass(frozen=True, slots=True)
class BlockPlan:
    """How a block is run.

    Attributes
    ----------
    text : str
        The function ``scans(coefficients, states, buffers, rows)``, which returns the states at the end; `rows` yields for every
        scan the rows of records, of the inputs in `inputs`, of what leaves the delay lines and where their sources are put.
    numbers : dict
        Numbers that the text reads: name, and value and kind.
    buffers : tuple of str
        The buffers' kinds.
    carried : dict
        The buffer in which a state is when a scan begins; the others are in no buffer, and are never written to.
    inputs : tuple of int
        Inputs that are read.
    operations : int
        Calls of NumPy in a scan.
    """

    text: str
    numbers: dict[str, tuple[float, Kind]]
    buffers: tuple[Kind, ...]
    carried: dict[int, int]
    inputs: tuple[int, ...]
    operations: int


def planned(scan: ScanGraph) -> BlockPlan:
    """Return the function's text for what a scan computes, and what it needs.

    Parameters
    ----------
    scan : ScanGraph
        What a scan computes.
    """
    homes = _homes(scan)
    carried = _carried(scan, homes)
    live = _live(scan)
    last = dict.fromkeys(live, -1)
    last.update({x: v for v in sorted(live) for x in scan.values[v].of})
    last.update(dict.fromkeys(_results(scan), _END))
    _spread(scan, homes, last)
    printer = _Printer(scan, homes, carried, last)
    printer.print(sorted(v for v in live if scan.computed(v)))
    return printer.plan(live)


def _homes(scan: ScanGraph) -> dict[int, str]:
    """Return where values are computed that have a row of their own: in the records, or in a delay line.

    Where a state may be bound to a line's row, which is filled anew when it has left the line, the row is filled last, with a copy.
    """
    bound = {scan.values[v].label for v in scan.finals if scan.values[v].what == "late"}
    rows = [(v, f"r{i}") for i, v in enumerate(scan.recorded)]
    rows += [(v, f"w{i}") for i, v in enumerate(scan.entering) if str(i) not in bound and v not in scan.finals]
    return {v: row for v, row in reversed(rows) if scan.computed(v) and scan.values[v].kind == "float64"}


def _results(scan: ScanGraph) -> list[int]:
    return [*scan.finals, *scan.recorded, *scan.entering]


def _live(scan: ScanGraph) -> set[int]:
    """Return every value that is needed."""
    live: set[int] = set()
    found = _results(scan)
    while found:
        value = found.pop()
        if value not in live:
            live.add(value)
            found += scan.values[value].of
    return live


def _carried(scan: ScanGraph, homes: dict[int, str]) -> list[int]:
    """Return the states that are in buffers; where a buffer would have to serve two states, the second gets a copy.

    So does a state that takes what leaves a delay line and hands it on: by the next scan's end the line's row is written anew.
    """
    results = _results(scan)
    states = range(len(scan.finals))
    for s in states:
        if scan.values[scan.finals[s]].what == "late" and scan.starts[s] in results:
            _copy(scan, s)
    owned: set[int] = set()
    for s in states:
        if scan.finals[s] in owned and _in_buffer(scan, homes, scan.finals[s]):
            _copy(scan, s)
        owned.add(scan.finals[s])
    return [s for s in states if _in_buffer(scan, homes, scan.starts[s])]


def _copy(scan: ScanGraph, state: int) -> None:
    final = scan.finals[state]
    scan.finals[state] = len(scan.values)
    scan.values.append(ScanValue("copy", (final,), scan.values[final].kind, f"state {state}"))


def _in_buffer(scan: ScanGraph, homes: dict[int, str], value: int) -> bool:
    """Tell whether a value is in a buffer when a scan ends.

    What a state held when the scan began is where that state's last value was put in the scan before, and so on: a history of
    outputs is a thousand states long. A state that keeps its value, and states that only change places, are in no buffer.
    """
    passed: set[int] = set()
    while scan.values[value].what == "start":
        state = int(scan.values[value].label)
        if scan.finals[state] == value or state in passed:
            return False
        passed.add(state)
        value = scan.finals[state]
    return scan.computed(value) and value not in homes


def _spread(scan: ScanGraph, homes: dict[int, str], last: dict[int, int]) -> None:
    """Compute one side of a select where its result goes, if that side ends there."""
    for v in sorted(last, reverse=True):
        if v in homes and scan.values[v].what == "select":
            _, yes, no = scan.values[v].of
            side = next((x for x in (no, yes) if scan.computed(x) and x not in homes and last[x] == v), None)
            if side is not None:
                homes[side] = homes[v]


class _Printer:
    """Gives out buffers and prints the operations, in order."""

    def __init__(self, scan: ScanGraph, homes: dict[int, str], carried: list[int], last: dict[int, int]) -> None:
        self.scan, self.homes, self.last = scan, homes, last
        self.kinds: list[Kind] = []
        self.free: list[str] = []
        self.lines: list[str] = []
        self.numbers: dict[str, tuple[float, Kind]] = {}
        self.where: dict[int, str] = {}
        self.carried = {s: int(self._buffer(scan.values[scan.starts[s]].kind)[1:]) for s in carried}
        for v, value in enumerate(scan.values):
            if not scan.computed(v):
                self.where[v] = self._given(v, value)
        self.free += [f"b{b}" for s, b in self.carried.items() if last.get(scan.starts[s], -1) < 0]

    def _given(self, v: int, value: ScanValue) -> str:
        if value.what == "number":
            self.numbers[f"n{v}"] = (float(value.label), value.kind)
            return f"n{v}"
        state = int(value.label)
        in_buffer = value.what == "start" and state in self.carried
        return f"b{self.carried[state]}" if in_buffer else _LETTERS[value.what] + value.label

    def _buffer(self, kind: Kind) -> str:
        found = next((b for b in reversed(self.free) if self._kind(b) == kind), None)
        if found is None:
            self.kinds.append(kind)
            return f"b{len(self.kinds) - 1}"
        self.free.remove(found)
        return found

    def _kind(self, buffer: str) -> Kind:
        return self.kinds[int(buffer[1:])]

    def _ends(self, x: int, v: int) -> bool:
        """Tell whether a value is in a buffer and needed no more after the operation that computes another."""
        return self.last[x] == v and self.where[x][0] == "b"

    def print(self, computed: list[int]) -> None:
        """Print the operations that compute values, then where a scan's results go."""
        for v in computed:
            value = self.scan.values[v]
            self.where[v] = self._select(v, value) if value.what == "select" else self._operation(v, value)
            self.free += {self.where[x] for x in value.of if self._ends(x, v)} - {self.where[v]}
        for letter, results in (("r", self.scan.recorded), ("w", self.scan.entering)):
            rows = [(f"{letter}{i}", self.where[v]) for i, v in enumerate(results)]
            self.lines += [f"{row}[...] = {now}" for row, now in rows if row != now]

    def _operation(self, v: int, value: ScanValue) -> str:
        operands = [self.where[x] for x in value.of]
        ending = (self.where[x] for x in value.of if self._ends(x, v) and self.scan.values[x].kind == value.kind)
        into = self.homes.get(v) or next(ending, None) or self._buffer(value.kind)
        copies = value.what == "copy"
        self.lines.append(f"{into}[...] = {operands[0]}" if copies else f"{value.what}({', '.join([*operands, into])})")
        return into

    def _select(self, v: int, value: ScanValue) -> str:
        """Print a select: one side is there already or is copied, the other is put where the condition holds, or does not."""
        test, yes, no = value.of
        home = self.homes.get(v)
        sides = (x for x in (no, yes) if (self.where[x] == home if home else self._ends(x, v)))
        side = next(sides, None)
        into = home or (self._buffer(value.kind) if side is None else self.where[side])
        if side is None:
            self.lines.append(f"{into}[...] = {self.where[no]}")
        if side != yes:
            self.lines.append(f"put({into}, {self.where[test]}, {self.where[yes]})")
            return into
        inverse = self.where[test] if self._ends(test, v) else self._buffer("bool")
        self.lines += [f"logical_not({self.where[test]}, {inverse})", f"put({into}, {inverse}, {self.where[no]})"]
        self.free += {inverse} - {self.where[test]}
        return into

    def _bound(self) -> list[tuple[str, str]]:
        """Return the names that are bound anew at the end of a scan, and to what."""
        pairs = [
            (self.where[self.scan.starts[s]], self.where[final])
            for s, final in enumerate(self.scan.finals)
            if final != self.scan.starts[s]
        ]
        before, after = ({p[side] for p in pairs if p[0][0] == "b"} for side in (0, 1))
        for kind in sorted(set(self.kinds)):
            lost, idle = (sorted(b for b in x if self._kind(b) == kind) for x in (after - before, before - after))
            pairs += zip(lost, idle, strict=True)
        return [(name, now) for name, now in pairs if name != now]

    def plan(self, live: set[int]) -> BlockPlan:
        """Return the finished text, and what it needs."""
        scan = self.scan
        inputs = tuple(int(scan.values[v].label) for v in sorted(live) if scan.values[v].what == "input")
        coefficients = sum(value.what == "coefficient" for value in scan.values)
        lines = range(len(scan.entering))
        rows = [f"r{i}" for i in range(len(scan.recorded))] + [f"x{i}" for i in inputs]
        rows += [f"l{i}" for i in lines] + [f"w{i}" for i in lines]
        bound = self._bound()
        text = [
            "def scans(coefficients, states, buffers, rows):",
            f"    [{', '.join(f'k{i}' for i in range(coefficients))}] = coefficients",
            f"    [{', '.join(f's{i}' for i in range(len(scan.starts)))}] = states",
            f"    [{', '.join(f'b{i}' for i in range(len(self.kinds)))}] = buffers",
            f"    for [{', '.join(rows)}] in rows:",
            *(f"        {line}" for line in self.lines),
            *([f"        {', '.join(p[0] for p in bound)} = {', '.join(p[1] for p in bound)}"] if bound else []),
            f"    return [{', '.join(self.where[v] for v in scan.starts)}]",
        ]
        if not (self.lines or bound):
            text.insert(-1, "        pass")
        return BlockPlan("\n".join(text) + "\n", self.numbers, tuple(self.kinds), self.carried, inputs, len(self.lines))
