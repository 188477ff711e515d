"""Laws that conversions break on: odd ratios of times, missing terms, other structures and units, scan intervals far apart."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import numpy as np
import pytest

import pidemu
from pidemu.conversion.result import Conversion
from pidemu.settings.settings import Settings
from tests.conversion.settled import load, settled
from tests.conversion.support import Complex, Floats, continuous, needed, outputs
from tests.conversion.usual import CARDS
from tests.helpers import WIDE

Ti = 60.0
RATIOS = (0, 0.1, 0.25, 0.2500001, 1, 4, 30)
"""Td/Ti. Vendors advise a quarter; above it the standard form has complex zeros; TDC 3000 settings with 30 are in print."""
SERIES: Mapping[str, dict[str, object]] = {
    "generic/series": {},
    "fisher/provox": {},
    "foxboro/pneumatic": {},
    "honeywell/tdc3000": {"FORM": "interactive"},
    "emerson/deltav": {"FORM": "Series"},
}
PLAIN = ("generic/standard", "generic/parallel")
DIALS = {
    "generic/standard": ("K", "Ti", "Td"),
    "generic/series": ("K", "Ti", "Td"),
    "fisher/provox": ("GAIN", "RESET", "RATE"),
    "foxboro/pneumatic": ("PB", "INT", "DERIV"),
    "honeywell/tdc3000": ("K", "T1", "T2"),
    "emerson/deltav": ("GAIN", "RESET", "RATE"),
}


def made(card: str, ratio: float, **more: object) -> Settings:
    """Gain 2, integral time 60 s, derivative time by its ratio to that; a filter of a tenth where the card lets one choose."""
    Td = ratio * Ti
    if card == "generic/parallel":
        return load(card, **{"kp": 2, "ki": 2 / Ti, "kd": 2 * Td, "Tf": 0.1 * Td, **more})
    own = {"generic/standard": {"Tf": 0.1 * Td}, "generic/series": {"alpha": 0.1}}.get(card, {})
    gain = "50 %" if card == "foxboro/pneumatic" else 2
    values = (gain, f"{Ti} s/repeat", f"{Td!r} s" if Td else 0)
    return load(card, **{**dict(zip(DIALS[card], values, strict=True)), **SERIES.get(card, {}), **own, **more})


def apart(conversion: Conversion, low: float, high: float) -> float:
    """Largest deviation of the two block diagrams over a band."""
    w = np.geomspace(low, high, 600)
    return float(np.max(np.abs(continuous(conversion.settings, w) / continuous(conversion.source, w) - 1)))


CROSSED = [
    (a, b)
    for a, b in itertools.product([*PLAIN, *SERIES], repeat=2)
    if a not in (b, "generic/parallel") and not (a in PLAIN and b in PLAIN)
]
"""Between standard and parallel there is nothing to factor, and into series they are the same source."""


@pytest.mark.parametrize(("source", "target"), CROSSED)
def test_whatever_Td_over_Ti_a_conversion_is_exact_or_costs_what_the_block_diagrams_say(source: str, target: str) -> None:
    for ratio in RATIOS:
        if source == "foxboro/pneumatic" and ratio * Ti > 600:
            continue  # beyond its dial
        conversion, reason = settled(made(source, ratio), target, options=SERIES.get(target, {}))
        if conversion is None:
            assert ratio >= 4
            assert "no settings of it come near" in reason
            assert any(word in reason for word in ("complex zeros", "this series form with its filter needs"))
            continue
        loop, full = conversion.certificate.feedback.loop_band, conversion.certificate.feedback.full_band
        own = apart(conversion, loop.low, loop.high)
        assert conversion.settings.law().moments()[0] == pytest.approx(2 / Ti)
        if reason:
            assert any(
                w in reason
                for w in (
                    "complex zeros", "no equivalent in this series form", "would have to be negative",
                    "this series form with its filter needs",
                )
            )  # fmt: skip
        elif conversion.verdict != "approximate":
            # 1e-9 is what the verdict promises; the two ways to compute it differ by less than a tenth of that
            assert apart(conversion, loop.low, full.high) < 1.1e-9
            continue
        # the certificate looks between the frequencies too, so it may find a little more
        assert own * (1 - 1e-6) <= loop.max_deviation <= own * 1.001
        assert loop.max_deviation < 1


@pytest.mark.parametrize("ratio", RATIOS)
def test_an_unfiltered_standard_form_goes_into_series_by_the_roots_of_its_zeros_or_not_at_all(ratio: float) -> None:
    source = load("generic/standard", K=2, Ti=Ti, Td=ratio * Ti)
    conversion, reason = settled(source, "generic/series")
    if 4 * ratio > 1:
        assert "complex zeros" in reason
        return
    root = math.sqrt(1 - 4 * ratio)
    assert conversion is not None
    assert conversion.verdict == "exact"
    found = [conversion.settings[n].value for n in ("K", "Ti", "Td", "alpha")]
    assert found == pytest.approx([2 * (1 + root) / 2, Ti * (1 + root) / 2, Ti * (1 - root) / 2, 0], rel=1e-12, abs=1e-12)


LIMITS = [
    ("fisher/provox", {}, {}, (1 - 0.125) / 4),
    ("foxboro/pneumatic", {}, {}, (1 - 0.1) / 4),
    ("honeywell/tdc3000", {"FORM": "interactive"}, {}, (1 - 0.1) / 4),
    ("emerson/deltav", {"FORM": "Series"}, {"ALPHA": 0.125}, 1 / (4 * (1 + 0.125))),
]
"""Largest Td/Ti of a standard form, by its moments ``m1^2/(m0 m2) = Ti/Td``; a filter asks for more than ``Ti >= 4 Td``."""


@pytest.mark.parametrize(("target", "options", "given", "limit"), LIMITS)
def test_a_fixed_filter_moves_the_limit_of_Td_over_Ti_to_where_the_closed_form_says(
    target: str, options: dict[str, object], given: dict[str, object], limit: float
) -> None:
    for ratio, refused in ((limit * (1 - 1e-6), False), (limit * (1 + 1e-6), True), (0.25, True)):
        conversion, reason = settled(load("generic/standard", K=2, Ti=Ti, Td=ratio * Ti), target, options=options, given=given)
        assert bool(reason) == refused
        assert conversion is not None
        if not refused and conversion.match == "low-frequency":
            assert conversion.settings.law().moments() == pytest.approx((2 / Ti, 2, 2 * ratio * Ti))


@pytest.mark.parametrize("source", ["generic/series", "foxboro/pneumatic", "honeywell/tdc3000"])
def test_a_series_form_goes_into_standard_until_its_filter_is_longer_than_its_integral_time(source: str) -> None:
    """``K (1 + 1/(Ti s)) (1 + Td s)/(1 + 0.1 Td s)`` in partial fractions; below zero at ``0.1 Td > Ti``."""
    for ratio in (0, 0.1, 0.25, 1, 4, 9.9):
        Td = ratio * Ti
        conversion, reason = settled(made(source, ratio), "generic/parallel")
        assert not reason
        assert conversion is not None
        kp, kd = 2 * (1 + 0.9 * ratio), 2 * 0.9 * Td * (1 - 0.1 * ratio)
        assert [conversion.settings[n].value for n in ("kp", "ki", "kd")] == pytest.approx([kp, 2 / Ti, kd], rel=1e-9)
        assert not Td or conversion.settings["Tf"].value == pytest.approx(0.1 * Td)
        assert conversion.verdict == "exact"
    if source != "foxboro/pneumatic":
        assert "would have to be negative" in settled(made(source, 30), "generic/parallel")[1]


@pytest.mark.parametrize("ratio", [1.5, 4, 30])
def test_with_a_free_filter_both_roots_are_the_same_controller_and_Ti_is_the_larger(ratio: float) -> None:
    small = load("generic/series", K=2, Ti=Ti, Td=ratio * Ti, alpha=0.1 / ratio)  # lag 6 s
    large = load("generic/series", K=2 * ratio, Ti=ratio * Ti, Td=Ti, alpha=0.1)
    w = np.geomspace(1e-4, 10, 200)
    assert continuous(small, w) == pytest.approx(continuous(large, w), rel=1e-12)
    as_parallel = pidemu.convert(small, "generic/parallel", emulate=False)
    back = pidemu.convert(as_parallel.settings, "generic/series", emulate=False)
    assert as_parallel.verdict == back.verdict == "exact"
    names = ("K", "Ti", "Td", "alpha")
    assert [back.settings[n].value for n in names] == pytest.approx([large[n].value for n in names], rel=1e-9)
    itself = pidemu.convert(small, "generic/series", emulate=False).settings
    assert [itself[n].value for n in names] == [small[n].value for n in names]  # nobody asked to exchange them


@pytest.mark.parametrize("ratio", [0.05, 0.1, 0.2])
def test_with_a_fixed_filter_the_root_that_is_taken_is_the_nearer_one(ratio: float) -> None:
    source = load("generic/standard", K=2, Ti=Ti, Td=ratio * Ti, Tf=0.0125 * ratio * Ti)
    conversion = pidemu.convert(source, "fisher/provox", match="low-frequency", emulate=False)
    loop = conversion.certificate.feedback.loop_band
    w = np.geomspace(loop.low, loop.high, 200)
    m0, m1, m2, sigma = 2 / Ti, 2.0, 2 * ratio * Ti, 0.125 / 0.875
    cost = {}
    for D in np.roots([m0 * (1 + sigma), -m1, m2]):
        K, Td = m1 - m0 * float(D), float(D) / 0.875
        s = 1j * w
        own = K * (1 + m0 / (K * s)) * (1 + Td * s) / (1 + 0.125 * Td * s)
        cost[Td] = float(np.max(np.abs(own / continuous(source, w) - 1)))
    assert conversion.settings["RATE"].canonical == pytest.approx(min(cost, key=lambda Td: cost[Td]))
    assert min(cost.values()) < max(cost.values())


INTEGRATORS = [{"kp": 0, "ki": 0.1}, {"kp": 0, "ki": 0.1, "kd": 3, "Tf": 0.3}]


@pytest.mark.parametrize("dials", INTEGRATORS)
@pytest.mark.parametrize("target", CARDS)
def test_no_card_is_given_a_gain_that_the_source_has_not(target: str, dials: dict[str, object]) -> None:
    source = load("generic/parallel", **dials)
    held = {} if target == "generic/parallel" else needed(pidemu.load_card(target))
    conversion, reason = settled(source, target, given=held)
    if reason:
        no_derivative = "kd" in dials and "the source has derivative action" in reason  # a card of P and I
        assert "no proportional action" in reason or no_derivative
        assert target in reason
        assert conversion is None, "no settings imitate a missing proportional term"
        return
    assert conversion is not None
    m0, m1, _ = conversion.settings.law().moments()
    assert [m0, m1] == pytest.approx([0.1, 0], abs=1e-12)
    if "kd" in dials:
        return
    assert conversion.verdict in ("exact", "exact-feedback")
    h = 0.5
    controller = pidemu.Controller(conversion.settings, h, output_limits=WIDE)
    controller.rest(50, 50, 50)
    moves = np.diff([controller.scan(50, 50 + x) for x in (0, 1, 1, 1, 1)])
    # integral alone: 0.1 x 0.5 per scan and percent, half of it in the first scan of a trapezoid, none of a forward rule.
    # 1e-5: float32 at 50; the limit of the integral of a card that has one is 1 %
    assert np.max(np.abs(moves)) == pytest.approx(0.1 * h, abs=1e-5)
    assert all(m <= 1e-5 for m in moves)


NOT_OFF = {
    "astrom-hagglund/listing", "foxboro/pneumatic", "honeywell/udc", "iec/61131-3-pid", "ni/pid", "yokogawa/fieldbus-pid",
}  # fmt: skip
"""Cards whose integral has no off value and no option without it."""


@pytest.mark.parametrize("kd", [0, 10])
@pytest.mark.parametrize("target", CARDS)
def test_a_controller_without_integral_never_gets_one(target: str, kd: float) -> None:
    source = load("generic/parallel", kp=2, ki=0, kd=kd)
    held = {} if target == "generic/parallel" else needed(pidemu.load_card(target))
    conversion, reason = settled(source, target, given=held)
    if target in NOT_OFF:
        assert "cannot be switched off: the card states no off value" in reason
        assert conversion is None
        return
    if kd and "the source has derivative action" in reason:  # a card of P and I
        assert conversion is None or conversion.verdict == "approximate"
        return
    assert conversion is not None
    # a velocity algorithm forgets at a limit where the output was, and epid has no place for a bias: refused, with the dials beside
    forgets = conversion.settings.algorithm().velocity or target == "epics/epid"
    assert ("cannot hold the output of a loop without integral action" in reason) == forgets
    assert bool(reason) == forgets
    assert conversion.settings.law().moments()[0] == 0
    if not kd:
        assert conversion.verdict == ("approximate" if forgets else "exact")
        u = outputs(conversion.settings, np.full(400, 50.0), np.full(400, 51.0), 1.0)
        assert np.ptp(u[1:]) == 0  # four hundred scans with a standing error


def step_kick(s: Settings, h: float = 1.0) -> float:
    """Move of the output in the scan in which the setpoint steps by 1 %."""
    controller = pidemu.Controller(s, h, output_limits=WIDE)
    controller.rest(50, 50, 50)
    return controller.scan(51, 50) - 50


B_ON = {
    "A": ("Setpoint steps: with the old controller the output ",),
    "B": ("P acts on the error on the old controller and on the measurement on the new one",),
}


@pytest.mark.parametrize("form", ["interactive", "ideal"])
@pytest.mark.parametrize("algo", ["A", "B"])
def test_equation_b_of_the_tdc_is_neither_pid_a_nor_pid_b_of_the_udc(form: str, algo: str) -> None:
    """TDC: P on the error, D on the measurement. UDC: A has both on the error, B both on the measurement."""
    source = load("honeywell/tdc3000", K=2, T1=1, T2=0.2, FORM=form, CTEQN="B")
    conversion = pidemu.convert(source, "honeywell/udc", options={"ALGO": algo}, scan=1.0, emulate=False)
    certificate = conversion.certificate
    assert not certificate.setpoint.is_exact
    assert conversion.verdict == "approximate"
    assert all(any(w.startswith(words) for w in conversion.warnings) for words in B_ON[algo])
    kick = certificate.setpoint_kick_at_scan
    assert kick is not None
    shown = step_kick(conversion.source), step_kick(conversion.settings)
    assert (kick.source, kick.target) == pytest.approx(shown)
    GAIN, RSET, RATE = (conversion.settings[n].value for n in ("GAIN", "RSET", "RATE"))
    integral = GAIN / (60 * RSET)
    assert shown[1] == pytest.approx(GAIN + integral + GAIN * 60 * RATE if algo == "A" else integral)
    plain = pidemu.convert(source, "honeywell/udc", options={"ALGO": algo}, emulate=False)
    assert any("unfiltered derivative on the error" in w for w in plain.warnings) == (algo == "A")


PI_TWINS = [
    ("A", "A", "exact"),
    ("B", "A", "exact"),
    ("C", "B", "exact"),
    ("B", "B", "exact-feedback"),
    ("C", "A", "exact-feedback"),
]


@pytest.mark.parametrize(("cteqn", "algo", "verdict"), PI_TWINS)
def test_without_derivative_equation_b_of_the_tdc_is_pid_a_of_the_udc_and_c_is_pid_b(cteqn: str, algo: str, verdict: str) -> None:
    source = load("honeywell/tdc3000", K=2, T1=1, CTEQN=cteqn)
    conversion = pidemu.convert(source, "honeywell/udc", options={"ALGO": algo}, emulate=False)  # the scan rules differ
    assert conversion.verdict == verdict
    kicks = step_kick(conversion.source), step_kick(conversion.settings)
    tdc, udc = (2 + 1 / 60, 1 / 60), (2 + 2 / 60, 2 / 60)  # trapezoidal: the first scan after the step counts half
    assert kicks == pytest.approx((tdc[cteqn == "C"], udc[algo == "B"]))


ROCKWELL: dict[str, tuple[str, dict[str, object], tuple[str, str, str]]] = {
    "PID, independent": ("allen-bradley/logix-pid", {"PE": "independent"}, ("KP", "KI", "KD")),
    "PID, dependent": ("allen-bradley/logix-pid", {"PE": "dependent"}, ("KP", "KI", "KD")),
    "PIDE, independent": ("allen-bradley/pide", {"DependIndepend": "false"}, ("PGain", "IGain", "DGain")),
    "PIDE, dependent": ("allen-bradley/pide", {"DependIndepend": "true"}, ("PGain", "IGain", "DGain")),
    "PLC-5, independent": ("allen-bradley/plc5", {"EQUATION": "independent"}, ("KP", "KI", "KD")),
    "PLC-5, ISA": ("allen-bradley/plc5", {"EQUATION": "ISA"}, ("KC", "TI", "TD")),
}
"""Gains in 1/s and s, or minutes on both: PIDE independent alone has 1/min and min."""


def in_its_dials(kind: str, kp: float, ki: float, kd: float) -> list[float]:
    """Return the three numbers by the manuals' formulas."""
    if kind == "PIDE, independent":
        return [kp, 60 * ki, kd / 60]
    if kind.endswith(", independent"):
        return [kp, ki, kd]
    return [kp, kp / ki / 60, kd / kp / 60]


