"""What a conversion gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

from pidemu.action import action_words, carried_action
from pidemu.certificate.models import Certificate, Verdict
from pidemu.certificate.sentence import sentence
from pidemu.certificate.setpoint_filter import SetpointFilter, setpoint_filter
from pidemu.conversion.aim import Match
from pidemu.conversion.choices import Attempt
from pidemu.conversion.request import Request
from pidemu.plain import json_safe
from pidemu.scan.build import Action
from pidemu.settings import Settings

if TYPE_CHECKING:
    from pidemu.cutover.plan import TransferPlan
    from pidemu.loop.process import Process

_SCAN_RULES: Final = ("integral.rule", "derivative.rule", "derivative.filter.rule")


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
        The source's and the target's settings.
    match : str
        How they were found: exact, low-frequency, textbook, frequency, loop or constrained.
    certificate : Certificate
        How near they are.
    textbook : Textbook
        What the textbook rule would have given.
    warnings : tuple of str
        What the target does differently, in words.
    refusal : str
        Why the target refused, where these are only the nearest settings.
    chosen : dict of str to str
        Options of the target that were chosen here, because nobody gave them, and are not as the card delivers them.
    ranking : tuple of Attempt
        The choices of the options that were looked at, the best first.
    factor : float
        What the source's gain was multiplied by for new signal ranges; negative where the action changes.
    scan : tuple of float or None
        Scan intervals of source and target [s].
    process : Process or None
        The process, where it was given.
    request : Request
        What was asked for.
    """

    source: Settings
    settings: Settings
    match: Match
    certificate: Certificate
    textbook: Textbook
    warnings: tuple[str, ...]
    refusal: str = ""
    chosen: Mapping[str, str] = field(default_factory=dict)
    ranking: tuple[Attempt, ...] = ()
    factor: float = 1.0
    scan: tuple[float, float] | None = None
    process: Process | None = None
    request: Request = field(default_factory=Request)

    @property
    def verdict(self) -> Verdict:
        """``exact``, ``exact-feedback`` or ``approximate``."""
        return self.certificate.verdict

    @property
    def sentence(self) -> str:
        """The verdict in one sentence for whoever stands at the loop."""
        return sentence(self.certificate)

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
        both: tuple[Action, ...] = ("reverse", "direct") if known is None else (known,)
        return "; ".join(self._action_words(a) for a in both)

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
            Setpoint, measurement and output at the cut-over [engineering units where the ranges are given, else %].
        action : {"reverse", "direct"}, optional
            Action of the loop in the ISA sense; needed where the plan depends on it and it is not known (see `action`).

        Raises
        ------
        ActionError
            What to set depends on the action, which is not known.
        ScanError
            The action contradicts the sign of the gain, or the signals cannot be used.
        """
        from pidemu.cutover.plan import transfer_plan

        scan = self.scan[1] if self.scan else None
        return transfer_plan(self.settings, sp, pv, op, scan=scan, action=action or self.action)

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What the result rests on without anybody having said so; what makes the law first."""
        found = [(a, f"{s.card.id}: {a}") for s in (self.source, self.settings) for a in s.assumptions()]
        law = [text for a, text in found if a.makes_the_law]
        return tuple(dict.fromkeys(law + [text for a, text in found if not a.makes_the_law]))

    @property
    def law_assumptions(self) -> tuple[str, ...]:
        """Those of `assumptions` that the settings rest on: what makes the law and, where these make up for scans, scan rules."""
        cost = self.certificate.scan_cost
        rules = _SCAN_RULES if cost is not None and cost.compensated else ()
        found = [(s, a) for s in (self.source, self.settings) for a in s.assumptions() if a.makes_the_law or a.path in rules]
        return tuple(dict.fromkeys(f"{s.card.id}: {a}" for s, a in found))

    @property
    def inferences(self) -> tuple[str, ...]:
        """What of the two equations is inferred from something documented, not itself stated."""
        found = [f"{s.card.id}: {a}" for s in (self.source, self.settings) for a in s.inferences()]
        return tuple(dict.fromkeys(found))

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, the form of ``pidemu convert --json``."""
        plain = {
            "from": self.source.to_dict(),
            "to": self.settings.to_dict(),
            "match": self.match,
            "verdict": self.verdict,
            "sentence": self.sentence,
            "chosen": dict(self.chosen),
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
            "inferences": list(self.inferences),
        }
        safe: dict[str, Any] = json_safe(plain)
        return safe
