"""The cut-over from the old controller to the new one: what to set, and in which order, so that the valve does not jump."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from pidemu.cutover.notes import notes
from pidemu.cutover.steps import CutoverStep, steps
from pidemu.cutover.takeover import Takeover, takeover_of
from pidemu.cutover.trials import NO_BUMP, cut_over, resolution
from pidemu.cutover.ways import best_way, simple_way
from pidemu.errors import ActionError, ScanError
from pidemu.formatting import json_safe
from pidemu.settings.action import ACTIONS, Action, action_line, action_words, carried_action, check_action
from pidemu.settings.settings import Settings


@dataclass(frozen=True, slots=True)
class TransferPlan:
    """What to do at the cut-over, in order, and what that is worth.

    Attributes
    ----------
    steps : tuple of CutoverStep
        What to do.
    bump : float
        What the output moves by in the first automatic scan where the plan is followed, by emulation [% of output span]. The
        increment that the integral adds in that scan (``ki h e``, where the card integrates in it at all) is control and not
        counted.
    without_plan : float
        The same where the controller is simply switched to automatic, with output and setpoint as they are [% of output span]. A
        controller without manual is then in its first scan of all.
    resolution : float
        Up to which a bump is none: the rounding of the card's arithmetic [% of output span].
    action : {"reverse", "direct"} or None
        Action of the loop that the plan is for; ``None``: it holds for both.
    action_text : str
        The same in the card's words, with the error formula.
    notes : tuple of str
        What the plan rests on, and what cannot be avoided and why.
    """

    steps: tuple[CutoverStep, ...]
    bump: float
    without_plan: float
    notes: tuple[str, ...]
    resolution: float = NO_BUMP
    action: Action | None = None
    action_text: str = ""

    @property
    def is_bumpless(self) -> bool:
        """Whether the output does not move but for the rounding of the card's arithmetic."""
        return abs(self.bump) <= self.resolution

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, for JSON."""
        plain = {
            "steps": [{"do": s.do, "set": dict(s.set)} for s in self.steps],
            "bump": self.bump,
            "without_plan": self.without_plan,
            "is_bumpless": self.is_bumpless,
            "resolution": self.resolution,
            "action": self.action,
            "action_text": self.action_text,
            "notes": list(self.notes),
        }
        safe: dict[str, Any] = json_safe(plain)
        return safe


def transfer_plan(
    target: Settings,
    sp: float,
    pv: float,
    op: float,
    *,
    scan: float | None = None,
    action: Action | None = None,
    output_limits: tuple[float, float] | None = None,
) -> TransferPlan:
    """Return what to set on the target, and in which order, so that the cut-over does not move the output.

    Every way that the card's transfer leaves is emulated (specs/equations.md, sections 5 and 6), and of those that leave the valve
    alone until the controller is in automatic the first without a bump is taken, or else the one with the smallest.

    Parameters
    ----------
    target : Settings
        The settings of the controller that takes over.
    sp, pv : float
        Setpoint and measurement at the cut-over [engineering units where the settings have a `pv_range`, else % of span].
    op : float
        Output at the cut-over, where the valve stands [engineering units where the settings have an `op_range`, else % of span].
    scan : float, optional
        Scan interval [s]; by default the card's.
    action : {"reverse", "direct"}, optional
        Action of the loop in the ISA sense: reverse acting, the output falls when the measurement rises. Where the sign of the gain
        is the action it is known without; elsewhere it is needed where the plan depends on it.
    output_limits : tuple of float, optional
        Low and high output limit [as `op`]; by default the card's.

    Raises
    ------
    ScanError
        A signal is not a finite number, the output is outside its limits, the controller cannot be run so, or the action
        contradicts the sign of the gain.
    ActionError
        What to set depends on the action, which was not stated.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("simple-pid/simple-pid").settings(Kp=2, Ki=0.1)
    >>> plan = transfer_plan(s, sp=50, pv=48, op=43)
    >>> plan.without_plan, plan.bump, plan.is_bumpless
    (4.0, 0.0, True)
    >>> plan.steps[2].do
    'load the integral with 39 %, and not with the output of 43 %: the proportional term of 4 % comes on top'
    """
    stated = action or carried_action(target)
    if contradiction := check_action(target, action):
        raise ScanError(contradiction)
    if stated is not None:
        return _plan(takeover_of(target, (sp, pv, op), scan, stated, output_limits))
    both = (takeover_of(target, (sp, pv, op), scan, a, output_limits) for a in ACTIONS)
    either, direct = (_plan(replace(new, action_known=False)) for new in both)
    if not _same(either, direct):
        raise ActionError(
            f"{target.card.id}: what to set at this cut-over depends on the action of the loop, which was not stated; add --action "
            f"reverse or --action direct (action= from Python): {action_line(target)}"
        )
    return either


def _same(one: TransferPlan, other: TransferPlan) -> bool:
    """Tell whether two plans say the same, but for rounding."""
    near = max(one.resolution, other.resolution)
    moves = ((one.bump, other.bump), (one.without_plan, other.without_plan))
    return (one.steps, one.notes) == (other.steps, other.notes) and all(abs(x - y) <= near for x, y in moves)


def _plan(new: Takeover) -> TransferPlan:
    """Return the plan for one action."""
    way, cut = best_way(new)
    bare = cut_over(new, simple_way(new))
    known = new.action_known
    return TransferPlan(
        steps=tuple(steps(new, way, cut)),
        bump=new.out.percent(cut.bump) + 0.0,
        without_plan=new.out.percent(bare.bump) + 0.0,
        notes=tuple(notes(new, way, cut)),
        resolution=resolution(new, cut),
        action=new.action if known else None,
        action_text=action_words(new.settings, new.action) if known else f"either action ({action_line(new.settings)})",
    )
