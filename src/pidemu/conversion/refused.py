"""What `pidemu.convert` raises where it has no answer: a refusal, with what comes nearest, or questions."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pidemu.errors import PidemuError

if TYPE_CHECKING:
    from pidemu.conversion.questions import Question
    from pidemu.conversion.result import Conversion


class ConversionRefusedError(PidemuError):
    """The target cannot reproduce the source.

    Attributes
    ----------
    nearest : Conversion or None
        The nearest settings inside the target's ranges, with the certificate that states their cost;
        ``None`` where the target has no settings that come near.
    alternatives : tuple of str
        What could do instead, such as another block or option.
    """

    def __init__(self, message: str, nearest: Conversion | None = None, alternatives: Iterable[str] = ()) -> None:
        super().__init__(message)
        self.nearest = nearest
        self.alternatives = tuple(alternatives)

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values, the form of ``pidemu convert --json``."""
        from pidemu.conversion.document import refusal_document

        return refusal_document(self)


class QuestionError(ConversionRefusedError):
    """What was given can mean several things, and the result depends on which.

    Attributes
    ----------
    questions : tuple of Question
        What to answer, each with its readings, what they would give, and their commands.
    """

    def __init__(self, questions: Iterable[Question]) -> None:
        self.questions = tuple(questions)
        super().__init__("\n".join(q.text for q in self.questions))

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values, the form of ``pidemu convert --json``."""
        from pidemu.conversion.document import question_document

        return question_document(self)
