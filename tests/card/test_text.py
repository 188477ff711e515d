"""The equation of a data sheet is the law: what it says is evaluated and compared."""

from __future__ import annotations

import cmath
import contextlib
import math
import re
from collections.abc import Mapping

import numpy as np
import pytest

import pidemu
from pidemu.card.datasheet.at_limits import limit_rows
from pidemu.card.datasheet.behaviour import mode_rows, scan_rows
from pidemu.card.datasheet.text import equation_heading, equation_lines
from pidemu.card.load import Card, Variant
from pidemu.card.model.card_file import default_scan
from pidemu.card.references import is_active
from pidemu.errors import UndefinedError
from pidemu.settings.settings import Settings, limits
from pidemu.units import Dimension, parse_unit
from tests.helpers import made_up_card, option_combinations

_W = np.array([0.003, 0.02, 0.3, 4.0])
_TOKEN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*|\d+(?:\.\d+)?(?:e[+-]?\d+)?|\*\*|\S")
_VARIANTS = [(i, o) for i in pidemu.cards() for o in option_combinations(pidemu.load_card(i))]
_DIALS = (("gain", "%/%"), ("integral", "1/s"), ("derivative", "s"))
_GAINS = {name: {"sets": sets, "unit": unit} for name, (sets, unit) in zip(("kp", "ki", "kd"), _DIALS, strict=True)}
_TIMES = {"K": _GAINS["kp"], "Ti": {"sets": "integral", "unit": "s"}, "Td": _GAINS["kd"]}


def settings_at_work(variant: Variant) -> Settings:
    """Settings with a different number on every dial that is used."""
    given: dict[str, object] = dict(variant.chosen)
    for n, (name, s) in enumerate(variant.equation.settings.items()):
        low, high = limits(s)
        if is_active(variant.equation, name, s) or s.default is None:
            given[name] = min(max(0.3 + 0.11 * n, low), high)
    return variant.card.settings(given)


def _numbers(s: Settings) -> dict[str, complex]:
    """Every dial in seconds, and percent as it stands."""
    found: dict[str, complex] = {"PVspan": 100, "OPspan": 100, "pi": math.pi, "S": 1, "bias": 0, "FF": 0}
    found["h"] = default_scan(s.equation)
    for name, value in s.items():
        unit = parse_unit(value.unit)
        plain = unit.dimension in (Dimension.PERCENT, Dimension.FREQUENCY)
        found[name] = value.value * (1 if plain else float(unit.factor))
    return found


def evaluated(lines: list[str], known: Mapping[str, complex], symbol: str = "OUT") -> complex:
    """What a symbol of the data sheet amounts to."""
    texts: dict[str, str] = {}
    for line in lines:
        name, equals, rest = line.partition(" = ")
        if equals and re.fullmatch(r"\w+", name) and not name.startswith("S("):
            texts.setdefault(name, re.sub(r"(, \w+)? \[[^] ]+\]$|, changing .*|   .*", "", rest))

    def value(name: str) -> complex:
        return formula(texts[name]) if name in texts and name not in ("PV", "SP") else known[name]

    def formula(text: str) -> complex:
        text = text.replace("PV span", "PVspan").replace("OP span", "OPspan").replace(" x ", " * ").replace("^", "**")
        text = re.sub(r"(\d) s$", r"\1", text.translate(str.maketrans("[]{}", "()()")))
        out: list[str] = []
        for token in _TOKEN.findall(text):
            if out and out[-1] not in "(+-*/**" and token not in ")+-*/**":
                out.append("*")
            out.append(f"value('{token}')" if token[0].isalpha() else token)
        return complex(eval("".join(out), {"value": value}))

    return value(symbol)


def paths(variant: Variant, s: Settings, w: float, lines: list[str] | None = None) -> tuple[complex, complex]:
    """Feedback and setpoint path as the data sheet has them, at a frequency [rad/s]."""
    lines = equation_lines(variant) if lines is None else lines
    known = {**_numbers(s), "s": 1j * w}
    feedback = -evaluated(lines, {**known, "PV": 1, "SP": 0})
    return feedback, evaluated(lines, {**known, "PV": 0, "SP": 1})


