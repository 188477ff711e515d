"""How good one choice of a target's options is: what is compared, in which order (specs/equations.md, section 9)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Final

from pidemu.algorithm.model import Algorithm
from pidemu.card.load import Variant
from pidemu.card.model.base import Form, Status
from pidemu.card.model.card_file import Equation
from pidemu.certificate.models import RANK, Certificate
from pidemu.certificate.noise import noise_gain
from pidemu.conversion.evidence import filter_status
from pidemu.conversion.modes import in_mode, looked_at
from pidemu.conversion.rounding import rounding_error
from pidemu.conversion.solver.yardstick import Yardstick
from pidemu.settings.settings import Settings
from pidemu.units import Role

_NOISY: Final = 1.5
"""Noise gain per source's from which another option is better."""
_NEAR: Final = 0.01
"""Deviation in the loop band that counts as none beside a filter that is only assumed or inferred."""
_FAR: Final = 0.2
"""Deviation in the loop band from which a choice is another class: no form is worth that."""
_DISTANCE: Final = {
    (Form.STANDARD, Form.SERIES): 2, (Form.STANDARD, Form.PARALLEL): 1, (Form.SERIES, Form.STANDARD): 1,
    (Form.SERIES, Form.PARALLEL): 2, (Form.PARALLEL, Form.STANDARD): 1, (Form.PARALLEL, Form.SERIES): 2,
}  # fmt: skip
"""How far a form is from another, to somebody who knows the dials of the first."""
_TERMS: Final = (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)
_UNBOUNDED: Final = 1000
"""Distance of noise gains of which one is nothing beside the other."""
_DIAL: Final = 1e-6
"""Relative difference from which a dial is another one."""
_SURE_ROUNDING: Final = 5e-4
"""Relative rounding of a dial that nobody notices."""


@dataclass(frozen=True, slots=True)
class Merit:
    """What is compared of two choices, smaller first; each field only breaks ties of those before it.

    Attributes
    ----------
    unused : int
        Dials that the user gave and that are not in use.
    setpoint : int
        How far the terms that see the setpoint are from the source's, in the worst mode: see `setpoint_class`.
    nonlinear : bool
        Whether what is not linear, such as a squared error, differs.
    forgets : bool
        Whether the target has no integral action and forgets at a limit where it was, which the source does not.
    verdict : int
        Class of the verdict.
    form : int
        How far the form is from the source's.
    noisy : bool
        Whether noise is more than 1.5 times the source's without the law being the same.
    by_number : bool
        Whether a term that the source does not have is switched off by a number, not by the structure.
    dials : int
        Dials that are not the source's own numbers.
    rules : bool
        Whether equal laws differ by their scan rules.
    assumed : int
        How much of windup, transfer and rules is only assumed.
    windup : bool
        Whether the windup scheme is another one.
    noise : int
        Distance of the noise gains, in steps of 10 %.
    derivative : bool
        Whether a derivative that is off would act on the error.
    rounding : int
        Coarse relative rounding of the dials at their resolution.
    units : int
        Dials that are not in the source's unit.
    changed : int
        Options that are not as the card delivers them.
    """

    unused: int = 0
    setpoint: int = 0
    nonlinear: bool = False
    forgets: bool = False
    verdict: int = 0
    form: int = 0
    noisy: bool = False
    by_number: bool = False
    dials: int = 0
    rules: bool = False
    assumed: int = 0
    windup: bool = False
    noise: int = 0
    derivative: bool = False
    rounding: int = 0
    units: int = 0
    changed: int = 0

    @property
    def key(self) -> tuple[float, ...]:
        """What to sort by."""
        return tuple(getattr(self, name) for name in _ORDER)

    def worse_by(self, best: Merit) -> str:
        """Return in words by what this is worse than the best; empty where it is as good."""
        return next((_WORDS[f.name] for f in fields(self) if getattr(self, f.name) > getattr(best, f.name)), "")


_ORDER: Final = tuple(f.name for f in fields(Merit))
_WORDS: Final = {
    "unused": "a dial that was given is not in use",
    "setpoint": "other terms see the setpoint",
    "nonlinear": "a nonlinear option differs",
    "forgets": "forgets its output at a limit",
    "noisy": "much more noise on the output",
    "verdict": "farther from the source",
    "form": "another form than the source's",
    "by_number": "a term is switched off by a number only",
    "dials": "more dials that are not the source's numbers",
    "rules": "another scan rule",
    "assumed": "more of it is only assumed",
    "windup": "another behaviour at limits",
    "noise": "noise farther from the source's",
    "derivative": "the derivative, once used, would act on the error",
    "rounding": "the dials round more coarsely",
    "units": "other units than the source's",
    "changed": "more options off the delivered values",
}


