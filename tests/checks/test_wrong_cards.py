"""What a contributor reads when a card is no YAML or has the wrong shape: every fault at its line and column."""

from __future__ import annotations

from pathlib import Path

import pytest

from pidemu.card.library import card_files
from pidemu.checks import check_file
from tests.checks.bench import CHOICE, VALID, WINDUP, Edit, edited, faults, headlines

_SETS = (
    "'gain', 'multiplier', 'integral', 'derivative', 'filter-time', 'filter-ratio', 'filter-gain', 'proportional-weight', "
    "'derivative-weight', 'tracking-time', 'filter-factor', 'integral-limit', 'windup-limit', 'deadband', 'gap-gain', 'linearity', "
    "'feedforward-gain', 'bias', 'output-rate', 'setpoint-rate', 'resolution', 'process-gain', 'process-time', 'process-delay' "
    "or 'closed-loop-time'"
)
_SCHEMES = (
    "'back-calculation', 'clamp', 'clamp-sum', 'conditional', 'external-reset', 'freeze', 'none', 'recompute', "
    "'reset-outside-band', 'velocity'"
)
_NAME = "is not a name: letters, digits and underscores, starting with a letter"
_WORDS = "'error', 'pv', 'weighted' or 'none'"

Case = tuple[Edit | tuple[Edit, ...], tuple[str, ...]]

UNKNOWN_KEYS: dict[str, Case] = {
    "at the top": (
        ("form: standard", "fomr: standard"),
        ("1:1: missing key 'form'", "7:1: unknown key 'fomr' (did you mean 'form'?)"),
    ),
    "at the top, like no other": (("quirks:", "remarks: none\nquirks:"), ("42:1: unknown key 'remarks'",)),
    "in a section": (
        ("{on: pv, filter:", "{on: pv, filtr:"),
        ("11:22: unknown key 'filtr' (did you mean 'filter'?)",),
    ),
    "in the filter": (
        ("applies-to: term", "aplies-to: term"),
        ("11:22: missing key 'applies-to'", "11:31: unknown key 'aplies-to' (did you mean 'applies-to'?)"),
    ),
    "in a setting": (
        ("off: 0, default: 0", "off: 0, defualt: 0"),
        ("16:45: unknown key 'defualt' (did you mean 'default'?)",),
    ),
    "in a source": (
        ("title: Bench manual", "titel: Bench manual"),
        ("6:3: missing key 'title'", "6:12: unknown key 'titel' (did you mean 'title'?)"),
    ),
    "in evidence, by upper case": (("at: trace 1", "At: trace 1"), ("31:54: unknown key 'At' (did you mean 'at'?)",)),
    "in a quirk": (
        ("hums., source: manual", "hums., sources: manual"),
        ("43:29: unknown key 'sources' (did you mean 'source'?)",),
    ),
    "in an example": (
        ("  - given:", "  - givn:"),
        ("45:5: missing key 'given'", "45:5: unknown key 'givn' (did you mean 'given'?)"),
    ),
    "in an example's gains": (("kd: 32, Tf: 2", "kd: 32, tf: 2"), ("46:47: unknown key 'tf' (did you mean 'Tf'?)",)),
    "in the action's example": (
        ("Reverse, sp: 50", "Reverse, SP: 50"),
        ("26:3: missing key 'sp'", "26:28: unknown key 'SP' (did you mean 'sp'?)"),
    ),
    "in an option": (
        ("    choices:", "    choises:"),
        ("19:3: missing key 'choices'", "21:5: unknown key 'choises' (did you mean 'choices'?)"),
    ),
}

MISSING_KEYS: dict[str, Case] = {
    "of the card": (("form: standard\n", ""), ("1:1: missing key 'form'",)),
    "of the language": (("card: 1\n", ""), ("1:1: missing key 'card'",)),
    "of a section": (("rule: backward, ", ""), ("10:1: missing key 'rule'",)),
    "of a setting": (('gain, unit: "%/%"', "gain"), ("14:3: missing key 'unit'",)),
    "in two places": (
        (("read: 2026-01-02", "note: old"), ("form: standard\n", "")),
        ("1:1: missing key 'form'", "6:3: missing key 'read'"),
    ),
}

