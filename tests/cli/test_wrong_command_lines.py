"""Command lines that cannot be carried out: the words on stderr, one cause and one remedy, and the exit status."""

from __future__ import annotations

from pathlib import Path

import pytest

from pidemu.card.library import ENVIRONMENT
from tests.checks.bench import VALID, edited, written
from tests.cli.helpers import Said, said

_LINES = {
    "code": "code [OPTIONS] CARD NAME=VALUE...",
    "convert": "convert [OPTIONS] [CARD] NAME=VALUE...",
    "run": "run [OPTIONS] CARD NAME=VALUE...",
    "show": "show [OPTIONS] CARD [NAME=VALUE]...",
    "cards": "cards [OPTIONS] [WORD]",
}
_PI = "fisher/provox GAIN=2 RESET=4"
_TO = "--to emerson/deltav"
_EXAMPLE = 'write for example GAIN=2 or "RESET=20 s/repeat"'
_RANGE = 'is not a range; write low and high with a unit, such as "0,400 degC"'
_ENDS = "is not a range; give two finite numbers, low before high"
_NUMBER = 'is not a number, nor a number with a unit such as "20 s/repeat"'
_SCAN = "is not a scan interval; write seconds, such as 0.5, or a unit too, 500 ms; 1,0.5 for source and target"
_LISTS = "'pidemu cards' lists them"


def usage(command: str, message: str) -> str:
    """What click prints of a wrong usage."""
    return f"Usage: pidemu {_LINES[command]}\nTry 'pidemu {command} --help' for help.\n\nError: {message}\n"


def error(message: str) -> str:
    """What pidemu prints of an error of its own."""
    return f"error: {message}\n"


def words(line: str) -> list[str]:
    """Split a line at blanks; an underscore stands for a blank inside a word."""
    return [word.replace("_", " ") for word in line.split()]


CARDS_AND_OPTIONS = {
    "show fisher/provx": f"no card 'fisher/provx' (did you mean 'fisher/provox'?); {_LISTS}",
    "show provox": f"no card 'provox' (did you mean 'fisher/provox'?); {_LISTS}",
    "show ../fisher/provox": f"no card '../fisher/provox' (did you mean 'fisher/provox'?); {_LISTS}",
    "show block.yaml": "no file 'block.yaml'",
    "show fisher/provox FORM=Series": "fisher/provox: unknown setting or option 'FORM'; settings: GAIN, RESET, RATE; options: none",
    "show emerson/deltav FROM=Series": (
        "emerson/deltav: unknown setting or option 'FROM' (did you mean 'FORM'?); settings: GAIN, RESET, RATE, ALPHA, BETA, GAMMA, "
        "PV_FTIME, SP_FTIME, ARW_HI_LIM, ARW_LO_LIM, NL_GAP, NL_MINMOD; options: FORM, STRUCTURE, FRSIPID_OPTS"
    ),
    "show emerson/deltav FORM=Seris": (
        "emerson/deltav: option FORM has no choice 'Seris' (did you mean 'Series'?); choices: Standard, Series"
    ),
    "show emerson/deltav FORM": "'FORM' is not NAME=VALUE; write for example GAIN=2 or \"RESET=20 s/repeat\"",
    "check nowhere": "no file or folder 'nowhere'",
    "check empty": "no .yaml file below 'empty'",
    "check --vendors nowhere": "no folder 'nowhere'; a folder of cards holds <vendor>/<block>.yaml",
    "cards --vendors nowhere": "no folder 'nowhere'; a folder of cards holds <vendor>/<block>.yaml",
    f"convert {_PI} --to emerson/deltv": f"no card 'emerson/deltv' (did you mean 'emerson/deltav'?); {_LISTS}",
    f"convert {_PI} {_TO} --set FORM=Seris": (
        "emerson/deltav: option FORM has no choice 'Seris' (did you mean 'Series'?); choices: Standard, Series"
    ),
    "convert --loop nowhere.yaml": "no file 'nowhere.yaml'",
}