@pytest.mark.parametrize(("card_id", "options"), [(i, o) for i, o in _VARIANTS if i != "generic/dahlin"], ids=str)
def test_the_equation_of_the_data_sheet_is_the_law(card_id: str, options: dict[str, str]) -> None:
    variant = pidemu.load_card(card_id).variant(options)
    s = settings_at_work(variant)
    law = None
    with contextlib.suppress(UndefinedError):  # a combination of choices that makes no controller
        law = s.law()
    for w in _W if law is not None else ():
        found = paths(variant, s, float(w))
        assert found[0] == pytest.approx(complex(s.law().response(w)), rel=1e-9)
        assert found[1] == pytest.approx(complex(s.law().response(w, "setpoint")), rel=1e-9)


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize("filt", [None, "term", "lead-lag", "measurement", "output"])
@pytest.mark.parametrize("d_on", ["error", "pv", "weighted"])
@pytest.mark.parametrize("p_on", ["error", "pv", "weighted"])
def test_every_structure_of_the_series_form_is_written_right(p_on: str, d_on: str, filt: str | None, fixed: bool) -> None:
    card = _card(
        form="series",
        settings=_TIMES,
        proportional={"on": p_on} | _weight(p_on, 0.4),
        derivative={"on": d_on, "filter": filt and {"applies-to": filt, "time": 0.7}} | _weight(d_on, 0.3),
        action=_action(fixed),
    )
    _is_the_law(card)


@pytest.mark.parametrize(
    "fields",
    [
        {"measurement": {"filter": {"time": 3}}, "derivative": {"on": "error", "filter": {"applies-to": "measurement", "time": 2}}},
        {"measurement": {"filter": {"factor": 0.25}}, "setpoint": {"filter": {"time": 5}, "rate": 1}},
        {"error": {"filter": {"time": 4}}, "setpoint": {"rate": 2}},
        {"form": "series", "settings": _TIMES, "error": {"filter": {"time": 4}, "shape": "squared"}},
        {"form": "series", "settings": _TIMES, "error": {"shape": "gap", "band": 1}, "derivative": {"on": "pv"}},
        {"integral": {"on": "none", "rule": "backward", "windup": {"scheme": "none"}}},
        {"feedforward": {"summed": "before-limits", "gain": 0.5}},
        {"proportional": {"on": "none"}},
    ],
    ids=str,
)
def test_what_stands_before_the_algorithm_is_written_right(fields: dict[str, object]) -> None:
    _is_the_law(_card(**fields))


def _card(**fields: object) -> Card:
    return made_up_card(**{"settings": _GAINS, **fields})


def _weight(on: str, value: float) -> dict[str, float]:
    return {"weight": value} if on == "weighted" else {}


def _action(fixed: bool) -> dict[str, object]:
    example = {"name": "Reverse", "sp": 50, "pv": 51, "output": "falls"}
    names = {"reverse": "Reverse", "direct": "Direct"}
    return {"names": names, "example": example} | ({"fixed": True, "reverse": "pv - sp"} if fixed else {})


def _is_the_law(card: Card) -> None:
    variant = card.variant()
    s = settings_at_work(variant)
    for w in _W:
        assert paths(variant, s, float(w)) == pytest.approx(
            (complex(s.law().response(w)), complex(s.law().response(w, "setpoint"))), rel=1e-9
        )


def test_the_structure_in_cascade_has_a_line_of_its_own() -> None:
    lines = equation_lines(pidemu.load_card("yokogawa/fieldbus-pid").variant())
    assert lines[:2] == [
        "OUT = K [ (-PVf) + 1/(Ti s) (SPf - PVf) + Td s (-PVf) ]",
        "OUT = K [ (SPf - PVf) + 1/(Ti s) (SPf - PVf) + Td s (-PVf) ]   in cascade, with a remote SP",
    ]
    rates = "at most SP_RATE_UP [eu/scan] upwards, SP_RATE_DN [eu/scan] downwards; a remote setpoint is not limited"
    assert f"SPf = SP, changing by {rates}" in lines


def test_pole_cancellation_is_written_as_its_discrete_law() -> None:
    variant = pidemu.load_card("generic/dahlin").variant()
    lines = equation_lines(variant)
    assert equation_heading(variant) == "Equation (from scan to scan, reverse acting)"
    assert lines[:2] == ["OUT = D(z) (SP - PV)", "D(z) = g (1 - p z^-1)/(1 - q z^-1 - (1 - q) z^-(N+1))"]
    assert lines[2] == "p = exp(-h/tau), q = exp(-h/lambda), g = (1 - q)/(Kp (1 - p))   h: scan interval"
    s = variant.card.settings({"Kp": 2, "tau": 10, "theta": 3, "lambda": 5})
    p, q, back, w = math.exp(-0.1), math.exp(-0.2), cmath.exp(-0.3j), 0.3  # h = 1 s
    expected = (1 - q) / (2 * (1 - p)) * (1 - p * back) / (1 - q * back - (1 - q) * back**4)
    assert complex(s.law(scan=1.0).response(w)) == pytest.approx(expected)


