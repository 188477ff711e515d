"""The test batch of Astrom and Hagglund: processes on which tuning rules are tried, by name.

The nine forms are those of the slides *PID Control* (Lund, 2020); their parameters run over the values of the authors' paper
"Revisiting the Ziegler-Nichols step response method for PID control", Journal of Process Control 14 (2004).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from pidemu.errors import ProcessError, suggest
from pidemu.excerpt import quoted
from pidemu.process.process import Process

_P1: Final = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.3, 1.5, 2, 4, 6, 8, 10, 20, 50, 100, 200, 500, 1000)
_P2: Final = (0.01, *_P1[:-1])
_P3: Final = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 2, 5, 10)
_L1: Final = (0.01, 0.02, 0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 1)


def _tenths(n: int) -> tuple[float, ...]:
    return tuple(i / 10 for i in range(1, n + 1))


def _with_rest(L1: float, lags: Sequence[float] = (), gain: float = 1.0, integrators: int = 0) -> Process:
    """Return a process whose dead time and further lag are 1 s together."""
    rest = [round(1 - L1, 12)] if L1 < 1 else []
    return Process.from_lags(gain, [*lags, *rest], integrators=integrators, delay=L1)


def _resonant(T: float) -> Process:
    """Return ``1/((s + 1)((s T)^2 + 1.4 s T + 1))``."""
    pair = complex(-0.7, (1 - 0.7**2) ** 0.5) / T
    return Process(1.0, [-1.0, pair, pair.conjugate()])


_Family = tuple[str, Sequence[float], Callable[[float], Process]]
_FAMILIES: Final[dict[str, _Family]] = {
    "P1": ("T", _P1, lambda T: Process.from_lags(1, [T], delay=1)),
    "P2": ("T", _P2, lambda T: Process.from_lags(1, [T, T], delay=1)),
    "P3": ("T", _P3, lambda T: Process.from_lags(1, [1, T, T])),
    "P4": ("n", (3, 4, 5, 6, 7, 8), lambda n: Process.from_lags(1, [1] * int(n))),
    "P5": ("alpha", _tenths(9), lambda a: Process.from_lags(1, [1, a, a**2, a**3])),
    "P6": ("L1", _L1, lambda L1: _with_rest(L1, integrators=1)),
    **{
        f"P7 T={T}": ("L1", _L1, lambda L1, T=T: _with_rest(L1, [T], gain=T))  # type: ignore[misc]
        for T in (1, 2, 5, 10)
    },
    "P8": ("alpha", _tenths(11), lambda a: Process.from_lags(1, [1, 1, 1], [-a])),
    "P9": ("T", _tenths(10), _resonant),
}


def test_batch(family: str | None = None) -> dict[str, Process]:  # noqa: PT028
    """Return the test batch of Astrom and Hagglund by name, such as ``"P4 n=3"``.

    Parameters
    ----------
    family : str, optional
        ``"P1"`` to ``"P9"``; by default all.

    Returns
    -------
    dict of str to Process
        In the order of the paper, gains in %/%, times in s: ``P1 = exp(-s)/(1 + sT)``, ``P2 = exp(-s)/(1 + sT)^2``,
        ``P3 = 1/((s + 1)(1 + sT)^2)``, ``P4 = 1/(s + 1)^n``, ``P5 = 1/((1 + s)(1 + as)(1 + a^2 s)(1 + a^3 s))``,
        ``P6 = exp(-s L1)/(s (1 + s T1))``, ``P7 = T exp(-s L1)/((1 + sT)(1 + s T1))``, both with ``T1 + L1 = 1``,
        ``P8 = (1 - as)/(s + 1)^3``, ``P9 = 1/((s + 1)((sT)^2 + 1.4 sT + 1))``.

    Raises
    ------
    ProcessError
        There is no such family.

    Examples
    --------
    >>> print(test_batch("P7")["P7 T=5 L1=0.3"])
    5 exp(-0.3 s)/((5 s + 1)(0.7 s + 1))
    """
    names = list(dict.fromkeys(name.partition(" ")[0] for name in _FAMILIES))
    if family is not None and family not in names:
        raise ProcessError(
            f"no family '{quoted(family)}' in the test batch{suggest(str(family), names)}; families: {', '.join(names)}"
        )
    return dict(_processes(family))


def _processes(family: str | None) -> Iterator[tuple[str, Process]]:
    for name, (parameter, values, make) in _FAMILIES.items():
        if family is None or name.partition(" ")[0] == family:
            for value in values:
                yield f"{name} {parameter}={value:g}", make(value)


_collected: Any = test_batch
_collected.__test__ = False  # a name that begins with test_, which pytest would take for a test
