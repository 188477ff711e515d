"""The JSON Schemas of what ``pidemu fit --json`` and ``pidemu relay --json`` print, in ``specs/``."""

from __future__ import annotations

import json
from typing import Any

from pydantic import BaseModel, RootModel

from pidemu.process import relay_document
from pidemu.process.fit import document
from tools.regenerate.conversion_schema import without_titles


class FitOutcome(RootModel[document.FitDocument | document.FitRefusal]):
    """What ``pidemu fit --json`` prints."""


def fit_text() -> str:
    """Return the file of the schema of a fit."""
    return _text(FitOutcome, document.SCHEMA)


def relay_text() -> str:
    """Return the file of the schema of a relay experiment."""
    return _text(relay_document.RelayDocument, relay_document.SCHEMA)


def _text(model: type[BaseModel], title: str) -> str:
    plain: dict[str, Any] = model.model_json_schema(by_alias=True, mode="serialization")
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    found = without_titles({**head, **{k: v for k, v in plain.items() if k != "title"}}, title)
    return json.dumps(found, indent=2, ensure_ascii=False) + "\n"
