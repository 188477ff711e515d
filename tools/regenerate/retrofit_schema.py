"""The JSON Schema of what ``pidemu retrofit --json`` prints, in ``specs/``."""

from __future__ import annotations

import json
from typing import Any

from pidemu.plant.document import SCHEMA, RetrofitDocument
from tools.regenerate.conversion_schema import without_titles


def text() -> str:
    """Return the file of the schema of a job."""
    plain: dict[str, Any] = RetrofitDocument.model_json_schema(by_alias=True, mode="serialization")
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": SCHEMA}
    found = without_titles({**head, **{k: v for k, v in plain.items() if k != "title"}}, SCHEMA)
    return json.dumps(found, indent=2, ensure_ascii=False) + "\n"