@pytest.mark.parametrize("target", ROCKWELL)
@pytest.mark.parametrize("source", ROCKWELL)
def test_every_rockwell_pid_goes_into_every_other_by_the_manuals_formulas(source: str, target: str) -> None:
    (card, options, names), (other, choice, dials) = ROCKWELL[source], ROCKWELL[target]
    law = (2.0, 0.05, 12.0)
    given = dict(zip(names, in_its_dials(source, *law), strict=True))
    conversion = pidemu.convert(load(card, **given, **options), other, options=choice, emulate=False)
    assert [conversion.settings[n].value for n in dials] == pytest.approx(in_its_dials(target, *law), rel=1e-9)


PER_PERIOD = 60
END = 2 * math.pi / PER_PERIOD
"""End of the loop band [rad/s] for an integral time of 5/END: a period of sixty seconds."""
LAWS = {
    "PI": (2.0, 2 * END / 5, 0.0, 0.0),
    "PID": (2.0, 2 * END / 5, 12.0, 0.0),
    "PID with filter": (2.0, 2 * END / 5, 12.0, 2.0),
}


def sampled(s: Settings, h: float, w: Floats) -> Complex:
    """Response of a parallel controller by backward differences every `h`, held from scan to scan, written out by hand."""
    kp, ki, kd, Tf = (s[n].value for n in ("kp", "ki", "kd", "Tf"))
    z1 = np.exp(-1j * w * h)
    controller = kp + ki * h / (1 - z1) + kd * (1 - z1) / (h + Tf * (1 - z1))
    return np.asarray(controller * (1 - z1) / (1j * w * h))


