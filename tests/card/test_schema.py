"""The JSON Schema and the language document are current and agree with the loader."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import pidemu
from pidemu.card.load import card_from
from pidemu.card.model.card_file import CardFile
from pidemu.card.model.marks import fields_of, parts_in
from pidemu.card.reading import parse
from pidemu.card.windup import SCHEMES, Scheme
from pidemu.errors import CardError
from tools.regenerate import RENEW, card_reference, card_schema

SPECS = Path(__file__).parents[2] / "specs"


@pytest.fixture(scope="module")
def validator() -> Any:
    found = json.loads((SPECS / "card.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(found)
    return jsonschema.Draft202012Validator(found)


def changed(card_id: str, path: tuple[str, ...], value: Any) -> Any:
    """A card with one field set; sections that it does not have are added."""
    card = plain(card_id)
    here = card
    for step in path[:-1]:
        here = here.setdefault(step, {})
    here[path[-1]] = value
    return card


def plain(card_id: str) -> Any:
    return json.loads(json.dumps(pidemu.load_card(card_id).document.value))


def test_the_schema_in_the_repository_is_what_the_models_generate() -> None:
    assert (SPECS / "card.schema.json").read_text(encoding="utf-8") == card_schema.text(), RENEW


def test_the_language_document_holds_the_reference_that_the_models_generate() -> None:
    text = (SPECS / "card-language.md").read_text(encoding="utf-8")
    assert text == card_reference.updated(text), RENEW


def test_a_document_without_the_marks_is_refused() -> None:
    with pytest.raises(ValueError, match="needs the lines"):
        card_reference.updated("nothing generated here")


@pytest.mark.parametrize("card_id", pidemu.cards())
def test_every_card_obeys_the_schema(card_id: str, validator: Any) -> None:
    assert [] == [e.message for e in validator.iter_errors(plain(card_id))]


WINDUP = ("integral", "windup")
CHOICE = ("options", "FORM", "choices", "Series")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("form",), "seires"),
        (("derivative", "filter", "order"), 3),
        (WINDUP, {"scheme": "clamp", "tracking-time": 3}),
        (WINDUP, {"scheme": "back-calculation"}),
        (WINDUP, {"scheme": "sometimes"}),
        (WINDUP, {"scheme": "recompute", "tracking-time": "Ti"}),
        (WINDUP, {"scheme": "recompute", "without-derivative": "yes"}),
        (WINDUP, {"scheme": "reset-outside-band", "fast-return": {"factor": 16, "high": 95, "low": 5}}),
        (WINDUP, {"scheme": "external-reset", "fast-return": {"factor": 0.5, "high": 95, "low": 5}}),
        (WINDUP, {"scheme": "external-reset", "fast-return": {"factor": 16, "high": 95}}),
        (WINDUP, {"scheme": "conditional", "last-increment": "kept"}),
        (WINDUP, {"scheme": "freeze", "judged-on": "the sum"}),
        (WINDUP, {"scheme": "velocity", "clamped": True}),
        (("integral", "holds"), "ki"),
        (("integral", "limits"), {"low": 0}),
        (("integral", "rule"), "four-point"),
        (("derivative", "rule"), "tustin"),
        (("measurement", "filter"), {"tiem": 3}),
        (("measurement", "filter"), {"time": 3, "rule": "exact"}),
        (("error", "shape"), "cubed"),
        (("error", "over"), 0),
        (("cascade",), {}),
        (("feedforward", "summed"), "at the limits"),
        (("arithmetic",), {"type": "float16"}),
        (("arithmetic",), {"type": "integer", "counts": 0.5}),
        (("faults", "signal"), "ignore"),
        (("transfer", "start"), "smooth"),
        (("action", "fixed"), "yes"),
        (("settings", "GAIN", "sets"), "process"),
        ((*CHOICE, "form"), "standrad"),
        ((*CHOICE, "settings"), {"GAIN": {"unti": "%"}}),
        ((*CHOICE, "integral"), {"windup": {"scheme": "recompute", "implicit": True}}),
        ((*CHOICE, "integral"), {"windup": {"scheme": "reset-outside-band", "clamped": True}}),
        ((*CHOICE, "error"), {"shap": "gap"}),
        (("unknown",), 1),
    ],
    ids=str,
)
def test_the_schema_refuses_what_the_loader_refuses(path: tuple[str, ...], value: Any, validator: Any) -> None:
    card = changed("emerson/deltav", path, value)
    assert list(validator.iter_errors(card)) != []
    with pytest.raises(CardError):
        card_from(parse(json.dumps(card), "deltav.yaml"), "emerson/deltav")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (WINDUP, {"scheme": "recompute"}),
        (WINDUP, {"scheme": "recompute", "without-derivative": True, "clamped": True}),
        (WINDUP, {"scheme": "reset-outside-band"}),
        (WINDUP, {"scheme": "external-reset", "fast-return": {"factor": 16, "high": 95, "low": "ARW_LO_LIM"}}),
        (WINDUP, {"scheme": "conditional", "last-increment": "dropped"}),
        (WINDUP, {"scheme": "freeze", "judged-on": "sum", "direction": "both"}),
        (WINDUP, {"scheme": "back-calculation", "tracking-time": 0.5, "times": "Ti", "implicit": True}),
        (("integral", "limits"), {"low": "output", "high": 5}),
        (("integral", "limits"), {"low": "-inf", "high": 3}),
        (("derivative", "rule"), "four-point"),
        (("measurement",), {"filter": {"factor": 0.5}, "previous-scan": True}),
        (("error",), {"shape": "gap", "band": 2, "zero-crossing": True}),
        (("cascade", "proportional"), {"on": "pv"}),
        (("faults",), {"signal": "nan", "negative-interval": "refuse"}),
        ((*CHOICE, "integral"), {"windup": {"scheme": "recompute", "clamped": True}}),
        ((*CHOICE, "integral"), {"windup": {"scheme": "reset-outside-band"}, "limits": {"high": "output"}}),
        ((*CHOICE, "measurement"), {"filter": {"time": 3}}),
        ((*CHOICE, "error"), None),
        ((*CHOICE, "arithmetic"), {"type": "float32"}),
    ],
    ids=str,
)
def test_the_schema_takes_what_the_loader_takes(path: tuple[str, ...], value: Any, validator: Any) -> None:
    card = changed("emerson/deltav", path, value)
    assert [] == [e.message for e in validator.iter_errors(card)]
    card_from(parse(json.dumps(card), "deltav.yaml"), "emerson/deltav")


def test_no_union_is_left_that_an_editor_would_ignore() -> None:
    text = card_schema.text()
    assert "discriminator" not in text
    assert "oneOf" not in text


def test_every_field_of_the_language_has_a_description() -> None:
    for line in card_reference.reference().splitlines():
        if line.startswith("| `"):
            assert line.rstrip("| ").split("|")[-1].strip() not in ("", "None"), line


def test_every_line_of_the_reference_s_tables_has_four_cells() -> None:
    lines = [line for line in card_reference.reference().splitlines() if line.startswith("|")]
    assert [line for line in lines if line.replace("\\|", "").count("|") != 5] == []


def test_every_part_of_the_language_is_in_the_reference() -> None:
    headings = {
        line.removeprefix("### ").lower().replace(" ", "-") for line in card_reference.reference().splitlines() if line[:3] == "###"
    }
    linked = set(re.findall(r"\(#([a-z-]+)\)", card_reference.reference()))
    assert linked <= headings
    parts = {part.__name__.lower() for part in all_parts(CardFile)}
    assert parts | {"equation"} == {heading.replace("-", "") for heading in headings - {"card"} | {"cardfile"}}


def all_parts(part: type[Any]) -> set[type[Any]]:
    """The part and all that its fields name, of the windup schemes all."""
    inner = {p for field in fields_of(part).values() for p in parts_in(field.annotation)}
    named = inner - {Scheme} | (set(SCHEMES) if Scheme in inner else set())
    return {part}.union(*(all_parts(p) for p in named))
