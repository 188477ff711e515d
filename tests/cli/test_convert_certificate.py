"""``pidemu convert`` with all that a certificate can hold: matches, processes, options, scans, the cut-over and the page."""

from __future__ import annotations

import html.parser
import json
import shlex
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import pidemu
from pidemu.loop.process import parse_process
from tests.cli.helpers import Said, said, strict_json, told

PROVOX = ("convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav")
PROCESS = "gain=0.5,lag=20,delay=3"


def converted(*words: str) -> Any:
    return strict_json(told(*words, "--json"))


def source() -> pidemu.Settings:
    return pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)


def section(text: str, heading: str) -> list[list[str]]:
    """Words of the lines below a heading."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(heading)) + 1
    end = next((i for i in range(start, len(lines)) if not lines[i].startswith(" ")), len(lines))
    return [line.split() for line in lines[start:end]]


NUMBER = {"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf", "nan"]}]}
SIDE = {
    "type": "object",
    "required": ["card", "settings", "options"],
    "properties": {
        "card": {"type": "string"},
        "settings": {
            "type": "object",
            "minProperties": 1,
            "additionalProperties": {
                "type": "object",
                "required": ["value", "unit"],
                "additionalProperties": False,
                "properties": {"value": NUMBER, "unit": {"type": "string"}},
            },
        },
        "options": {"type": "object", "additionalProperties": {"type": "string"}},
    },
}
BAND = {
    "type": "object",
    "required": ["low", "high", "max_deviation", "gain_db", "phase_deg", "worst_at"],
    "additionalProperties": NUMBER,
}
PATH = {"type": "object", "required": ["loop_band", "full_band"], "additionalProperties": BAND}
OR_NULL = [{"type": "null"}]
LOOP = {
    "type": "object",
    "required": ["stable", "gain_margin", "phase_margin", "delay_margin", "crossover", "Ms", "Mt", "iae"],
    "properties": {"stable": {"type": "boolean"}},
    "additionalProperties": NUMBER,
}
CERTIFICATE = {
    "type": "object",
    "required": [
        "feedback", "setpoint", "feedback_at_scan", "setpoint_at_scan", "setpoint_kick", "setpoint_kick_at_scan", "time_scale",
        "scan_by_scan", "not_emulated", "scan_cost", "nonlinear", "loop", "dials", "feedback_before_rounding",
    ],
    "properties": {
        "feedback": PATH,
        "setpoint": PATH,
        "feedback_at_scan": {"anyOf": [*OR_NULL, PATH]},
        "setpoint_at_scan": {"anyOf": [*OR_NULL, PATH]},
        "setpoint_kick": {"type": "object", "required": ["source", "target", "ratio"], "additionalProperties": NUMBER},
        "scan_by_scan": {
            "anyOf": [
                *OR_NULL,
                {
                    "type": "object",
                    "required": ["scan", "taken", "largest", "largest_at", "segment", "on_measurement", "size"],
                    "properties": {"scan": {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2}},
                },
            ]
        },
        "not_emulated": {"type": "string"},
        "scan_cost": {
            "anyOf": [*OR_NULL, {"type": "object", "required": ["at", "phase_deg", "compensated", "uncompensated"]}]
        },
        "nonlinear": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["aspect", "text", "figures"],
                "properties": {"figures": {"type": "object", "additionalProperties": {"type": "array", "items": NUMBER}}},
            },
        },
        "loop": {
            "anyOf": [
                *OR_NULL,
                {"type": "object", "required": ["process", "source", "target"], "properties": {"source": LOOP, "target": LOOP}},
            ]
        },
        "dials": {"type": "array", "items": {"type": "object", "required": ["name", "exact", "rounded"]}},
        "feedback_before_rounding": {"anyOf": [*OR_NULL, PATH]},
    },
}  # fmt: skip
SCHEMA = {
    "type": "object",
    "required": [
        "from", "to", "verdict", "certificate", "warnings",  # these names stay
        "match", "sentence", "chosen", "textbook", "scan", "gain_factor", "process", "setpoint_filter", "notes", "assumptions",
        "inferences",
    ],
    "properties": {
        "from": SIDE,
        "to": SIDE,
        "verdict": {"enum": ["exact", "exact-feedback", "approximate", "refused"]},
        "certificate": CERTIFICATE,
        "warnings": {"type": "array", "items": {"type": "string"}},
        "sentence": {"type": "string", "minLength": 1},
        "process": {"type": ["string", "null"]},
    },
}  # fmt: skip
"""What programs may rely on."""

FULL: dict[str, tuple[str, ...]] = {
    "plain": PROVOX,
    "all": (*PROVOX, "--scan", "1,0.5", "--process", PROCESS, "--round", "--all-options", "--cut-over", "50,48.5,40"),
    "infinite": (
        "convert", "honeywell/udc", "GAIN=2", "RSET=1", "RATE=0.1", "--to", "generic/standard", "--process", "gain=1,lag=9,delay=2",
    ),
    "unstable": (*PROVOX, "--process", "gain=9,lag=10,delay=30"),
    "no integral": ("convert", "generic/standard", "K=2", "Ti=off", "--to", "generic/series", "--process", "gain=1,lag=3"),
    "not emulated": (
        "convert", "gnc-tools/cpid", "Kp=2", "Ki=0.002", "Kd=1", "Tf=1e-6", "b=1", "c=1", "rRampMax=1e9",
        "--to", "generic/parallel",
    ),
    "rounded": ("convert", "generic/standard", "K=2", "Ti=100", "Td=10", "--to", "honeywell/udc", "--round", "--scan", "0.5"),
}  # fmt: skip


@pytest.mark.parametrize("name", FULL)
def test_json_is_strict_and_has_the_names_that_programs_rely_on(name: str) -> None:
    found = converted(*FULL[name])
    jsonschema.validate(found, SCHEMA)
    assert set(found["from"]) <= {"card", "settings", "options", "pv_range", "op_range"}
    assert json.loads(json.dumps(found)) == found
    full = name == "all"
    certificate = found["certificate"]
    assert (found["process"] is None) == ("--process" not in FULL[name]) == (certificate["loop"] is None)
    assert (certificate["scan_cost"] is None) == (found["scan"] is None) == ("--scan" not in FULL[name])
    assert ("transfer_plan" in found) == full
    assert bool(certificate["not_emulated"]) == (certificate["scan_by_scan"] is None) == (name == "not emulated")
    assert bool(certificate["dials"]) == (name == "rounded")


def test_a_refusal_keeps_these_names_and_adds_its_reason() -> None:
    status, out, _ = said("convert", "generic/standard", "K=2", "Ti=1", "Td=0.5", "--to", "generic/series", "--json")
    found = strict_json(out)
    jsonschema.validate(found, SCHEMA)
    assert (status, found["verdict"]) == (1, "refused")
    assert "complex zeros" in found["reason"]


def test_a_refusal_without_any_settings_still_names_both_cards() -> None:
    status, out, _ = said(*PROVOX, "--set", "STRUCTURE=4", "--json")
    found = strict_json(out)
    assert status == 1
    assert (found["from"]["card"], found["to"]["card"], found["verdict"]) == ("fisher/provox", "emerson/deltav", "refused")


class TestMatch:
    """The match that is asked for is the one that is printed."""

    WORDS = (*PROVOX, "--set", "FORM=Standard", "--set", "ALPHA=0.1")

    @pytest.mark.parametrize("match", ["frequency:0.1rad/s", "constrained", "textbook", "low-frequency"])
    def test_it_stands_over_the_settings_and_in_json(self, match: str) -> None:
        word = match.partition(":")[0]
        text = told(*self.WORDS, "--match", match)
        assert any(f"{word} match" in " ".join(row) for row in section(text, "To: Emerson DeltaV"))
        assert converted(*self.WORDS, "--match", match)["match"] == word

    def test_a_frequency_match_is_that_of_the_function(self) -> None:
        wanted = pidemu.convert(
            source(), "emerson/deltav", match="frequency:0.1rad/s", options={"FORM": "Standard"}, given={"ALPHA": "0.1"}
        )
        assert converted(*self.WORDS, "--match", "frequency:0.1rad/s") == wanted.to_dict()

    @pytest.mark.parametrize("match", ["frequency", "loop"])
    def test_with_a_process_the_crossover_and_the_loop_can_be_matched(self, match: str) -> None:
        found = converted(*self.WORDS, "--match", match, "--process", PROCESS)
        assert found["match"] == match
        crossovers = [found["certificate"]["loop"][side]["crossover"] for side in ("source", "target")]
        if match == "frequency":
            assert crossovers[0] == pytest.approx(crossovers[1], rel=1e-6)
        assert found["to"]["settings"] != converted(*self.WORDS)["to"]["settings"]


class TestProcess:
    """A process gives the loop before and after."""

    def test_the_figures_are_those_of_the_function_and_stand_side_by_side(self) -> None:
        text = told(*PROVOX, "--process", PROCESS)
        assert "The loop with the process 0.5 exp(-3 s)/(20 s + 1)" in text
        rows = {" ".join(row[:-2]): row[-2:] for row in section(text, "The loop with the process")[1:]}
        found = converted(*PROVOX, "--process", PROCESS)
        assert found["process"] == "0.5 exp(-3 s)/(20 s + 1)"
        for name, key in (("gain margin", "gain_margin"), ("phase margin [deg]", "phase_margin"), ("Ms", "Ms")):
            for cell, side in zip(rows[name], ("source", "target"), strict=True):
                assert float(cell) == pytest.approx(found["certificate"]["loop"][side][key], rel=1e-3)  # four digits
        assert rows["stable"] == ["yes", "yes"]
        wanted = pidemu.convert(source(), "emerson/deltav", process=parse_process(PROCESS))
        assert found == wanted.to_dict()

    def test_an_unstable_loop_is_said_to_be_in_the_verdict_and_in_the_table(self) -> None:
        text = told(*FULL["unstable"])
        assert "the loop is unstable, before and after: check the process, or the action." in " ".join(text.split())
        assert section(text, "The loop with the process")[-1] == ["stable", "NO", "NO"]

    def test_without_a_process_there_is_no_loop(self) -> None:
        assert "The loop with" not in told(*PROVOX)


class TestAllOptions:
    """Every choice of the options, ranked."""

    def test_there_is_a_line_for_each_choice_the_best_first(self) -> None:
        rows = section(told(*PROVOX, "--all-options"), "Choices of the options")
        assert rows[0] == ["options", "verdict", "loop", "band", "setpoint", "path"]
        assert len(rows) - 1 == 2 * 8 * 2  # FORM, STRUCTURE and FRSIPID_OPTS, whose gap nobody gave: refused
        verdicts = [next(w for w in row if w in ("exact", "exact-feedback", "approximate", "refused")) for row in rows[1:]]
        order = ["exact", "exact-feedback", "approximate", "refused"]
        assert verdicts == sorted(verdicts, key=order.index)
        assert rows[1] == ["STRUCTURE=7", "exact", "none", "none"]
        assert ["as", "the", "card", "delivers", "them", "exact-feedback", "none", "34", "%"] in rows

    def test_the_best_is_the_one_that_is_taken(self) -> None:
        assert converted(*PROVOX, "--all-options")["to"]["options"] == {
            "FORM": "Standard",
            "STRUCTURE": "7",
            "FRSIPID_OPTS": "none",
        }

    def test_what_is_set_is_not_varied(self) -> None:
        rows = section(told(*PROVOX, "--all-options", "--set", "STRUCTURE=1"), "Choices of the options")
        assert len(rows) - 1 == 2 * 2  # FORM and FRSIPID_OPTS
        assert not any("STRUCTURE" in word for row in rows for word in row)

    def test_without_being_asked_for_there_is_no_table(self) -> None:
        assert "Choices of the options" not in told(*PROVOX)


class TestScans:
    """Settings for other intervals, and without making up for them."""

    def test_compensation_can_be_left_out(self) -> None:
        words = (*PROVOX, "--set", "STRUCTURE=1", "--set", "FORM=Standard", "--scan", "1,0.5")
        with_it, without = converted(*words), converted(*words, "--no-compensation")
        rates = [found["to"]["settings"]["RATE"]["value"] for found in (with_it, without)]
        assert rates == pytest.approx([3.4444, 3.6944], abs=1e-4)  # less derivative by half the difference, 0.25 s
        costs = [found["certificate"]["scan_cost"] for found in (with_it, without)]
        assert [cost["compensated"] for cost in costs] == [True, False]
        assert costs[0]["uncompensated"] == costs[1]["uncompensated"]
        assert without["to"]["settings"] == converted(*words[:-2])["to"]["settings"]

    def test_what_is_made_up_for_is_said_with_the_flag_that_leaves_it_out(self) -> None:
        text = " ".join(told(*PROVOX, "--scan", "1,0.5").split())
        assert "scan intervals differ, 1 s and 0.5 s: that gains 3.5 degrees of phase at 0.247 rad/s" in text
        assert "'--no-compensation' gives the others" in text
        assert "'--no-compensation' gives the others" not in " ".join(told(*PROVOX, "--scan", "1,0.5", "--no-compensation").split())


class TestCutOver:
    """What to set, in which order."""

    def test_the_steps_are_numbered_and_the_bump_is_stated(self) -> None:
        words = ("convert", "fisher/provox", "GAIN=2", "RESET=4", "--to", "simple-pid/simple-pid", "--cut-over", "50,48,43")
        rows = section(told(*words), "Cut-over")
        numbered = [row[0] for row in rows if row[0].rstrip(".").isdigit()]
        assert numbered == [f"{k}." for k in range(1, len(numbered) + 1)]
        bump = next(" ".join(row) for row in rows if row[:3] == ["the", "output", "then"])
        assert bump.endswith("% of span; without this, by 4 %")  # P of 2 x 2 on top of the output

    def test_json_has_the_plan_of_the_function(self) -> None:
        plan = converted(*PROVOX, "--cut-over", "50,48.5,40")["transfer_plan"]
        wanted = pidemu.convert(source(), "emerson/deltav").transfer_plan(50, 48.5, 40)
        assert plan == json.loads(json.dumps(wanted.to_dict()))
        assert {"steps", "bump", "without_plan", "is_bumpless", "notes"} <= set(plan)

    def test_the_target_s_scan_interval_is_used(self) -> None:
        plan = converted(*PROVOX, "--cut-over", "50,48.5,40", "--scan", "1,0.5")["transfer_plan"]
        wanted = pidemu.convert(source(), "emerson/deltav", scan=(1, 0.5)).transfer_plan(50, 48.5, 40)
        assert plan == json.loads(json.dumps(wanted.to_dict()))


class TestFrom:
    """Where it is not sure what the numbers mean."""

    def test_two_readings_are_both_shown_and_none_is_chosen(self) -> None:
        status, out, err = said("convert", "--from", "provox", "GAIN=2", "RESET=0.75", "--to", "emerson/deltav")
        assert (status, out) == (1, "")
        assert err.startswith("error: refused: these settings can be read in 2 ways, and nothing given says which is meant; ")
        assert "RESET = 80 s/repeat" in err
        assert "RESET = 45 s/repeat" in err

    def test_each_command_that_is_shown_runs_and_keeps_process_and_scans(self) -> None:
        words = ("--to", "emerson/deltav", "--process", PROCESS, "--scan", "1,0.5", "--no-compensation")
        status, out, _ = said("convert", "--from", "provox", "GAIN=2", "RESET=0.75", *words, "--json")
        found = strict_json(out)
        assert (status, found["verdict"]) == (1, "ambiguous")
        assert len(found["readings"]) == 2
        for reading in found["readings"]:
            program, *command = shlex.split(reading["command"])
            assert program == "pidemu"
            again = converted(*command)
            assert again == reading["conversion"]
            assert (again["process"], again["scan"]) == ("0.5 exp(-3 s)/(20 s + 1)", [1.0, 0.5])
            assert again["certificate"]["scan_cost"]["compensated"] is False

    def test_one_reading_is_converted_as_if_its_card_had_been_given(self) -> None:
        word = ("convert", "--from", "provox", "GAIN=2", "RESET=4 repeat/min", "RATE=0.1", "--to", "emerson/deltav")
        assert converted(*word) == converted(*PROVOX)

    def test_the_values_may_stand_before_the_options(self) -> None:
        word = ("convert", "GAIN=2", "RESET=4 repeat/min", "RATE=0.1", "--from", "provox", "--to", "emerson/deltav")
        assert converted(*word) == converted(*PROVOX)

    def test_with_two_readings_no_page_is_written(self, folder: Path) -> None:
        status, out, _ = said(
            "convert", "--from", "provox", "GAIN=2", "RESET=0.75", "--to", "emerson/deltav", "--html", "page.html"
        )
        assert (status, out, list(folder.iterdir())) == (1, "", [])


class _Page(html.parser.HTMLParser):
    """The words of a page, and what it would load from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.words: list[str] = []
        self.loaded: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loaded += [v for name, v in attrs if name in ("src", "href") and v and not v.startswith(("data:", "#"))]
        if tag == "script":
            self.loaded.append(tag)

    def handle_data(self, data: str) -> None:
        self.words += data.split()


