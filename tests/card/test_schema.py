"""The JSON Schema and the language document are current and agree with the loader."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import pidemu
from pidemu.card import schema

SPECS = Path(__file__).parents[2] / "specs"


@pytest.fixture(scope="module")
def validator() -> Any:
    found = json.loads((SPECS / "card.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(found)
    return jsonschema.Draft202012Validator(found)


def plain(card_id: str) -> Any:
    return json.loads(json.dumps(pidemu.load_card(card_id).document.value))


def test_the_schema_in_the_repository_is_what_the_models_generate() -> None:
    assert (SPECS / "card.schema.json").read_text(encoding="utf-8") == schema.schema_text()


def test_the_language_document_holds_the_reference_that_the_models_generate() -> None:
    text = (SPECS / "card-language.md").read_text(encoding="utf-8")
    assert text == schema.updated(text)


def test_a_document_without_the_marks_is_refused() -> None:
    with pytest.raises(ValueError, match="needs the lines"):
        schema.updated("nothing generated here")


@pytest.mark.parametrize("card_id", pidemu.cards())
def test_every_card_obeys_the_schema(card_id: str, validator: Any) -> None:
    assert [] == [e.message for e in validator.iter_errors(plain(card_id))]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("form",), "seires"),
        (("derivative", "filter", "order"), 3),
        (("integral", "windup"), {"scheme": "clamp", "tracking-time": 3}),
        (("integral", "windup"), {"scheme": "back-calculation"}),
        (("integral", "windup"), {"scheme": "sometimes"}),
        (("options", "FORM", "choices", "Series", "form"), "standrad"),
        (("options", "FORM", "choices", "Series", "settings"), {"GAIN": {"unti": "%"}}),
        (("unknown",), 1),
    ],
)
def test_the_schema_refuses_what_the_loader_refuses(path: tuple[str, ...], value: Any, validator: Any) -> None:
    card = plain("emerson/deltav")
    here = card
    for step in path[:-1]:
        here = here[step]
    here[path[-1]] = value
    assert list(validator.iter_errors(card)) != []


def test_no_union_is_left_that_an_editor_would_ignore() -> None:
    text = schema.schema_text()
    assert "discriminator" not in text
    assert "oneOf" not in text


def test_every_field_of_the_language_has_a_description() -> None:
    for line in schema.reference().splitlines():
        if line.startswith("| `"):
            assert line.rstrip("| ").split("|")[-1].strip() not in ("", "None"), line
