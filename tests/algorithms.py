"""Made-up algorithms, and algorithms with something changed at any depth."""

from __future__ import annotations

import typing
from collections import defaultdict
from dataclasses import is_dataclass, replace
from typing import Any, Final, Literal, TypeVar, cast

from pidemu.algorithm.model import Algorithm, Place
from pidemu.card.model.base import Form, Rule
from pidemu.card.model.integral import Integral
from pidemu.card.model.marks import fields_of
from pidemu.card.model.operation import Action, ActionExample, Arithmetic, Output
from pidemu.card.model.signals import ErrorShape, Measurement, Setpoint
from pidemu.card.model.terms import Derivative, Filter, Proportional
from pidemu.card.transfer import Transfer
from pidemu.card.windup import Scheme
from pidemu.card.windup.back_calculation import WindupBackCalculation
from pidemu.card.windup.clamp import WindupClamp
from pidemu.card.windup.conditional import WindupConditional
from pidemu.card.windup.external_reset import WindupExternalReset
from pidemu.card.windup.freeze import WindupFreeze
from pidemu.card.windup.none import WindupNone
from pidemu.card.windup.recompute import WindupRecompute
from pidemu.card.windup.reset_outside_band import WindupResetOutsideBand
from pidemu.card.windup.velocity import WindupVelocity

NONE: Final[Scheme[float]] = WindupNone(scheme="none")
CLAMP: Final[Scheme[float]] = WindupClamp(scheme="clamp")
CLAMP_SUM: Final[Scheme[float]] = WindupClamp(scheme="clamp-sum")
FREEZE: Final[Scheme[float]] = WindupFreeze(scheme="freeze")
CONDITIONAL: Final[Scheme[float]] = WindupConditional(scheme="conditional")
RECOMPUTE: Final[Scheme[float]] = WindupRecompute(scheme="recompute")
EXTERNAL_RESET: Final[Scheme[float]] = WindupExternalReset(scheme="external-reset")
RESET_OUTSIDE_BAND: Final[Scheme[float]] = WindupResetOutsideBand(scheme="reset-outside-band")
VELOCITY: Final[Scheme[float]] = WindupVelocity(scheme="velocity")

_ACTION: Final = Action(
    names={"reverse": "Reverse", "direct": "Direct"},
    example=ActionExample(name="Reverse", sp=50.0, pv=51.0, output="falls"),
)
_IMPLEMENTATION: Final[dict[bool, Literal["positional", "velocity"]]] = {False: "positional", True: "velocity"}

T = TypeVar("T")


def back_calculation(tracking_time: float, *, implicit: bool = False) -> Scheme[float]:
    """Return the scheme with a tracking time [s]."""
    return WindupBackCalculation(scheme="back-calculation", tracking_time=tracking_time, implicit=implicit)


def algorithm(
    *,
    form: Form = Form.STANDARD,
    kp: float = 0.0,
    ki: float = 0.0,
    kd: float = 0.0,
    b: float = 1.0,
    c: float = 1.0,
    Tf: float = 0.0,
    Ti: float | None = None,
    windup: Scheme[float] = NONE,
    **changes: Any,
) -> Algorithm:
    """Return a made-up algorithm with plain parts, and what is changed in it.

    Parameters
    ----------
    form, kp, ki, kd, b, c, Tf
        As in `Algorithm`.
    Ti : float, optional
        Integral time [s]; by default ``|kp/ki|``, where there is integral action.
    windup : Scheme
        Windup scheme; that of the velocity implementation makes a velocity algorithm.
    changes
        As in `changed`.
    """
    plain: Algorithm = Algorithm(
        form=form,
        implementation=_IMPLEMENTATION[windup.implementation == "velocity"],
        kp=kp,
        ki=ki,
        kd=kd,
        b=b,
        c=c,
        cascade_b=None,
        Tf=Tf,
        Ti=Ti if Ti is not None else abs(kp / ki) if ki else 0.0,
        bias=0.0,
        error=ErrorShape(),
        proportional=Proportional(on="weighted"),
        integral=Integral(rule=Rule.BACKWARD, windup=windup),
        derivative=Derivative(on="weighted"),
        setpoint=Setpoint(),
        measurement=Measurement(),
        feedforward=None,
        transfer=Transfer(start="bumpless"),
        action=_ACTION,
        output=Output(limits=(0.0, 100.0)),
        arithmetic=Arithmetic(type="float64"),
        shaped_in_cascade=True,
        dahlin=None,
    )
    return changed(plain, **changes)


def changed(part: T, **changes: Any) -> T:
    """Return an algorithm, or a part of one, with other values at any depth.

    Parameters
    ----------
    part : Algorithm or a part of it
        What is changed.
    changes
        Paths with double underscores, as in ``changed(a, kp=2.0, integral__rule=Rule.FORWARD)``.

    Raises
    ------
    TypeError
        There is no such field, or no part that could have it.
    ValueError
        The field is a choice of words, and this is none of them.
    """
    if not is_dataclass(part):
        raise TypeError(f"there is no part that could have {', '.join(changes)}")
    new: dict[str, Any] = {}
    deeper: dict[str, dict[str, Any]] = defaultdict(dict)
    for path, value in changes.items():
        name, _, rest = path.partition("__")
        if name not in fields_of(type(part)):
            raise TypeError(f"{type(part).__name__} has no field {name!r}")
        if rest:
            deeper[name][rest] = value
        else:
            new[name] = _checked(type(part), name, value)
    if twice := new.keys() & deeper.keys():
        raise TypeError(f"{', '.join(twice)}: changed as a whole and in part")
    new |= {name: changed(getattr(part, name), **inner) for name, inner in deeper.items()}
    return cast(T, replace(cast(Any, part), **new)) if new else part


def _checked(part: type[Any], name: str, value: Any) -> Any:
    words = _words(fields_of(part)[name].annotation)
    if words and isinstance(value, str) and value not in words:
        raise ValueError(f"{part.__name__}.{name} is one of {', '.join(map(str, words))}, not {value!r}")
    return value


def _words(annotation: Any) -> list[Any]:
    if typing.get_origin(annotation) is Literal:
        return list(typing.get_args(annotation))
    return [word for argument in typing.get_args(annotation) for word in _words(argument)]


def incremental(a: Algorithm, **changes: Any) -> Algorithm:
    """Return the algorithm in its velocity implementation, and what else is changed."""
    return changed(a, implementation="velocity", integral__windup=VELOCITY, **changes)


def filter_at(place: Place, order: Literal[1, 2] = 1, rule: Rule | None = None) -> Filter[float]:
    """Return a filter that goes with the derivative."""
    return Filter(applies_to=place, order=order, rule=_checked(Filter, "rule", rule))
