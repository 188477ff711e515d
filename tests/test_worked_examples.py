"""Every example of ``specs/worked-examples``, and every file of ``examples``, is run."""

from __future__ import annotations

import json
import math
import re
import runpy
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from pydantic import Field, ValidationError, model_validator

import pidemu
from pidemu.card.document import Document
from pidemu.card.model.base import Number, Text
from pidemu.card.reading import parse, parse_file
from pidemu.card.validation import Model, problems
from pidemu.cli import cli
from pidemu.conversion.loopfile import read_loop
from pidemu.errors import CardError, Problem
from pidemu.records.files import read_record
from pidemu.settings.settings import Settings

ROOT = Path(__file__).parents[1]
WORKED = ROOT / "specs" / "worked-examples"
LOOPS = sorted((ROOT / "examples").glob("*.yaml"))

PLAIN = 1e-9
"""Relative tolerance of a number that is not as printed: rounding of a few operations, many times over."""

Expected = Number | Annotated[str, Field(pattern=r"^-?[0-9]+(\.[0-9]+)?$")]
"""A number, or one as printed, in quotes."""

Dials = dict[Text, str | Number]
Columns = Number | Annotated[list[Number], Field(min_length=2)]


class Source(Model):
    title: Text
    address: Text | None = None


class Place(Model):
    title: Text
    place: Text


class Given(Model):
    card: Text
    settings: Dials
    pv_range: list[Number] | None = None
    op_range: list[Number] | None = None

    def read(self) -> Settings:
        ranges = {k: v for k, v in (("pv_range", self.pv_range), ("op_range", self.op_range)) if v is not None}
        return pidemu.load_card(self.card).settings({**self.settings, **ranges})


class Canonical(Model):
    kp: Expected | None = None
    ki: Expected | None = None
    kd: Expected | None = None
    Tf: Expected | None = Field(default=None, alias="Tf")


class InUnit(Model):
    value: Expected
    unit: Text


class Goal(Model):
    to: Text
    set_: Dials = Field(default={}, alias="set")
    match: Text | None = None
    scan: Number | None = None

    def convert(self, source: Settings) -> pidemu.Conversion:
        card = pidemu.load_card(self.to)
        options = {k: v for k, v in self.set_.items() if k in card.options}
        given = {k: v for k, v in self.set_.items() if k not in options}
        return pidemu.convert(source, card, options=options, given=given, match=self.match, scan=self.scan)


class Convert(Goal):
    settings: dict[Text, Expected] = Field(min_length=1)
    verdict: Text
    deviation: Expected | None = None
    kick: Expected | None = None


class Refused(Goal):
    reason: Text


class Emulate(Model):
    scan: Number
    sp: Columns
    pv: Columns
    initial_output: Number = 0.0
    limits: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    output: Annotated[list[Expected], Field(min_length=2)] | None = None
    change: Annotated[dict[Annotated[str, Field(pattern="^[0-9]+$")], Expected], Field(min_length=1)] | None = None
    same_as: Given | None = None

    @model_validator(mode="after")
    def expects_one_thing(self) -> Emulate:
        if sum(x is not None for x in (self.output, self.change, self.same_as)) != 1:
            raise ValueError("tests nothing, or two things; give one of output, change and same-as")
        return self

    def run(self, settings: Settings) -> npt.NDArray[np.float64]:
        sp, pv = (np.asarray(x) for x in (self.sp, self.pv))
        scans = max(sp.size, pv.size, len(self.output or ()))
        limits = (self.limits[0], self.limits[1]) if self.limits else None
        controller = pidemu.Controller(settings, self.scan, output_limits=limits, initial_output=self.initial_output)
        return controller.run(*(np.broadcast_to(x, scans) for x in (sp, pv)))


class Example(Model):
    title: Text
    source: Place
    given: Given
    note: Text | None = None
    canonical: Canonical | None = None
    dials: Annotated[dict[Text, InUnit], Field(min_length=1)] | None = None
    convert: Convert | None = None
    refused: Refused | None = None
    emulate: Emulate | None = None

    @model_validator(mode="after")
    def tests_one_thing(self) -> Example:
        stated = [x for x in (self.canonical, self.dials, self.convert, self.refused, self.emulate) if x is not None]
        if len(stated) != 1 or stated[0] == Canonical():
            raise ValueError("tests nothing, or two things; give one of canonical, dials, convert, refused and emulate")
        return self