SETTINGS = {
    f"convert fisher/provox GAIN=2 {_TO}": "fisher/provox: RESET: missing; it sets the integral (reset rate), in repeat/min",
    f"convert fisher/provox {_TO}": (
        "fisher/provox: GAIN: missing; it sets the gain (% output per % PV), in %/%\n"
        "fisher/provox: RESET: missing; it sets the integral (reset rate), in repeat/min"
    ),
    f"convert fisher/provox GIAN=2 RESET=4 {_TO}": (
        "fisher/provox: unknown setting 'GIAN' (did you mean 'GAIN'?); settings: GAIN, RESET, RATE"
    ),
    f"convert fisher/provox GAIN=2 RESET=4_% {_TO}": (
        "fisher/provox: RESET: '%' is a percentage and cannot set integral; "
        "use one of: s, s/repeat, repeat/s, 1/s, min, min/repeat, repeat/min, 1/min"
    ),
    f"convert fisher/provox GAIN=2_s RESET=4 {_TO}": (
        "fisher/provox: GAIN: 's' is a time and cannot set gain; use one of: 1, %/%, %, eu, eu/eu, %/eu"
    ),
    f"convert {_PI} RATE=3_repeat/min {_TO}": (
        "fisher/provox: RATE: 'repeat/min' is repeats per time and cannot set derivative; use one of: s, min"
    ),
    "convert generic/parallel kp=1 ki=3_repeat/min --to generic/standard": (
        "generic/parallel: ki: '3 repeat/min' counts repeats of the proportional action, but this dial is a gain of its own, "
        "in 1/s; write 3 1/min if the gain is meant"
    ),
    f"convert fisher/provox GAIN=nan RESET=4 {_TO}": "fisher/provox: GAIN: is not a number (NaN)",
    f"convert fisher/provox GAIN=inf RESET=4 {_TO}": "fisher/provox: GAIN: "
    "inf %/% is infinite, and infinity does not switch it off here",
    f"convert fisher/provox GAIN=2,5 RESET=4 {_TO}": "fisher/provox: GAIN: '2,5' has a comma; write a decimal point",
    f"convert fisher/provox GAIN=two RESET=4 {_TO}": f"fisher/provox: GAIN: 'two' {_NUMBER}",
    f"convert fisher/provox GAIN=-2 RESET=4 {_TO}": "fisher/provox: GAIN: -2 %/% is outside 0 to inf %/%",
    f"convert fisher/provox GAIN=off RESET=4 {_TO}": ("fisher/provox: GAIN: cannot be switched off: the card states no off value"),
    f"convert generic/standard K=1 Ti=0 {_TO}": ("generic/standard: Ti: 0 s would be infinite action; inf switches it off"),
    f"convert honeywell/udc GAIN=2 RSET=80 {_TO}": ("honeywell/udc: RSET: 80 min/repeat is outside 0.02 to 50 min/repeat"),
    f"convert honeywell/udc GAIN=2 RSET=9000_s/repeat {_TO}": (
        "honeywell/udc: RSET: 150 min/repeat (given as 9000 s/repeat) is outside 0.02 to 50 min/repeat"
    ),
    f"convert {_PI} GAIN=3 {_TO}": "GAIN is given twice, 2 and 3; give it once",
    f"convert {_PI} gain=3 {_TO}": "gain is given twice, 2 and 3; give it once",
    f"convert {_PI} {_TO} --set ALPHA=0.1 --set alpha=0.2": "alpha is given twice, 0.1 and 0.2; give it once",
    f"convert fisher/provox GAIN 2 {_TO}": f"'GAIN' is not NAME=VALUE; {_EXAMPLE}",
    f"convert {_PI} RATE= {_TO}": f"'RATE=' is not NAME=VALUE; {_EXAMPLE}",
    f"convert {_PI} =3 {_TO}": f"'=3' is not NAME=VALUE; {_EXAMPLE}",
    f"convert {_PI} {_TO} --set ALPHA": f"'ALPHA' is not NAME=VALUE after --set; {_EXAMPLE}",
    f"convert {_PI} {_TO} --set ALPHA=2": "emerson/deltav: ALPHA: 2 is outside 0.05 to 1",
    f"convert {_PI} {_TO} --set GAIN=2": "emerson/deltav: GAIN is what the conversion computes; it cannot be given",
    f"convert {_PI} {_TO} --set ALFA=2": (
        "emerson/deltav: unknown setting 'ALFA' (did you mean 'ALPHA'?); "
        "settings: GAIN, RESET, RATE, ALPHA, BETA, GAMMA, PV_FTIME, SP_FTIME, ARW_HI_LIM, ARW_LO_LIM, NL_GAP, NL_MINMOD, FORM, "
        "STRUCTURE, FRSIPID_OPTS"
    ),
}