def merit(judge: Yardstick, settings: Settings, certificate: Certificate, changed: int, unused: int) -> Merit:
    """Return the merit of one choice of the options.

    Parameters
    ----------
    judge : Yardstick
        What it is held against.
    settings : Settings
        What it found.
    certificate : Certificate
        The linear figures.
    changed, unused : int
        How many options are not as delivered, and how many given dials are not in use.
    """
    source, a, b = judge.source, judge.source.algorithm(), settings.algorithm()
    exact = certificate.feedback.is_exact
    ratio = _noise(judge, settings)
    modes = looked_at(judge.mode, source, settings)
    return Merit(
        unused=unused,
        setpoint=max(setpoint_class(in_mode(a, m), in_mode(b, m)) for m in modes),
        nonlinear=a.beyond_the_law != b.beyond_the_law,
        forgets=forgets(source, settings),
        noisy=not exact and ratio > _NOISY,
        verdict=_class(judge, certificate),
        form=_form_distance(source.equation, settings.equation),
        by_number=not a.ki and settings.equation.integral.on != "none",
        dials=dials_that_differ(source, settings, judge.factor),
        rules=rules_differ(source, settings),
        assumed=_assumed(settings.variant),
        windup=a.integral.windup.scheme != b.integral.windup.scheme,
        noise=0 if exact else _noise_steps(ratio),
        derivative=not b.kd and settings.equation.derivative.on not in ("pv", "none"),
        rounding=_coarse(rounding_error(settings)),
        units=_other_units(source, settings),
        changed=changed,
    )


def floor(source: Settings, variant: Variant, changed: int, unused: int) -> Merit:
    """Return what the merit of one choice of the options is at least, by what its equation says.

    Parameters
    ----------
    source : Settings
        What is converted.
    variant : Variant
        The target with these options.
    changed, unused : int
        How many options are not as delivered, and how many given dials are not in use.
    """
    a, e = source.algorithm(), variant.equation
    return Merit(
        unused=unused,
        setpoint=_least_setpoint_class(a, e),
        form=_form_distance(source.equation, e),
        by_number=not a.ki and e.integral.on != "none",
        assumed=_assumed(variant),
        windup=a.integral.windup.scheme != e.integral.windup.scheme,
        changed=changed,
    )


def with_same_law(least: Merit, like: Merit) -> Merit:
    """Return a closer floor of a choice whose continuous law is that of another one, whose merit is known."""
    return replace(
        like,
        unused=least.unused,
        nonlinear=False,
        forgets=False,
        noisy=False,
        rules=False,
        assumed=least.assumed,
        windup=least.windup,
        noise=0,
        changed=least.changed,
    )


def _least_setpoint_class(source: Algorithm, e: Equation) -> int:
    """Return how far the terms that see the setpoint are at least from the source's, in every mode (see `setpoint_class`)."""
    modes = (e.proportional,) if e.cascade is None else (e.proportional, e.cascade.proportional)
    p_may_see_it = any(p.on in ("error", "weighted") for p in modes)
    if source.kp and source.b and (source.cascade_b is None or source.cascade_b) and not p_may_see_it:
        return 4
    p_sees_it = e.form is not Form.PARALLEL and all(p.on == "error" for p in modes)  # there the gain is never 0
    if source.kp and not source.b and not source.cascade_b and p_sees_it:
        return 3
    return int(bool(source.kd and source.c) and e.derivative.on in ("pv", "none"))


def forgets(source: Settings, target: Settings) -> bool:
    """Whether a source that holds its output by a bias meets a target that does not, with no integral in either.

    A velocity controller counts from its last output. One that loads the output into its integral, and clears that where nothing
    is integrated, has no bias at all.
    """
    if source.algorithm().ki or target.algorithm().ki:
        return False
    return _holds_a_bias(source) and not _holds_a_bias(target)


def _holds_a_bias(settings: Settings) -> bool:
    a = settings.algorithm()
    cleared = a.transfer.way.loads_output and a.transfer.without_integral != "kept" and settings.by_role(Role.BIAS) is None
    return not a.velocity and not cleared


def setpoint_class(source: Algorithm, target: Algorithm) -> int:
    """Return how far the terms that see the setpoint are from the source's, by the continuous law.

    0: the same terms. 1: the derivative no longer sees it. 2: a filtered derivative sees it anew. 3: P sees it anew. 4: P on the
    error became P on the measurement. 5: an unfiltered derivative sees it anew, which spikes the output.
    """
    p = (bool(source.b) and source.kp != 0, bool(target.b) and target.kp != 0)
    d = (bool(source.c) and source.kd != 0, bool(target.c) and target.kd != 0)
    if d[1] and not d[0]:
        unfiltered = not (target.has_term_filter or target.has_signal_filter)
        found = 5 if unfiltered else 2
    else:
        found = 1 if d[0] and not d[1] else 0
    return max(found, 4 if p[0] and not p[1] else 3 if p[1] and not p[0] else 0)