class File(Model):
    sources: dict[Text, Source] = Field(min_length=1)
    examples: list[Example] = Field(min_length=1)


@dataclass(frozen=True)
class Case:
    """One example with its file, so that a failure names the place."""

    document: Document
    index: int
    example: Example

    def fail(self, path: tuple[str | int, ...], message: str) -> None:
        pytest.fail(self.document.problem(("examples", self.index, *path), message).render(), pytrace=False)

    def check(self, path: tuple[str | int, ...], expected: str | float, found: float) -> None:
        if not agrees(expected, found):
            self.fail(path, f"{'printed ' if isinstance(expected, str) else ''}{expected}, found {found:.12g}")


def agrees(expected: str | float, found: float) -> bool:
    if isinstance(expected, str):
        exponent = Decimal(expected).as_tuple().exponent
        assert isinstance(exponent, int)
        half = 0.5 * 10.0**exponent
        return abs(found - float(expected)) <= half * (1 + PLAIN)
    return math.isclose(expected, found, rel_tol=PLAIN, abs_tol=PLAIN)


def read(document: Document) -> File:
    try:
        file = File.model_validate(document.value)
    except ValidationError as error:
        raise CardError(sorted(problems(error, document.value, File, document, lambda p: p))) from None
    faults: list[Problem] = []
    for key in file.sources:
        if not any(e.source.title == key for e in file.examples):
            faults.append(document.problem(("sources", key), f"no example uses '{key}'; remove it", at_key=True))
    titles: set[str] = set()
    for i, e in enumerate(file.examples):
        if e.source.title not in file.sources:
            faults.append(document.problem(("examples", i, "source", "title"), f"no source '{e.source.title}'"))
        if e.title in titles:
            faults.append(document.problem(("examples", i, "title"), "a second example of this title"))
        titles.add(e.title)
    if faults:
        raise CardError(faults)
    return file


def cases() -> list[Any]:
    found = []
    for path in sorted(WORKED.glob("*.yaml")):
        document = parse_file(path, str(path.relative_to(ROOT)))
        for i, example in enumerate(read(document).examples):
            slug = re.sub(r"[^a-z0-9]+", "-", example.title.casefold()).strip("-")
            found.append(pytest.param(Case(document, i, example), id=f"{path.stem}: {slug}"))
    return found


@pytest.mark.parametrize("case", cases())
def test_the_worked_example_holds(case: Case) -> None:
    e = case.example
    settings = e.given.read()
    if e.canonical is not None:
        check_canonical(case, e.canonical, settings)
    elif e.dials is not None:
        for name, wanted in e.dials.items():
            case.check(("dials", name, "value"), wanted.value, settings[name].to(wanted.unit))
    elif e.convert is not None:
        check_conversion(case, e.convert, settings)
    elif e.refused is not None:
        with pytest.raises(pidemu.ConversionRefusedError) as refusal:
            e.refused.convert(settings)
        if e.refused.reason not in str(refusal.value):
            case.fail(("refused", "reason"), f"refused, but: {refusal.value}")
    else:
        assert e.emulate is not None
        check_emulation(case, e.emulate, settings)


def check_canonical(case: Case, wanted: Canonical, settings: Settings) -> None:
    n0, n1, n2, d1, d2 = settings.law().coefficients()
    assert d2 == 0
    kp = n1 - n0 * d1
    found = {"kp": kp, "ki": n0, "kd": n2 - kp * d1, "Tf": d1}
    for name, value in found.items():
        expected = getattr(wanted, name)
        if expected is not None:
            case.check(("canonical", name), expected, value)


