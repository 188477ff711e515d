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
from pidemu.process.process import parse_process
from tests.cli.helpers import Said, answer, said, strict_json, told

PROVOX = ("convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav")
STATED = ("convert", "fisher/provox", "GAIN=2", "RESET=4 repeat/min", "RATE=0.1", "--to", "emerson/deltav")
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
                "properties": {"value": NUMBER, "unit": {"type": "string"}, "unrounded": NUMBER},
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
            "anyOf": [*OR_NULL, {"type": "object", "required": ["at", "phase_deg", "too_slow"]}]
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
        "match", "verdicts", "sentence", "conditions", "chosen", "runner_up", "beside", "ranking", "textbook", "scan",
        "gain_factor", "process", "setpoint_filter", "notes", "assumptions", "at_the_loop", "command",
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
    "all": (*PROVOX, "--scan", "1,0.5", "--process", PROCESS, "--digits", "3", "--cut-over", "50,48.5,40"),
    "infinite": (
        "convert", "honeywell/udc", "GAIN=2", "RSET=1", "RATE=0.1", "--to", "generic/standard", "--process", "gain=1,lag=9,delay=2",
    ),
    "unstable": (*PROVOX, "--process", "gain=9,lag=10,delay=30"),
    "no integral": ("convert", "generic/standard", "K=2", "Ti=off", "--to", "generic/series", "--process", "gain=1,lag=3"),
    "not emulated": (
        "convert", "gnc-tools/cpid", "Kp=2", "Ki=0.002", "Kd=1", "Tf=1e-6", "b=1", "c=1", "rRampMax=1e9",
        "--pv-range", "0,100", "--op-range", "0,100", "--to", "generic/parallel",
    ),
    "rounded": ("convert", "generic/standard", "K=2", "Ti=100", "Td=10", "--to", "honeywell/udc", "--scan", "0.5"),
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
    assert {d["name"] for d in certificate["dials"] if d["to_resolution"]} == ({"RSET", "RATE"} if name == "rounded" else set())


def test_a_refusal_keeps_these_names_and_adds_its_reason() -> None:
    status, out, _ = said("convert", "generic/standard", "K=2", "Ti=1", "Td=0.5", "--to", "generic/series", "--json")
    found = strict_json(out)
    jsonschema.validate(found["nearest"], SCHEMA)
    assert {"verdict", "reason", "nearest", "alternatives"} <= set(found)
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
            source(), "emerson/deltav", match="frequency:0.1rad/s", options={"FORM": "Standard"}, given={"ALPHA": "0.1"}, digits=5
        )
        assert answer(converted(*self.WORDS, "--match", "frequency:0.1rad/s")) == answer(wanted.to_dict())

    @pytest.mark.parametrize("match", ["frequency", "loop"])
    def test_with_a_process_the_crossover_and_the_loop_can_be_matched(self, match: str) -> None:
        found = converted(*self.WORDS, "--match", match, "--process", PROCESS)
        assert found["match"] == match
        crossovers = [found["certificate"]["loop"][side]["crossover"] for side in ("source", "target")]
        if match == "frequency":
            assert crossovers[0] == pytest.approx(crossovers[1], rel=5e-5)  # of dials that are rounded to five digits
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
        wanted = pidemu.convert(source(), "emerson/deltav", process=parse_process(PROCESS), digits=5)
        assert answer(found) == answer(wanted.to_dict())

    def test_an_unstable_loop_is_said_to_be_in_the_verdict_and_in_the_table(self) -> None:
        text = told(*FULL["unstable"])
        assert "the loop is unstable, before and after: check the process, or the action." in " ".join(text.split())
        assert section(text, "The loop with the process")[-1] == ["stable", "NO", "NO"]

    def test_without_a_process_there_is_no_loop(self) -> None:
        assert "The loop with" not in told(*PROVOX)


class TestExplain:
    """Why these options, and what every other choice would cost."""

    def test_there_is_a_line_for_every_choice_that_was_looked_at_the_best_first(self) -> None:
        found = converted(*PROVOX)
        ranking = found["ranking"]
        assert len(ranking) == 2 * 8 * 2  # FORM, STRUCTURE and FRSIPID_OPTS, whose gap was not given: refused
        assert ranking[0]["verdict"] == "exact"
        assert ranking[0]["changed"] == found["chosen"] == {"FORM": "Series"}
        text = told(*PROVOX, "--explain")
        assert "FORM=Standard, STRUCTURE=7" in text[text.index("Why these options") :]

    def test_what_is_set_is_not_varied(self) -> None:
        ranking = converted(*PROVOX, "--set", "STRUCTURE=1")["ranking"]
        assert len(ranking) == 2 * 2  # FORM and FRSIPID_OPTS
        assert not any("STRUCTURE" in attempt["changed"] for attempt in ranking)

    def test_without_being_asked_for_there_is_no_table(self) -> None:
        assert told(*PROVOX, "--explain").startswith(told(*PROVOX).rstrip())


