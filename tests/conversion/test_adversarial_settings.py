"""Settings that conversions break on: the other sign, ends of ranges, new spans, off values, huge numbers, nonsense."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import pidemu
from pidemu.card.model.base import Rule
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import PidemuError, ScanError, SettingError
from pidemu.settings.action import switch_position
from pidemu.settings.settings import Settings, off_values
from pidemu.units import Role
from tests.conversion.settled import load, settled
from tests.conversion.support import Floats, difference, needed, random_signal
from tests.conversion.usual import CARDS
from tests.helpers import WIDE

SIGNED = [
    ("simple-pid/simple-pid", {"Kp": -2, "Ki": -0.05}),
    ("advanced-pid/advanced-pid", {"Kp": -2, "Ki": -0.05, "Kd": 0, "Tf": 0}),
    ("simple-pid/simple-pid", {"Kp": 0, "Ki": -0.05}),
    ("epics/epid", {"KP": -2, "KI": 0.025}),
    ("iec/61131-3-pid", {"KP": 2, "TR": 40}),  # its own error is PV - SP
    ("iec/61131-3-pid", {"KP": -2, "TR": 40}),
    ("yokogawa/fieldbus-pid", {"GAIN": 2, "RESET": 40}),
    ("fisher/provox", {"GAIN": 2, "RESET": 4}),
]


def first_moves(s: Settings, action: str) -> tuple[float, float]:
    """Move of the output in the scan in which the measurement rises by 1 %, and nine scans later."""
    controller = pidemu.Controller(s, 1.0, action, output_limits=WIDE)  # type: ignore[arg-type]
    controller.rest(50, 50, 50)
    u = [controller.scan(50, 50 + x) for x in [0, *[1] * 10]]
    return u[1] - u[0], u[-1] - u[0]


@pytest.mark.parametrize(("source", "dials"), SIGNED)
def test_with_the_action_that_the_warnings_say_both_outputs_move_the_same_way(source: str, dials: dict[str, object]) -> None:
    old = load(source, **dials)
    before = first_moves(old, "reverse")
    for target in CARDS:
        held = {} if target == source else needed(pidemu.load_card(target))
        conversion, reason = settled(old, target, given=held, mode="auto")
        if conversion is None:
            assert "no proportional action" in reason
            continue
        assert (conversion.action is None) == (not old.equation.action.fixed)  # a sign says it, a switch does not
        said = switch_position(conversion.settings, conversion.action or "reverse")
        assert conversion.settings.equation.action.names[said] in conversion.action_text
        after = first_moves(conversion.settings, said)
        assert math.copysign(1, after[1]) == math.copysign(1, before[1]), target
        if dials.get("Kp") != 0:
            assert math.copysign(1, after[0]) == math.copysign(1, before[0]), target
            # rules integrate in this scan, half in it, or in the next; 1e-5: float32 at 50
            assert after[0] == pytest.approx(before[0], abs=abs(old.law().moments()[0]) + 1e-5), target


NAMED = [c for c in CARDS if pidemu.load_card(c).variant({}).equation.action.fixed]


@pytest.mark.parametrize("target", NAMED)
def test_where_the_sign_is_the_action_the_words_of_the_card_are_what_the_controller_does(target: str) -> None:
    source = load("generic/parallel", kp=2, ki=0.05)
    conversion = pidemu.convert(source, target, given=needed(pidemu.load_card(target)), emulate=False)
    s = conversion.settings
    names = s.equation.action.names
    assert conversion.action_text.startswith(f"reverse acting, SP - PV: {names['reverse']}; direct acting, PV - SP: ")
    gain = next(v for v in s.values() if v.role is Role.GAIN)
    assert (gain.value > 0) == names["reverse"].startswith("positive")
    parallel = s.equation.form == "parallel"
    turned = s.changed({n: -v.value for n, v in s.items() if v.role is Role.GAIN or (parallel and v.role is Role.INTEGRAL)})
    for action in ("reverse", "direct"):  # the sign counts, whatever is asked for
        assert first_moves(s, action)[1] < 0 < first_moves(turned, action)[1]
    assert pidemu.convert(turned, "generic/parallel", emulate=False).factor == -1


@pytest.mark.parametrize(("source", "dials"), [("epics/epid", {"KP": -2, "KI": 0.025}), ("iec/61131-3-pid", {"KP": 2, "TR": 40})])
def test_where_the_sign_is_the_action_the_target_is_told_one_action_and_no_choice(source: str, dials: dict[str, object]) -> None:
    """These cards have no action but the sign: theirs is direct, and nobody can set them to reverse."""
    conversion = pidemu.convert(load(source, **dials), "fisher/provox", emulate=False)
    assert first_moves(conversion.source, "reverse")[0] == pytest.approx(2, abs=0.1)
    assert first_moves(conversion.settings, "direct")[0] == pytest.approx(2, abs=0.1)
    assert conversion.action_text.startswith("direct acting, PV - SP: Direct")
    assert "reverse acting" not in conversion.action_text


ENDS: list[tuple[str, dict[str, object], str, float, str, dict[str, object]]] = [
    ("honeywell/udc", {"PBorGAIN": "PB PCT"}, "PB", 0.1, "K", {"K": 1000, "Ti": 60}),
    ("honeywell/udc", {"PBorGAIN": "PB PCT"}, "PB", 9999, "K", {"K": 100 / 9999, "Ti": 60}),
    ("honeywell/udc", {"MINorRPM": "MIN"}, "RSET", 0.02, "Ti", {"K": 2, "Ti": 1.2}),
    ("honeywell/udc", {"MINorRPM": "MIN"}, "RSET", 50, "Ti", {"K": 2, "Ti": 3000}),
    ("honeywell/udc", {"MINorRPM": "RPM"}, "RSET", 0.02, "Ti", {"K": 2, "Ti": 3000}),
    ("honeywell/udc", {"MINorRPM": "RPM"}, "RSET", 50, "Ti", {"K": 2, "Ti": 1.2}),
    ("honeywell/udc", {}, "RATE", 0.09, "Td", {"K": 2, "Ti": 60, "Td": 5.4}),
    ("honeywell/udc", {}, "RATE", 10, "Td", {"K": 2, "Ti": 2900, "Td": 600}),
    ("foxboro/pneumatic", {}, "INT", 0.01, "Ti", {"K": 2, "Ti": 0.6}),
    ("foxboro/pneumatic", {}, "INT", 50, "Ti", {"K": 2, "Ti": 3000}),
    ("yokogawa/fieldbus-pid", {}, "GAIN", 0.05, "K", {"K": 0.05, "Ti": 60}),
    ("yokogawa/fieldbus-pid", {}, "GAIN", 20, "K", {"K": 20, "Ti": 60}),
    ("yokogawa/fieldbus-pid", {}, "RESET", 0.1, "Ti", {"K": 2, "Ti": 0.1}),
    ("yokogawa/fieldbus-pid", {}, "RESET", 10000, "Ti", {"K": 2, "Ti": 10000}),
    ("automationdirect/directlogic", {}, "GAIN", 99.99, "K", {"K": 99.99, "Ti": 60}),
    ("automationdirect/directlogic", {"RESET_UNITS": "SECONDS"}, "RESET", 0.01, "Ti", {"K": 2, "Ti": 0.01}),
    ("automationdirect/directlogic", {"RESET_UNITS": "MINUTES"}, "RESET", 99.98, "Ti", {"K": 2, "Ti": 99.98 * 60}),
    ("automationdirect/directlogic", {}, "RATE", 99.99, "Td", {"K": 2, "Ti": 60, "Td": 99.99}),
    ("toshiba/pid3", {}, "KP", 327.67, "K", {"K": 327.67, "Ti": 60}),
    ("toshiba/pid3", {}, "TI", 32.767, "Ti", {"K": 2, "Ti": 32.767 * 60}),
]
"""Target, its options, a dial and an end of its range; the setting of the standard form that it stands for, worked by hand."""


@pytest.mark.parametrize(("target", "options", "dial", "end", "moved", "dials"), ENDS)
def test_a_dial_reaches_the_end_of_its_range_and_a_thousandth_beyond_is_refused_with_the_range(
    target: str, options: dict[str, object], dial: str, end: float, moved: str, dials: dict[str, float]
) -> None:
    low = end < 1
    rises = pidemu.convert(load("generic/standard", **dials), target, options=options, emulate=False).settings[dial]
    assert rises.value == pytest.approx(end, rel=1e-12)
    assert not rises.off
    outcomes = {}
    for step in (1.001, 1 / 1.001):
        source = load("generic/standard", **{**dials, moved: dials[moved] * step})
        conversion, reason = settled(source, target, options=options)
        outcomes[step] = reason
        if reason:
            assert f"{dial}: " in reason
            assert f"is outside {rises.setting.range[0]:g} to {rises.setting.range[1]:g}" in reason  # type: ignore[index]
            assert conversion is None or conversion.settings[dial].value == pytest.approx(end, rel=1e-3)
        else:
            assert conversion is not None
            assert conversion.settings[dial].value == pytest.approx(end * 1.001 if low else end / 1.001, rel=1e-9)
    assert sum(bool(reason) for reason in outcomes.values()) == 1


@pytest.mark.parametrize(("alpha", "refused"), [(0.05, False), (0.0499, True), (1, False), (1.001, True)])
def test_a_filter_ratio_reaches_the_ends_of_its_range(alpha: float, refused: bool) -> None:
    source = load("generic/standard", K=2, Ti=60, Td=10, Tf=10 * alpha)
    conversion, reason = settled(source, "emerson/deltav", options={"FORM": "Standard"}, match="exact")
    assert bool(reason) == refused
    if refused:
        assert "ALPHA: " in reason
        assert "is outside 0.05 to 1" in reason
    else:
        assert conversion is not None
        assert conversion.settings["ALPHA"].value == pytest.approx(alpha, rel=1e-12)


@pytest.mark.parametrize(("unit", "Ti"), [("SECONDS", 99.99), ("MINUTES", 99.99 * 60)])
def test_an_integral_time_that_happens_to_be_an_off_value_does_not_switch_the_integral_off(unit: str, Ti: float) -> None:
    """DirectLOGIC: 99.98 is the longest reset, 99.99 is none."""
    source = load("generic/standard", K=2, Ti=Ti)
    conversion, reason = settled(source, "automationdirect/directlogic", options={"RESET_UNITS": unit})
    assert "is outside 0.01 to 99.98" in reason
    assert conversion is not None
    assert conversion.settings.law().moments()[0] == pytest.approx(2 / Ti, rel=1e-3)


OLD = {"pv_range": (0.0, 100.0, "degC"), "op_range": (0.0, 80.0, "kg/h")}
NEW = {"to_pv_range": (50.0, 250.0, "degC"), "to_op_range": (0.0, 100.0, "kg/h")}
FACTOR = (200 / 100) * (80 / 100)
PID_DIALS: dict[str, tuple[dict[str, object], tuple[str, str, str], tuple[float, float, float]]] = {
    # parallel, in percent: all three
    "generic/parallel": ({}, ("kp", "ki", "kd"), (2 * FACTOR, 0.05 * FACTOR, 12 * FACTOR)),
    "allen-bradley/logix-pid": ({"NDF": "on"}, ("KP", "KI", "KD"), (2 * FACTOR, 0.05 * FACTOR, 12 * FACTOR)),
    "allen-bradley/pide": ({}, ("PGain", "IGain", "DGain"), (2 * FACTOR, 3 * FACTOR, 0.2 * FACTOR)),
    # parallel, in engineering units: 80/100 output units per measurement unit, whatever the new ranges
    "simple-pid/simple-pid": ({}, ("Kp", "Ki", "Kd"), (2 * 0.8, 0.05 * 0.8, 12 * 0.8)),
    "arduino/pid": ({}, ("Kp", "Ki", "Kd"), (2 * 0.8, 0.05 * 0.8, 12 * 0.8)),
    # standard and series: one
    "generic/standard": ({}, ("K", "Ti", "Td"), (2 * FACTOR, 40, 6)),
    "honeywell/udc": ({"MINorRPM": "MIN"}, ("GAIN", "RSET", "RATE"), (2 * FACTOR, 40 / 60, 0.1)),
    "king/velocity": ({}, ("Kc", "Ti", "Td"), (2 * FACTOR, 40 / 60, 0.1)),
    "epics/epid": ({}, ("KP", "KI", "KD"), (2 * 0.8, 1 / 40, 6)),
}


def valve(s: Settings, sp: Floats, pv: Floats, start: float) -> Floats:
    """Output in engineering units for signals in engineering units, from rest."""
    assert s.pv_range is not None
    assert s.op_range is not None
    own = s.equation.signals == "engineering"
    (zero, top), (low, high) = ((0.0, 100.0), (0.0, 100.0)) if own else (s.pv_range.ends, s.op_range.ends)
    controller = pidemu.Controller(s, 1.0, output_limits=WIDE)
    sp, pv = (100 * (x - zero) / (top - zero) for x in (sp, pv))
    controller.rest(float(sp[0]), float(pv[0]), 100 * (start - low) / (high - low))
    return low + (high - low) / 100 * controller.run(sp, pv)


@pytest.mark.parametrize("target", PID_DIALS)
def test_new_spans_go_into_all_gains_of_a_parallel_card_and_into_one_of_a_standard_card(target: str) -> None:
    options, names, wanted = PID_DIALS[target]
    source = load("generic/parallel", kp=2, ki=0.05, kd=12, c=0, **OLD)
    conversion = pidemu.convert(source, target, options=options, scan=1.0, emulate=False, **NEW)  # type: ignore[arg-type]
    assert conversion.factor == pytest.approx(FACTOR)
    assert [conversion.settings[n].value for n in names] == pytest.approx(wanted, rel=1e-9)
    assert conversion.verdict in ("exact", "exact-feedback")
    pv = 75 + 0.2 * (random_signal(5) - 50)
    a, b = (valve(s, np.full(pv.size, 75.0), pv, 40.0) for s in (conversion.source, conversion.settings))
    assert np.ptp(a) > 1
    assert difference(a, b) < 1e-9  # 200 scans of doubles


@pytest.mark.parametrize(
    ("target", "options"),
    [
        ("generic/parallel", {}),
        ("simple-pid/simple-pid", {}),
        ("emerson/deltav", {"STRUCTURE": "6"}),
        ("honeywell/tdc3000", {"CTEQN": "D"}),
        ("foxboro/ia-pid", {"MODOPT": "I"}),
    ],
)
def test_new_spans_go_into_the_integral_gain_of_a_card_that_only_integrates(target: str, options: dict[str, object]) -> None:
    source = load("generic/parallel", kp=0, ki=0.05, **OLD)
    conversion = pidemu.convert(source, target, options=options, scan=1.0, emulate=False, **NEW)  # type: ignore[arg-type]
    assert conversion.settings.law().moments() == pytest.approx((0.05 * FACTOR, 0, 0))
    sp, pv = (75 + 0.2 * (random_signal(seed) - 50) for seed in (6, 7))
    a, b = (valve(s, sp, pv, 40.0) for s in (conversion.source, conversion.settings))
    assert np.ptp(a) > 1
    if conversion.settings.equation.integral.rule is Rule.TRAPEZOIDAL:  # each increment is the mean of two backward ones
        steps, means = np.diff(b)[1:], (np.diff(a)[1:] + np.diff(a)[:-1]) / 2
        assert difference(steps, means) < 1e-9
    else:
        assert difference(a, b) < 1e-9


OFF: dict[str, tuple[dict[str, object], str, float]] = {
    "fisher/provox": ({"GAIN": 2}, "RESET", 0),
    "emerson/deltav": ({"GAIN": 2}, "RESET", math.inf),
    "honeywell/tdc3000": ({"K": 2}, "T1", math.inf),
    "automationdirect/directlogic": ({"GAIN": 2}, "RESET", 99.99),
    "toshiba/pid3": ({"KP": 2}, "TI", 0),
    "oscat/ft-pid": ({"KP": 2, "TV": 0}, "TN", 0),
    "epics/epid": ({"KP": 2}, "KI", 0),
    "king/velocity": ({"Kc": 2}, "Ti", math.inf),
    "generic/standard": ({"K": 2}, "Ti", math.inf),
    "generic/series": ({"K": 2}, "Ti", math.inf),
    "allen-bradley/logix-pid": ({"KP": 2, "PE": "dependent"}, "KI", 0),
    "allen-bradley/pide": ({"PGain": 2, "DependIndepend": "true"}, "IGain", 0),
    "allen-bradley/plc5": ({"KC": 2, "EQUATION": "ISA"}, "TI", 0),
    "mathworks/pid2": ({"Kp": 2, "FORM": "standard"}, "Ti", math.inf),
}
"""What switches the integral off: 0 repeats, 0 minutes, infinity, the last number on the dial."""


@pytest.mark.parametrize("source", OFF)
def test_an_integral_that_is_off_stays_off_whatever_number_says_so(source: str) -> None:
    dials, name, off = OFF[source]
    old = load(source, **dials, **{name: off})
    assert old[name].canonical == 0
    for target, (others, dial, _) in OFF.items():
        options = {n: v for n, v in others.items() if isinstance(v, str)}
        # a target that forgets its output at a limit is refused, with the dials all the same
        new = pidemu.convert(old, target, options=options, emulate=False, allow_approximate=True).settings
        assert dial not in new or not new[dial].active or new[dial].value in off_values(new[dial].setting), target
        assert new.law().moments() == pytest.approx((0, 2, 0)), target


COPIED = [
    ("emerson/deltav", {"GAIN": 2}, "RESET", 0, "infinite action"),  # PROVOX, DirectLOGIC, Toshiba, OSCAT: off
    ("honeywell/tdc3000", {"K": 2}, "T1", 0, "infinite action"),
    ("king/velocity", {"Kc": 2}, "Ti", 0, "infinite action"),
    ("generic/standard", {"K": 2}, "Ti", 0, "infinite action"),
    ("ni/pid", {"Kc": 2}, "Ti", 0, "infinite action"),
    ("foxboro/ia-pid", {"PBAND": 50}, "INT", 0, "infinite action"),
    ("modelica/limpid", {"k": 2}, "Ti", 0, "infinite action"),
    ("honeywell/udc", {"GAIN": 2}, "RSET", 0, "outside 0.02 to 50"),
    ("foxboro/pneumatic", {"PB": 50}, "INT", 0, "outside 0.01 to 50"),
    ("fisher/provox", {"GAIN": 2}, "RESET", math.inf, "infinity does not switch it off"),
    ("toshiba/pid3", {"KP": 2}, "TI", math.inf, "outside 0 to 32.767"),
    ("automationdirect/directlogic", {"GAIN": 2}, "RESET", math.inf, "outside 0.01 to 99.98"),
    ("automationdirect/directlogic", {"GAIN": 2}, "RESET", 9999, "outside 0.01 to 99.98"),
    ("fisher/provox", {"GAIN": 2}, "RESET", "", "is not a number"),
    ("emerson/deltav", {"GAIN": 2}, "RESET", None, "missing"),
    ("honeywell/udc", {"GAIN": 2}, "RSET", "off", "cannot be switched off"),
]


@pytest.mark.parametrize(("card", "dials", "name", "value", "message"), COPIED)
def test_one_cards_off_value_typed_into_another_card_is_no_infinite_action(
    card: str, dials: dict[str, object], name: str, value: object, message: str
) -> None:
    with pytest.raises(SettingError, match=message):
        load(card, **dials, **{name: value})


SCALES = [1e-9, 1e-6, 1e6, 1e9]


@pytest.mark.parametrize("size", SCALES)
@pytest.mark.parametrize("target", ["generic/parallel", "generic/series", "fisher/provox", "emerson/deltav", "king/velocity"])
def test_a_gain_a_billion_times_as_large_gives_gains_a_billion_times_as_large_and_the_same_times(target: str, size: float) -> None:
    plain, huge = (pidemu.convert(load("generic/standard", K=2 * k, Ti=60, Td=6, Tf=0.6), target, emulate=False) for k in (1, size))
    assert (huge.verdict, huge.match, huge.settings.options) == (plain.verdict, plain.match, plain.settings.options)
    for name, value in plain.settings.items():
        parallel = plain.settings.equation.form == "parallel"
        gains = (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE) if parallel else (Role.GAIN,)
        assert huge.settings[name].value == pytest.approx(value.value * (size if value.role in gains else 1), rel=1e-9)
    # the worst frequency is looked for on a grid
    assert huge.certificate.feedback.loop_band.max_deviation == pytest.approx(
        plain.certificate.feedback.loop_band.max_deviation, rel=1e-6, abs=1e-12
    )


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e6, 1e9])
@pytest.mark.parametrize("target", ["generic/parallel", "generic/series", "fisher/provox", "emerson/deltav", "king/velocity"])
def test_nanoseconds_and_centuries_change_the_times_and_nothing_else(target: str, size: float) -> None:
    plain, slow = (
        pidemu.convert(load("generic/standard", K=2, Ti=60 * k, Td=6 * k, Tf=0.6 * k), target, scan=k, emulate=False)
        for k in (1.0, size)
    )
    assert (slow.verdict, slow.match, slow.settings.options) == (plain.verdict, plain.match, plain.settings.options)
    old, new = (c.settings.law().moments() for c in (plain, slow))
    assert [new[0] * size, new[1], new[2] / size] == pytest.approx(old, rel=1e-9)
    assert slow.certificate.headline.loop_band.max_deviation == pytest.approx(
        plain.certificate.headline.loop_band.max_deviation, rel=1e-6, abs=1e-12
    )


def test_a_proportional_band_of_a_millionth_of_a_percent_is_a_gain_of_a_hundred_million() -> None:
    conversion = pidemu.convert(load("foxboro/pneumatic", PB=1e-6, INT=1), "generic/standard", emulate=False)
    assert conversion.settings["K"].value == pytest.approx(1e8)
    assert conversion.verdict == "exact"


PROVOX = {"GAIN": 2, "RESET": 4, "RATE": 0.1}


@pytest.mark.parametrize(
    ("name", "bad"),
    list(itertools.product(PROVOX, [math.nan, math.inf, -math.inf, -1, "nan", "1e400", "", "abc", "2,5", True, [1], 2j, b"2"])),
)
def test_a_dial_value_that_is_no_number_of_its_range_is_an_error(name: str, bad: object) -> None:
    with pytest.raises(SettingError, match=f"fisher/provox: {name}: "):
        load("fisher/provox", **{**PROVOX, name: bad})


WORDS = [
    "textbok", "Textbook", "", ":", "exact:1", "loop:1Hz", "frequency:", "frequency:abc", "frequency:0.02", "frequency:Hz",
    "frequency:-1rad/s", "frequency:0rad/s", "frequency:nanrad/s", "frequency:infHz", "frequency:1e400Hz", "frequency:1,5Hz",
    "frequency:0.02 rad / s",
]  # fmt: skip


@pytest.mark.parametrize("match", WORDS)
def test_a_match_that_is_none_is_an_error_that_says_what_there_is(match: str) -> None:
    with pytest.raises(SettingError, match=r"match is '.*'; (it is one of exact, |only 'frequency'|write the frequency|the freq)"):
        pidemu.convert(load("fisher/provox", **PROVOX), "emerson/deltav", match=match)


@pytest.mark.parametrize("match", ["loop", "frequency"])
@pytest.mark.parametrize("allow", [False, True])
def test_a_match_without_the_process_it_needs_is_an_error_and_no_refusal_of_the_target(match: str, allow: bool) -> None:
    with pytest.raises(SettingError, match="needs the process") as error:
        pidemu.convert(load("fisher/provox", **PROVOX), "foxboro/pneumatic", match=match, allow_approximate=allow)
    assert not isinstance(error.value, ConversionRefusedError)


@pytest.mark.parametrize("scan", [math.inf, math.nan, 0, -1, (1, -1), (1, 0), (math.nan, 1), 1j, {"a": 1}])
def test_an_interval_that_is_none_is_an_error(scan: object) -> None:
    with pytest.raises(ScanError):
        pidemu.convert(load("fisher/provox", **PROVOX), "emerson/deltav", scan=scan)  # type: ignore[arg-type]


@pytest.mark.parametrize("slow", [1e3, 1e4, 1e6])
def test_a_scan_longer_than_the_loops_times_is_not_called_little(slow: float) -> None:
    """The loop has an integral time of 20 s; nothing of its band is left below the Nyquist frequency of such a scan."""
    conversion = pidemu.convert(load("fisher/provox", **PROVOX), "generic/parallel", scan=(1.0, slow), emulate=False)
    assert "little beside usual margins" not in conversion.sentence
    assert "stays stable" not in conversion.sentence


@pytest.mark.parametrize("bad", [(0, 0), (100, 0), (0, math.nan), (0, math.inf), (5,), 5, "0,100,200", ("a", "b"), (0, 1, 2)])
@pytest.mark.parametrize("name", ["to_pv_range", "to_op_range"])
def test_a_range_of_the_target_that_is_none_is_an_error(name: str, bad: object) -> None:
    source = load("fisher/provox", **PROVOX, pv_range=(0, 100), op_range=(0, 100))
    with pytest.raises(SettingError, match=name):
        pidemu.convert(source, "generic/parallel", **{name: bad})  # type: ignore[arg-type]


@pytest.mark.parametrize(("options", "chosen"), [({"form": "SERIES"}, "Series"), ({"Form": "standard"}, "Standard")])
def test_options_in_another_case_are_those_options(options: dict[str, object], chosen: str) -> None:
    assert pidemu.convert(load("fisher/provox", **PROVOX), "emerson/deltav", options=options).settings.options["FORM"] == chosen


@pytest.mark.parametrize(
    "arguments", [{"options": {"form": "Series", "FORM": "Standard"}}, {"given": {"alpha": 0.1, "ALPHA": 0.3}}]
)
def test_a_name_given_twice_in_two_cases_is_an_error_as_it_is_for_settings(arguments: dict[str, dict[str, object]]) -> None:
    with pytest.raises(SettingError, match=r"the same|once"):
        pidemu.convert(load("fisher/provox", **PROVOX), "emerson/deltav", emulate=False, **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["GAIN", "gain", "RESET", "rate"])
def test_a_dial_that_the_conversion_computes_cannot_be_given_in_any_case(name: str) -> None:
    with pytest.raises(SettingError, match="is what the conversion computes"):
        pidemu.convert(load("fisher/provox", **PROVOX), "emerson/deltav", given={name: 2})


@pytest.mark.parametrize("structure", ["3", "6"])
def test_an_option_among_the_given_dials_is_an_error_or_that_option_and_never_loses_a_term(structure: str) -> None:
    """STRUCTURE 3 has no integral, 6 no proportional term: with the option such a conversion is refused."""
    with pytest.raises(PidemuError):
        pidemu.convert(load("fisher/provox", **PROVOX), "emerson/deltav", given={"STRUCTURE": structure}, emulate=False)


def test_a_given_dial_is_used_or_said_to_be_of_no_use() -> None:
    conversion = pidemu.convert(load("fisher/provox", **PROVOX), "emerson/deltav", given={"BETA": 0.5}, emulate=False)
    beta = conversion.settings["BETA"]
    assert beta.value == 0.5
    assert beta.active or any(n.startswith("BETA is not used") for n in conversion.settings.notes)


SAME = [
    ("honeywell/udc", {"GAIN": 2, "RSET": 0.5}, {"MINorRPM": "RPM"}, {"RSET": 2}),
    ("honeywell/udc", {"GAIN": 2, "RSET": 0.5}, {"PBorGAIN": "PB PCT"}, {"PB": 50}),
    ("automationdirect/directlogic", {"GAIN": 2, "RESET": 30}, {"RESET_UNITS": "MINUTES"}, {"RESET": 0.5}),
    ("emerson/deltav", {"GAIN": 2, "RESET": 30, "FORM": "Series"}, {"FORM": "Standard"}, {"GAIN": 2, "RESET": 30}),
    # series with the D term filtered: K (1 + 6/30), and Ti + Td; kd less by the filter of 0.75 s
    ("emerson/deltav", {"GAIN": 2, "RESET": 30, "RATE": 6, "FORM": "Series"}, {"FORM": "Standard"}, {"GAIN": 2.4, "RESET": 36}),
    ("honeywell/tdc3000", {"K": 2, "T1": 0.5}, {"FORM": "ideal"}, {"K": 2, "T1": 0.5}),
    ("foxboro/ia-pid", {"PBAND": 50, "INT": 0.5}, {"MODOPT": "PI"}, {"PBAND": 50, "INT": 0.5}),
]


@pytest.mark.parametrize(("card", "dials", "options", "wanted"), SAME)
def test_the_same_card_with_other_options_gets_other_numbers_for_the_same_controller(
    card: str, dials: dict[str, object], options: dict[str, object], wanted: dict[str, float]
) -> None:
    conversion = pidemu.convert(load(card, **dials), card, options=options, emulate=False)
    assert {n: conversion.settings[n].value for n in wanted} == pytest.approx(wanted)
    assert conversion.certificate.feedback.is_exact