def read(file: Path) -> _Page:
    page = _Page()
    page.feed(file.read_text(encoding="utf-8"))
    return page


class TestPage:
    """The certificate as a page."""

    def test_it_is_written_and_said_to_be(self, folder: Path) -> None:
        text = told(*PROVOX, "--process", PROCESS, "--cut-over", "50,48.5,40", "--html", "page.html")
        assert text.rstrip().endswith("written: page.html")
        page = read(folder / "page.html")
        words = " ".join(page.words)
        found = converted(*PROVOX)
        assert found["sentence"] in words
        assert "20.25" in words
        assert "0.5 exp(-3 s)/(20 s + 1)" in words
        assert page.loaded == []

    def test_with_json_the_page_is_written_and_stdout_is_json_alone(self, folder: Path) -> None:
        found = converted(*PROVOX, "--html", "page.HTML")
        jsonschema.validate(found, SCHEMA)
        assert (folder / "page.HTML").stat().st_size > 10_000

    def test_a_refused_conversion_writes_none(self, folder: Path) -> None:
        status, _, _ = said(*PROVOX, "--set", "STRUCTURE=4", "--html", "page.html")
        assert (status, list(folder.iterdir())) == (1, [])


LOOP_FILE = f"""\
card: fisher/provox
settings: {{GAIN: 2, RESET: 4, RATE: 6 s}}
to: emerson/deltav
scan: [1, 0.5]
process: {PROCESS}
"""