WRONG_TYPES: dict[str, Case] = {
    "a word for a number": (("[0.05, 1]", "[low, 1]"), ("17:50: 'low' is not a number",)),
    "a quoted number": (("off: 0, default: 0", 'off: 0, default: "0"'), ("16:54: '0' is not a number",)),
    "true for a number": (("off: 0, default: 0", "off: 0, default: true"), ("16:54: True is not a number",)),
    "a word for an off value": (("off: inf", "off: never"), ("15:41: 'never' is not a number",)),
    "a word among off values": (("off: inf", "off: [inf, never]"), ("15:47: 'never' is not a number",)),
    "a resolution in quotes": (("off: inf", "off: inf, resolution: '1'"), ("15:58: '1' is not a number",)),
    "a resolution of zero": (("off: inf", "off: inf, resolution: 0"), ("15:58: 0 is not above zero",)),
    "a word for yes or no": (
        ("proportional: {on: error}", "proportional: {on: error, accumulated: perhaps}"),
        ("9:40: 'perhaps' is neither true nor false",),
    ),
    "yes for true": (
        ("proportional: {on: error}", "proportional: {on: error, accumulated: yes}"),
        ("9:40: 'yes' is neither true nor false",),
    ),
    "a word for a mapping": (
        ("transfer: {start: bumpless}", "transfer: bumpless"),
        ("12:11: expected a mapping (key: value), found 'bumpless'",),
    ),
    "nothing for a mapping": (
        ("scan: {default: 1 s}", "scan:"),
        ("27:6: expected a mapping (key: value), found nothing",),
    ),
    "a list for a mapping": (
        ("scan: {default: 1 s}", "scan: [1 s]"),
        ("27:7: expected a mapping (key: value), found a list",),
    ),
    "a mapping for a list": (("  - {text: The", "  {text: The"), ("43:3: expected a list, found a mapping",)),
    "a number for a pair": (("limits: [0, 100]", "limits: 100"), ("28:18: expected a list, found '100'",)),
    "one number for a pair": (("[0.05, 1]", "[0.05]"), ("17:49: expected 2 values, found 1",)),
    "three numbers for a pair": (("[0.05, 1]", "[0.05, 1, 2]"), ("17:49: expected 2 values, found 3",)),
    "a number for a text": (
        ("product: test bench", "product: 3500"),
        ("3:10: 3500 is not a text; put it in quotes if it is meant as one",),
    ),
    "the unit 1 without quotes": (
        ('unit: "1"', "unit: 1"),
        ("17:37: 1 is not a text; put it in quotes if it is meant as one",),
    ),
    "a page number without p.": (
        ("at: trace 1", "at: 7"),
        ("31:58: 7 is not a text; put it in quotes if it is meant as one",),
    ),
    "a scan interval without a unit": (
        ("scan: {default: 1 s}", "scan: {default: 1}"),
        ("27:17: 1 is not a text; put it in quotes if it is meant as one",),
    ),
    "an empty text": (("vendor: Nobody", 'vendor: ""'), ("2:9: empty; write it, or remove the key",)),
    "blanks for a text": (("vendor: Nobody", 'vendor: "  "'), ("2:9: empty; write it, or remove the key",)),
    "nothing for a text": (("vendor: Nobody", "vendor:"), ("2:8: empty; write it, or remove the key",)),
    "an empty name": (("  manual: {title", '  "": {title'), ("6:3: empty; write it, or remove the key",)),
    "nothing for a value in an example": (
        ("RESET: 60, RATE: 16", "RESET: 60, RATE: null"),
        ("45:39: empty; write it, or remove the key",),
    ),
    "no examples": (
        (VALID[VALID.index("examples:") :], "examples: []\n"),
        ("44:11: empty; write it, or remove the key",),
    ),
    "an option without choices": (
        (VALID[VALID.index("    choices:") : VALID.index("action:")], "    choices: {}\n"),
        ("21:14: empty; write it, or remove the key",),
    ),
    "words for a date": (("read: 2026-01-02", "read: last week"), ("6:39: 'last week' is not a date such as 2026-11-22",)),
    "a month too many": (("read: 2026-01-02", "read: 2026-13-02"), ("6:39: '2026-13-02' is not a date such as 2026-11-22",)),
    "a year for a date": (("read: 2026-01-02", "read: 2026"), ("6:39: 2026 is not a date such as 2026-11-22",)),
    "zero for a date": (("read: 2026-01-02", "read: 0"), ("6:39: 0 is not a date such as 2026-11-22",)),
    "a time of day with the date": (
        ("read: 2026-01-02", "read: 2026-01-02 10:00"),
        ("6:39: '2026-01-02 10:00' is not a date such as 2026-11-22",),
    ),
}