def test_where_the_action_is_fixed_the_equation_has_the_vendor_s_error() -> None:
    variant = pidemu.load_card("iec/61131-3-pid").variant()
    assert equation_heading(variant) == "Equation (continuous; the error is PV - SP, and the sign of the gain decides the action)"
    assert equation_lines(variant)[0] == "OUT = K [ (PV - SP) + 1/(Ti s) (PV - SP) + Td s (PV - SP) ]"


@pytest.mark.parametrize(
    ("error", "line"),
    [
        ({"shape": "squared"}, "S(x) = x |x|/100"),
        ({"shape": "gain-linear", "linearity": 0.1}, "S(x) = x (0.1 + (1 - 0.1) |x|/100)"),
        ({"shape": "gap", "band": 2}, "S(x) = 0 while |x| <= 2; else x"),
        ({"shape": "gap", "band": 2, "edge": "outside"}, "S(x) = 0 while |x| < 2; else x"),
        ({"shape": "gap", "band": 2, "gain": 0.2, "subtracted": True}, "S(x) = 0.2 x while |x| <= 2; else x - (1 - 0.2) 2 sign(x)"),
        ({"shape": "gap", "band": 2, "zero-crossing": True}, "S(x) = 0 while |x| <= 2, once x has changed its sign there; else x"),
    ],
)
def test_a_shape_of_the_error_is_written_as_a_formula(error: dict[str, object], line: str) -> None:
    lines = equation_lines(_card(error=error).variant())
    assert (lines[0], lines[1]) == ("OUT = kp S(SP - PV) + ki/s S(SP - PV) + kd s (SP - PV)", line)


@pytest.mark.parametrize(
    ("on", "p", "expected"),
    [
        ("integral", "error", "OUT = kp (SP - PV) + ki/s S(SP - PV) + kd s (SP - PV)"),
        ("proportional", "error", "OUT = kp S(SP - PV) + ki/s (SP - PV) + kd s (SP - PV)"),
        ("error", "pv", "OUT = kp (-PV) + ki/s S(SP - PV) + kd s (SP - PV)"),
    ],
)
def test_a_shape_stands_at_the_terms_that_have_it(on: str, p: str, expected: str) -> None:
    assert equation_lines(_card(error={"shape": "squared", "on": on}, proportional={"on": p}).variant())[0] == expected


@pytest.mark.parametrize(
    ("unit", "signals", "line"),
    [
        ("%/%", "percent", "K = GAIN [%/%]"),
        ("%", "percent", "K = 100/GAIN, GAIN [%]"),
        ("eu", "percent", "K = PV span/GAIN, GAIN [eu]"),
        ("eu/eu", "percent", "K = GAIN x PV span/OP span, GAIN [eu/eu]"),
        ("eu/eu", "engineering", "K = GAIN [eu/eu]"),
        ("%/eu", "percent", "K = GAIN x PV span/100, GAIN [%/eu]"),
    ],
)
def test_a_dial_s_unit_shows_in_the_formula(unit: str, signals: str, line: str) -> None:
    settings = {"GAIN": {"sets": "gain", "unit": unit}, "TI": {"sets": "integral", "unit": "repeat/min"}}
    lines = equation_lines(_card(form="standard", signals=signals, derivative={"on": "none"}, settings=settings).variant())
    assert lines[1:] == [line, "Ti = 1/TI, TI [repeat/min]"]


@pytest.mark.parametrize(("card_id", "options"), _VARIANTS, ids=str)
def test_the_behaviour_of_every_card_is_in_words(card_id: str, options: dict[str, str]) -> None:
    q = pidemu.load_card(card_id).variant(options).equation
    rows = [*scan_rows(q), *limit_rows(q), *mode_rows(q)]
    assert len({label for label, _ in rows}) == len(rows)
    assert [row for row in rows if not row[1] or "None" in row[1] or "  " in row[1] or row[1].endswith((" ", ";", ","))] == []