class TestLoopFile:
    """A loop file may hold the process too."""

    def test_it_says_what_the_command_line_would(self, folder: Path) -> None:
        (folder / "loop.yaml").write_text(LOOP_FILE, encoding="utf-8")
        words = ("convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=6 s", "--to", "emerson/deltav", "--scan", "1,0.5")
        found = converted("convert", "--loop", "loop.yaml")
        assert found["process"] == "0.5 exp(-3 s)/(20 s + 1)"
        assert found == converted(*words, "--process", PROCESS)

    def test_the_command_line_overrides_it(self, folder: Path) -> None:
        (folder / "loop.yaml").write_text(LOOP_FILE, encoding="utf-8")
        assert converted("convert", "--loop", "loop.yaml", "--process", "gain=2,lag=7")["process"] == "2/(7 s + 1)"

    def test_its_process_serves_a_match_in_the_loop(self, folder: Path) -> None:
        (folder / "loop.yaml").write_text(LOOP_FILE.replace("scan: [1, 0.5]", "set: {ALPHA: 0.1}"), encoding="utf-8")
        assert converted("convert", "--loop", "loop.yaml", "--match", "loop")["match"] == "loop"

    def test_a_wrong_process_is_refused(self, folder: Path) -> None:
        (folder / "loop.yaml").write_text(LOOP_FILE.replace("delay=3", "dealy=3"), encoding="utf-8")
        status, out, err = said("convert", "--loop", "loop.yaml")
        assert (status, out) == (2, "")
        assert "unknown name 'dealy'" in err
        assert "did you mean 'delay'?" in err

    def test_a_process_that_is_no_text_is_refused_at_its_place(self, folder: Path) -> None:
        (folder / "loop.yaml").write_text(LOOP_FILE.replace(PROCESS, "{gain: 1}"), encoding="utf-8")
        status, out, err = said("convert", "--loop", "loop.yaml")
        assert (status, out) == (1, "")
        assert err.startswith("error: loop.yaml:5:10: ")


