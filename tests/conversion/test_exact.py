"""What exact means: the same law, and the same output scan by scan where interval and scan rules are the same too."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import ScanError
from tests.conversion.exact_pairs import EXACT, FEEDBACK, OTHER_RULE, PROVOX, SCAN, Pair
from tests.conversion.support import HUNDRED, Floats, difference, outputs, random_signal, rules, settings_that_act

ROUNDING = 1e-9
"""Of the span, or of what the outputs move over: sums over 200 scans of doubles, with a margin of a thousand and more."""


@pytest.mark.parametrize("pair", EXACT, ids=str)
def test_exact_means_the_same_output_whatever_the_setpoint_and_the_measurement_do(pair: Pair) -> None:
    conversion = pair.convert()
    assert conversion.verdict == "exact"
    assert conversion.certificate.scan_by_scan is not None
    assert conversion.certificate.scan_by_scan.is_exact
    for seed in range(3):
        sp, pv = random_signal(seed), random_signal(100 + seed)
        a, b = (outputs(s, sp, pv, SCAN) for s in (conversion.source, conversion.settings))
        assert np.ptp(a) > 1
        assert difference(a, b) < ROUNDING


def smooth(scan: float) -> tuple[Floats, Floats]:
    """Setpoint and measurement over 200 s, at rest before."""
    t = np.arange(round(200 / scan)) * scan
    return 50 + 5 * (1 - np.cos(t / 20)), 50 + 4 * (1 - np.cos(t / 13))


@pytest.mark.parametrize("pair", OTHER_RULE, ids=str)
def test_exact_by_another_scan_rule_is_the_same_output_the_faster_both_scan(pair: Pair) -> None:
    conversion = pair.convert()
    assert conversion.verdict == "exact"
    assert conversion.certificate.scan_by_scan is not None
    assert not conversion.certificate.scan_by_scan.is_exact  # the further claim is not made
    apart = []
    for scan in (SCAN, SCAN / 10):
        a, b = (outputs(s, *smooth(scan), scan) for s in (conversion.source, conversion.settings))
        apart.append(difference(a, b))
    # backward and trapezoidal sums differ by half a scan of the integrand: in proportion to the interval
    assert ROUNDING < apart[1]
    assert apart[1] == pytest.approx(apart[0] / 10, rel=0.2)


@pytest.mark.parametrize("pair", FEEDBACK, ids=str)
def test_exact_feedback_means_the_same_output_while_the_setpoint_stays(pair: Pair) -> None:
    conversion = pair.convert()
    assert conversion.verdict == "exact-feedback"
    sp, pv = np.full(200, 50.0), random_signal(7)
    a, b = (outputs(s, sp, pv, SCAN) for s in (conversion.source, conversion.settings))
    assert np.ptp(a) > 1
    assert difference(a, b) < ROUNDING


@pytest.mark.parametrize("pair", FEEDBACK, ids=str)
def test_exact_feedback_is_not_said_of_controllers_that_agree_on_setpoint_changes_too(pair: Pair) -> None:
    conversion = pair.convert()
    sp, pv = random_signal(8), np.full(200, 50.0)
    a, b = (outputs(s, sp, pv, SCAN) for s in (conversion.source, conversion.settings))
    assert difference(a, b) > 1e-3


GENERIC = (
    "generic/standard",
    "generic/parallel",
    "generic/series",
    "fisher/provox",
    "emerson/deltav",
    "honeywell/tdc3000",
    "bailey/fc19",
)


@given(
    data=st.data(),
    names=st.tuples(st.sampled_from(GENERIC), st.sampled_from(GENERIC)),
    scan=st.floats(0.1, 5),
    seed=st.integers(0, 999),
)
@settings(max_examples=100)
def test_exact_with_the_same_scan_rules_is_what_the_emulated_controllers_show(
    data: st.DataObject, names: tuple[str, str], scan: float, seed: int
) -> None:
    source = settings_that_act(data, pidemu.load_card(names[0]))
    try:
        conversion = pidemu.convert(source, names[1], scan=scan)
    except (ConversionRefusedError, ScanError):  # the filter of a forward rule is unstable at this interval
        assume(False)
    assume(conversion.verdict != "approximate")
    sp, pv = random_signal(seed, 120), random_signal(seed + 1000, 120)
    if conversion.verdict == "exact-feedback":
        sp = np.full(120, 50.0)
    try:
        a, b = (outputs(s, sp, pv, scan) for s in (conversion.source, conversion.settings))
    except ScanError:  # one of them cannot run at this interval, and says so
        assume(False)
    if not conversion.source.algorithm().ki:  # positional: counted from the bias; velocity: from the output at the transfer
        a, b = a - a[0], b - b[0]
    shown = conversion.certificate.scan_by_scan
    claimed = shown is not None and (shown.is_exact if conversion.verdict == "exact" else shown.is_exact_on_measurement)
    if claimed or rules(conversion.source) == rules(conversion.settings):
        # the law's verdict is relative, per frequency, to 1e-9; an output adds up 120 scans of it
        assert difference(a, b) < 100 * ROUNDING


@pytest.mark.parametrize(
    ("card", "given", "target", "scan", "phase", "verdict"),
    [
        ("fisher/provox", PROVOX, "generic/parallel", (1.0, 0.25), -2.0, "exact"),
        ("fisher/provox", PROVOX, "generic/parallel", (1.0, 1.1), 0.27, "exact"),
        ("fisher/provox", PROVOX, "generic/parallel", (0.25, 1.0), 2.0, "approximate"),
        ("foxboro/ia-pid", {"PBAND": 50, "INT": 1, "DERIV": 0.1}, "foxboro/ia-pid", (1.0, 1.0), 0.0, "exact"),
        ("foxboro/ia-pid", {"PBAND": 50, "INT": 1, "DERIV": 0.1}, "foxboro/ia-pid", (1.0, 0.5), -0.35, "exact"),
        ("foxboro/ia-pid", {"PBAND": 50, "INT": 1, "DERIV": 0.1}, "foxboro/ia-pid", (1.0, 8.0), 5.0, "approximate"),
    ],
)
def test_equal_laws_are_exact_while_the_new_scan_loses_no_more_than_one_degree(
    card: str, given: Mapping[str, object], target: str, scan: tuple[float, float], phase: float, verdict: str
) -> None:
    """At 2/Te; the sentence says which way, and never that the outputs are the same scan by scan."""
    conversion = pidemu.convert(pidemu.load_card(card).settings(**given), target, scan=scan)
    cost = conversion.certificate.scan_cost
    assert conversion.certificate.feedback.is_exact
    assert conversion.verdict == verdict
    assert cost is not None
    assert cost.phase_deg == pytest.approx(phase, abs=0.05)  # as rounded above
    assert (f"gains {-cost.phase_deg:.3g} degrees of phase" in conversion.sentence) == (phase < 0)
    assert (f"loses {cost.phase_deg:.3g} degrees of phase" in conversion.sentence) == (phase > 0)
    assert any("scan intervals differ" in w for w in conversion.warnings) == (scan[0] != scan[1])


@pytest.mark.parametrize(("scan", "lag"), [(None, 0.05), (1.0, 1.0), (0.002, 0.002)])
def test_a_filter_set_as_a_share_per_scan_is_carried_over_as_the_lag_that_it_is_at_the_scan(scan: float | None, lag: float) -> None:
    """Half the new sample per scan is a lag of one scan, h (1 - f)/f; the card's own scan is 0.05 s."""
    card = pidemu.load_card("automationdirect/directlogic")
    source = card.settings({**card.variant({}).chosen, "GAIN": 1, "RESET": 20, "FILTER": 0.5, **HUNDRED})
    conversion = pidemu.convert(source, "generic/standard", scan=scan, emulate=False)
    assert conversion.settings.lag == pytest.approx(lag, rel=1e-12)
    assert conversion.verdict == "exact"
