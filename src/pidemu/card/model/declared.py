"""What a field of the card language declares for pydantic: what it means, and which values it takes.

pydantic takes longer to import than most commands run, and is needed only where a card is read that was not compiled before. These
declarations import it when it opens them, as groups of annotations, by the protocol of `annotated_types.GroupedMetadata`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Literal


class Declaration:
    """Base of declarations: a group that pydantic opens."""

    __slots__ = ()
    __is_annotated_types_grouped_metadata__: ClassVar[Literal[True]] = True

    def __iter__(self) -> Iterator[Any]:
        """Yield what pydantic makes of it."""
        raise NotImplementedError


class Means(Declaration):
    """What a field means, for the reference and the JSON Schema.

    Parameters
    ----------
    text : str
        The sentences.
    """

    __slots__ = ("text",)

    def __init__(self, text: str) -> None:
        self.text = text

    def __iter__(self) -> Iterator[Any]:
        """Yield the description."""
        yield self

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        return {**handler(core_schema), "description": self.text}


class Only(Declaration):
    """Which values of its type a field takes.

    Parameters
    ----------
    before, after : callable, optional
        What is done to a value before and after it is held against its type; it raises a `refusal`.
    schema : dict, optional
        The JSON Schema, where that is not the type's.
    **limits
        Limits, as `pydantic.Field` has them.
    """

    __slots__ = ("after", "before", "limits", "schema")

    def __init__(
        self,
        *,
        before: Callable[[Any], Any] | None = None,
        after: Callable[[Any], Any] | None = None,
        schema: dict[str, Any] | None = None,
        **limits: Any,
    ) -> None:
        self.before, self.after, self.schema, self.limits = before, after, schema, limits

    def __repr__(self) -> str:
        return f"Only({', '.join(f'{name}={value!r}' for name, value in self.limits.items())})"

    def __iter__(self) -> Iterator[Any]:
        """Yield the limits and what is called."""
        from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

        yield from Field(**self.limits).metadata
        if self.before is not None:
            yield BeforeValidator(self.before)
        if self.after is not None:
            yield AfterValidator(self.after)
        if self.schema is not None:
            yield WithJsonSchema(self.schema)


class ByScheme(Declaration):
    """One of several parts, told apart by their key ``scheme``."""

    __slots__ = ()

    def __iter__(self) -> Iterator[Any]:
        """Yield what tells them apart."""
        from pydantic import Discriminator

        yield Discriminator("scheme")


def refusal(kind: str, message: str) -> ValueError:
    """Return the error of a value that a field does not take.

    Parameters
    ----------
    kind : str
        What `pidemu.card.validation` knows it by.
    message : str
        What is said of it.
    """
    from pydantic_core import PydanticCustomError

    return PydanticCustomError(kind, "{message}", {"message": message})