WRONG_WORDS: dict[str, Case] = {
    "a later card language": (
        ("card: 1", "card: 2"),
        ("1:7: card language 2 is unknown; this version of pidemu reads 1",),
    ),
    "form": (
        ("form: standard", "form: serial"),
        ("7:7: 'serial' is not one of 'parallel', 'standard', 'series' or 'dahlin' (did you mean 'series'?)",),
    ),
    "upper case": (
        ("derivative: {on: pv", "derivative: {on: PV"),
        (f"11:18: 'PV' is not one of {_WORDS} (did you mean 'pv'?)",),
    ),
    "what a dial sets": (("sets: gain", "sets: gian"), (f"14:16: 'gian' is not one of {_SETS} (did you mean 'gain'?)",)),
    "status": (
        ("status: measured", "status: proven"),
        ("31:28: 'proven' is not one of 'documented', 'measured', 'inferred' or 'assumed'",),
    ),
    "rule": (
        ("rule: backward", "rule: tustin"),
        ("10:29: 'tustin' is not one of 'backward', 'forward' or 'trapezoidal'",),
    ),
    "a number among numbers": (
        ("applies-to: term", "applies-to: term, order: 3"),
        ("11:56: 3 is not one of 1 or 2",),
    ),
    "a name of the action": (
        ("direct: Direct", "backwards: Direct"),
        ("25:29: 'backwards' is not one of 'reverse' or 'direct'",),
    ),
    "the default choice": (("default: PID", "default: PI"), ("20:14: default 'PI' is not one of the choices: PID, I-PD",)),
}

WRONG_WINDUP: dict[str, Case] = {
    "an unknown scheme": (
        (WINDUP, "{scheme: back-calculated, tracking-time: Ti}"),
        (f"10:47: 'back-calculated' is not one of {_SCHEMES} (did you mean 'back-calculation'?)",),
    ),
    "no scheme": ((WINDUP, "{tracking-time: Ti}"), ("10:39: missing key 'scheme'",)),
    "a key of another scheme": (
        (WINDUP, "{scheme: clamp, tracking-time: Ti}"),
        ("10:63: 'tracking-time' does not go with scheme 'clamp'",),
    ),
    "a key of freeze": (
        (WINDUP, "{scheme: conditional, direction: both}"),
        ("10:69: 'direction' does not go with scheme 'conditional'",),
    ),
    "a key of conditional": (
        (WINDUP, "{scheme: freeze, test: error-times-output}"),
        ("10:64: 'test' does not go with scheme 'freeze'",),
    ),
    "a key that its scheme needs": ((WINDUP, "{scheme: back-calculation}"), ("10:39: missing key 'tracking-time'",)),
    "a misspelt key": (
        (WINDUP, "{scheme: back-calculation, traking-time: Ti}"),
        ("10:39: missing key 'tracking-time'", "10:74: unknown key 'traking-time' (did you mean 'tracking-time'?)"),
    ),
    "a scheme alone": ((WINDUP, "clamp"), ("10:47: expected a mapping (key: value), found 'clamp'",)),
    "nothing": ((WINDUP, "null"), ("10:47: expected a mapping (key: value), found nothing",)),
    "a tracking time with its unit": (
        (WINDUP, "{scheme: back-calculation, tracking-time: 5 s}"),
        (f"10:89: '5 s' {_NAME}, nor a number, nor one of 'Ti' or 'sqrt(Ti Td)'",),
    ),
}

