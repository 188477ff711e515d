"""The JSON Schema of what ``pidemu fit --json`` prints: ``specs/fit.schema.json``."""

from __future__ import annotations

import json
from typing import Any

from pydantic import RootModel

from pidemu.process.fit.document import SCHEMA, FitDocument, FitRefusal
from tools.regenerate.conversion_schema import without_titles


class Outcome(RootModel[FitDocument | FitRefusal]):
    """What ``pidemu fit --json`` prints."""


def text() -> str:
    """Return the schema's file."""
    plain: dict[str, Any] = Outcome.model_json_schema(by_alias=True, mode="serialization")
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": SCHEMA}
    found = without_titles({**head, **{k: v for k, v in plain.items() if k != "title"}}, SCHEMA)
    return json.dumps(found, indent=2, ensure_ascii=False) + "\n"
