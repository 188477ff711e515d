"""A tuning rule's answer for a process, in the dials of a card."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pidemu
from pidemu.analysis.figures import loop_figures, scan_for
from pidemu.analysis.load_response import load_iae
from pidemu.analysis.loop_figures import LoopFigures
from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.conversion.convert import convert
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.result import Conversion
from pidemu.errors import ProcessError, TuningError
from pidemu.formatting import json_safe
from pidemu.process.process import Process
from pidemu.process.text import PERCENT as PERCENT_GAIN
from pidemu.process.text import written
from pidemu.settings.action import Action, read_action
from pidemu.settings.ranges import RangeGiven
from pidemu.settings.settings import Settings
from pidemu.tuning.choice import find_rule, kind_for, parameters_of
from pidemu.tuning.formula import value
from pidemu.tuning.model import RuleModel, rule_model
from pidemu.tuning.rules import TuningRule

SCHEMA: Final = "pidemu-tuning-1"
"""Name and version of the form of ``pidemu tune --json``; a change that breaks a reader counts the version up."""
_EQUATION: Final = "generic/standard"


@dataclass(frozen=True)
class Tuning:
    """What a tuning rule gives, in the dials of a card.

    Attributes
    ----------
    settings : Settings
        Card, dials and options.
    rule : TuningRule
        The rule.
    process : Process
        The process.
    model : RuleModel
        What the rule saw of it.
    parameters : dict
        Parameters of the rule [s].
    standard : dict
        What the rule says: ``K``, ``Ti`` and ``Td`` of the standard form [output per measurement, s].
    conversion : Conversion
        How the dials came about, and how near they are to the rule.
    action : {"reverse", "direct"}
        The control action that makes the feedback negative.
    figures : LoopFigures
        The sampled loop with these dials; the integral of the absolute error after a load step of 1 % from the emulated one.
    scan : float
        Scan interval of the figures [s].
    """

    settings: Settings
    rule: TuningRule
    process: Process
    model: RuleModel
    parameters: Mapping[str, float]
    standard: Mapping[str, float]
    conversion: Conversion
    action: Action
    figures: LoopFigures
    scan: float

    @property
    def source(self) -> str:
        """Where the rule was read."""
        return self.rule.reference

    @property
    def gains(self) -> dict[str, float]:
        """Gains of the dials: ``kp``, ``ki`` [1/s], ``kd`` [s] and the filter time ``Tf`` [s]; percent, where ranges are known."""
        a = self.settings.algorithm()
        return {name: float(getattr(a, name)) for name in ("kp", "ki", "kd", "Tf")}

    @property
    def notes(self) -> tuple[str, ...]:
        """What should be known beside the numbers."""
        found = [f"the rule saw {self.model.text}"] if self.model.reduced and "ultimate" not in self.rule.formulas else []
        found += [self.rule.note] if self.rule.note else []
        if self.conversion.refusal:
            found.append(f"these are only the nearest settings: {self.conversion.refusal}")
        elif self.conversion.verdict == "approximate":
            found.append(f"the card's equation is not the rule's: {self.conversion.sentence}")
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, the form of ``pidemu tune --json`` (``specs/tuning.schema.json``)."""
        plain: dict[str, Any] = json_safe(
            {
                "schema": SCHEMA,
                "pidemu": pidemu.__version__,
                **{k: v for k, v in self.settings.to_dict().items() if k in ("card", "settings", "options")},
                "gains": self.gains,
                "figures": {**dataclasses.asdict(self.figures), "scan": self.scan},
                "action": self.action,
                "rule": self.rule.name,
                "source": self.source,
                "standard": dict(self.standard),
                "parameters": dict(self.parameters),
                "process": written(self.process),
                "verdict": self.conversion.verdict,
                "notes": list(self.notes),
            }
        )
        return plain