def held_sine(s: Settings, h: float) -> complex:
    """Response that a running controller shows at END, as a process sees its stairs: their Fourier coefficient over ten periods."""
    per = round(PER_PERIOD / h)
    n = np.arange(30 * per)
    u = outputs(s, np.full(n.size, 50.0), 50 + np.sin(END * h * n), h)
    last = slice(20 * per, None)
    steps = u[last] * np.exp(-1j * END * h * n[last])
    fourier = 2 / (10 * PER_PERIOD) * np.sum(steps) * (1 - np.exp(-1j * END * h)) / (1j * END)
    return -complex(fourier) / -1j  # the sine's own coefficient is -j; the output falls when it rises


@pytest.mark.parametrize("scan", [(0.1, 1.0), (1.0, 0.1)])
@pytest.mark.parametrize("kind", LAWS)
def test_at_scan_intervals_ten_times_apart_the_figures_are_those_of_the_sampled_laws_and_of_the_running_controllers(
    kind: str, scan: tuple[float, float]
) -> None:
    source = load("generic/parallel", **dict(zip(("kp", "ki", "kd", "Tf"), LAWS[kind], strict=True)))
    conversion = pidemu.convert(source, "generic/parallel", scan=scan, compensate=True, emulate=False)
    plain = pidemu.convert(source, "generic/parallel", scan=scan, emulate=False)
    scaled = source.changed({n: source[n].value * scan[1] / scan[0] for n in ("kp", "ki", "kd")})
    at_scan = [c.certificate.feedback_at_scan for c in (conversion, plain)]
    assert at_scan[0] is not None
    assert at_scan[1] is not None
    band = at_scan[0].loop_band
    assert band.high == pytest.approx(END)
    w = np.geomspace(band.low, band.high, 400)
    wanted = sampled(source, scan[0], w)
    costs = [float(np.max(np.abs(sampled(s, scan[1], w) / wanted - 1))) for s in (conversion.settings, plain.settings, scaled)]
    assert (band.max_deviation, at_scan[1].loop_band.max_deviation) == pytest.approx(costs[:2], rel=1e-6)
    assert not plain.certificate.compensated
    assert [plain.settings[n].value for n in ("kp", "ki", "kd")] == [source[n].value for n in ("kp", "ki", "kd")]
    if kind == "PI":  # a slower scan takes phase that only a derivative gives back, and a faster one gives phase
        assert costs[0] <= costs[1]
        assert conversion.certificate.compensated == (costs[0] < costs[1])
    else:
        assert conversion.certificate.compensated
        assert costs[0] < (0.9 if LAWS[kind][3] == 0 and scan[1] > scan[0] else 0.2) * costs[1]  # there is no filter to shorten
    assert costs[2] > 0.85, "the gain scaled by the ratio of the intervals is no advice"
    shown = abs(held_sine(conversion.settings, scan[1]) / held_sine(source, scan[0]) - 1)
    assert shown == pytest.approx(abs(sampled(conversion.settings, scan[1], np.array([END]))[0] / wanted[-1] - 1), rel=0.01)
    if band.worst_at == pytest.approx(END):
        assert shown == pytest.approx(band.max_deviation, rel=0.01)


def test_values_that_stay_from_series_card_to_series_card_are_wrong_as_soon_as_the_filters_differ() -> None:
    for source, target in itertools.permutations(SERIES, 2):
        old = made(source, 0.25)
        copied = made(target, 0.25)
        conversion, reason = settled(old, target, options=SERIES[target])
        assert not reason
        assert conversion is not None
        loop = conversion.certificate.feedback.loop_band
        w = np.geomspace(loop.low, loop.high, 200)
        typed = float(np.max(np.abs(continuous(copied, w) / continuous(old, w) - 1)))
        if typed < 1e-9:
            assert {source, target} <= {"generic/series", "foxboro/pneumatic", "honeywell/tdc3000"}  # a tenth, all three
            assert conversion.verdict in ("exact", "exact-feedback")
        else:
            assert loop.max_deviation < typed