def rules_differ(source: Settings, target: Settings) -> bool:
    """Whether two controllers compute what they have in common by different scan rules."""
    a, b = source.algorithm(), target.algorithm()
    found = bool(a.ki and b.ki) and a.integral.rule is not b.integral.rule
    filtered = (a.has_term_filter or a.has_signal_filter) and (b.has_term_filter or b.has_signal_filter)
    return found or (bool(a.kd and b.kd) and filtered and a.derivative.rule is not b.derivative.rule)


def dials_that_differ(source: Settings, target: Settings, factor: float) -> int:
    """Return how many of gain, integral and derivative dial are not the source's own number in another unit."""
    old, new = ([abs(x) for x in _numbers(s)] for s in (source, target))
    parallel = target.equation.form is Form.PARALLEL
    if parallel and source.equation.form is not Form.PARALLEL:
        old = [old[0], old[0] * old[1], old[0] * old[2]]
    elif not parallel and source.equation.form is Form.PARALLEL:
        old = [old[0], *(x / old[0] if old[0] else math.inf for x in old[1:])]
    scale = [abs(factor)] * 3 if parallel else [abs(factor), 1.0, 1.0]
    return sum(not math.isclose(x * k, y, rel_tol=_DIAL) for x, y, k in zip(old, new, scale, strict=True))


def _numbers(settings: Settings) -> list[float]:
    """Return gain, integral and derivative dial in canonical units, those of a parallel form in percent."""
    found = []
    scale = settings.by_role(Role.MULTIPLIER)
    parallel = settings.equation.form is Form.PARALLEL
    for role in _TERMS:
        value = settings.by_role(role)
        x = 0.0 if value is None else value.canonical
        if scale is not None and (parallel or role is Role.GAIN):
            x *= scale.canonical
        if parallel and role is not Role.GAIN and settings.equation.signals == "engineering":
            x *= float(settings.spans.ratio)
        found.append(x * (settings.pace if role is Role.DERIVATIVE else 1 / settings.pace if role is Role.INTEGRAL else 1.0))
    return found


def _class(judge: Yardstick, c: Certificate) -> int:
    """Return the verdict's class; nearly exact counts as exact where the source's filter is only assumed or inferred.

    Where the scans are made up for, the laws at these are what counts.
    """
    if judge.compensates and c.feedback_at_scan is not None and not c.feedback_at_scan.is_exact:
        return RANK["approximate"] + (c.feedback_at_scan.loop_band.max_deviation > _FAR)
    if c.verdict != "approximate" or c.feedback.is_exact:
        same = c.feedback.is_exact and c.setpoint.is_exact and (c.setpoint_in_cascade is None or c.setpoint_in_cascade.is_exact)
        return RANK["exact" if same else "exact-feedback"]
    off = c.feedback.loop_band.max_deviation
    known = not judge.source.algorithm().kd or filter_status(judge.source) in (Status.DOCUMENTED, Status.MEASURED)
    if off < _NEAR and not known:
        return RANK["exact" if c.setpoint.loop_band.max_deviation < _NEAR else "exact-feedback"]
    return RANK["approximate"] + (off > _FAR)


def _noise(judge: Yardstick, settings: Settings) -> float:
    """Return the noise gain per source's; 1 where they cannot be compared, as the source has no filter."""
    old, new = judge.scans or (None, None)
    before = noise_gain(judge.source, old) * abs(judge.factor)
    if math.isinf(before):
        return 1.0
    return noise_gain(settings, new) / before if before else math.inf


def _noise_steps(ratio: float) -> int:
    return _UNBOUNDED if not 0 < ratio < math.inf else round(abs(math.log(ratio)) * 10)


def _form_distance(source: Equation, target: Equation) -> int:
    return 0 if source.form is target.form else _DISTANCE.get((source.form, target.form), 3)


@lru_cache(maxsize=1024)
def _assumed(variant: Variant) -> int:
    """Return how many fields of windup, transfer and scan rules are only assumed."""
    found = {s.key for s in variant.statements if s.is_assumed and _is_of_the_scan(s.path)}
    return len(found)


def _is_of_the_scan(path: str) -> bool:
    return path.startswith(("transfer", "integral.windup")) or path.endswith(".rule")


def _coarse(error: float) -> int:
    return 0 if error <= _SURE_ROUNDING else math.ceil(math.log2(error / _SURE_ROUNDING))


def _other_units(source: Settings, target: Settings) -> int:
    old, new = ({v.role: v.unit for v in s.values() if v.active and v.role in _TERMS} for s in (source, target))
    return sum(role in old and old[role] != unit for role, unit in new.items())


def unused(variant: Variant, wanted: Iterable[str]) -> int:
    """Return how many of the dials that the user gave are not in use."""
    used = {n.casefold() for n in variant.active}
    return sum(n.casefold() not in used for n in wanted)