NAMES = "names: gain, lag, lead, integrators, delay, pole, zero"
SUCH = "write for example gain=1.5,lag=10 s,delay=3 s"

PROCESSES = {
    "": f"'' in '' is not NAME=VALUE; {SUCH}",
    "1.5": f"'1.5' in '1.5' is not NAME=VALUE; {SUCH}",
    "gain=1,,lag=3": f"'' in 'gain=1,,lag=3' is not NAME=VALUE; {SUCH}",
    "gain=1,lag=": f"'lag=' in 'gain=1,lag=' is not NAME=VALUE; {SUCH}",
    "lag=3": "'lag=3' has no gain; add gain=1.5, for example",
    "gain=1,lg=3": f"unknown name 'lg' in 'gain=1,lg=3' (did you mean 'lag'?); {NAMES}",
    "gain=1,delay=3,delay=4": "delay comes twice in 'gain=1,delay=3,delay=4'; give it once",
    "gain=0": "the gain is 0: nothing would reach the measurement; give the process's gain in %/%",
    "gain=1 s": "gain=1 s: a process gain is in %/% of the signal ranges; convert it and leave out the unit",
    "gain=1,lag=3 %": "lag=3 %: '%' is a percentage and cannot set process time; use one of: s, min",
    "gain=1,delay=-3": "the dead time -3 s is negative; give the time that the process waits, or 0",
    "gain=1,pole=fast": "pole=fast is not a number [rad/s] such as -0.1 or -0.1+0.2j",
    "gain=1,integrators=1.5": "integrators is 1.5; give how many there are: 0, 1 or 2",
}
"""A cause and a remedy for every wrong process."""