RUNS = {
    f"run {_PI} --record none.csv": "none.csv: cannot be read: No such file or directory",
    f"run {_PI} --record empty": "empty: cannot be read: it is a folder",
    f"run {_PI} --record good.csv --scan 0": "scan interval 0 s is not a positive number",
    f"run {_PI} --record good.csv --scan inf": "scan interval is inf; give a finite number",
    f"run {_PI} --record good.csv --bias 3": ("a bias belongs to a positional controller without integral action; leave it out"),
    f"run {_PI} --record good.csv --initial-output nan": "initial output is nan; give a finite number",
    "run generic/standard K=2 Ti=off --record good.csv --bias nan": "bias is nan; give a finite number",
    f"run {_PI} --record good.csv -o nowhere/out.csv": "nowhere/out.csv: cannot be written: No such file or directory",
    f"run {_PI} --record good.csv -o empty": "empty: cannot be written: it is a folder",
    f"code {_PI} --scan -1": "scan interval -1 s is not a positive number",
}

USAGE = {
    f"run {_PI} --record good.csv --limits 100,0": (
        "run",
        "Invalid value for '--limits': '100,0' is not low and high; write the lower number first, such as 0,100",
    ),
    f"code {_PI} --limits 3,1": (
        "code",
        "Invalid value for '--limits': '3,1' is not low and high; write the lower number first, such as 0,100",
    ),
    "cards nothing-like": ("cards", "no card holds 'nothing-like'; 'pidemu cards' lists all"),
    "show": ("show", "Missing argument 'CARD'."),
    "convert": (
        "convert",
        "no CARD to convert from; for example: pidemu convert fisher/provox GAIN=2 RESET=4 --to emerson/deltav",
    ),
    f"convert {_PI}": ("convert", "no card to convert to; add --to CARD, 'pidemu cards' lists them"),
    f"convert {_PI} {_TO} --pv-range 5": ("convert", f"Invalid value for '--pv-range': '5' {_RANGE}"),
    f"convert {_PI} {_TO} --op-range low,high": ("convert", f"Invalid value for '--op-range': 'low,high' {_RANGE}"),
    f"convert {_PI} {_TO} --pv-range 200,0": ("convert", f"Invalid value for '--pv-range': 200 to 0 {_ENDS}"),
    f"convert {_PI} {_TO} --pv-range 0,inf": ("convert", f"Invalid value for '--pv-range': 0 to inf {_ENDS}"),
    f"convert {_PI} {_TO} --pv-range 0,100 --to-pv-range 200,0": (
        "convert",
        f"Invalid value for '--to-pv-range': 200 to 0 {_ENDS}",
    ),
    f"convert {_PI} {_TO} --match best": (
        "convert",
        "Invalid value for '--match': match is 'best'; it is one of exact, same-numbers, low-frequency, textbook, frequency, loop, "
        "constrained, or frequency:0.02rad/s",
    ),
    f"run {_PI}": ("run", "Missing option '--record'."),
    f"run {_PI} --record good.csv --scan fast": ("run", "Invalid value for '--scan': 'fast' is not a valid float."),
    f"run {_PI} --record good.csv --action up": (
        "run",
        "Invalid value for '--action': 'up' is not one of 'reverse', 'direct'.",
    ),
}

