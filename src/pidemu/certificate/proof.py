"""Whether two controllers have the same law, decided without rounding (specs/equations.md, section 9).

Dials are the decimals that were typed, constants of a card the decimals that it states, units fractions. Both laws are then
quotients of polynomials in ``s`` with exact coefficients, and they are the same if the cross products agree term by term. Dials
that a conversion computed are rounded to floats; the proof is about the numbers that these stand for, solved for exactly.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from typing import Any, Final, Literal

from pidemu.algorithm.model import Algorithm
from pidemu.certificate.exact_law import ExactLaw, PathName, difference, exact_algorithm, exact_paths
from pidemu.certificate.ideal_dials import Dials
from pidemu.certificate.law_text import law_text
from pidemu.certificate.models import EXACT
from pidemu.errors import PidemuError
from pidemu.formatting import json_safe
from pidemu.law.exact import Exact, as_typed
from pidemu.settings.settings import Settings
from pidemu.units import Dimension, Role, parse_unit

Mode = Literal["auto", "cascade", "both"]
_WEIGHTS: Final = (Role.PROPORTIONAL_WEIGHT, Role.DERIVATIVE_WEIGHT)

ROUNDING: Final = 1e-13
"""Relative difference of a dial from an exact one that is the rounding of some hundred operations in double."""
_SAME_LAW: Final = 4e-15
"""Difference of all coefficients that is the same: where a dial hangs on the others by a root or a difference of nearly equal
numbers, it is wrong by more than its rounding, the law is not."""
_NEARLY: Final = 1e-5
"""Relative difference from a dial beyond which an exact one is another setting, whatever the law says."""


@dataclass(frozen=True, slots=True)
class PathProof:
    """One path of both controllers.

    Attributes
    ----------
    name : {"feedback", "setpoint", "setpoint in cascade"}
        Which path.
    equal : bool
        Whether both are the same function of ``s``, with the target's exact dials.
    residual : float
        Largest difference of the coefficients of the cross products, each relative to what it is the sum of, with the target's
        dials as they stand in floats.
    source, target : str
        Both laws, as drawn and as quotients of polynomials.
    """

    name: PathName
    equal: bool
    residual: float
    source: str
    target: str


@dataclass(frozen=True, slots=True)
class Proof:
    """What arithmetic without rounding says of two controllers.

    Attributes
    ----------
    source_card, target_card : str
        The two cards.
    paths : tuple of PathProof
        Feedback path and the setpoint paths of the modes looked at; none where there is no exact law.
    dials : dict of str to str
        The target's exact dials with their units, where the feedback paths are the same.
    rounded : bool
        Whether one of these is not the float that it stands for.
    decided : bool
        Whether the arithmetic decides; otherwise the comparison of floats does.
    why_not : str
        Why it does not decide.
    notes : tuple of str
        What the numbers rest on.
    """

    source_card: str
    target_card: str
    paths: tuple[PathProof, ...] = ()
    dials: Mapping[str, str] = field(default_factory=dict)
    rounded: bool = False
    decided: bool = True
    why_not: str = ""
    notes: tuple[str, ...] = ()

    @property
    def feedback_equal(self) -> bool:
        """Whether the feedback paths are the same function."""
        return self.equal("feedback")

    @property
    def setpoint_equal(self) -> bool:
        """Whether the setpoint paths are the same function, in every mode looked at."""
        return len(self.paths) > 1 and all(p.equal for p in self.paths if p.name != "feedback")

    def equal(self, name: PathName) -> bool:
        """Whether a path is the same function; in cascade as in automatic where neither card's equation depends on the mode."""
        found = {p.name: p.equal for p in self.paths}
        return found.get(name, name == "setpoint in cascade" and found.get("setpoint", False))

    @property
    def source_law(self) -> str:
        """The source's feedback path, multiplied by the factor of the ranges."""
        return next((p.source for p in self.paths), "")

    @property
    def target_law(self) -> str:
        """The target's feedback path."""
        return next((p.target for p in self.paths), "")

    @property
    def residual(self) -> float:
        """Largest difference of the feedback paths' coefficients with the dials in floats; infinite where there is no exact law."""
        return next((p.residual for p in self.paths), float("inf"))

    @property
    def text(self) -> tuple[str, ...]:
        """The proof in lines for the certificate."""
        return tuple(_lines(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the proof as plain values, for JSON."""
        own = asdict(self) | {"feedback_equal": self.feedback_equal, "setpoint_equal": self.setpoint_equal, "text": self.text}
        safe: dict[str, Any] = json_safe(own)
        return safe


Laws = Mapping[PathName, ExactLaw]


@dataclass(frozen=True, slots=True)
class _Exactly:
    """A controller with exact numbers, and paths of its law.

    Attributes
    ----------
    settings : Settings
        Its settings.
    algorithm : Algorithm[Exact]
        Its algorithm, with exact numbers.
    factor : Exact
        What its law is multiplied by.
    laws : mapping
        The paths.
    dials : mapping
        Exact dials in place of floats.
    """

    settings: Settings
    algorithm: Algorithm[Exact]
    factor: Exact
    laws: Laws
    dials: Mapping[str, Exact] = field(default_factory=dict)

    def text(self, name: PathName) -> str:
        return law_text(self.settings.equation, self.algorithm, name, self.laws[name], self.factor)


def prove(source: Settings, target: Settings, factor: Fraction | float = 1, mode: Mode = "both", within: float = ROUNDING) -> Proof:
    """Decide without rounding whether two controllers have the same continuous law.

    Parameters
    ----------
    source, target : Settings
        The two controllers. Where the target's dials were computed, give them as computed, not rounded for print.
    factor : Fraction or float
        What the source's gain is multiplied by for new signal ranges; negative where the action changes.
    mode : {"auto", "cascade", "both"}
        In which mode setpoint changes are looked at.
    within : float
        How far, relatively, a dial of the target may lie from the exact one that it stands for. By default by rounding alone;
        for dials that a conversion computed `pidemu.certificate.models.EXACT`, since a search ends before the last digit.

    Returns
    -------
    Proof
        Which paths are the same function, the exact dials, and both laws to check by hand.

    Examples
    --------
    >>> import pidemu
    >>> source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET="15 s/repeat", RATE="6 s")
    >>> target = pidemu.load_card("emerson/deltav").settings(GAIN=2.7, RESET=20.25, RATE=133 / 36, ALPHA=27 / 133)
    >>> proof = prove(source, target)
    >>> proof.feedback_equal, proof.setpoint_equal
    (True, False)
    >>> print(proof.target_law)
    27/10 (1 + 1/(81/4 s) + 133/36 s/(1 + 3/4 s)) = (2/15 + 14/5 s + 12 s^2)/(s (1 + 3/4 s))
    """
    try:
        scale = Exact(factor) if isinstance(factor, Fraction | int) else as_typed(factor)
        both = exact_algorithm(source), exact_algorithm(target)
        names = tuple(_names(both, mode))
        own = _Exactly(source, both[0], scale, exact_paths(both[0], names, scale))
        return _proof(own, _Exactly(target, both[1], Exact(1), exact_paths(both[1], names)), within)
    except (PidemuError, ArithmeticError) as error:
        return Proof(source.card.id, target.card.id, decided=False, why_not=str(error))


def _names(both: tuple[Algorithm[Exact], Algorithm[Exact]], mode: Mode) -> Iterator[PathName]:
    yield "feedback"
    if mode != "cascade":
        yield "setpoint"
    if mode == "cascade" or (mode == "both" and any(a.cascade_b is not None for a in both)):
        yield "setpoint in cascade"


def _proof(source: _Exactly, standing: _Exactly, within: float) -> Proof:
    residuals = {name: _residual(source, standing, name) for name in source.laws}
    target, reachable = _best(source, standing, residuals, within)
    paths = tuple(
        PathProof(name, law.equals(target.laws[name]), residuals[name], source.text(name), target.text(name))
        for name, law in source.laws.items()
    )
    counting = paths if paths[0].equal else paths[:1]  # without the feedback path, the setpoint path does not count
    open_ones = [p.name for p in counting if not p.equal and p.residual < EXACT and p.name not in reachable]
    return Proof(
        source.settings.card.id,
        standing.settings.card.id,
        paths,
        _dial_texts(target) if paths[0].equal else {},
        rounded=bool(target.dials),
        decided=not open_ones,
        why_not=f"no exact dials were found for the {' and '.join(open_ones)} path" if open_ones else "",
        notes=_notes(source.settings, standing.settings),
    )


def _residual(source: _Exactly, target: _Exactly, name: PathName) -> float:
    if source.laws[name].equals(target.laws[name]):
        return 0.0
    return difference(source.algorithm, target.algorithm, name, source.factor) or math.ulp(0.0)


def _best(
    source: _Exactly, standing: _Exactly, residuals: Mapping[PathName, float], within: float
) -> tuple[_Exactly, set[PathName]]:
    """Return the target with the exact dials that make most paths the same, and the paths that any dials, near or not, make so."""
    best, score = standing, [law.equals(standing.laws[name]) for name, law in source.laws.items()]
    reachable: set[PathName] = set()
    if all(score) or residuals["feedback"] > _NEARLY:
        return best, reachable
    for dials, left in _proposals(source, standing, residuals):
        algorithm = exact_algorithm(standing.settings, dials)
        laws = exact_paths(algorithm, tuple(source.laws))
        found = [law.equals(laws[name]) for name, law in source.laws.items()]
        reachable |= {name for name, same in zip(source.laws, found, strict=True) if same and found[0]}
        near = _is_near(standing.settings, dials, _NEARLY if left < _SAME_LAW else within)
        if found[0] and sum(found) > sum(score) and near:
            best, score = _Exactly(standing.settings, algorithm, standing.factor, laws, dials), found
    return best, reachable


def _proposals(
    source: _Exactly, standing: _Exactly, residuals: Mapping[PathName, float]
) -> Iterator[tuple[dict[str, Exact], float]]:
    """Yield exact dials for the feedback path, each also with the weights that the setpoint paths need, and what floats leave."""
    solver = Dials(standing.settings, standing.algorithm)
    for dials in [{}] if residuals["feedback"] == 0 else solver.feedback(source.laws["feedback"]):
        if dials:
            yield dials, residuals["feedback"]
        for name, law in source.laws.items():
            weights = solver.weights(law, name, dials) if name != "feedback" and residuals[name] < _NEARLY else {}
            if weights:
                yield dials | weights, max(residuals["feedback"], residuals[name])


def _is_near(target: Settings, dials: Mapping[str, Exact], tolerance: float) -> bool:
    """Whether the floats are the exact dials, rounded; a setpoint weight is a part of 1, of which 0 is the rounding too."""
    for name, x in dials.items():
        stands = Fraction(target[name].value)
        size = max(abs(stands), Fraction(1)) if target[name].role in _WEIGHTS else abs(stands)
        if abs(x.near - stands) > tolerance * size:
            return False
    return True


def _dial_texts(target: _Exactly) -> dict[str, str]:
    texts = {}
    for name, value in target.settings.items():
        if value.active and (name in target.dials or math.isfinite(value.value)):
            number = target.dials[name] if name in target.dials else as_typed(value.value)
            texts[name] = str(number) if value.unit == "1" else f"{number} {value.unit}"
    return texts


def _notes(*both: Settings) -> tuple[str, ...]:
    turning = {
        f"{s.card.id}: {name} is a frequency, and 2 pi is computed as 6.283185307179586"
        for s in both
        for name, v in s.items()
        if v.active and not v.off and parse_unit(v.unit).dimension is Dimension.FREQUENCY
    }
    return tuple(sorted(turning))


_TITLES: Final = {
    "feedback": "From the measurement to the output",
    "setpoint": "From the setpoint to the output",
    "setpoint in cascade": "From the setpoint to the output, in cascade",
}


def _lines(proof: Proof) -> Iterator[str]:
    if not proof.decided:
        yield f"Exact arithmetic does not decide: {proof.why_not}."
    if proof.dials:
        listed = ", ".join(f"{name} {text}" for name, text in proof.dials.items())
        yield f"Exact settings of {proof.target_card}: {listed}."
    for path in proof.paths:
        yield f"{_TITLES[path.name]}:"
        yield f"  {proof.source_card}: {path.source}"
        yield f"  {proof.target_card}: {path.target}"
        if path.equal:
            yield "  These are the same function: the cross products of numerator and denominator agree term by term."
        else:
            yield f"  These are not the same function: coefficients differ by up to {path.residual:.2g} of their size."
    yield from proof.notes
