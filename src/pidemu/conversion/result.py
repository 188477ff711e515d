"""What a conversion gives."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pidemu.certificate.models import Certificate, Verdict
from pidemu.certificate.sentence import sentence
from pidemu.certificate.setpoint_filter import SetpointFilter, setpoint_filter
from pidemu.certificate.unverified import facts, unverified_law, unverified_program
from pidemu.conversion.advice import warnings_for
from pidemu.conversion.beside import Beside, runner_up, stands_beside
from pidemu.conversion.command import words_for
from pidemu.conversion.conditions import Condition, conditions_of
from pidemu.conversion.document import provenance
from pidemu.conversion.match.no_match import REFUSALS
from pidemu.conversion.match_method import Match
from pidemu.conversion.modes import MODES
from pidemu.conversion.options import Attempt
from pidemu.conversion.request import Request
from pidemu.conversion.solver.closed_forms import textbook
from pidemu.conversion.solver.solver import Solver
from pidemu.conversion.unstated import Open
from pidemu.errors import ScanError
from pidemu.formatting import json_safe, number
from pidemu.settings.action import ACTIONS, Action, action_line, action_words, carried_action
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from pidemu.certificate.proof import Proof
    from pidemu.cutover.bench_check import BenchCheck
    from pidemu.cutover.plan import TransferPlan
    from pidemu.process.process import Process


@dataclass(frozen=True)
class Textbook:
    """What the rule in manuals would have given, shown beside the default.

    Attributes
    ----------
    settings : Settings or None
        The settings; ``None`` where the rule has no answer or the target refuses it.
    certificate : Certificate or None
        Its figures.
    reason : str
        Why there is no answer.
    """

    settings: Settings | None
    certificate: Certificate | None
    reason: str = ""


@dataclass(frozen=True)
class Conversion:
    """Settings of a target that stand for those of a source.

    Attributes
    ----------
    source, settings : Settings
        The source's and the target's settings, the latter as they are printed.
    unrounded : Settings
        The target's settings before rounding.
    match : str
        How they were found: exact, same-numbers, low-frequency, textbook, frequency, loop or constrained.
    certificate : Certificate
        How near they are.
    refusal : str
        Why the target refused, where these are only the nearest settings.
    chosen : dict of str to str
        Options of the target that were chosen here, because they were not stated, and are not as the card delivers them.
    ranking : sequence of Attempt
        The choices of the options, the best first; what nobody asks for is not worked out.
    solver : Solver or None
        What found them.
    factor : float
        What the source's gain was multiplied by for new signal ranges; negative where the action changes.
    scan : tuple of float or None
        Intervals at which source and target are executed [s].
    process : Process or None
        The process, where it was given.
    request : Request
        What was asked for.
    opens : tuple of Open
        What was not stated of the source.
    """

    source: Settings
    settings: Settings
    unrounded: Settings
    match: Match
    certificate: Certificate
    refusal: str = ""
    chosen: Mapping[str, str] = field(default_factory=dict)
    ranking: Sequence[Attempt] = ()
    solver: Solver | None = field(default=None, repr=False, compare=False)
    factor: float = 1.0
    scan: tuple[float, float] | None = None
    process: Process | None = None
    request: Request = field(default_factory=Request)
    opens: tuple[Open, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """``exact``, ``exact-feedback`` or ``approximate``; where both modes count, the worse of the two."""
        return self.certificate.verdict

    @property
    def verdicts(self) -> dict[str, Verdict]:
        """The verdict by mode, where it depends on the mode; else that of the modes looked at alone."""
        if self.certificate.setpoint_in_cascade is not None:
            return {mode: self.certificate.verdict_in(mode) for mode in MODES}
        return {self.request.mode: self.verdict}

    @property
    def proof(self) -> Proof | None:
        """Both laws compared without rounding; ``None`` where they are not the same anyway, or where the scans were made up for."""
        return self.certificate.proof

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What the target does differently, in words."""
        return tuple(warnings_for(self))

    @cached_property
    def textbook(self) -> Textbook:
        """What the textbook rule would have given."""
        assert self.solver is not None  # there are settings
        try:
            book = textbook(self.solver.pair).settings
            return Textbook(book, self.solver.yardstick.certify(book))
        except REFUSALS as error:
            return Textbook(None, None, str(error))

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """On which unverified facts of the cards the result rests, with what else it would be."""
        return conditions_of(self)

    @cached_property
    def beside(self) -> tuple[Beside, ...]:
        """Other settings worth a line: the runner-up, the source's own numbers, settings compensated for the scans."""
        return tuple(stands_beside(self))

    @cached_property
    def runner_up(self) -> Beside | None:
        """The best settings with other options, where they are no worse; ``None`` where there are none."""
        return runner_up(self)

    @property
    def assumed(self) -> tuple[str, ...]:
        """What was taken though it should have been asked, because the user wanted it so."""
        return tuple(f"{o.about} = {o.taken.value}" for o in self.opens if o.asked)

    @property
    def sentence(self) -> str:
        """The verdict in a sentence or two for whoever stands at the loop, with the conditions that it rests on."""
        return sentence(self.certificate, [str(c) for c in self.conditions if c.headline], self.assumed, self._lag)

    @property
    def _lag(self) -> str:
        return f"{number(self.settings.lag)} s" if self.settings.lag else ""

    @cached_property
    def bench_check(self) -> BenchCheck | ScanError:
        """A check of the dials at the controller before the cut-over; the error where the target cannot be run for one."""
        from pidemu.cutover.bench_check import bench_check

        try:
            return bench_check(self.settings, self._checked_at, self.action)
        except ScanError as error:
            return error

    @property
    def _checked_at(self) -> float | None:
        """The interval at which the check is worked out [s]: the target's, else the one at which the two were run."""
        run = self.certificate.scan_by_scan
        return self.scan[1] if self.scan else run.scan[1] if run is not None else None

    @property
    def at_the_loop(self) -> tuple[str, ...]:
        """What to do at the loop: the action to set, and a check on the bench before the cut-over."""
        lines = [f"Action: {self.action_text}." + self._old_action()]
        if self.request.bias is not None and not self.settings.algorithm().ki:
            lines.append(
                f"Bias: set the output at SP = PV to {number(self.request.bias)} %, by the manual reset or bias of the new block."
            )
        if self.request.limits is not None:
            lines.append(f"Output limits: {self._limits(self.request.limits)}.")
        check = self.bench_check
        lines.append(f"No bench check: {check}." if isinstance(check, ScanError) else f"Bench check: {check.text}")
        return tuple(lines)

    def _limits(self, limits: tuple[float, float]) -> str:
        """Return what the source's output limits are on the target, in words."""
        old, new = self.source.own_ranges.op, self.settings.own_ranges.op
        low, high = map(number, new.limits_from_percent(old.limits_in_percent(limits)))
        unit = "%" if self.settings.equation.signals == "percent" else new.unit or "output units"
        return f"set {low} to {high} {unit}"

    @cached_property
    def command(self) -> str:
        """The command that makes the conversion again."""
        return words_for(self.source, self.settings.card, self.request)

    @cached_property
    def setpoint_filter(self) -> SetpointFilter | None:
        """The setpoint filter that would make the setpoint paths agree; ``None`` where they do, or where no filter can."""
        return setpoint_filter(self.source.law(), self.settings.law(), self.factor)

    @property
    def action(self) -> Action | None:
        """The loop's action: as it was stated, or as the sign of a gain carries it; ``None`` where it is not known."""
        return self.request.action or carried_action(self.source)

    @property
    def action_text(self) -> str:
        """What the target's action has to be set to, with the error formula; for both actions where it is not known."""
        known = self.action
        both = ACTIONS if known is None else (known,)
        return "; ".join(self._action_words(a) for a in both)

    def _old_action(self) -> str:
        """Return what the action is called on the source, where that is another word."""
        old, new = self.source.equation.action, self.settings.equation.action
        same = {k: v.casefold() for k, v in old.names.items()} == {k: v.casefold() for k, v in new.names.items()}
        if same and self.factor > 0 and old.fixed == new.fixed:
            return ""
        return f" On {self.source.card.id} it is {action_line(self.source, self.action)}."

    def _action_words(self, action: Action) -> str:
        carried = carried_action(self.settings)
        if carried is not None and carried != action:  # the gains are for the other action
            return f"{action_words(self.settings, action)} (turn the sign of the gains, or convert with --action {action})"
        return action_words(self.settings, action)

    def transfer_plan(self, sp: float, pv: float, op: float, action: Action | None = None) -> TransferPlan:
        """Return what to set, and in which order, so that the cut-over to the target does not bump.

        Parameters
        ----------
        sp, pv, op : float
            Setpoint, measurement and output at the cut-over, as the old controller shows them [the source's engineering units where
            its range is given, else %]. Where the target has another range, the plan is in its units.
        action : {"reverse", "direct"}, optional
            Action of the loop in the ISA sense; needed where the plan depends on it and it is not known (see `action`).

        Raises
        ------
        ActionError
            What to set depends on the action, which is not known.
        ScanError
            The action contradicts the sign of the gain, or the signals cannot be used: not finite, or outside the ranges.
        SettingError
            One range is of a gauge pressure and the other one of an absolute pressure.
        """
        from pidemu.cutover.old_signals import as_the_target_shows, limits_in_signal_units
        from pidemu.cutover.plan import transfer_plan

        scan = self.scan[1] if self.scan else None
        signals, note = as_the_target_shows(self.source, self.settings, (sp, pv, op))
        stated = self.request.limits and self.source.own_ranges.op.limits_in_percent(self.request.limits)
        limits = stated and limits_in_signal_units(stated, self.settings.op_range)
        plan = transfer_plan(self.settings, *signals, scan=scan, action=action or self.action, output_limits=limits)
        return replace(plan, notes=(note, *plan.notes)) if note else plan

    @property
    def assumptions(self) -> tuple[str, ...]:
        """Every fact of the two cards that is assumed or inferred and at work at these settings; what makes the law first."""
        both = (self.source, self.settings)
        law = [f"{s.card.id}: {fact}" for s in both for fact in facts(unverified_law(s))]
        program = [f"{s.card.id}: {fact}" for s in both for fact in facts(unverified_program(s, scan=self.scan is not None))]
        return tuple(dict.fromkeys(law + program))

    def to_dict(self, date: datetime.date | None = None) -> dict[str, Any]:
        """Return everything as plain values, the form of ``pidemu convert --json`` (specs/conversion.schema.json).

        Parameters
        ----------
        date : datetime.date, optional
            Date of the certificate; by default today.
        """
        check = self.bench_check
        plain = {
            **provenance(self, date),
            "from": self.source.to_dict(),
            "to": self._target_dict(),
            "match": self.match,
            "verdict": self.verdict,
            "verdicts": self.verdicts,
            "refusal": self.refusal,
            "sentence": self.sentence,
            "conditions": [c.to_dict() for c in self.conditions],
            "chosen": dict(self.chosen),
            "runner_up": None if self.runner_up is None else self.runner_up.to_dict(),
            "beside": [b.to_dict() for b in self.beside],
            "ranking": [attempt.to_dict() for attempt in self.ranking],
            "certificate": self.certificate.to_dict(),
            "textbook": {
                "to": self.textbook.settings.to_dict() if self.textbook.settings else None,
                "certificate": self.textbook.certificate.to_dict() if self.textbook.certificate else None,
                "reason": self.textbook.reason,
            },
            "scan": list(self.scan) if self.scan else None,
            "gain_factor": self.factor,
            "process": str(self.process) if self.process else None,
            "setpoint_filter": self.setpoint_filter.to_dict() if self.setpoint_filter else None,
            "warnings": list(self.warnings),
            "notes": [*self.source.notes, *self.settings.notes],
            "assumptions": list(self.assumptions),
            "action": {"action": self.action, "text": self.action_text},
            "bench_check": None if isinstance(check, ScanError) else asdict(check),
            "at_the_loop": list(self.at_the_loop),
            "command": self.command,
        }
        safe: dict[str, Any] = json_safe(plain)
        return safe

    def _target_dict(self) -> dict[str, Any]:
        """Return the target's settings, with their values before rounding."""
        plain = self.settings.to_dict()
        for name, dial in plain["settings"].items():
            dial["unrounded"] = self.unrounded[name].value
        plain["lag_on_pv"] = self.settings.lag
        return plain
