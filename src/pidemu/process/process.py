"""Process models: gain, poles, zeros and dead time (specs/equations.md, section 9, point 6).

A process is ``P(s) = gain * prod(1 - s/z)/prod(1 - s/p) * exp(-delay s)``, from the controller's output to its measurement, both
in percent of their ranges, where its gain has no other unit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.columns.functions import is_traced, sign_of
from pidemu.errors import ProcessError
from pidemu.law.rational import Rational, Response
from pidemu.plausible import GAIN, POLES, PROCESS_TIME, plausible
from pidemu.process.hold import SampledProcess, sample
from pidemu.process.hold_columns import sampled_traced
from pidemu.process.roots import count, factors, in_pairs, joined, poles_of, polynomial_of, zeros_of
from pidemu.process.text import PERCENT, gain_unit, read
from pidemu.settings.ranges import PERCENT as RANGE
from pidemu.settings.ranges import RangeGiven, read_range

_DECADES: Final = 6
"""How far beyond the process's own frequencies a phase of -180 degrees is looked for."""


@dataclass(frozen=True)
class Process:
    """A linear process with dead time.

    Attributes
    ----------
    gain : float
        Low-frequency gain [%/%]. A pole at 0 contributes ``1/s``, so that it is then the velocity gain [%/(% s)]; a zero at 0
        contributes ``s``.
    poles, zeros : sequence of complex
        Roots of denominator and numerator in the s plane [rad/s]; a negative real part is stable, complex ones come in conjugate
        pairs.
    delay : float
        Dead time [s].
    unit : str
        Unit of the gain, apart from the 1/s of an integrator: ``%/%``, or units of the measurement per unit of the output, such as
        ``degC/%``. A loop is computed in percent: `in_percent`.

    Raises
    ------
    ProcessError
        A number is not finite or not one that a process has (`pidemu.plausible`), a complex root stands alone, there are more zeros
        than poles or more poles than 20, the gain is zero or the dead time negative, the unit is none of one unit per another.

    Examples
    --------
    >>> p = Process(gain=1.5, poles=[-0.1, -0.5], delay=3)
    >>> print(p)
    1.5 exp(-3 s)/((10 s + 1)(2 s + 1))
    >>> p == Process.from_lags(1.5, lags=[10, 2], delay=3)
    True
    >>> round(p.w180, 4)
    0.3878
    """

    gain: float
    poles: Sequence[complex] = ()
    zeros: Sequence[complex] = ()
    delay: float = 0.0
    unit: str = PERCENT

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", gain_unit(self.unit))
        for name, quantity in (("gain", GAIN), ("delay", PROCESS_TIME)):
            object.__setattr__(self, name, plausible(name, getattr(self, name), quantity, ProcessError))
        for name in ("poles", "zeros"):
            object.__setattr__(self, name, in_pairs(name.removesuffix("s"), getattr(self, name)))
        if self.gain == 0:
            raise ProcessError("the gain is 0: nothing would reach the measurement; give the process's gain in %/%")
        if self.delay < 0:
            raise ProcessError(f"the dead time {self.delay:g} s is negative; give the time that the process waits, or 0")
        if len(self.poles) > POLES:
            raise ProcessError(f"{len(self.poles)} poles; give {POLES} at most, and a chain of many short lags as a dead time")
        if len(self.zeros) > len(self.poles):
            raise ProcessError(
                f"{len(self.zeros)} zeros and {len(self.poles)} poles: such a process would answer a step with an infinite value; "
                f"add the small lags of valve and transmitter as poles"
            )

    @classmethod
    def from_lags(
        cls,
        gain: float,
        lags: Iterable[float] = (),
        leads: Iterable[float] = (),
        integrators: int = 0,
        delay: float = 0.0,
        unit: str = PERCENT,
    ) -> Process:
        """Return ``gain prod(1 + lead s)/(s^integrators prod(1 + lag s)) exp(-delay s)``.

        Parameters
        ----------
        gain : float
            Low-frequency gain [%/%]; velocity gain [%/(% s)] with an integrator.
        lags, leads : iterable of float
            Time constants of denominator and numerator [s]; a negative lead is an inverse response.
        integrators : int
            How many.
        delay : float
            Dead time [s].
        unit : str
            Unit of the gain.

        Raises
        ------
        ProcessError
            A lag is not positive, a lead is zero, or what `Process` refuses.
        """
        return cls(gain, poles_of(lags, count(integrators)), zeros_of(leads), delay, unit)

    def in_percent(self, pv_range: RangeGiven, op_range: RangeGiven = RANGE) -> Process:
        """Return the process with its gain in %/%.

        Parameters
        ----------
        pv_range, op_range : range
            What 0 and 100 % of measurement and output are, such as ``(0, 400, "degC")``.

        Raises
        ------
        ProcessError
            A range has another unit than the gain.

        Examples
        --------
        >>> print(Process(2, [-0.1], unit="degC/%").in_percent("0,400 degC"))
        0.5/(10 s + 1)
        """
        ranges = [read_range(given) for given in (pv_range, op_range)]
        for what, unit, given in zip(("measurement", "output"), self.unit.rsplit("/", 1), ranges, strict=True):
            if given.unit not in ("", unit):
                raise ProcessError(
                    f"the gain of {self} is in {self.unit}, and the range of the {what}, {given}, in another; give it in {unit}"
                )
        pv, op = (given.span for given in ranges)
        return replace(self, gain=self.gain * op / pv, unit=PERCENT)

    def with_numbers(self, gain: Any, delay: Any, roots: Sequence[Any]) -> Process:
        """Return a process of this shape with other numbers, which are not checked: they are those of one that was.

        Parameters
        ----------
        gain, delay : number
            Gain and dead time.
        roots : sequence of number
            Poles, then zeros, as many as there are.
        """
        made, n = object.__new__(Process), len(self.poles)
        numbers = {"gain": gain, "poles": tuple(roots[:n]), "zeros": tuple(roots[n:]), "delay": delay, "unit": self.unit}
        for name, value in numbers.items():
            object.__setattr__(made, name, value)
        return made

    def rounded(self, digits: int = 6) -> Process:
        """Return the process with so many significant digits of gain, lags and leads, and dead time, as they are printed."""

        def short(x: complex) -> complex:
            if x.imag:
                return complex(short(x.real).real, short(x.imag).real)
            return complex(float(f"{x.real:.{digits}g}"))

        poles, zeros = ([r and (short(r) if r.imag else 1 / short(1 / r)) for r in roots] for roots in (self.poles, self.zeros))
        return Process(short(self.gain + 0j).real, poles, zeros, short(self.delay + 0j).real, self.unit)

    def check_percent(self) -> None:
        """Refuse a process whose gain is not in %/%, for a loop that is computed in percent.

        Raises
        ------
        ProcessError
            It is not.
        """
        if self.unit != PERCENT:
            raise ProcessError(
                f"the gain of {self} is in {self.unit}, and a loop is computed in %/%; give process.in_percent(pv_range)"
            )

    def response(self, w: npt.ArrayLike) -> Response:
        """Return the frequency response, the dead time exact.

        Parameters
        ----------
        w : array_like, shape (n,) or scalar
            Angular frequencies [rad/s], above zero.

        Returns
        -------
        ndarray of complex, shape of `w`
            Gain [%/%] and phase.
        """
        s = 1j * np.asarray(w, dtype=float)
        found: Any = self.gain * np.exp(-self.delay * s)
        for z in self.zeros:
            found = found * (1 - s / z if z else s)
        for p in self.poles:
            found = found / (1 - s / p if p else s)
        return np.asarray(found, dtype=np.complex128)

    def sampled(self, h: float) -> SampledProcess:
        """Return the exact model at the scans of a controller that holds its output between them (zero-order hold).

        Parameters
        ----------
        h : float
            Scan interval [s].

        Raises
        ------
        ProcessError
            The interval is not a positive number, or an unstable process outgrows all numbers within it.
        """
        sampled = sampled_traced if is_traced(self.gain, self.delay, h, *self.poles, *self.zeros) else sample
        return sampled(self.gain, self.poles, self.zeros, self.delay, h)

    @cached_property
    def rational(self) -> Rational:
        """The process without its dead time, rational in ``s``."""
        num, den = (polynomial_of(roots) for roots in (self.zeros, self.poles))
        return Rational(tuple(self.gain * x for x in num), den)

    @property
    def integrators(self) -> int:
        """How many poles are at zero."""
        return sum(p == 0 for p in self.poles)

    @property
    def is_stable(self) -> bool:
        """Whether all poles have a negative real part; an integrating process is not stable."""
        return all(p.real < 0 for p in self.poles)

    @property
    def feedback_sign(self) -> float:
        """Sign that a controller's gain must have to make negative feedback.

        That of the process's gain, turned round by every unstable real pole: ``1/(s - 1)`` has the low-frequency gain -1 and
        needs a positive controller gain.
        """
        turned = sum(p.imag == 0 and p.real > 0 for p in self.poles)
        return sign_of(self.gain) * (-1.0) ** turned

    @property
    def time(self) -> float:
        """Dead time plus the times ``1/|p|`` of all poles but integrators [s]; 0 where there are none."""
        return self.delay + sum(1 / abs(p) for p in self.poles if p)

    def phase(self, w: npt.ArrayLike) -> Floats:
        """Return the unwrapped phase of the loop that this process makes with a controller of the right sign and phase 0 [rad].

        Parameters
        ----------
        w : array_like, shape (n,) or scalar
            Angular frequencies [rad/s], above zero.
        """
        at = np.asarray(w, dtype=float)
        unstable = sum(p.imag == 0 and p.real > 0 for p in self.poles)
        found = -self.delay * at - math.pi * unstable
        for sign, roots in ((1.0, self.zeros), (-1.0, self.poles)):
            for r in roots:
                found = found + sign * (np.angle(1 - 1j * at / r) if r else math.pi / 2)
        return np.asarray(found, dtype=np.float64)

    @cached_property
    def w180(self) -> float:
        """Lowest frequency at which the phase falls to -180 degrees, the dead time exact [rad/s].

        The phase is that of `phase`, relative to the sign that makes the feedback negative. Infinite where it never falls so far,
        and where it is there from the lowest frequencies on (two integrators).
        """
        corners = [abs(r) for r in (*self.poles, *self.zeros) if r] + ([1 / self.delay] if self.delay else [])
        if not corners:
            return math.inf
        reach = 10.0**_DECADES
        high = max(corners) * reach
        if self.delay:  # there the dead time alone is enough
            high = min(high, (len(self.zeros) + len(self.poles) + 2) * math.pi / self.delay)
        low = min(min(corners) / reach, high / reach)
        w = np.unique(np.concatenate([np.geomspace(low, high, 4000), corners]))
        below = self.phase(w) <= -math.pi
        falls = np.flatnonzero(below[1:])
        if below[0] or not falls.size:
            return math.inf
        a, b = float(w[falls[0]]), float(w[falls[0] + 1])
        while (middle := math.sqrt(a * b)) not in (a, b):
            a, b = (a, middle) if self.phase(middle) <= -math.pi else (middle, b)
        return b

    @property
    def text(self) -> str:
        """The transfer function, as people write it."""
        wait = "" if not self.delay else "exp(-s)" if self.delay == 1 else f"exp(-{self.delay:g} s)"
        unit = "" if self.unit == PERCENT else f" [{self.unit}]"
        numerator = " ".join(part for part in (f"{self.gain:g}", joined(factors(self.zeros)), wait) if part)
        below = factors(self.poles)
        if not below:
            return numerator + unit
        bottom = below[0] if len(below) == 1 else f"({joined(below)})"
        return f"{numerator}/{bottom}{unit}"

    def __str__(self) -> str:
        return self.text


def parse_process(text: str, *, any_unit: bool = False) -> Process:
    """Read a process as it is written on a command line.

    Parameters
    ----------
    text : str
        ``NAME=VALUE``, comma-separated: ``gain`` [%/%], ``lag`` and ``lead`` (time constants), ``integrators``, ``delay``, ``pole``
        and ``zero`` [rad/s]. Lags, leads, poles and zeros may come more than once; times are in seconds or have a unit; a complex
        pole or zero brings its conjugate along.
    any_unit : bool
        Whether the gain may have another unit than %/%, such as ``gain=2 degC/%``.

    Raises
    ------
    ProcessError
        A name is unknown or comes twice, a value cannot be read, there is no gain, or what `Process` refuses.

    Examples
    --------
    >>> print(parse_process("gain=1.5, lag=10, lag=2 min, delay=3"))
    1.5 exp(-3 s)/((10 s + 1)(120 s + 1))
    """
    process = Process(*read(text))
    if process.unit != PERCENT and not any_unit:
        given = text.partition("gain")[2].partition("=")[2].partition(",")[0].strip()
        raise ProcessError(f"gain={given}: a process gain is in %/% of the signal ranges; convert it and leave out the unit")
    return process
