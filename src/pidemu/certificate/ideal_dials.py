"""Exact dials of a target from the exact law of a source: the formulas of specs/equations.md, section 3, without rounding.

What comes out is a proposal. Whether it is right is decided by comparing the laws, in `pidemu.certificate.proof`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Form
from pidemu.certificate.exact_law import ExactLaw, ExactReader, PathName, divide, exact_algorithm, exact_paths, exact_spans, trimmed
from pidemu.law.exact import Exact, InexactError, exact, sqrt
from pidemu.law.rational import multiply
from pidemu.settings.settings import Settings
from pidemu.units import Role, from_canonical_exactly, parse_unit

_ZERO: Final = Exact(0)
_AT: Final = (1, 2)
"""Values of ``s`` at which the setpoint weights are solved for."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """Canonical numbers that a target shall have.

    Attributes
    ----------
    K, rate, time : Exact
        With proportional action in standard and series form: gain [%/%], reset rate [1/s] and derivative time on the dial [s];
        otherwise ``kp``, ``ki`` and ``kd``.
    Tf : Exact
        Filter time [s].
    """

    K: Exact
    rate: Exact
    time: Exact
    Tf: Exact


class Dials:
    """Exact dials of a target.

    Parameters
    ----------
    settings : Settings
        The target's settings as they stand.
    algorithm : Algorithm[Exact]
        Their algorithm.
    """

    def __init__(self, settings: Settings, algorithm: Algorithm[Exact]) -> None:
        self.settings = settings
        self.spans = exact_spans(settings)
        self.standing = ExactReader(settings, self.spans)
        self.algorithm = algorithm
        self.parallel = settings.equation.form is Form.PARALLEL
        self.by_gain = not self.parallel and settings.equation.proportional.on != "none"
        filt = settings.equation.derivative.filter
        self.lead_lag = filt is not None and filt.applies_to == "lead-lag"
        given = None if filt is None else next((x for x in (filt.ratio, filt.gain, filt.time) if x is not None), None)
        self.filter_dial = given if isinstance(given, str) else None

    def feedback(self, source: ExactLaw) -> Iterator[dict[str, Exact]]:
        """Yield exact dials, by name, with which the target's feedback path is the source's, without those that do not change."""
        a = self.algorithm
        core = source
        for lag in (a.error.filter, a.measurement.filter):
            core = core if lag is None else core.times((1, lag.seconds))
        for Tf in self._filter_times(core):
            lag_ = (1, Tf, Tf * Tf / 2) if a.filter_order == 2 and a.filter_on != "term" else (1, Tf)
            top = multiply(multiply(core.num, (_ZERO, exact(1))), trimmed(lag_))
            quotient, rest = divide(trimmed(top), core.den)
            if any(rest) or len(quotient) > 3:
                continue
            n0, n1, n2 = (*quotient, _ZERO, _ZERO)[:3]
            for wanted in self._numbers(n0, n1, n2, Tf):
                with suppress(InexactError, ZeroDivisionError):
                    yield self._dials(wanted)

    def _filter_times(self, core: ExactLaw) -> Iterator[Exact]:
        """Yield filter times that the target may need: that of the law, the one it has, none."""
        lowest = next(k for k, x in enumerate(core.den) if x)
        found = [*core.den[lowest + 1 : lowest + 2], exact(self.algorithm.Tf), _ZERO]
        yield from dict.fromkeys(found)

    def _numbers(self, n0: Exact, n1: Exact, n2: Exact, Tf: Exact) -> Iterator[Wanted]:
        """Yield the target's numbers for ``(n0 + n1 s + n2 s^2)/s`` before its filter."""
        a = self.algorithm
        if a.series and self.by_gain:
            for lead in _leads(n0, n1, n2):
                K = n1 - n0 * lead
                time = lead if self.lead_lag or a.filter_on != "term" else lead - Tf
                if K:
                    yield Wanted(K, n0 / K, time if lead else _ZERO, Tf)
            return
        kp = n1 - n0 * Tf if a.filter_on == "term" else n1
        kd = n2 - kp * Tf if a.filter_on == "term" else n2
        if self.by_gain and kp:
            yield Wanted(kp, n0 / kp, kd / kp, Tf)
        elif not self.by_gain:
            yield Wanted(kp, n0, kd, Tf)

    def _dials(self, n: Wanted) -> dict[str, Exact]:
        a = self.algorithm
        wanted: dict[str, Exact] = {}
        ki, kd = exact(a.ki), exact(a.kd)
        if self.by_gain:
            self._put(wanted, Role.GAIN, self._scaled(Role.GAIN, n.K, exact(a.kp)))
            self._put(wanted, Role.INTEGRAL, n.rate)
            self._put(wanted, Role.DERIVATIVE, n.time)
        else:
            self._put(wanted, Role.GAIN, self._scaled(Role.GAIN, n.K, exact(a.kp)))
            self._put(wanted, Role.INTEGRAL, self._scaled(Role.INTEGRAL, n.rate, ki))
            self._put(wanted, Role.DERIVATIVE, self._scaled(Role.DERIVATIVE, n.time, kd))
        self._set_filter(wanted, n.Tf)
        return {name: x for name, x in wanted.items() if x != self.standing.dial(name)}

    def _scaled(self, role: Role, number: Exact, has: Exact) -> Exact | None:
        """Return a dial's canonical value in proportion to the number that it makes; ``None`` where it stays."""
        dial = self.settings.by_role(role)
        if dial is None or not (number and has):
            return None
        now = exact(self.standing.value(dial.name))
        return now * number / has

    def _put(self, wanted: dict[str, Exact], role: Role, canonical: Exact | None) -> None:
        """Set the dial of a role from its canonical value; one that is off stays so."""
        dial = self.settings.by_role(role)
        if dial is None or canonical is None or not canonical:
            return
        wanted[dial.name] = exact(from_canonical_exactly(role, canonical, parse_unit(dial.unit), self.spans))

    def _set_filter(self, wanted: dict[str, Exact], Tf: Exact) -> None:
        """Set the filter's dial, or the overall multiplier that decides about it, so that the filter time is the one wanted."""
        has = exact(exact_algorithm(self.settings, wanted).Tf)
        if has == Tf or not (has and Tf):
            return
        if self.filter_dial is not None:
            value = self.settings[self.filter_dial]
            change = has / Tf if value.role is Role.FILTER_GAIN else Tf / has
            canonical = exact(self.standing.value(value.name)) * change
            wanted[value.name] = exact(from_canonical_exactly(value.role, canonical, parse_unit(value.unit), self.spans))
            return
        multiplier = self.settings.by_role(Role.MULTIPLIER)
        if multiplier is None or not self.parallel:
            return
        wanted[multiplier.name] = self.standing.dial(multiplier.name) * has / Tf
        for role in (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE):
            dial = self.settings.by_role(role)
            if dial is not None and dial.name in wanted:
                now = ExactReader(self.settings, self.spans, dials=wanted).value(dial.name)
                self._put(wanted, role, now * Tf / has)

    def weights(self, source: ExactLaw, path: PathName, dials: dict[str, Exact]) -> dict[str, Exact]:
        """Return the setpoint weights with which a setpoint path is the source's, beside exact dials of the feedback path."""
        equation = self.settings.equation
        a = exact_algorithm(self.settings, dials)
        names = [
            (x, name)
            for x, name, gain in (("b", equation.proportional.weight, a.kp), ("c", equation.derivative.weight, a.kd))
            if isinstance(name, str) and self.settings[name].active and gain
        ]
        if not names:
            return {}
        with suppress(InexactError, ZeroDivisionError):
            solved = _solve(a, [x for x, _ in names], source, path)
            found = {
                name: exact(from_canonical_exactly(self.settings[name].role, x, parse_unit(self.settings[name].unit), self.spans))
                for (_, name), x in zip(names, solved, strict=True)
            }
            return {name: x for name, x in found.items() if x != self.standing.dial(name)}
        return {}


