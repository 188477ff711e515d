"""Advice that is in print and wrong: none of it comes out of a conversion."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

import pidemu
from pidemu.cli import cli
from pidemu.errors import SettingError
from tests.conversion.support import difference, outputs, random_signal

PROVOX = {"GAIN": 2, "RESET": 4, "RATE": 0.1}


@pytest.mark.parametrize("scan", [(1.0, 0.25), (0.1, 1.0), (1.0, 1.0), None])
@pytest.mark.parametrize("target", ["emerson/deltav", "generic/parallel", "generic/standard"])
def test_the_gain_is_not_scaled_by_the_ratio_of_the_update_times(target: str, scan: tuple[float, float] | None) -> None:
    source = pidemu.load_card("fisher/provox").settings(**PROVOX)
    without = pidemu.convert(source, target)
    plain = pidemu.convert(source, target, scan=scan)
    assert {n: v.value for n, v in plain.settings.items()} == {n: v.value for n, v in without.settings.items()}
    gains = [
        c.settings.law().moments()[1] for c in (pidemu.convert(source, target, scan=scan, compensate=scan is not None), without)
    ]
    # what makes up for the hold moves the gain by the integral over half the difference, less than 10 %; their ratio is 4 or 10
    assert gains[0] == pytest.approx(gains[1], rel=0.1)


def test_a_warning_says_not_to_scale_the_gain_by_the_update_times() -> None:
    source = pidemu.load_card("fisher/provox").settings(**PROVOX)
    conversion = pidemu.convert(source, "generic/parallel", scan=(1.0, 0.5))
    assert any("do not scale the gain by their ratio" in w for w in conversion.warnings)


def test_scaling_the_gain_by_the_update_times_would_be_farther_off() -> None:
    source = pidemu.load_card("generic/parallel").settings(kp=2, ki=0.05, kd=0)
    sp, pv = random_signal(1), random_signal(2)
    fast_sp, fast_pv = (x.repeat(2) for x in (sp, pv))
    wanted = outputs(source, sp, pv, 1.0)
    found = outputs(pidemu.convert(source, "generic/parallel").settings, fast_sp, fast_pv, 0.5)[1::2]
    scaled = outputs(pidemu.load_card("generic/parallel").settings(kp=1, ki=0.025, kd=0), fast_sp, fast_pv, 0.5)[1::2]
    assert difference(found, wanted) < 1e-9  # held samples: two half scans integrate what one whole scan does
    assert difference(scaled, wanted) > 0.01


def test_a_reset_of_the_dependent_equation_is_minutes_and_not_seconds_per_repeat() -> None:
    card = pidemu.load_card("allen-bradley/plc5")
    s = card.settings(EQUATION="ISA", KC=2, TI=0.5)
    assert s["TI"].to("s/repeat") == pytest.approx(30)
    conversion = pidemu.convert(s, card, options={"EQUATION": "independent"})
    assert conversion.settings["KI"].value == pytest.approx(2 / 30)
    assert conversion.settings["KI"].value != pytest.approx(2 / 0.5)


def test_a_proportional_band_is_100_over_the_gain_and_not_a_hundredth_of_it() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=60)
    for target, options in (("honeywell/udc", {"PBorGAIN": "PB PCT"}), ("foxboro/pneumatic", {}), ("foxboro/ia-pid", {})):
        settings = pidemu.convert(source, target, options=options).settings
        name = next(n for n in ("PB", "PBAND") if n in settings)
        assert settings[name].value == pytest.approx(50)
        assert settings[name].value != pytest.approx(2 / 100)


FORMS = [
    ("fisher/provox", PROVOX, "emerson/deltav", {"FORM": "Standard"}),
    ("fisher/provox", PROVOX, "emerson/deltav", {"FORM": "Series"}),
    ("generic/series", {"K": 2, "Ti": 60, "Td": 12, "alpha": 0.1}, "generic/standard", {}),
    ("generic/standard", {"K": 2, "Ti": 60, "Td": 12, "Tf": 1}, "generic/series", {}),
    ("foxboro/pneumatic", {"PB": 50, "INT": 1, "DERIV": 0.2}, "honeywell/udc", {}),
    ("honeywell/tdc3000", {"K": 2, "T1": 1, "T2": 0.2, "FORM": "interactive"}, "honeywell/tdc3000", {"FORM": "ideal"}),
]


@pytest.mark.parametrize(("card", "dials", "target", "options"), FORMS)
def test_values_do_not_stay_as_they_are_when_derivative_is_not_zero(
    card: str, dials: dict[str, object], target: str, options: dict[str, object]
) -> None:
    source = pidemu.load_card(card).settings(**dials)
    conversion = pidemu.convert(source, target, options=options)
    old, new = ({v.role: v.canonical for v in s.values() if v.active} for s in (source, conversion.settings))
    assert any(new[role] != pytest.approx(old[role], rel=1e-3) for role in new if role in old)
    unchanged = conversion.settings.card.settings(
        {
            **conversion.settings.options,
            **{n: unit_free(source, v.role, v.unit) for n, v in conversion.settings.items() if v.role in old},
        }
    )
    w = conversion.certificate.feedback.loop_band.worst_at
    wrong, right = (abs(complex(s.law().response(w) / source.law().response(w)) - 1) for s in (unchanged, conversion.settings))
    assert right < wrong


def unit_free(source: pidemu.Settings, role: object, unit: str) -> float:
    value = next(v for v in source.values() if v.role is role)
    return value.to(unit)


@pytest.mark.parametrize(("card", "dials", "target", "options"), FORMS[:2])
def test_without_derivative_only_the_units_change(
    card: str, dials: dict[str, object], target: str, options: dict[str, object]
) -> None:
    source = pidemu.load_card(card).settings(**{**dials, "RATE": 0})
    settings = pidemu.convert(source, target, options=options).settings
    assert [settings[n].value for n in ("GAIN", "RESET", "RATE")] == pytest.approx([2, 15, 0])


def test_repeats_per_minute_are_no_unit_of_an_independent_integral_gain() -> None:
    card = pidemu.load_card("generic/parallel")
    with pytest.raises(SettingError, match="a gain of its own"):
        card.settings(kp=0.9, ki="0.75 repeat/min")
    assert card.settings(kp=0.9, ki="0.75 1/min")["ki"].value == pytest.approx(0.0125)


def test_a_half_minute_per_repeat_and_half_a_repeat_per_minute_are_not_alike() -> None:
    card = pidemu.load_card("generic/standard")
    assert card.settings(K=1, Ti="0.5 min/repeat")["Ti"].value == pytest.approx(30)
    assert card.settings(K=1, Ti="0.5 repeat/min")["Ti"].value == pytest.approx(120)


def test_the_command_line_says_when_a_number_was_inverted() -> None:
    words = ["convert", "generic/standard", "K=1", "Ti=0.5 repeat/min", "--to", "generic/parallel"]
    result = CliRunner().invoke(cli, words)
    assert result.exit_code == 0
    assert "the reciprocal" in " ".join(result.stdout.split())