WRONG_NUMBERS: dict[str, Case] = {
    "not a number as default": (("default: 0.125", "default: .nan"), ("17:69: nan is not a number; give one",)),
    "not a number as a limit": (
        (WINDUP, "{scheme: none}, limits: {low: .nan, high: output}"),
        ("10:77: nan is not a number; give one",),
    ),
    "not a number in a range": (("[0.05, 1]", "[0.05, .nan]"), ("17:56: nan is not a number; give one",)),
    "too large": (("default: 0.125", "default: 1e300"), ("17:69: 1e+300 is not a plausible number",)),
    "too small": (("ratio: ALPHA", "ratio: -1e-300"), ("11:56: -1e-300 is not a plausible number",)),
    "among off values": (("off: 0, default", "off: [0, 5e-324], default"), ("16:46: 4.94066e-324 is not a plausible number",)),
    "in an example": (("GAIN: 2, RESET", "GAIN: 1e41, RESET"), ("45:19: 1e+41 is not a plausible number",)),
    "an infinite step": (("default: 0.125", "default: 0.125, resolution: .inf"), ("17:88: inf is not a finite number",)),
    "a step too small": (
        ("default: 0.125", "default: 0.125, resolution: 5e-324"),
        ("17:88: 4.94066e-324 is not a plausible number",),
    ),
    "counts beyond whole numbers": (
        ("\nevidence:", f"\narithmetic: {{type: integer, counts: 100, gain-counts: {10**298}}}\nevidence:"),
        (f"29:55: 1{'0' * 39}…{'0' * 20} is more than 1e+09, the largest that makes sense",),
    ),
    "a scan of no length": (
        ("default: 1 s", "default: 1e-300 ms"),
        ("27:17: '1e-300 ms' is not a plausible scan interval; write it like '1 s'",),
    ),
    "an endless scan": (
        ("default: 1 s", "default: 1e300 h"),
        ("27:17: '1e300 h' is not a plausible scan interval; write it like '1 s'",),
    ),
}

_HIDDEN = "is not allowed in a text; remove it"

WRONG_TEXTS: dict[str, Case] = {
    "an escape sequence": (("The bench hums.", r'"hums \e[2J"'), (f"43:12: character U+001B {_HIDDEN}",)),
    "NUL": (("note: from the step response", r'note: "a\0b"'), (f"33:54: character U+0000 {_HIDDEN}",)),
    "a character that turns the direction of writing": (
        ("The bench hums.", "hums \u202e"),
        (f"43:12: character U+202E {_HIDDEN}",),
    ),
    "a character that cannot be seen": (("product: test bench", "product: te\u200bst"), (f"3:10: character U+200B {_HIDDEN}",)),
    "the command of a terminal of eight bits": (
        ("product: test bench", r'product: "\x9b2J"'),
        (f"3:10: character U+009B {_HIDDEN}",),
    ),
    "an escape sequence as a choice": (
        ("      PID: {}", '      "PID\\e[2J": {}'),
        ("22:7: character U+001B is not allowed in a key; remove it",),
    ),
    "a line break in a choice": (
        ("      PID: {}", '      "PID\\nimport os": {}'),
        ("22:7: character U+000A is not allowed in a key; remove it",),
    ),
    "blanks around a choice": (("      PID: {}", "      'PID ': {}"), ("22:7: a key has blanks around it; remove them",)),
    "a name of two lines": (
        ("product: test bench", r'product: "test\nbench"'),
        ("3:10: more than one line; a name is one line, without tabs",),
    ),
    "a word for the action of two lines": (
        ("direct: Direct", r'direct: "a\nb"'),
        ("25:37: more than one line; a name is one line, without tabs",),
    ),
    "a long name": (("algorithm: PID", f"algorithm: {'P' * 201}"), ("4:12: 201 characters, at most 200 are allowed",)),
    "a long text": (("The bench hums.", "h" * 10_001), ("43:12: 10001 characters, at most 10000 are allowed",)),
    "a setting with a long name": (
        ("  RATE: {", f"  {'R' * 65}: {{"),
        ("16:3: 65 characters, at most 64 are allowed",),
    ),
    "a long word is cut": (
        ("form: standard", f"form: {'s' * 5000}"),
        (f"7:7: '{'s' * 40}…{'s' * 20}' is not one of 'parallel', 'standard', 'series' or 'dahlin'",),
    ),
    "one word for the action": ((", direct: Direct", ""), ("25:10: names needs both 'reverse' and 'direct'",)),
}

