"""What the JSON documents of commands are made of, those that have a schema in ``specs/``."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

Number = float | Literal["inf", "-inf", "nan"]
"""JSON has no infinity: it is written as a word."""


class DocumentPart(BaseModel):
    """A part of a document; what it does not name is not in it."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)
