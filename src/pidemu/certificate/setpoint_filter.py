"""The setpoint filter that would make two setpoint paths agree (specs/equations.md, section 3, setpoint path)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pidemu.law.law import Law

_SAME_ROOT: Final = 1e-7
"""Relative distance of two roots that cancel: they come out of polynomials of low degree, to about this."""
_DIGITS: Final = 4


@dataclass(frozen=True, slots=True)
class SetpointFilter:
    """A filter ``F(s)`` before the target's setpoint, with ``F(0) = 1`` where both integrate.

    Attributes
    ----------
    numerator, denominator : tuple of float
        Coefficients of ``1, s, s^2, ...``.
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def __str__(self) -> str:
        top, bottom = (_polynomial(p) for p in (self.numerator, self.denominator))
        return top if bottom == "1" else f"{_bracketed(top)}/{_bracketed(bottom)}"

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON."""
        return {"numerator": list(self.numerator), "denominator": list(self.denominator), "text": str(self)}


def setpoint_filter(source: Law, target: Law, factor: float = 1.0) -> SetpointFilter | None:
    """Return ``factor Cs/Ct`` of the two setpoint paths, reduced; ``None`` where it is 1, unstable, or no filter but a derivative.

    Parameters
    ----------
    source, target : Law
        Continuous laws.
    factor : float
        What the source's gain is multiplied by for new signal ranges.

    Examples
    --------
    >>> import pidemu
    >>> card = pidemu.load_card("generic/standard")
    >>> half = card.settings(K=2, Ti=20, b=0.5)
    >>> str(setpoint_filter(half.law(), card.settings(K=2, Ti=20).law()))
    '(1 + 10 s)/(1 + 20 s)'
    """
    top = np.polymul(*(_descending(x) for x in (source.setpoint.num, target.setpoint.den))) * factor
    bottom = np.polymul(*(_descending(x) for x in (source.setpoint.den, target.setpoint.num)))
    if not (top.size and bottom.size and np.any(top) and np.any(bottom)):
        return None
    top, bottom = _reduced(top, bottom)
    if top.size > bottom.size or np.any(np.roots(bottom).real >= 0):
        return None
    if top.size == bottom.size and np.allclose(top / bottom[-1], bottom / bottom[-1], rtol=1e-9, atol=0):
        return None
    num, den = (tuple((p[::-1] / bottom[-1]).tolist()) for p in (top, bottom))
    return SetpointFilter(num, den)


def _descending(ascending: tuple[float, ...]) -> Any:
    return np.trim_zeros(np.array(ascending[::-1], dtype=float), "f")


def _reduced(top: Any, bottom: Any) -> tuple[Any, Any]:
    """Return both polynomials without their common roots."""
    zeros, poles = list(np.roots(top)), list(np.roots(bottom))
    for zero in list(zeros):
        twin = next((p for p in poles if abs(p - zero) <= _SAME_ROOT * max(abs(p), abs(zero))), None)
        if twin is not None:
            zeros.remove(zero)
            poles.remove(twin)
    return (np.atleast_1d(np.real(np.poly(roots))) * first for roots, first in ((zeros, top[0]), (poles, bottom[0])))  # type: ignore[return-value]


def _polynomial(ascending: tuple[float, ...]) -> str:
    terms = []
    for power, x in enumerate(ascending):
        if x:
            unit = "" if power == 0 else " s" if power == 1 else f" s^{power}"
            terms.append(f"{x:.{_DIGITS}g}{unit}" if power == 0 or x != 1 else unit.strip())
    return " + ".join(terms).replace("+ -", "- ") or "0"


def _bracketed(text: str) -> str:
    return f"({text})" if " " in text else text