RECORDS = {
    "": "no samples; a record has a header line such as sp,pv and one line per scan",
    "sp,pv\n": "no samples; a record has a header line such as sp,pv and one line per scan",
    "# only a remark\n": "no samples; a record has a header line such as sp,pv and one line per scan",
    "sp,out\n1,2\n": "no column 'pv' among sp, out",
    "# trend\nset,pv\n1,2\n": "no column 'sp' among set, pv",
    "sp,pv\n1,2\n\n1,high\n": "column pv: 'high' is not a number",
    'sp,pv\n"2,5",2\n': "column sp: '2,5' has a comma; write a decimal point",
    "sp,pv\n1,\n": "column pv: empty; every sample needs a number",
    "sp,pv,auto\n1,2,cascade\n": "column auto: 'cascade' is neither 1 (automatic) nor 0 (manual)",
    "sp,pv,man\n1,2,x\n": "column man: 'x' is not a number",
    "sp,pv\n1,2\n1\n": "1 cell, the header has 2",
    "sp,pv\n1,2,3\n": "3 cells, the header has 2",
    "sp,pv,PV,y\n1,2,3,4\n": "columns pv, PV, y all mean pv; keep one",
}


@pytest.fixture(autouse=True)
def _files(folder: Path) -> None:
    (folder / "empty").mkdir()
    (folder / "good.csv").write_text("sp,pv\n50,49\n50,49.5\n", encoding="utf-8")


@pytest.mark.parametrize(("line", "message"), [*CARDS_AND_OPTIONS.items(), *SETTINGS.items(), *RUNS.items()])
def test_what_cannot_be_done_is_said_in_one_message_with_status_2(line: str, message: str) -> None:
    assert said(*words(line)) == Said(2, "", error(message))


@pytest.mark.parametrize(("line", "expected"), USAGE.items())
def test_wrong_usage_is_said_with_the_usage_and_status_2(line: str, expected: tuple[str, str]) -> None:
    assert said(*words(line)) == Said(2, "", usage(*expected))


def test_a_scan_interval_may_have_a_unit() -> None:
    with_unit, plain = (said("convert", *_PI.split(), *_TO.split(), "--scan", scan) for scan in ("500 ms,1 s", "0.5,1"))
    assert with_unit == plain
    assert with_unit.status == 0


@pytest.mark.parametrize("scan", ["0", "-1", "a", "nan", "inf", "1,2,3", "1,", "", "500_parsec"])
def test_a_scan_interval_that_is_none_is_refused(scan: str) -> None:
    [scan] = words(scan) or [""]
    message = usage("convert", f"Invalid value for '--scan': '{scan}' {_SCAN}")
    assert said("convert", *_PI.split(), *_TO.split(), "--scan", scan) == Said(2, "", message)


@pytest.mark.parametrize(("text", "message"), RECORDS.items())
def test_a_record_that_cannot_be_used_is_refused_with_line_and_column(text: str, message: str, folder: Path) -> None:
    (folder / "bad.csv").write_text(text, encoding="utf-8")
    lines = [n for n, line in enumerate(text.split("\n"), 1) if line and not line.startswith("#")]
    where = "" if len(lines) < 2 else f":{lines[0] if message.startswith(('no column', 'columns')) else lines[-1]}"
    assert said("run", *_PI.split(), "--record", "bad.csv") == Said(2, "", error(f"bad.csv{where}: {message}"))


def test_a_record_in_another_encoding_is_refused(folder: Path) -> None:
    (folder / "bad.csv").write_bytes("sp,pv,Störung\n1,2,3\n".encode("latin-1"))
    message = error("bad.csv:1:9: not UTF-8 text (byte 0xF6); save the file as UTF-8")
    assert said("run", *_PI.split(), "--record", "bad.csv") == Said(2, "", message)


