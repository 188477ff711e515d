"""Questions in print: each with its readings, what they give, and the commands that answer it."""

from __future__ import annotations

from pidemu.cli.common import echo, number, print_json
from pidemu.conversion.document import question_document
from pidemu.conversion.questions import Question
from pidemu.conversion.refused import QuestionError
from pidemu.conversion.result import Conversion
from pidemu.conversion.target.computed import is_computed
from pidemu.settings.settings import Settings


def print_questions(error: QuestionError, source: Settings | None, goal: str, as_json: bool) -> None:
    """Print what has to be answered first: on stderr, with ``--json`` on stdout."""
    if as_json:
        known = {} if source is None else {"from": source.to_dict(), "to": {"card": goal}}
        print_json(question_document(error, known))
        echo(f"question: {error}", err=True)
        return
    for question in error.questions:
        _print(question)
    if source is not None and all(q.readings and q.kind != "action" for q in error.questions):
        echo("\n--assume takes the first reading of each question, and says so.", err=True)


def _print(question: Question) -> None:
    echo(f"question: {question.text}", err=True)
    for k, answer in enumerate(question.readings, start=1):
        says = f" ({answer.says})" if answer.says else ""
        echo(f"\n{k}. {answer.value}{says}", err=True)
        for text in answer.alike:
            echo(f"   or {text}", err=True)
        if answer.conversion is not None:
            echo(f"   -> {dials_line(answer.conversion)}", err=True)
            echo(f"   {answer.conversion.verdict}", err=True)
        elif answer.outcome:
            echo(f"   {answer.outcome}", err=True)
        if answer.command:
            echo(f"   {answer.command}", err=True)


def dials_line(c: Conversion) -> str:
    """Return a target's settings and options in one line."""
    s = c.settings
    dials = [
        f"{name} = {number(v.value)} {v.unit}".removesuffix(" 1")
        for name, v in s.items()
        if v.active and (is_computed(s.equation, name, v.role) or not v.off)
    ]
    return f"{s.card.id}: {', '.join(dials)}" + (f" [{s.variant.choice_text}]" if s.options else "")
