"""Two certificates value by value: numbers within what another machine may move, everything else as it is."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from pidemu.formatting import number

DIAL: Final = 1e-6
"""Relative difference up to which a dial is the same: optimisers and other processors end that near, and no dial is set finer."""
FIGURE: Final = 1e-4
"""The same of a figure: the largest of a curve, the root of a margin and the area of a response are found that exactly, and are
printed to two to four digits."""
ZERO: Final = 1e-5
"""Difference of figures that is none, whatever their size: what rounding dials to five digits makes of zero [1, dB, deg, s]."""
_PLACES: Final = frozenset({"worst_at", "largest_at"})
"""Where a largest value is: that jumps between equal ones from one machine to another."""


@dataclass(frozen=True, slots=True)
class Change:
    """One thing that is not as the certificate says.

    Attributes
    ----------
    kind : str
        What it is: ``conversion``, ``card``, ``dial``, ``option``, ``range``, these of the old controller with ``before``,
        ``verdict``, ``condition``, ``action``, ``bench check``, ``cut-over plan``, ``figure``, ``scan interval``, ``gain factor``,
        ``process``, ``setpoint filter``, ``verification`` or, by the same pidemu with the same cards, what is worded or stands
        beside the answer: ``sentence``, ``at the loop``, ``warnings``, ``match``, ``chosen``, ``command``, ``notes``,
        ``assumptions``, ``refusal``, ``runner-up``, ``other settings``, ``ranking``, ``textbook rule``.
    name : str
        Which one; empty where there is but one.
    before, after : str
        What the certificate says, and what comes out now.
    """

    kind: str
    name: str
    before: str
    after: str

    def __str__(self) -> str:
        what = f"{self.kind} {self.name}".strip()
        return f"{what}: {self.before} on the certificate, {self.after} now"


@dataclass(frozen=True, slots=True)
class ValueComparison:
    """How nested values are compared.

    Attributes
    ----------
    words : bool
        Whether wording counts, too.
    complete : bool
        Whether what is there today only counts: an older program did not know of it.
    """

    words: bool
    complete: bool

    def of(self, kind: str, name: str, old: Any, new: Any) -> Iterator[Change]:
        """Yield what differs; what only the certificate says does so always."""
        if isinstance(new, dict) and isinstance(old, dict):
            for key in dict.fromkeys([*new, *old]):
                if self.complete or key in old:
                    yield from self.of(kind, f"{name}.{key}" if name else str(key), old.get(key), new.get(key))
        elif isinstance(new, list) and isinstance(old, list) and len(new) == len(old):
            for k, (x, y) in enumerate(zip(old, new, strict=True)):
                yield from self.of(kind, f"{name}[{k}]", x, y)
        elif not self._same(name, old, new):
            yield Change(kind, name, text(old), text(new))

    def _same(self, name: str, old: Any, new: Any) -> bool:
        a, b = _number(old), _number(new)
        if a is not None and b is not None:
            return name.rpartition(".")[2] in _PLACES or same(a, b, FIGURE, ZERO)
        if a is None and b is None and not self.words and _is_wording(old) and _is_wording(new):
            return True
        return type(old) is type(new) and bool(old == new)


def _is_wording(x: Any) -> bool:
    return isinstance(x, str) or (isinstance(x, list) and all(isinstance(one, str) for one in x))


def _number(x: Any) -> float | None:
    if isinstance(x, bool) or not isinstance(x, int | float | str) or (isinstance(x, str) and x not in ("inf", "-inf", "nan")):
        return None
    try:
        return float(x)
    except OverflowError:  # a whole number of JSON has no largest
        return math.inf


def same(a: float, b: float, relative: float, absolute: float) -> bool:
    """Tell whether two numbers are the same within a relative or an absolute difference; NaN is NaN."""
    return math.isclose(a, b, rel_tol=relative, abs_tol=absolute) or (math.isnan(a) and math.isnan(b))


def text(x: Any) -> str:
    """Return a figure in print."""
    if isinstance(x, list | dict):
        return f"{len(x)} entries" if isinstance(x, list) else "figures"
    value = _number(x)
    if value is not None:
        return number(value)
    return "none" if x is None else "yes" if x is True else "no" if x is False else str(x)[:80]