def tune(
    card: str | Path | Card,
    process: Process,
    rule: str = "simc",
    *,
    controller: str | None = None,
    options: Mapping[str, object] | None = None,
    given: Mapping[str, object] | None = None,
    pv_range: RangeGiven | None = None,
    op_range: RangeGiven | None = None,
    scan: float | None = None,
    action: str | None = None,
    digits: int | None = None,
    allow_approximate: bool = False,
    **parameters: object,
) -> Tuning:
    """Return what a tuning rule gives for a process, in the dials of a card.

    Parameters
    ----------
    card : str, path or Card
        The card to tune, its id, or its file.
    process : Process
        The process. A gain in other units than %/% needs the range of the measurement.
    rule : str
        The rule, such as ``"simc"``, ``"amigo-pi"`` or a family, ``"amigo"`` (`pidemu.tuning_rules`).
    controller : {"P", "PI", "PID"}, optional
        Which rule of a family; by default the one with the most terms.
    options, given : mapping, optional
        Options of the card, and dials that shall have these values. Other options are chosen, as `pidemu.convert` does.
    pv_range, op_range : tuple or str, optional
        Ranges of measurement and output: for a card with gains in engineering units, and for a process gain in other units than
        percent.
    scan : float, optional
        Scan interval for the figures [s]; by default the card's, or a twentieth of the time in which the loop moves where that is
        shorter.
    action : {"reverse", "direct"}, optional
        Control action; by default the one that makes the feedback negative, and no other is taken.
    digits : int, optional
        Round the dials to their resolution or so many digits; the figures are those of the rounded ones.
    allow_approximate : bool
        Where the card cannot do what the rule says, return the nearest settings instead of raising.
    **parameters
        Parameters of the rule [s], such as ``Tcl=20`` of SIMC or ``lam="1 min"`` of lambda tuning.

    Raises
    ------
    TuningError
        The rule or a parameter is unknown, or the rule does not serve this process: then the error names the nearest one that does.
    ProcessError
        The action contradicts the sign of the process's gain.
    ConversionRefusedError
        The card cannot do what the rule says.

    Examples
    --------
    >>> import pidemu
    >>> found = tune("emerson/deltav", pidemu.Process.from_lags(2.0, lags=[60], delay=6), rule="simc")
    >>> found.settings["GAIN"].value, found.settings["RESET"].value
    (2.5, 48.0)
    """
    found, target = find_rule(rule, controller), card if isinstance(card, Card) else load_card(card)
    process = percent_process(process, pv_range, op_range)
    acts = _action(process, action)
    model = rule_model(process)
    formulas = found.formulas[kind_for(found, model)]
    chosen = parameters_of(found, model, parameters)
    standard = {name: value(formula, {**model.numbers, **chosen}) for name, formula in formulas.items()}
    if not all(0 <= x < math.inf for x in standard.values()) or not standard["K"]:
        raise TuningError(
            f"the rule '{found.name}' gives {_shown(standard)} for {process}, which is not a controller; take another rule"
        )
    weights = {"b": 0, "c": 0} if found.on_measurement else {"b": 1, "c": 0}
    ranges = {k: v for k, v in (("pv_range", pv_range), ("op_range", op_range)) if v is not None}
    source = load_card(_EQUATION).settings({"Ti": math.inf, **standard, **weights, **ranges})
    conversion = _converted(
        source, target, found, options=options, given=given, action=acts, digits=digits, allow_approximate=allow_approximate
    )
    settings = conversion.settings
    h = scan_for(settings, process) if scan is None else scan
    figures = loop_figures(settings.law(h), process, iae=load_iae(settings, process, h))
    return Tuning(settings, found, process, model, chosen, standard, conversion, acts, figures, h)


def percent_process(process: Process, pv_range: RangeGiven | None, op_range: RangeGiven | None) -> Process:
    """Return a process with its gain in percent per percent, as loops are computed.

    Parameters
    ----------
    process : Process
        The process, with a gain in any unit.
    pv_range, op_range : range, optional
        What 0 and 100 % are; needed where the gain is in other units.

    Raises
    ------
    ProcessError
        The range of the measurement is needed and missing, or in another unit.
    """
    if process.unit == PERCENT_GAIN:
        return process
    if pv_range is None:
        raise ProcessError(
            f"the gain of {process} is in {process.unit}; give the range of the measurement (pv_range, --pv-range), so that it can "
            "be told in percent"
        )
    return process.in_percent(pv_range, *(() if op_range is None else (op_range,)))


def _converted(source: Settings, target: Card, rule: TuningRule, **arguments: Any) -> Conversion:
    try:
        return convert(source, target, emulate=False, **arguments)
    except ConversionRefusedError as error:
        error.args = (f"what the rule '{rule.name}' says ({source.summary}) is refused: {error}", *error.args[1:])
        raise


def _action(process: Process, wanted: str | None) -> Action:
    """Return the action that makes the feedback negative."""
    right: Action = "reverse" if process.feedback_sign > 0 else "direct"
    if read_action(wanted) not in (None, right):
        raise ProcessError(
            f"with the gain of {process} a {wanted} acting controller makes the feedback positive; leave out the action, or "
            f"give the gain the other sign"
        )
    return right


def _shown(standard: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {x:g}" for name, x in standard.items())
