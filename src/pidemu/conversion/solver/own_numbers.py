"""The source's own numbers on a target of its form."""

from __future__ import annotations

from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.solver.found import Found
from pidemu.conversion.solver.pair import Pair
from pidemu.conversion.target.numbers import Numbers
from pidemu.units import Role


def own_numbers(pair: Pair, *, filtered: bool = False) -> Found:
    """Return the source's own numbers on a target of its form, their units converted.

    Parameters
    ----------
    pair : Pair
        Source and target.
    filtered : bool
        Whether a filter that can be set takes the source's filter time; otherwise it stays as delivered.

    Raises
    ------
    NoMatchError, SettingError
        The target has another form, or does not take them.
    """
    form, target, a = pair.source.equation.form, pair.target, pair.wanted
    gain = pair.source.by_role(Role.GAIN)
    if form is not target.form:
        raise NoMatchError(f"the source is of {form.value} form, the target of {target.form.value} form")
    K = a.kp or (gain.canonical if gain is not None else 0.0)
    Tf = a.Tf if filtered and target.filter.free else None
    return pair.settle(Numbers(K, a.ki, pair.dial_kd, Tf), "same-numbers")