def test_a_range_that_only_the_target_has_is_asked_about() -> None:
    """It is a question and no wrong usage: the answer is a number of the plant."""
    text = "fisher/provox: the target's PV range is 0 to 200, the source's is not given; give both, also where they agree"
    assert said("convert", *_PI.split(), *_TO.split(), "--to-pv-range", "0,200") == Said(1, "", f"question: {text}\n")


def test_an_unknown_command_is_refused_with_the_nearest_one() -> None:
    status, out, err = said("cnvert")
    assert (status, out) == (2, "")
    assert "'cnvert'" in err
    assert "did you mean 'convert'?" in err.lower()


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("show fisher/provox --josn", "--json"),
        ("cards deltav provox", "provox"),
        (f"convert {_PI} --to", "--to"),
        (f"code {_PI} --lang ada", "'ada'"),
    ],
)
def test_click_s_own_messages_name_the_word(line: str, word: str) -> None:
    status, out, err = said(*words(line))
    assert (status, out) == (2, "")
    assert word in err


def test_a_missing_folder_in_the_environment_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ENVIRONMENT, "nowhere")
    message = error("no folder 'nowhere'; a folder of cards holds <vendor>/<block>.yaml")
    assert said("cards") == Said(2, "", message)


@pytest.mark.parametrize(
    "line", ["show nobody/bench.yaml", f"convert {_PI} --to nobody/bench.yaml", "code nobody/bench.yaml GAIN=1 RESET=1"]
)
def test_a_broken_card_is_refused_at_its_place_with_status_1(line: str, folder: Path) -> None:
    written(folder, edited(VALID, ("form: standard", "form: serial")))
    assert said(*words(line)) == Said(
        1,
        "",
        "error: nobody/bench.yaml:7:7: 'serial' is not one of 'parallel', 'standard', 'series' or 'dahlin' "
        "(did you mean 'series'?)\n"
        "  6 |   manual: {title: Bench manual, read: 2026-01-02}\n"
        "  7 | form: serial\n"
        "    |       ^^^^^^\n"
        "  8 | implementation: positional\n",
    )


@pytest.mark.parametrize(
    ("text", "headlines"),
    [
        (
            "card: fisher/provox\nsetings: {GAIN: 2}\n",
            ["1:1: missing key 'settings'", "2:1: unknown key 'setings' (did you mean 'settings'?)"],
        ),
        ("settings: {GAIN: 2}\nto: emerson/deltav\n", ["1:1: missing key 'card'"]),
        ("card: fisher/provox\nsettings: {GAIN: }\n", ["2:18: empty; write it, or remove the key"]),
        ("card: fisher/provox\nsettings: {GAIN: 2}\nscan: []\n", ["3:7: empty; write it, or remove the key"]),
        ("card: fisher/provox\nsettings: {GAIN: 2}\nscan: [1, 2, 3]\n", ["3:7: expected 1 to 2 values, found 3"]),
        ("card: fisher/provox\nsettings: {GAIN: 2}\nscan: [1 s]\n", ["3:8: '1 s' is not a number"]),
        ("card: fisher/provox\nsettings: {GAIN: 2}\nset: FORM\n", ["3:6: expected a mapping (key: value), found 'FORM'"]),
    ],
)
def test_a_wrong_loop_file_is_refused_at_its_place_with_status_1(text: str, headlines: list[str], folder: Path) -> None:
    (folder / "loop.yaml").write_text(text, encoding="utf-8")
    status, out, err = said("convert", "--loop", "loop.yaml")
    assert (status, out) == (1, "")
    assert [f"loop.yaml:{h}" for h in headlines] == [
        line.removeprefix("error: ") for line in err.splitlines() if "loop.yaml:" in line
    ]


def test_settings_that_are_one_word_are_told_how_to_be_separated() -> None:
    status, out, err = said("show", "fisher/provox", "GAIN=2,RESET=4")
    expected = "error: 'GAIN=2,RESET=4' is more than one setting; separate them by blanks, such as GAIN=2 RESET=20\n"
    assert (status, out, err) == (2, "", expected)
