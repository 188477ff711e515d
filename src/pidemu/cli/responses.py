"""What the commands that simulate loops share: other controllers by their words, and the figures of responses."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

from pidemu.card.library import load_card
from pidemu.cli.common import assignments, heading, number, table
from pidemu.errors import SettingError
from pidemu.excerpt import quoted
from pidemu.formatting import json_safe
from pidemu.settings.settings import Settings
from pidemu.simulation.response import UNITS, ResponseFigures
from pidemu.simulation.trial import Step

_RESPONSES: Final = {
    "size": "step",
    "ie": "IE",
    "iae": "IAE",
    "ise": "ISE",
    "itae": "ITAE",
    "largest_error": "largest error, or overshoot",
    "overshoot": "overshoot",
    "decay_ratio": "decay ratio",
    "rise_time": "rise time, 10 to 90 %",
    "settling_time": "settling time, 5 %",
    "peak_output": "largest move of the output",
    "travel": "travel of the output",
    "last_error": "last error",
}


def controller_in_words(option: str, words: str, vendors: tuple[str, ...]) -> Settings:
    """Return the settings of another controller, as they stand behind an option."""
    try:
        card, *values = shlex.split(words)
    except ValueError:  # an open quotation mark, or nothing
        raise SettingError(f"{option} '{quoted(words)}' is not a card with settings; write \"CARD NAME=VALUE...\"") from None
    return load_card(card, vendors).settings(assignments(values))


def name_of(settings: Settings) -> str:
    """Return what a controller is called beside others: card, the dials that were given, the options that are off their default."""
    said = [f"{name} {number(value.value)}" for name, value in settings.items() if value.given and value.active]
    said += [f"{name}={choice}" for name, choice in settings.options.items() if choice != settings.card.options[name][0]]
    return f"{settings.card.id}: {', '.join(said)}" if said else settings.card.id


def print_responses(responses: Sequence[ResponseFigures], title: str) -> None:
    """Print the figures of responses as a table, a column for each."""
    if responses:
        heading(title)
        names = [name for name in UNITS if any(not math.isnan(getattr(r, name)) for r in responses)]
        rows = [[_RESPONSES[name], *(short(getattr(r, name)) for r in responses), UNITS[name]] for name in names]
        table(["", *(r.step for r in responses), ""], rows, right=tuple(range(1, len(responses) + 1)))


def plain_responses(responses: Sequence[ResponseFigures]) -> list[dict[str, Any]]:
    """Return the figures of responses as plain values."""
    told: list[dict[str, Any]] = json_safe([asdict(response) for response in responses])
    return told


def step_text(step: Step | None, duration: float = 0.0) -> str:
    """Return when and how far something moves, in words."""
    if step is None:
        return "none"
    over = f", along a ramp of {number(duration)} s" if duration else ""
    return f"{number(step[1])} % at {number(step[0])} s{over}"


def short(x: float) -> str:
    """Return a figure in four digits."""
    return "-" if math.isnan(x) else number(x, 4)
