"""What two controllers do differently beyond the linear law, in words and numbers (specs/equations.md, section 9, point 5)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pidemu.certificate.arithmetic import arithmetic_differences
from pidemu.certificate.differences import (
    error_differences,
    integral_differences,
    limit_differences,
    output_differences,
    setpoint_differences,
)
from pidemu.certificate.limit_test import output_number, unknown_windup, windup_differences
from pidemu.certificate.models import NonlinearDifference
from pidemu.certificate.scaled_controller import ScaledController, scaled_controllers
from pidemu.certificate.trials import TrialPlan, TriedController, planned
from pidemu.controller.bench import limits_in_percent
from pidemu.errors import PidemuError
from pidemu.settings.action import acting_alike
from pidemu.settings.range_relation import Relation, relation
from pidemu.settings.settings import Settings
from pidemu.units import Role

_MANUAL: Final = {
    "operator": "gives the operator's output",
    "gain-times-operator": "multiplies the operator's output by the gain",
    "zero": "gives zero",
}
_BUMP: Final = 1e-6
"""Difference of bumps that counts [% of the output span]."""
_ROUNDED_BUMP: Final = 1e-4
"""The same where numbers are rounded to 24 bits, 8e-6 at 100 %, in every term of the sum."""


def nonlinear_differences(
    source: Settings,
    target: Settings,
    scans: tuple[float, float],
    time_and_size: tuple[float, float],
    *,
    limits: tuple[float, float] | None = None,
    in_cascade: bool = False,
) -> tuple[NonlinearDifference, ...]:
    """Return what two controllers do differently beyond the linear law (specs/equations.md, sections 5 to 9).

    What happens at a limit and at transfers, and which errors the arithmetic loses, is found by emulation, with parts of the
    standard record, each controller at its own scan interval and with the source's output limits, 0 to 100 % where it has none.
    Two that are described by different words and behave alike have no difference. Where one cannot be emulated the text says why,
    and the figures are missing.

    Parameters
    ----------
    source, target : Settings
        Settings of the two controllers.
    scans : tuple of float
        Their scan intervals [s].
    time_and_size : tuple of float
        Characteristic time [s] and size [%] of the standard record, as `pidemu.records.standard.scale_of` gives them for the
        source. A time of more than 2,000 scans of the faster, or less than 20 of the slower controller gives way to that.
    limits : tuple of float, optional
        Output limits that both are set to [% of the output span]; by default the source card's.
    in_cascade : bool
        Whether only a remote setpoint counts.

    Returns
    -------
    tuple of NonlinearDifference
        By aspect: windup, transfer, bias, limits, arithmetic, error, integral, output, setpoint.

    Examples
    --------
    >>> import pidemu
    >>> old = pidemu.load_card("generic/parallel").settings(kp=2, ki=0.02)
    >>> new = pidemu.load_card("arduino/pid").settings(Kp=2, Ki=0.02)
    >>> found = {d.aspect: d for d in nonlinear_differences(old, new, (1.0, 1.0), (100.0, 4.0))}
    >>> before, after = found["transfer"].figures["bump to automatic [% of output span]"]
    >>> round(before, 9), round(after, 9)  # the error is half the size, with the measurement above the setpoint; P comes on top
    (0.0, -4.04)
    """
    both = scaled_controllers(source, target, scans)
    trial = planned(both, time_and_size, _limits(source, limits))
    found = [
        *_emulated(both, trial),
        *_bias(*both),
        *limit_differences(*both, stated=limits is not None),
        *_inside_limits(both, trial.limits, in_cascade=in_cascade),
    ]
    return tuple(found)


def differences_inside_limits(
    source: Settings,
    target: Settings,
    scans: tuple[float, float],
    *,
    limits: tuple[float, float] | None = None,
    in_cascade: bool = False,
) -> tuple[NonlinearDifference, ...]:
    """Return what of `nonlinear_differences` shows in automatic with the output inside its limits; arguments as there.

    Only the arithmetic has to be emulated for it, and that only where it is not double precision on both sides.
    """
    return tuple(_inside_limits(scaled_controllers(source, target, scans), _limits(source, limits), in_cascade=in_cascade))


def _limits(source: Settings, stated: tuple[float, float] | None) -> tuple[float, float]:
    return limits_in_percent(source, None) if stated is None else stated


def _inside_limits(
    both: tuple[ScaledController, ScaledController], limits: tuple[float, float], *, in_cascade: bool
) -> Iterator[NonlinearDifference]:
    yield from arithmetic_differences(*both)
    yield from error_differences(*both)
    yield from integral_differences(*both, limits)
    yield from output_differences(*both)
    yield from setpoint_differences(*both, in_cascade=in_cascade)


def _emulated(both: tuple[ScaledController, ScaledController], trial: TrialPlan) -> Iterator[NonlinearDifference]:
    """Yield what differs at limits and transfers, or what the cards say of it where it cannot be tried."""
    source, target = both
    related = relation(source.settings.pv_range, target.settings.pv_range, "pv_range")
    span = 1 / float(related.factor) if isinstance(related, Relation) else 1.0
    tried = []
    try:
        actions = acting_alike(target.settings, source.sign * target.sign)
        for side, action, share in zip(both, actions, (1.0, span), strict=True):
            name = side.name
            tried.append(TriedController(side, trial, action, share))
            tried[-1].check()
    except PidemuError as error:
        reason = f"{name} cannot be emulated: {error}"
        yield from unknown_windup(both, reason)
        yield from _unknown_transfer(both, reason)
        return
    pair = tried[0], tried[1]
    yield from windup_differences(both, pair, trial)
    yield from _transfer(both, pair, trial)


def _transfer(
    both: tuple[ScaledController, ScaledController], tried: tuple[TriedController, TriedController], trial: TrialPlan
) -> Iterator[NonlinearDifference]:
    """Yield how differently the transfers between manual and automatic go (section 6)."""
    (hand, auto), (new_hand, new_auto) = (one.transfers() for one in tried)
    to_auto, to_manual = (auto, new_auto), (hand, new_hand)
    least = _BUMP if all(side.own.arithmetic.type == "float64" for side in both) else _ROUNDED_BUMP
    parts = []
    if abs(auto - new_auto) > least:
        parts.append(
            f"Switched to automatic with PV {trial.offset:.3g} % above SP, the output jumps by {_jumps(to_auto)}"
            f"{_each(both, [side.own.transfer.way.of_a_controller for side in both])}."
        )
    if abs(hand - new_hand) > least:
        parts.append(f"Switched to manual at its present output, it jumps by {_jumps(to_manual)}.")
    manuals = [_MANUAL[side.own.transfer.manual_output] for side in both]
    if manuals[0] != manuals[1]:
        parts.append(f"In manual {both[0].name} {manuals[0]}, {both[1].name} {manuals[1]}.")
    if parts:
        figures = {"bump to automatic [% of output span]": to_auto, "bump to manual [% of output span]": to_manual}
        yield NonlinearDifference("transfer", " ".join(parts), figures)


def _unknown_transfer(both: tuple[ScaledController, ScaledController], reason: str) -> Iterator[NonlinearDifference]:
    """Yield what the cards say where the transfers cannot be tried."""
    ways = [f"{side.own.transfer.way.of_a_controller}; in manual it {_MANUAL[side.own.transfer.manual_output]}" for side in both]
    if ways[0] != ways[1]:
        each = ". ".join(f"{side.name} {w}" for side, w in zip(both, ways, strict=True))
        yield NonlinearDifference(
            "transfer", f"How far the output jumps at transfers is not known ({reason}). By their cards: {each}.", {}
        )


def _each(both: tuple[ScaledController, ScaledController], words: list[str]) -> str:
    """Return what each does, in brackets; nothing where it is the same."""
    if words[0] == words[1]:
        return ""
    return f" ({', '.join(f'{side.name} {w}' for side, w in zip(both, words, strict=True))})"


def _jumps(bumps: tuple[float, float]) -> str:
    return f"{output_number(bumps[0])} % on the old controller and {output_number(bumps[1])} % on the new one"


def _bias(source: ScaledController, target: ScaledController) -> Iterator[NonlinearDifference]:
    """Yield that the output of a positional target without integral rests on a bias, which no dial of the source holds."""
    if target.integrates or target.own.velocity or target.own.dahlin is not None or source.own.bias:
        return
    dial = target.settings.by_role(Role.BIAS)
    where = "" if dial is None else f" and enter it as {dial.name}"
    text = (
        f"Open: the bias. Without integral action the output at SP = PV is a bias, and the settings of {source.name} do not hold "
        f"it; read the output of the old controller while SP = PV{where}, or give it with --bias."
    )
    yield NonlinearDifference("bias", text, {})