TOO_MANY: dict[str, Case] = {
    "settings": (
        ("options:\n", "".join(f"  S{i}: {{sets: bias, unit: '%'}}\n" for i in range(47)) + "options:\n"),
        ("14:3: expected 1 to 50 values, found 51",),
    ),
    "choices": (
        ("      PID: {}\n", "      PID: {}\n" + "".join(f"      C{i}: {{}}\n" for i in range(49))),
        ("22:7: expected 1 to 50 values, found 51",),
    ),
    "combinations of options": (
        (
            "options:\n  STRUCTURE",
            "options:\n"
            + "".join(f"  O{i}: {{default: a, choices: {{a: {{}}, b: {{}}, c: {{}}}}}}\n" for i in range(5))
            + "  STRUCTURE",
        ),
        ("18:1: the options can be chosen in 486 ways, at most 200 are checked; make it several cards",),
    ),
    "keys and values": (
        ("quirks:\n", "".join(f"k{i}: 1\n" for i in range(2500)) + "quirks:\n"),
        ("1930:8: more than 4,000 keys and values; no card is that long",),
    ),
    "characters": (("quirks:\n", f"# {'x' * 1_000_000}\nquirks:\n"), ("1:1: 1,001,726 characters; a card has at most 1,000,000",)),
}

WRONG_NAMES: dict[str, Case] = {
    "of a setting": (("  GAIN: {", "  GAIN %: {"), (f"14:3: 'GAIN %' {_NAME}",)),
    "that starts with a digit": (("  RATE: {", "  2RATE: {"), (f"16:3: '2RATE' {_NAME}",)),
    "of an option": (("  STRUCTURE:\n", "  CONTROL ALG:\n"), (f"19:3: 'CONTROL ALG' {_NAME}",)),
    "of a weight": (
        ("proportional: {on: error}", "proportional: {on: weighted, weight: b (0-1)}"),
        (f"9:38: 'b (0-1)' {_NAME}, nor a number",),
    ),
}

WRONG_CHOICES: dict[str, Case] = {
    "an unknown field": (
        (CHOICE, "{proportinal: {on: pv}}"),
        ("23:14: unknown key 'proportinal' (did you mean 'proportional'?)",),
    ),
    "a field that no option changes": ((CHOICE, "{vendor: Else}"), ("23:14: unknown key 'vendor'",)),
    "an unknown key in a field": ((CHOICE, "{proportional: {onn: pv}}"), ("23:29: unknown key 'onn' (did you mean 'on'?)",)),
    "a wrong word": ((CHOICE, "{proportional: {on: measurement}}"), (f"23:33: 'measurement' is not one of {_WORDS}",)),
    "a filter with a key missing": ((CHOICE, "{derivative: {filter: {ratio: 0.1}}}"), ("23:27: missing key 'applies-to'",)),
    "a windup with an unknown scheme": (
        (CHOICE, "{integral: {windup: {scheme: clmp}}}"),
        (f"23:33: 'clmp' is not one of {_SCHEMES} (did you mean 'clamp'?)",),
    ),
    "a windup with a key of another scheme": (
        (CHOICE, "{integral: {windup: {scheme: clamp, tracking-time: Ti}}}"),
        ("23:49: 'tracking-time' does not go with scheme 'clamp'",),
    ),
    "a setting with a misspelt key": (
        (CHOICE, "{settings: {RESET: {unti: min}}}"),
        ("23:33: unknown key 'unti' (did you mean 'unit'?)",),
    ),
    "a setting that is a number": (
        (CHOICE, "{settings: {RESET: 4}}"),
        ("23:32: expected a mapping (key: value), found '4'",),
    ),
    "a setting with a wrong name": (
        (CHOICE, "{settings: {GAIN %: {sets: gain, unit: '%'}}}"),
        (f"23:25: 'GAIN %' {_NAME}",),
    ),
    "a number for a text": (
        (CHOICE, "{scan: {default: 5}}"),
        ("23:30: 5 is not a text; put it in quotes if it is meant as one",),
    ),
    "a needed section removed": ((CHOICE, "{scan: null}"), ("23:14: missing key 'scan'",)),
    "a needed key removed": ((CHOICE, "{proportional: {on: null}}"), ("23:29: missing key 'on'",)),
    "nothing": ((CHOICE, ""), ("23:12: expected a mapping (key: value), found nothing",)),
    "a list": (("PID: {}", "PID: []"), ("22:12: expected a mapping (key: value), found a list",)),
}

