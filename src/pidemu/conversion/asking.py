"""Asking: what each answer to a question would give, and the error that holds it (specs/equations.md, section 9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

from pidemu.card.load import Card
from pidemu.card.model.base import Form
from pidemu.conversion.command import words_for
from pidemu.conversion.modes import depends_on_mode
from pidemu.conversion.options import Attempt
from pidemu.conversion.questions import Answer, Question
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.request import DIGITS, Request
from pidemu.conversion.spans import range_questions, rescaling
from pidemu.conversion.unstated import Alternative, Open
from pidemu.errors import PidemuError
from pidemu.settings.action import carried_action, check_action
from pidemu.settings.range_relation import RangeQuestion
from pidemu.settings.settings import Settings
from pidemu.units import Role


def ask(questions: Sequence[Question], source: Settings, card: Card, request: Request) -> None:
    """Raise the questions with what their answers would give, unless the defaults are to be taken.

    Raises
    ------
    QuestionError
        There are questions; or one is about a contradiction, which no default settles.
    """
    if any(q.kind == "action" for q in questions) or (questions and not request.assume):
        raise QuestionError(
            [replace(q, readings=tuple(_worked_out(a, source, card, request) for a in q.readings)) for q in questions]
        )


def taken_for_granted(questions: Sequence[Question], source: Settings) -> tuple[Open, ...]:
    """Return what is taken where the user wants no questions: the first reading of each."""
    first = [(q, q.readings[0]) for q in questions if q.readings]
    return tuple(Open(q.kind, q.about, Alternative(answer.value, source, {}), asked=True) for q, answer in first)


def _worked_out(answer: Answer, source: Settings, card: Card, request: Request) -> Answer:
    """Return an answer with its conversion, and the command that states it."""
    from pidemu.conversion.convert import converted  # a question is answered by converting

    try:
        read = replace(source.changed(answer.given), pace=1.0) if answer.given else replace(source, pace=1.0)
        stated: dict[str, Any] = dict(answer.asked)
        asked = replace(request, **{**stated, "assume": True, "digits": request.digits or DIGITS})
        command = words_for(read, card, replace(request, **stated))
    except PidemuError as error:
        return replace(answer, outcome=str(error))
    try:
        return replace(answer, command=command, conversion=converted(read, card, asked, emulate=False))
    except ConversionRefusedError as refusal:
        return replace(answer, command=command, outcome=f"refused: {refusal}")
    except PidemuError as error:
        return replace(answer, command=command, outcome=str(error))


def action_questions(source: Settings, request: Request) -> list[Question]:
    """Return the question for the action, where what was stated contradicts the sign of the source's gains."""
    text = check_action(source, request.action)
    carried = carried_action(source)
    if not text or carried is None or request.action is None:
        return []
    signed = _SIGNED[source.equation.form is Form.PARALLEL]
    turned = {n: -v.value for n, v in source.items() if v.value and v.role in signed and (v.given or not v.off)}
    return [
        Question(
            "action",
            "action",
            f"{source.card.id}: {text}. Which is right?",
            (
                Answer(carried, "the signs of the gains are right", asked={"action": carried}),
                Answer(request.action, "the action is right, the gains have the other sign", given=turned),
            ),
        )
    ]


_SIGNED: Final = {False: (Role.GAIN,), True: (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)}
"""Dials that carry the sign, of a parallel form and of the others."""


def scale_questions(source: Settings, request: Request) -> list[Question]:
    """Return what is not clear of two ranges of one signal: the same signal on another scale, or another range of it."""
    return [
        _of_range(
            source,
            found,
            tuple(
                Answer(
                    f"{reading.source.argument} to {reading.target.argument}",
                    reading.text,
                    given={found.about: reading.source},
                    asked={f"to_{found.about}": reading.target},
                )
                for reading in found.readings
            ),
        )
        for found in rescaling(source, request.to_pv_range, request.to_op_range).questions
    ]


def missing_ranges(source: Settings, settings: Settings) -> list[Question]:
    """Return what has to be known of ranges that were not given and that would change a dial."""
    return [
        _of_range(source, found, (Answer("0 to 100", f"or give it: {found.example}", given={found.about: (0, 100)}),))
        for found in range_questions(source, settings)
        if not (found.about == "op_range" and _output_is_percent(source, settings))
    ]


def _output_is_percent(*both: Settings) -> bool:
    """Whether controllers that compute in engineering units have their output in percent, by the limits that their cards state."""
    limits = [s.equation.output.limits for s in both if s.equation.signals == "engineering"]
    return bool(limits) and all(low >= _PERCENT[0] and high <= _PERCENT[1] and high - low >= 100 for low, high in limits)


_PERCENT: Final = (-10.0, 110.0)
"""Between these output limits in percent lie."""


def _of_range(source: Settings, found: RangeQuestion, answers: tuple[Answer, ...]) -> Question:
    return Question(found.kind, found.about, f"{source.card.id}: {found.text}", answers)


def mode_is_open(source: Settings, ranking: Sequence[Attempt], request: Request) -> bool:
    """Whether the source is another equation in cascade, both modes count, and no choice of the target holds in both."""
    if request.mode != "both" or not depends_on_mode(source):
        return False
    return all(attempt.merit is None or attempt.merit.setpoint for attempt in ranking)


def mode_question(source: Settings) -> Question:
    """Return the question for the mode in which a loop runs."""
    text = (
        f"{source.card.id}: the equation depends on the mode (in cascade other terms see the setpoint than in automatic), and no "
        "choice of the target's options does the same in both. In which mode does the loop run?"
    )
    return Question(
        "mode",
        "mode",
        text,
        (
            Answer("auto", "the operator sets the setpoint", asked={"mode": "auto"}),
            Answer("cascade", "another controller sets the setpoint", asked={"mode": "cascade"}),
        ),
    )