def check_conversion(case: Case, wanted: Convert, settings: Settings) -> None:
    conversion = wanted.convert(settings)
    for name, expected in wanted.settings.items():
        if name not in conversion.settings:
            case.fail(("convert", "settings", name), f"{wanted.to} has no dial '{name}' with these options")
        case.check(("convert", "settings", name), expected, conversion.settings[name].value)
    if conversion.verdict != wanted.verdict:
        case.fail(("convert", "verdict"), f"the verdict is {conversion.verdict}")
    if wanted.deviation is not None:
        found = conversion.certificate.feedback.loop_band.max_deviation
        case.check(("convert", "deviation"), wanted.deviation, found)
    if wanted.kick is not None:
        case.check(("convert", "kick"), wanted.kick, conversion.certificate.setpoint_kick.target)


def check_emulation(case: Case, wanted: Emulate, settings: Settings) -> None:
    found = wanted.run(settings)
    if wanted.output is not None:
        assert len(wanted.output) == len(found)
        for i, expected in enumerate(wanted.output):
            case.check(("emulate", "output", i), expected, float(found[i]))
    elif wanted.change is not None:
        for at, expected in wanted.change.items():
            case.check(("emulate", "change", at), expected, float(found[int(at)] - found[int(at) - 1]))
    else:
        assert wanted.same_as is not None
        assert np.ptp(found) > 0, "a signal that moves nothing shows nothing"
        other = wanted.run(wanted.same_as.read())
        for i, (a, b) in enumerate(zip(other, found, strict=True)):
            if not agrees(float(a), float(b)):
                case.fail(("emulate", "same-as"), f"scan {i}: {wanted.same_as.card} gives {a:.12g}, {settings.card.id} {b:.12g}")


def test_the_readme_names_every_key_of_an_example() -> None:
    text = (WORKED / "README.md").read_text(encoding="utf-8")
    for model in (Example, Given, Canonical, InUnit, Convert, Refused, Emulate):
        for name, field in model.model_fields.items():
            assert f"`{field.alias or name}`" in text or f"{field.alias or name}:" in text, f"{model.__name__}: {name}"


FINE = """
sources: {s: {title: a source}}
examples:
  - title: one
    source: {title: s, place: p. 1}
    given: {card: generic/standard, settings: {K: 2, Ti: 3}}
    canonical: {kp: 2}
"""


def test_an_example_file_as_in_the_readme_is_read() -> None:
    assert len(read(parse(FINE, "e.yaml")).examples) == 1


@pytest.mark.parametrize(
    ("old", "new", "place", "message"),
    [
        ("canonical: {kp: 2}", "canonical: {kq: 2}", "e.yaml:7:17", "unknown key 'kq'"),
        ("canonical: {kp: 2}", "canonical: {}", "e.yaml:4:5", "tests nothing"),
        ("    canonical: {kp: 2}\n", "", "e.yaml:4:5", "tests nothing"),
        ("canonical: {kp: 2}", "canonical: {kp: 2}\n    dials: {K: {value: 2, unit: '%/%'}}", "e.yaml:4:5", "two things"),
        ("canonical: {kp: 2}", "convert: {to: generic/series, settings: {}, verdict: exact}", "e.yaml:7:45", "empty"),
        ("canonical: {kp: 2}", "emulate: {scan: 1, sp: 50, pv: 50}", "e.yaml:7:14", "tests nothing"),
        ("title: s,", "title: t,", "e.yaml:5:21", "no source 't'"),
        ("s: {title: a source}", "s: {title: a source}, t: {title: another}", "e.yaml:2:33", "no example uses 't'"),
        ("canonical: {kp: 2}", 'canonical: {kp: "two"}', "e.yaml:7:21", "'two'"),
    ],
)
def test_a_wrong_example_is_an_error_with_its_place(old: str, new: str, place: str, message: str) -> None:
    assert old in FINE
    with pytest.raises(CardError) as error:
        read(parse(FINE.replace(old, new, 1), "e.yaml"))
    headlines = [p.headline() for p in error.value.problems]
    assert any(h.startswith(place) and message in h for h in headlines), headlines


def test_a_printed_number_holds_to_half_a_unit_of_its_last_digit() -> None:
    assert agrees("0.083", 0.0825001)
    assert not agrees("0.083", 0.0836)
    assert agrees("180", 180.4)
    assert not agrees(180, 180.4)