class TestScans:
    """Settings for other intervals, and without making up for them."""

    WORDS = (*PROVOX, "--set", "FORM=Standard", "--set", "STRUCTURE=1", "--set", "ALPHA=0.203008", "--scan", "0.5,1")

    def test_the_settings_are_the_plain_ones_unless_compensation_is_asked_for(self) -> None:
        plain, compensated = converted(*self.WORDS), converted(*self.WORDS, "--compensate")
        rates = [found["to"]["settings"]["RATE"]["value"] for found in (plain, compensated)]
        assert rates == pytest.approx([3.6944, 3.9444], abs=1e-4)  # more derivative by half the difference, 0.25 s
        assert [found["certificate"]["compensated"] for found in (plain, compensated)] == [False, True]
        assert plain["to"]["settings"] == converted(*self.WORDS[:-2])["to"]["settings"]

    def test_what_the_scans_cost_is_said_and_the_compensated_settings_stand_beside(self) -> None:
        found = converted(*self.WORDS)
        assert found["certificate"]["scan_cost"]["phase_deg"] > 1
        assert "The new controller scans more slowly: the loop loses " in found["sentence"]
        assert any("--compensate" in json.dumps(beside) for beside in found["beside"])

    def test_a_faster_scan_gains_phase_and_costs_no_verdict(self) -> None:
        found = converted(*PROVOX, "--scan", "1,0.5")
        assert found["verdict"] == "exact"
        assert "The new controller scans faster: the loop gains " in found["sentence"]


class TestCutOver:
    """What to set, in which order."""

    def test_the_steps_are_numbered_and_the_bump_is_stated(self) -> None:
        words = (
            "convert", "fisher/provox", "GAIN=2", "RESET=4", "--to", "simple-pid/simple-pid", "--cut-over", "50,48,43",
            "--action", "reverse", "--pv-range", "0,100", "--op-range", "0,100",
        )  # fmt: skip
        rows = section(told(*words), "Cut-over")
        numbered = [row[0] for row in rows if row[0].rstrip(".").isdigit()]
        assert numbered == [f"{k}." for k in range(1, len(numbered) + 1)]
        bump = next(" ".join(row) for row in rows if row[:3] == ["the", "output", "then"])
        assert bump.endswith("% of span; without this, by 4 %")  # P of 2 x 2 on top of the output

    def test_json_has_the_plan_of_the_function(self) -> None:
        plan = converted(*PROVOX, "--cut-over", "50,48.5,40")["transfer_plan"]
        wanted = pidemu.convert(source(), "emerson/deltav").transfer_plan(50, 48.5, 40)
        assert plan == {"at": [50, 48.5, 40], **json.loads(json.dumps(wanted.to_dict()))}
        assert {"steps", "bump", "without_plan", "is_bumpless", "notes"} <= set(plan)

    def test_the_target_s_scan_interval_is_used(self) -> None:
        plan = converted(*PROVOX, "--cut-over", "50,48.5,40", "--scan", "1,0.5")["transfer_plan"]
        wanted = pidemu.convert(source(), "emerson/deltav", scan=(1, 0.5)).transfer_plan(50, 48.5, 40)
        assert plan == {"at": [50, 48.5, 40], **json.loads(json.dumps(wanted.to_dict()))}


class TestFrom:
    """Where it is not sure what the numbers mean."""

    def test_two_readings_are_both_shown_and_none_is_chosen(self) -> None:
        status, out, err = said("convert", "--from", "provox", "GAIN=2", "RESET=0.75", "--to", "emerson/deltav")
        assert (status, out) == (1, "")
        assert err.startswith("question: these settings can be read in 2 ways. ")
        assert "RESET = 80 s/repeat" in err
        assert "RESET = 45 s/repeat" in err

    def test_each_command_that_is_shown_runs_and_keeps_process_and_scans(self) -> None:
        words = ("--to", "emerson/deltav", "--process", PROCESS, "--scan", "1,0.5", "--compensate")
        status, out, _ = said("convert", "--from", "provox", "GAIN=2", "RESET=0.75", *words, "--json")
        found = strict_json(out)
        [question] = found["questions"]
        assert (status, found["verdict"], len(question["readings"])) == (1, "question", 2)
        for reading in question["readings"]:
            program, *command = shlex.split(reading["command"])
            assert program == "pidemu"
            again = converted(*command)
            assert {n: v["value"] for n, v in again["to"]["settings"].items()} == {
                n: v["value"] for n, v in reading["settings"].items()
            }
            assert (again["process"], again["scan"]) == ("0.5 exp(-3 s)/(20 s + 1)", [1.0, 0.5])
            assert (
                "--compensate" in command
            )  # a PI loop has no derivative to make up for a scan with: its settings are the plain ones

    def test_one_reading_is_converted_as_if_its_card_had_been_given(self) -> None:
        word = ("convert", "--from", "provox", "GAIN=2", "RESET=4 repeat/min", "RATE=0.1", "--to", "emerson/deltav")
        assert converted(*word) == converted(*STATED)

    def test_the_values_may_stand_before_the_options(self) -> None:
        word = ("convert", "GAIN=2", "RESET=4 repeat/min", "RATE=0.1", "--from", "provox", "--to", "emerson/deltav")
        assert converted(*word) == converted(*STATED)

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
        assert "5.25" in words
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
        assert answer(found) == answer(converted(*words, "--process", PROCESS))

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
    "gain=1,integrators=1.5": "integrators is '1.5'; give how many there are: 0 to 4, and usually 0 or 1",
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
    "best": "match is 'best'; it is one of exact, same-numbers, low-frequency, textbook, frequency, loop, constrained, or "
    "frequency:0.02rad/s",
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


def test_digits_beyond_six_are_printed_when_typed_or_asked_for() -> None:
    out = said("convert", "generic/standard", "K=2.123456789", "Ti=20", "--to", "emerson/deltav", "--digits", "9").out
    assert "2.123456789" in out
    assert "2.12345679" in out.replace("2.123456789", "")