def _solve(a: Algorithm[Exact], unknown: list[str], source: ExactLaw, path: PathName) -> list[Exact]:
    """Return the weights that a setpoint path needs; it is linear in them."""

    def values(**weights: float) -> list[Exact]:
        law = exact_paths(replace(a, **weights), [path])[path]  # type: ignore[arg-type]
        return [law(s) for s in _AT]

    none = dict.fromkeys(unknown, 0.0)
    base = values(**none)
    right = [source(s) - x for s, x in zip(_AT, base, strict=True)]
    columns = [[y - x for x, y in zip(base, values(**{**none, name: 1.0}), strict=True)] for name in unknown]
    if len(columns) == 1:
        return [right[0] / columns[0][0]]
    (p, q), (r, t) = columns
    determinant = p * t - r * q
    return [(right[0] * t - r * right[1]) / determinant, (p * right[1] - right[0] * q) / determinant]


def _leads(n0: Exact, n1: Exact, n2: Exact) -> tuple[Exact, ...]:
    """Return the time constants that ``n0 + n1 s + n2 s^2`` is factored into; none where they are complex or no square roots."""
    if not n2:
        return (_ZERO,)
    if not n0:
        return (n2 / n1,) if n1 else ()
    square = n1 * n1 - n0 * n2 * 4
    if square.b or square.sign < 0:
        return ()
    root = sqrt(square.a)
    return ((n1 - root) / (n0 * 2), (n1 + root) / (n0 * 2))
