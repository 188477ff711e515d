"""Settings that can be read in several ways, as a question: every reading with its result, and none chosen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NoReturn

from pidemu.card.load import Card
from pidemu.cli.common import number
from pidemu.cli.questions import print_questions
from pidemu.conversion.ambiguity.readings import Apart, Reading, apart, command_line
from pidemu.conversion.convert import convert
from pidemu.conversion.questions import Answer, Question
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.request import read_request
from pidemu.conversion.result import Conversion


def refuse_to_choose(
    found: Sequence[Reading],
    goal: Card,
    arguments: Mapping[str, Any],
    *,
    to: str,
    as_json: bool = False,
) -> NoReturn:
    """Print every reading with the result of its conversion, refuse to choose, and exit with status 1.

    Parameters
    ----------
    found : sequence of Reading
        The readings, two at least.
    goal : Card
        The target.
    arguments : mapping
        What else `convert` is to be given, by name.
    to : str
        The target as the user named it, for the commands that state a reading.
    as_json : bool
        Print JSON on stdout, and the question alone on stderr.

    Raises
    ------
    SystemExit
        Always, with status 1.
    """
    words = command_line(["--to", to, *read_request(goal, **arguments).words()])
    answers = tuple(_answer(reading, goal, arguments, words) for reading in found)
    text = f"these settings can be read in {len(found)} ways. {_how_far(apart(found))} Which is meant?"
    names = {r.settings.card.id for r in found}
    question = Question("unit" if len(names) == 1 else "option", "settings" if len(names) == 1 else "card", text, answers)
    print_questions(QuestionError([question]), None, goal.id, as_json)
    raise SystemExit(1)


def _answer(reading: Reading, goal: Card, arguments: Mapping[str, Any], words: str) -> Answer:
    answer = Answer(reading.text, command=f"pidemu convert {reading.command} {words}", alike=reading.alike)
    result = _result(reading, goal, arguments)
    return replace(answer, outcome=f"refused: {result}") if isinstance(result, str) else replace(answer, conversion=result)


def _result(reading: Reading, goal: Card, arguments: Mapping[str, Any]) -> Conversion | str:
    try:
        return convert(reading.settings, goal, **{**arguments, "assume": True})
    except (ConversionRefusedError, QuestionError) as error:
        return str(error)


def _how_far(far: Apart) -> str:
    if math.isinf(far.integral):
        return "Not all of them have integral action."
    if far.integral > 1 + 1e-9:
        return f"Their integral gains are apart by a factor of up to {far.integral:.3g}."
    deviation = f"up to {number(100 * far.deviation, 2)} %" if far.deviation < 10 else "over 1000 %"
    return f"Their integral gains are the same; their laws for measurement differ by {deviation} in the loop band."
