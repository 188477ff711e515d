"""What a job writes: JSON by its schema, CSV and workbook cell by cell, the exception report in the order of risk."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from click.testing import CliRunner, Result

from pidemu.cli import cli
from tests.plant.lists import run_one, write_list
from tests.plant.scoring import DATA, MAP, RULES
from tools.regenerate import retrofit_schema

ROOT = Path(__file__).parents[2]


def job(*words: str) -> Result:
    return CliRunner().invoke(cli, ["retrofit", *words])


def small(folder: Path, *more: str) -> Path:
    done = job(str(DATA / "plant_small.csv"), "--map", str(MAP), "--rules", str(RULES), "--out", str(folder), *more)
    assert done.exit_code == 1, done.output
    return folder


def table(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_the_schema_is_that_of_the_models() -> None:
    assert (ROOT / "specs" / "retrofit.schema.json").read_text("utf-8") == retrofit_schema.text()


def test_a_job_is_written_as_its_schema_says(tmp_path: Path) -> None:
    document = json.loads((small(tmp_path, "--no-workbook") / "job.json").read_text("utf-8"))
    jsonschema.validate(document, json.loads(retrofit_schema.text()))
    assert document["summary"]["counts"] == {"converted": 24, "decision": 13, "error": 3, "skipped": 15}
    assert {"sheet", "row", "tag", "class", "codes", "settings", "options", "verdict"} <= set(document["rows"][0])
    assert document["made_with"]["decisions"] == ""
    assert len(document["made_with"]["rules"]) == 64


def test_json_on_the_screen_is_the_file(tmp_path: Path) -> None:
    words = [str(DATA / "plant_small.csv"), "--map", str(MAP), "--rules", str(RULES)]
    done = job(*words, "--json", "--out", str(tmp_path), "--no-workbook")
    assert json.loads(done.stdout) == json.loads((tmp_path / "job.json").read_text("utf-8"))


def test_the_files_account_for_every_loop(tmp_path: Path) -> None:
    small(tmp_path, "--no-workbook")
    converted, decide = table(tmp_path / "converted.csv"), table(tmp_path / "decisions.csv")
    assert len(converted) == 24
    assert {line["tag"] for line in decide} | {line["tag"] for line in converted} | {
        line["tag"] for line in table(tmp_path / "errors.csv")
    } == {row["tag"] for row in json.loads((tmp_path / "job.json").read_text("utf-8"))["rows"]}
    first = converted[0]
    assert {n: first[n] for n in ("tag", "area", "GAIN", "RESET", "FORM", "verdict", "source I as found", "row")} == {
        "tag": "TIC-7002", "area": "100", "GAIN": "3.1", "RESET": "545.4", "FORM": "Series", "verdict": "exact",
        "source I as found": "9,09 min/repeat (unit column)", "row": "5",
    }  # fmt: skip
    assert len(table(tmp_path / "skipped.csv")) == 15


def test_the_decisions_file_is_filled_in_and_read_back(tmp_path: Path) -> None:
    small(tmp_path, "--no-workbook")
    lines = table(tmp_path / "decisions.csv")
    assert [line["rule"] for line in lines][:3] == ["D-refused", "D-duplicate", "D-duplicate"]
    doubt = next(line for line in lines if line["tag"] == "FIC-7017")
    assert (doubt["reading A"], doubt["result A"]) == (
        "min/repeat: 3.7 is an integral time in minutes", "GAIN 0.47, RESET 222, RATE 0 (exact)",
    )  # fmt: skip
    doubt.update(answer="min/repeat", name="M. Roth")
    answered = tmp_path / "answered.csv"
    with answered.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(lines[0]))
        writer.writeheader()
        writer.writerows(lines)
    words = [str(DATA / "plant_small.csv"), "--map", str(MAP), "--rules", str(RULES), "--decisions", str(answered), "--json"]
    rows = json.loads(job(*words).stdout)["rows"]
    row = next(row for row in rows if row["tag"] == "FIC-7017")
    assert (row["class"], row["settings"]["RESET"], row["decided"][0]["name"]) == ("converted", 222.0, "M. Roth")


def test_the_exception_report_begins_with_the_counts_and_goes_on_by_risk(tmp_path: Path) -> None:
    lines = (small(tmp_path, "--no-workbook") / "exceptions.txt").read_text("utf-8").splitlines()
    assert lines[0] == "40 loops: 24 converted (18 exact), 13 to decide, 3 errors; 15 other lines"
    assert [line.split(".")[0] for line in lines if line[:1].isdigit() and ". " in line[:4]] == [
        "1",
        "2",
        "3",
        "4",
        "5",
        "6",
        "7",
        "8",
        "10",
    ]
    doubts = [line.split()[0] for line in lines[lines.index(next(x for x in lines if x.startswith("4. "))) :] if " D-unit " in line]
    assert doubts == ["TIC-7019", "FIC-7017", "FIC-7074"]  # by the ratio between the readings: 16, 13.7, 6.25


def test_the_same_input_makes_the_same_bytes(tmp_path: Path) -> None:
    pytest.importorskip("xlsxwriter")
    one, other = (small(tmp_path / name) for name in ("one", "other"))
    for file in sorted(one.iterdir()):
        assert file.read_bytes() == (other / file.name).read_bytes(), file.name


def test_the_workbook_holds_what_the_json_holds(tmp_path: Path) -> None:
    calamine: Any = pytest.importorskip("python_calamine")
    pytest.importorskip("xlsxwriter")
    document = json.loads((small(tmp_path) / "job.json").read_text("utf-8"))
    book = calamine.CalamineWorkbook.from_path(str(tmp_path / "workbook.xlsx"))
    assert book.sheet_names == [
        "Summary", "Converted", "Decide", "Errors", "Unchanged or unused", "Assumptions", "Sources", "Skipped lines",
    ]  # fmt: skip
    header, *lines = book.get_sheet_by_name("Converted").to_python()
    found = {line[0]: dict(zip(header, line, strict=True)) for line in lines}
    converted = [row for row in document["rows"] if row["class"] == "converted"]
    assert set(found) == {row["tag"] for row in converted}
    for row in converted:
        line = found[row["tag"]]
        assert {n: line[n] for n in row["settings"]} == row["settings"]
        assert (line["verdict"], line["sheet"], line["row"]) == (row["verdict"], row["sheet"], row["row"])
    for name, kind in (("Decide", "decision"), ("Errors", "error")):
        _, *lines = book.get_sheet_by_name(name).to_python()
        assert {line[0] for line in lines} == {row["tag"] for row in document["rows"] if row["class"] == kind}
    assert len(book.get_sheet_by_name("Skipped lines").to_python()) == 1 + len(document["skipped"])


@pytest.mark.parametrize("text", ["=1+1", "+A1", "-x", "@SUM(A1)", "\t=1", '=HYPERLINK("http://x")'])
def test_text_never_becomes_a_formula(text: str, tmp_path: Path) -> None:
    calamine: Any = pytest.importorskip("python_calamine")
    pytest.importorskip("xlsxwriter")
    file = write_list(tmp_path, {"Service": text.replace('"', '""')})
    done = job(str(file), "--to", "emerson/deltav", "--out", str(tmp_path / "job"))
    assert done.exit_code == 0, done.output
    header, line = (
        calamine.CalamineWorkbook.from_path(str(tmp_path / "job" / "workbook.xlsx")).get_sheet_by_name("Converted").to_python()
    )
    assert str(line[header.index("service")]).strip() == text.strip()
    assert table(tmp_path / "job" / "converted.csv")[0]["service"][0] == "'"


def test_the_status_tells_whether_all_loops_are_converted(tmp_path: Path) -> None:
    good = write_list(tmp_path, {}, name="good.csv")
    bad = write_list(tmp_path, {"P": "~2"}, name="bad.csv")
    assert job(str(good), "--to", "emerson/deltav").exit_code == 0
    assert job(str(bad), "--to", "emerson/deltav").exit_code == 1


def test_rules_are_listed_with_what_answers_them() -> None:
    done = job("--list-rules")
    assert done.exit_code == 0
    for said in ("E-number", "D-unit", "F-approx", "the unit, such as min/repeat"):
        assert said in done.output


def test_a_mapping_is_drafted_from_the_command_line(tmp_path: Path) -> None:
    done = job(str(DATA / "plant_small.csv"), "--draft-map", str(tmp_path / "map.yaml"))
    assert done.exit_code == 0
    assert (tmp_path / "map.yaml").read_text("utf-8").startswith("# How the words of these lists are to be read.")


def test_a_row_as_plain_values_says_where_each_number_comes_from(tmp_path: Path) -> None:
    plain = run_one(tmp_path, {"I": "15 s/rep", "I unit": ""}).to_dict()
    assert plain["source"]["settings"]["RESET"] == {
        "value": 4.0, "unit": "repeat/min", "place": "line 2, column 6", "cell": "15 s/rep", "unit_read": "s/repeat",
        "unit_from": "cell",
    }  # fmt: skip
    assert plain["pasted"] == {"GAIN": 2.0, "RESET": 15.0, "RATE": 0.0}