NOT_YAML: dict[str, Case] = {
    "a duplicate key": (
        ("implementation: positional", "form: series\nimplementation: positional"),
        ("8:1: duplicate key 'form' (first on line 7); keep one",),
    ),
    "an alias": (
        (("form: standard", "form: &f standard"), ("implementation: positional", "implementation: *f")),
        (
            "7:7: anchor '&f' is not used in cards; remove it",
            "8:17: alias '*f' is not used in cards; write the value out",
        ),
    ),
    "a tag": (
        ("form: standard", "form: !!str standard"),
        ("7:7: tag 'tag:yaml.org,2002:str' is not used in cards; remove it",),
    ),
    "two documents": (
        ("form: standard", "---\nform: standard"),
        ("8:1: a second document; a card is one document, put it in a file of its own",),
    ),
    "a tab": (("    default: PID", "\tdefault: PID"), ("20:1: not YAML: found character that cannot start any token",)),
    "a bracket left open": (("[0, 100]}", "[0, 100}"), ("28:25: not YAML: did not find expected ',' or ']'",)),
    "a colon in a text": (("test bench", "bench: test"), ("3:15: not YAML: mapping values are not allowed in this context",)),
}

TABLES = {
    "unknown key": UNKNOWN_KEYS,
    "missing key": MISSING_KEYS,
    "wrong type": WRONG_TYPES,
    "wrong word": WRONG_WORDS,
    "windup": WRONG_WINDUP,
    "number": WRONG_NUMBERS,
    "text": WRONG_TEXTS,
    "too many": TOO_MANY,
    "name": WRONG_NAMES,
    "choice": WRONG_CHOICES,
    "YAML": NOT_YAML,
}


def _edits(change: Edit | tuple[Edit, ...]) -> tuple[Edit, ...]:
    return (change,) if isinstance(change[0], str) else change


def test_the_card_that_the_others_are_made_from_is_right(tmp_path: Path) -> None:
    assert faults(tmp_path, VALID) == []


@pytest.mark.parametrize(
    ("change", "expected"),
    [pytest.param(*case, id=f"{table}: {name}") for table, cases in TABLES.items() for name, case in cases.items()],
)
def test_a_wrong_card_is_refused_at_its_place(change: Edit | tuple[Edit, ...], expected: tuple[str, ...], tmp_path: Path) -> None:
    assert list(expected) == headlines(faults(tmp_path, edited(VALID, *_edits(change))))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty; a card starts with 'card: 1'"),
        ("# only a remark\n", "the file is empty; a card starts with 'card: 1'"),
        ("- card: 1\n", "the file is not a mapping; a card starts with 'card: 1'"),
        ("card 1\n", "the file is not a mapping; a card starts with 'card: 1'"),
    ],
)
def test_a_file_that_holds_no_card_is_refused_at_its_start(text: str, message: str, tmp_path: Path) -> None:
    assert [f"1:1: {message}"] == headlines(faults(tmp_path, text))


def test_a_problem_is_shown_with_the_lines_around_and_marks_under_the_word(tmp_path: Path) -> None:
    [problem] = faults(tmp_path, edited(VALID, ("off: 0, default: 0", "off: 0, defualt: 0")))
    assert problem.render() == (
        "bench.yaml:16:45: unknown key 'defualt' (did you mean 'default'?)\n"
        "  15 |   RESET: {sets: integral, unit: s, off: inf}\n"
        "  16 |   RATE: {sets: derivative, unit: s, off: 0, defualt: 0}\n"
        "     |                                             ^^^^^^^\n"
        '  17 |   ALPHA: {sets: filter-ratio, unit: "1", range: [0.05, 1], default: 0.125}'
    )


def test_a_problem_on_the_first_line_is_shown_without_a_line_before(tmp_path: Path) -> None:
    [problem] = faults(tmp_path, edited(VALID, ("card: 1\n", "card: one\n")))
    assert problem.render().splitlines()[1:] == ["  1 | card: one", "    |       ^^^", "  2 | vendor: Nobody"]


@pytest.mark.parametrize(("card_id", "file"), card_files().items())
def test_a_built_in_card_has_no_fault(card_id: str, file: Path) -> None:
    assert check_file(file, card_id) == []