@pytest.mark.parametrize("text", PROCESSES)
def test_a_wrong_process_is_refused_with_one_cause_and_one_remedy(text: str) -> None:
    assert said(*PROVOX, "--process", text) == Said(2, "", f"error: {PROCESSES[text]}\n")


@pytest.mark.parametrize("text", ["gain=a", "gain=1,lag=two", "gain=nan", "gain=1,lag=0", "gain=1,lag=-3", "gain=1,lead=3"])
def test_other_wrong_processes_are_refused_in_one_line(text: str) -> None:
    status, out, err = said(*PROVOX, "--process", text)
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1


@pytest.mark.parametrize("text", ["50,48.5", "50", "", "50,48,40,1", "50;48;40", "50,48,now", "50,48,"])
def test_a_wrong_cut_over_is_wrong_usage_with_an_example(text: str) -> None:
    status, out, err = said(*PROVOX, "--cut-over", text)
    assert (status, out) == (2, "")
    wrong = f"'{text}' is not three numbers; write setpoint, measurement and output: --cut-over 50,48.5,40"
    assert err.splitlines()[-1] == f"Error: {wrong}"


@pytest.mark.parametrize(("text", "what"), [("50,nan,40", "measurement"), ("50,48,inf", "output"), ("nan,48,40", "setpoint")])
def test_a_cut_over_that_is_not_finite_is_refused(text: str, what: str) -> None:
    status, out, err = said(*PROVOX, "--cut-over", text)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: emerson/deltav: the {what} ")
    assert err.count("\n") == 1