TEXTBOOK = {
    "provox-to-deltav-series": {"GAIN": 2.0, "RESET": 15.0, "RATE": 6.0},
    "provox-to-deltav-standard": {"GAIN": 2.8, "RESET": 21.0, "RATE": 90 / 21},
    "plc5-isa-to-independent": {"KP": 1.0, "KI": 5 / 60, "KD": 180.0},
    "udc-to-deltav": {"GAIN": 5.0, "RESET": 60.0, "RATE": 6.0},
    "bailey-to-deltav": {"GAIN": 2.0, "RESET": 240.0, "RATE": 3.0},
    "pneumatic-to-udc": {"PB": 80.0, "RSET": 1.25, "RATE": 0.2},
}
"""What the formula that each loop file names gives."""


def test_every_loop_file_has_its_published_numbers() -> None:
    assert {p.stem for p in LOOPS} == set(TEXTBOOK)


@pytest.mark.parametrize("file", LOOPS, ids=lambda p: p.stem)
def test_the_loop_file_converts_on_the_command_line(file: Path) -> None:
    result = CliRunner().invoke(cli, ["convert", "--loop", str(file), "--json"])
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["verdict"] in ("exact", "exact-feedback", "approximate")
    published = answer["textbook"]["to"]["settings"]
    for name, value in TEXTBOOK[file.stem].items():
        assert published[name]["value"] == pytest.approx(value, rel=PLAIN)
    assert read_loop(file).to == answer["to"]["card"]


@pytest.mark.parametrize("file", LOOPS, ids=lambda p: p.stem)
def test_the_loop_file_says_where_its_numbers_come_from_and_what_to_type(file: Path) -> None:
    about = parse_file(file).value["about"]
    assert len(about) > 60
    assert f"pidemu convert --loop examples/{file.name}" in file.read_text(encoding="utf-8")


@pytest.mark.parametrize("file", LOOPS, ids=lambda p: p.stem)
def test_the_loop_file_prints_a_readable_page(file: Path) -> None:
    result = CliRunner().invoke(cli, ["convert", "--loop", str(file)])
    assert result.exit_code == 0, result.output
    assert "Verdict" in result.stdout


RECORD = ROOT / "examples" / "record.csv"
RUN = ["run", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--scan", "1", "--record", str(RECORD)]


def test_the_recorded_output_is_reproduced_to_the_last_bit() -> None:
    result = CliRunner().invoke(cli, RUN)
    assert result.exit_code == 0, result.output
    assert "largest difference from the recorded output: 0 " in result.stderr


def test_another_tuning_does_not_reproduce_the_record() -> None:
    result = CliRunner().invoke(cli, [w.replace("RATE=0.1", "RATE=0.2") for w in RUN])
    assert result.exit_code == 0, result.output
    match = re.search(r"largest difference from the recorded output: ([0-9.e+-]+)", result.stderr)
    assert match is not None
    assert float(match[1]) > 1


def test_the_record_is_what_its_script_writes() -> None:
    script = runpy.run_path(str(ROOT / "examples" / "make_record.py"))
    assert script["record"]() == RECORD.read_text(encoding="utf-8")


def test_the_bump_test_is_what_its_script_writes() -> None:
    script = runpy.run_path(str(ROOT / "examples" / "make_bump.py"))
    assert script["record"]() == (ROOT / "examples" / "bump.csv").read_text(encoding="utf-8")


def test_the_record_has_a_setpoint_step_a_load_and_a_manual_spell() -> None:
    record = read_record(RECORD)
    assert record.auto is not None
    assert record.manual is not None
    assert record.output is not None
    assert len(record.sp) == 120
    assert set(record.sp.tolist()) == {50.0, 55.0}
    manual = record.auto == 0
    assert 5 < manual.sum() < 40
    np.testing.assert_array_equal(record.output[manual], record.manual[manual])
    assert np.isnan(record.manual[~manual]).all()
    assert RECORD.read_text(encoding="utf-8").startswith("# ")
