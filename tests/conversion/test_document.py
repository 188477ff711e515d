"""What ``--json`` prints: every outcome has the form that specs/conversion.schema.json states, and holds what it was made from."""

from __future__ import annotations

import copy
import hashlib
import json
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import pidemu
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.process.process import Process
from tests.cli.helpers import said, strict_json
from tests.conversion.commands import CONVERSIONS, OTHERS
from tests.helpers import copied
from tools.regenerate import RENEW, conversion_schema
from tools.regenerate.pages import ROOT

SCHEMA = json.loads((ROOT / "specs" / "conversion.schema.json").read_text(encoding="utf-8"))
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
DAY = date(2026, 7, 1)


@cache
def printed(*words: str) -> Any:
    return strict_json(said("convert", *words, "--json").out)


def fault(plain: Any) -> str:
    """Return what the schema says against a document; empty where it has the form."""
    error = jsonschema.exceptions.best_match(VALIDATOR.iter_errors(plain))
    return "" if error is None else f"{list(error.absolute_path)}: {error.message}"


def test_the_schema_is_a_schema_and_is_the_one_that_the_models_make() -> None:
    VALIDATOR.check_schema(SCHEMA)
    assert (ROOT / "specs" / "conversion.schema.json").read_text(encoding="utf-8") == conversion_schema.text(), RENEW


@pytest.mark.parametrize("name", CONVERSIONS)
def test_every_conversion_has_the_form(name: str) -> None:
    plain = printed(*CONVERSIONS[name])
    assert plain["verdict"] in ("exact", "exact-feedback", "approximate")
    assert fault(plain) == ""


@pytest.mark.parametrize("name", OTHERS)
def test_questions_and_refusals_have_the_form(name: str) -> None:
    plain = printed(*OTHERS[name])
    assert (plain["schema"], plain["verdict"]) == ("pidemu-conversion-1", name)
    assert fault(plain) == ""


def test_the_errors_of_python_have_the_form_too() -> None:
    with pytest.raises(QuestionError) as asked:
        pidemu.convert(pidemu.load_card("honeywell/tdc3000").settings(K=2, T1=1, T2=0.1), "emerson/deltav")
    assert fault(asked.value.to_dict()) == ""
    assert asked.value.to_dict()["questions"] == printed(*OTHERS["question"])["questions"]
    with pytest.raises(ConversionRefusedError) as refused:
        pidemu.convert(pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=4), "fisher/provox")
    assert fault(refused.value.to_dict()) == ""
    assert refused.value.to_dict()["reason"] == printed(*OTHERS["refused"])["reason"]


def test_whatever_is_not_in_the_form_is_refused() -> None:
    plain = printed(*CONVERSIONS["all figures"])
    changes: list[tuple[tuple[Any, ...], Any]] = [
        (("schema",), "pidemu-conversion-2"),
        (("more",), 1),
        (("verdict",), "perfect"),
        (("to", "settings", "GAIN", "value"), "2"),
        (("to", "settings", "GAIN", "value"), None),
        (("cards", "emerson/deltav"), "1.0"),
        (("request", "scan"), [1.0]),
        (("request", "more"), 1),
        (("certificate", "feedback", "loop_band", "gain_db"), "much"),
        (("certificate", "feedback", "more"), 1),
        (("conditions", 0, "status"), "documented"),
        (("transfer_plan", "bump"), None),
    ]
    for path, value in changes:
        bad = copy.deepcopy(plain)
        place = bad
        for step in path[:-1]:
            place = place[step]
        place[path[-1]] = value
        assert fault(bad) != "", path
    for key in plain:
        if key != "transfer_plan":  # only with --cut-over
            assert fault({k: v for k, v in plain.items() if k != key}) != "", key


def test_date_and_versions_are_in_it() -> None:
    s = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4)
    plain = pidemu.convert(s, "emerson/deltav", emulate=False).to_dict(DAY)
    assert (plain["date"], plain["pidemu"]) == ("2026-07-01", pidemu.__version__)
    files = {card: Path(pidemu.load_card(card).document.path) for card in ("fisher/provox", "emerson/deltav")}
    assert plain["cards"] == {card: hashlib.sha256(file.read_bytes()).hexdigest() for card, file in files.items()}
    assert pidemu.convert(s, "emerson/deltav", emulate=False).to_dict()["date"] == date.today().isoformat()


def test_a_card_has_the_same_version_whatever_its_line_ends_are(tmp_path: Path) -> None:
    text = copied(Path(pidemu.load_card("generic/series").document.path)).encode()
    for name, written in (("unix", text), ("windows", text.replace(b"\n", b"\r\n"))):
        (tmp_path / "generic").mkdir(exist_ok=True)
        (tmp_path / "generic" / f"{name}.yaml").write_bytes(written)
    digests = {pidemu.load_card(tmp_path / "generic" / f"{name}.yaml").digest for name in ("unix", "windows")}
    assert digests == {hashlib.sha256(text).hexdigest()}


def test_everything_asked_is_in_it_by_the_names_of_the_arguments() -> None:
    source = pidemu.load_card("generic/standard").settings(
        K=2, Ti="0.5 min", pv_range=(0, 100, "degC"), op_range="0,50 V = 0..100 %"
    )
    asked: dict[str, Any] = {
        "options": {"FORM": "Standard"}, "given": {"ALPHA": 0.2}, "scan": (0.2, 0.5), "runs_every": (0.02, 0.5), "mode": "auto",
        "action": "direct", "to_pv_range": "0,200 degC", "to_op_range": "0,50 V = 0,100 %", "match": "low-frequency",
        "process": Process.from_lags(-0.8, lags=[20.0], delay=3), "compensate": True, "digits": 4, "allow_approximate": True,
        "assume": True, "tag": "TIC-101", "bias": 40.0, "limits": (5.0, 95.0),
    }  # fmt: skip
    request = pidemu.convert(source, "emerson/deltav", emulate=False, **asked).to_dict()["request"]
    assert request == {
        "from": {
            "card": "generic/standard", "settings": {"K": 2.0, "Ti": "0.5 min"}, "options": {}, "pv_range": "0,100 degC",
            "op_range": "0,50 V = 0,100 %", "lag_on_pv": 0.0,
        },
        "to": "emerson/deltav", **asked, "scan": [0.2, 0.5], "runs_every": [0.02, 0.5], "limits": [5.0, 95.0],
        "process": "gain=-0.8,lag=20,delay=3",
    }  # fmt: skip