def test_a_cut_over_outside_the_limits_is_refused() -> None:
    status, out, err = said(*PROVOX, "--cut-over", "50,48,140")
    assert (status, out) == (2, "")
    assert err.startswith("error: emerson/deltav: the output of 140 % is outside the output limits, 0 % to 100 %; bring it inside")


@pytest.mark.parametrize("name", ["page.pdf", "page", "html", "page.htm"])
def test_a_page_with_another_ending_is_refused(name: str, folder: Path) -> None:
    message = f"error: {name}: the certificate is written as .html; give the file this ending\n"
    assert said(*PROVOX, "--html", name) == Said(2, "", message)
    assert list(folder.iterdir()) == []


def test_a_page_that_cannot_be_written_is_said_so() -> None:
    message = "error: nowhere/page.html: cannot be written: No such file or directory\n"
    assert said(*PROVOX, "--html", "nowhere/page.html") == Said(2, "", message)


MATCHES = {
    "best": "match is 'best'; it is one of exact, low-frequency, textbook, frequency, loop, constrained, or frequency:0.02rad/s",
    "loop:1rad/s": "match is 'loop:1rad/s'; only 'frequency' takes a number, such as frequency:0.02rad/s",
    "frequency:1": "match is 'frequency:1'; write the frequency as a number with one of the units rad/s, rad/min, rad/h, Hz, mHz",
    "frequency:0Hz": "match is 'frequency:0Hz'; the frequency must be ",
}


@pytest.mark.parametrize("text", MATCHES)
def test_a_wrong_match_is_wrong_usage(text: str) -> None:
    status, out, err = said(*PROVOX, "--match", text)
    assert (status, out) == (2, "")
    assert err.splitlines()[-1].startswith(f"Error: Invalid value for '--match': {MATCHES[text]}")


@pytest.mark.parametrize("match", ["loop", "frequency"])
def test_a_match_that_needs_a_process_asks_for_it(match: str) -> None:
    status, out, err = said(*PROVOX, "--match", match)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: the match '{match}' needs the process")
    assert "--process gain=...,lag=...,delay=..." in err
    assert err.count("\n") == 1


def test_a_frequency_beyond_half_the_scan_rate_is_refused() -> None:
    status, out, err = said(*PROVOX, "--match", "frequency:4rad/s", "--scan", "1")
    assert (status, out) == (1, "")
    assert err.splitlines()[0].endswith("4 rad/s is beyond half the scan rate; match at a lower frequency")


def test_a_word_that_names_no_card_is_refused() -> None:
    status, out, err = said("convert", "--from", "nothing", "GAIN=2", "--to", "emerson/deltav")
    assert (status, out, err) == (2, "", "error: no card, vendor or product 'nothing'; 'pidemu cards' lists them\n")
