"""Roots of polynomials in ``s``: read in conjugate pairs, multiplied out, written as factors of a transfer function."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final

from pidemu.columns.functions import isfinite
from pidemu.columns.traced import Traced
from pidemu.errors import ProcessError
from pidemu.law.rational import multiply
from pidemu.plausible import INTEGRATORS, PROCESS_TIME, ROOT, plausible, shown

_SAME: Final = 1e-9
"""Relative difference within which two roots are a conjugate pair."""


def in_pairs(name: str, given: Any) -> tuple[complex, ...]:
    """Return roots: the real ones as they stand, then each complex one followed by its exact conjugate."""
    try:
        roots: list[Any] = [r if isinstance(r, Traced) else complex(r) for r in given]
    except (TypeError, ValueError, OverflowError):
        raise ProcessError(f"{name}s is {shown(given)}; give a list of numbers [rad/s] such as [-0.1, -0.5]") from None
    for r in roots:
        if not (isfinite(r.real) and isfinite(r.imag)):
            raise ProcessError(f"the {name} {r} is not finite; give its place in the s plane [rad/s]")
        if not ROOT.has(abs(r)):
            raise ProcessError(f"the {name} {r:g}: {ROOT.refusal(f'{abs(r):g} rad/s')}")
    real = [r for r in roots if not r.imag]
    upper, lower = ([r for r in roots if sign * r.imag > 0] for sign in (1, -1))
    for r in upper:
        partner = next((x for x in lower if abs(x - r.conjugate()) <= _SAME * abs(r)), None)
        if partner is None:
            raise _alone(name, r)
        lower.remove(partner)
    if lower:
        raise _alone(name, lower[0])
    return (*real, *(x for r in upper for x in (r, r.conjugate())))


def _alone(name: str, r: complex) -> ProcessError:
    return ProcessError(
        f"the {name} {r.real:g}{r.imag:+g}j has no partner; complex {name}s come in conjugate pairs: add {r.real:g}{-r.imag:+g}j"
    )


def poles_of(lags: Iterable[Any], integrators: int) -> list[complex]:
    """Return the poles of time constants [s] and of integrators."""
    poles: list[complex] = [0.0] * integrators
    for given in lags:
        lag = plausible("lag", given, PROCESS_TIME, ProcessError)
        if not lag > 0:
            raise ProcessError(
                f"lag {lag:g} s is not positive; leave out a lag of zero, and give an unstable process its pole [rad/s] instead"
            )
        poles.append(-1 / lag)
    return poles


def zeros_of(leads: Iterable[Any]) -> list[complex]:
    """Return the zeros of time constants [s]."""
    zeros: list[complex] = []
    for given in leads:
        lead = plausible("lead", given, PROCESS_TIME, ProcessError)
        if lead == 0:
            raise ProcessError("a lead of 0 s does nothing; leave it out")
        zeros.append(-1 / lead)
    return zeros


def count(given: Any) -> int:
    """Return a number of integrators."""
    try:
        if float(given) == int(given) and 0 <= int(given) <= INTEGRATORS:
            return int(given)
    except (TypeError, ValueError, OverflowError):
        pass
    raise ProcessError(f"integrators is {shown(given)}; give how many there are: 0 to {INTEGRATORS}, and usually 0 or 1")


def polynomial_of(roots: Sequence[complex]) -> tuple[float, ...]:
    """Return the coefficients of ``prod(1 - s/r)``, with ``s`` for a root at 0, ascending; pairs are real quadratics."""
    found: tuple[float, ...] = (1.0,)
    for r in roots:
        if r.imag > 0:
            found = multiply(found, (1.0, -2 * r.real / abs(r) ** 2, 1 / abs(r) ** 2))
        elif not r.imag:
            found = multiply(found, (1.0, -1 / r.real) if r else (0.0, 1.0))
    return found


def factors(roots: Sequence[complex]) -> list[str]:
    """Return the factors of ``prod(1 - s/r)`` in words, equal ones as powers."""
    words: list[str] = []
    for r in roots:
        if r.imag > 0:
            middle = _term(-2 * r.real / abs(r) ** 2, "s")
            square = _term(1 / abs(r) ** 2, "s^2")
            words.append(f"({square}{_signed(middle)} + 1)")
        elif not r.imag:
            words.append("s" if not r else f"({_term(-1 / r.real, 's')} + 1)" if r.real < 0 else f"(1 - {_term(1 / r.real, 's')})")
    powers = {word: words.count(word) for word in dict.fromkeys(words)}
    return [word if n == 1 else f"{word}^{n}" for word, n in powers.items()]


def joined(words: Sequence[str]) -> str:
    """Return factors in a row."""
    text = "".join(words)
    return text.replace("s(", "s (", 1) if text.startswith("s(") else text


def _term(coefficient: float, power: str) -> str:
    number = f"{coefficient:g}"
    return "" if number in ("0", "-0") else power if number == "1" else f"-{power}" if number == "-1" else f"{number} {power}"


def _signed(term: str) -> str:
    if not term:
        return ""
    return f" - {term[1:]}" if term.startswith("-") else f" + {term}"
