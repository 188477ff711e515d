"""What stops a loop, and what is told of it: every code, its level, what it means, and the order of risk."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from pidemu.errors import ListError, suggest

Level = Literal["error", "decision", "flag"]
RowClass = Literal["converted", "decision", "error", "skipped"]


@dataclass(frozen=True, slots=True)
class RowCode:
    """A code of a finding.

    Attributes
    ----------
    name : str
        ``E-``, ``D-`` or ``F-`` and a word.
    about : str
        What it means, and what a person does about it.
    risk : int
        Its place in the exception report, the greatest risk first.
    answers : str
        How it is answered in the decisions file; empty where it cannot be.
    """

    name: str
    about: str
    risk: int
    answers: str = ""

    @property
    def level(self) -> Level:
        """What it does to a row unless the rules say otherwise."""
        return {"E": "error", "D": "decision"}.get(self.name[0], "flag")  # type: ignore[return-value]


_CODES: Final = (
    RowCode("E-tag", "The loop has no tag, so that nobody can say which one it is.", 3),
    RowCode("E-card", "The system is not known: no card, and no word of the mapping, has this name.", 3),
    RowCode("E-missing", "A gain or an integral setting is blank or not there.", 3),
    RowCode("E-number", "A cell that should hold a number holds something else, or a number with a mark such as ~2 or 1.5?.", 3),
    RowCode("E-date", "A cell that should hold a number holds a date, which spreadsheets make of fractions and part numbers.", 3),
    RowCode("E-unit", "A unit is of another kind than the setting, or unknown.", 3),
    RowCode("E-negative", "A setting is negative, and the card's range is not.", 3),
    RowCode("E-range", "A range whose low end is not below its high end, or a value outside the card's range.", 3),
    RowCode("E-bits", "The named bits of a Logix PID tag contradict its control word CTL.", 3),
    RowCode("E-program", "pidemu failed on this loop, which is a fault of its own: report it with the line of the list.", 3),
    RowCode("D-refused", "The target cannot do what the source does; the nearest settings and their cost are stated.", 1,
    "nearest; skip"),
    RowCode("D-duplicate", "Another line has the same tag and other contents.", 2, "the line that counts, such as Sheet1:12, "
    "or the file; skip"),
    RowCode("D-unit", "A unit can be read in two ways, or cell and unit column contradict each other.",
         4, "the unit, such as min/repeat"),
    RowCode("D-form", "The form is not stated and it matters, because derivative is used.", 4, "the choice, such as ideal"),
    RowCode("D-equation", "The equation is not stated, and the units of the settings hang on it.",
         4, "the choice, such as independent"),
    RowCode("D-structure", "It is not stated which terms see the setpoint, though other loops of this system state it.", 4,
    "the choice"),
    RowCode("D-mode", "The structure follows the mode, and the mode is not stated or is manual.", 4, "auto; cascade"),
    RowCode("D-action", "The control action is blank or a word that is not known.", 5, "reverse; direct"),
    RowCode("D-range", "A signal range is needed and not there.", 6, "the range, such as 0..45 t/h"),
    RowCode("D-rerange", "There is a new range, and not whether it is the same signal on another scale or another range.", 6,
         "same signal; other range"),
    RowCode("D-update", "The update time that the block computes with is not the interval at which it is executed.", 6,
         "scan (the block computes with the interval); real (it computes with the update time, and that shall be made up for)"),
    RowCode("D-zero-gain", "The gain is zero while another setting is not.", 6, "convert; skip"),
    RowCode("D-unused", "The loop is not used: all settings are zero, nothing executes it, or a remark says so.",
         6, "convert; skip"),
    RowCode("D-default", "The settings are those the block is delivered with: it was never tuned.", 6, "convert; skip"),
    RowCode("D-no-integral", "There is no integral action: the output at SP = PV, the bias, has to be chosen.",
         6, "the bias in %, such as 50"),
    RowCode("D-nonlinear", "The loop uses something beyond PID (gap, error squared, feedforward, ratio, split range, ...).", 6,
         "convert (without it); skip"),
    RowCode("D-filter", "The source filters its measurement, and the target has nowhere to put the filter.", 6,
         "in front (a filter outside the block); leave out"),
    RowCode("F-approx", "The conversion is not exact, or not at the scan intervals of both; how far it is off is stated.", 7),
    RowCode("F-structure", "Another share of the terms sees the setpoint: a setpoint step kicks the output otherwise.", 8),
    RowCode("F-limits", "The output limits are not 0 to 100 %; set them and anti-windup limits on the target, in its units.", 9),
    RowCode("F-unit-assumed", "No unit is stated: the card's own, or the mapping's, was taken.", 10),
    RowCode("F-unit-other", "The unit that is stated is not the card's own, so the number was converted.", 10),
    RowCode("F-td-ti", "The derivative time is longer than the integral time.", 10),
    RowCode("F-series-limit", "The integral time is less than four derivative times, which no series form can do exactly.", 10),
    RowCode("F-scan-slow", "The loop is executed less than ten times in its integral time.", 10),
    RowCode("F-filter-long", "The filter of the measurement is longer than the derivative time.", 10),
    RowCode("F-rerange", "The measurement gets another range, so the gain was multiplied by new over old span.", 10),
    RowCode("F-rescaled", "The measurement gets another scale of the same signal; the gain stays.", 10),
    RowCode("F-manual", "The loop was in manual: nobody knows whether these settings work.", 10),
    RowCode("F-hidden-row", "The line, or a column that was read, is hidden in the spreadsheet.", 10),
    RowCode("F-cascade", "The loop is in cascade, and its partner is not named in the list.", 10),
    RowCode("F-rounding", "Rounding moves a setting by more than 0.1 %.", 10),
    RowCode("F-repeat", "The loop stands in the list more than once, with the same contents; it counts once.", 10),
    RowCode("F-interval", "The interval at which the block is executed cannot be told from the file.", 10),
    RowCode("F-decided", "A person decided; the name and the reason stand with the loop.", 10),
    RowCode("F-lowered", "The plant's rules let pass what would stop the loop.", 10),
)  # fmt: skip
CODES: Final = {code.name: code for code in _CODES}
"""Every code by its name."""
STOP_WORDS: Final = {
    "no-integral": "D-no-integral", "zero-gain": "D-zero-gain", "unknown-action": "D-action", "ambiguous-unit": "D-unit",
    "missing-range-when-needed": "D-range", "form-not-stated-with-derivative": "D-form", "equation-not-stated": "D-equation",
    "mode-not-stated-where-structure-follows-mode": "D-mode", "duplicate-tag-with-other-settings": "D-duplicate",
    "new-range-without-saying-why": "D-rerange", "update-time-not-interval": "D-update", "nonlinear-option": "D-nonlinear",
    "vendor-default": "D-default", "target-refuses": "D-refused", "structure-not-stated": "D-structure", "unused": "D-unused",
    "filter-without-a-place": "D-filter",
}  # fmt: skip
"""What plants call the decisions."""


def code_named(word: str) -> RowCode:
    """Return the code with a name, or with a plant's word for it.

    Raises
    ------
    ListError
        There is none.
    """
    found = CODES.get(STOP_WORDS.get(word, word))
    if found is None:
        raise ListError(f"unknown rule '{word}'{suggest(word, [*CODES, *STOP_WORDS])}; pidemu retrofit --list-rules lists all")
    return found


def class_of(levels: list[Level]) -> RowClass:
    """Return the class of a row whose findings have these levels."""
    if "error" in levels:
        return "error"
    return "decision" if "decision" in levels else "converted"
