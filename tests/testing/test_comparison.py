"""A stranger's controller is compared with a card, and a difference is made short."""

from __future__ import annotations

import math
from typing import Any

import pytest
import simple_pid

import pidemu
from pidemu.card.library import card_files
from pidemu.settings.settings import Settings
from pidemu.testing import AdapterError, DifferenceError, assert_equals, assert_equivalent, over_arrays
from tests.testing.mine import Mine, StartsFromZero, WindsUp, WrongSignOfD

SETTINGS = pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=1)
EVERYTHING: dict[str, Any] = {"scan": 0.5, "modes": ("automatic", "manual"), "limits": (10.0, 90.0), "initial_output": 20.0}


def found(mine: Any, card: Any = SETTINGS, **asked: Any) -> DifferenceError:
    with pytest.raises(DifferenceError) as caught:
        assert_equals(card, mine, **{"scan": 1.0} | asked)
    return caught.value


def test_a_controller_that_is_right_equals_the_card() -> None:
    assert_equals(SETTINGS, Mine, **EVERYTHING)


def test_a_controller_that_is_right_equals_the_card_while_settings_change() -> None:
    """From Ti and Td to other ones that are on: what stays in the integral is ``ki e`` for both."""

    class Always(Mine):
        def change(self, settings: Settings) -> None:
            super().change(settings)
            assert self.Ti > 0

    card = pidemu.load_card("generic/parallel")

    class Parallel:
        """kp, ki and kd change; the sum stays."""

        def __init__(self, settings: Settings, scan: float) -> None:
            self.h, self.sum, self.before, self.last, self.begun = scan, 0.0, 0.0, 0.0, False
            self.change(settings)

        def change(self, settings: Settings) -> None:
            self.kp, self.ki = settings["kp"].value, settings["ki"].value

        def scan(self, sp: float, pv: float) -> float:
            e = sp - pv
            self.sum = self.sum + self.ki * self.h * e if self.begun else self.last - self.kp * e
            self.begun, self.last = True, self.kp * e + self.sum
            return self.last

    limits = (-1e9, 1e9)
    assert_equals(card.settings(kp=2, ki=0.1, kd=0), Parallel, scan=1.0, limits=limits)
    assert_equals(SETTINGS, Always, **EVERYTHING)


@pytest.mark.parametrize(("mine", "most"), [(WrongSignOfD, 3), (WindsUp, 10), (StartsFromZero, 1)])
def test_the_mistakes_that_people_make_are_found_and_made_short(mine: type[Mine], most: int) -> None:
    error = found(mine)
    assert len(error.record.scans) <= most
    assert f"{mine.__name__} differs from pidemu by" in str(error)
    assert "P  proportional term" in str(error)
    assert error.expected[-1] != error.found[-1]
    again = found(mine)
    assert (str(again), again.record) == (str(error), error.record)


def test_the_settings_of_a_card_are_drawn_and_told() -> None:
    def only_P(settings: Settings) -> Any:
        return lambda sp, pv: settings["kp"].value * (sp - pv)

    error = found(only_P, "generic/parallel", limits=(-1e6, 1e6))
    assert error.settings is not None
    assert error.settings.card.id == "generic/parallel"
    assert "generic/parallel: kp=" in str(error)


def test_a_package_of_the_index_equals_its_card() -> None:
    """simple-pid itself, driven scan by scan: the card's arithmetic is that of the package."""

    def make(settings: Settings, scan: float) -> Any:
        Kp, Ki, Kd = (settings[name].value for name in ("Kp", "Ki", "Kd"))
        pid: Any = simple_pid.PID(Kp, Ki, Kd, sample_time=None, output_limits=(0, 100))

        def step(sp: float, pv: float) -> float:
            pid.setpoint = sp
            return float(pid(pv, dt=scan))

        return step

    s = pidemu.load_card("simple-pid/simple-pid").settings(Kp=2, Ki=0.3, Kd=0.4)
    assert_equals(s, make, scan=0.5, limits=(0, 100))


def test_a_function_over_whole_records_is_compared_as_well() -> None:
    def run(settings: Settings, sp: list[float], pv: list[float]) -> list[float]:
        K = settings["K"].value
        return [min(max(K * (a - b), 0.0), 100.0) for a, b in zip(sp, pv, strict=True)]

    p_only = pidemu.load_card("generic/standard").settings(K=2, Ti="inf", Td=0)
    assert_equals(p_only, over_arrays(run), scan=1.0)
    assert "run differs from pidemu" in str(found(over_arrays(run)))


def test_two_controllers_of_the_user_s_own_are_compared() -> None:
    assert_equivalent(Mine, Mine, card=SETTINGS, scan=1.0)
    with pytest.raises(DifferenceError, match="WrongSignOfD differs from Mine by"):
        assert_equivalent(Mine, WrongSignOfD, card=SETTINGS, scan=1.0)
    assert_equivalent(lambda: lambda sp, pv: sp - pv, lambda: lambda sp, pv: -(pv - sp))


def test_a_difference_within_the_tolerance_is_none() -> None:
    p_only = pidemu.load_card("generic/standard").settings(K=1, Ti="inf", Td=0)
    assert_equals(p_only, lambda settings: lambda sp, pv: min(max(sp - pv, 0), 100) + 0.01, scan=1.0, tolerance=0.02)
    assert "is allowed" in str(found(lambda settings: lambda sp, pv: min(max(sp - pv, 0), 100) + 0.01, p_only))


def test_an_error_of_the_controller_is_a_difference_and_its_cause_is_kept() -> None:
    class Raises:
        def scan(self, sp: float, pv: float) -> float:
            return 1 / (sp - pv)

    error = found(Raises)
    assert "Raises raised ZeroDivisionError" in str(error)
    assert isinstance(error.__cause__, ZeroDivisionError)
    assert len(error.record.scans) == 1


def test_nan_is_a_difference() -> None:
    assert "nan" in str(found(lambda settings: lambda sp, pv: math.nan))


@pytest.mark.parametrize(
    ("mine", "message"),
    [
        (lambda settings: lambda sp, pv: None, "<lambda> returned None in scan 0; return the output"),
        (lambda settings: lambda sp, pv: "50", "<lambda> returned '50' in scan 0; return the output as a number"),
        (
            lambda settings: 5,
            "which has no method scan, step, update and cannot be called; give the controller a method scan(sp, pv)",
        ),
        (7, "7 makes no controllers; give a class, or a function that takes the settings and returns one"),
        (lambda sp, pv: 0.0, "takes sp and pv itself, and would keep its state from one try to the next"),
        (over_arrays(lambda sp: []), "returned 0 outputs for 1 scans; return one for each scan"),
    ],
)
def test_what_cannot_be_driven_is_told(mine: Any, message: str) -> None:
    with pytest.raises(AdapterError) as caught:
        assert_equals(SETTINGS, mine, scan=1.0)
    assert message in str(caught.value)


def test_changes_need_a_method_for_them() -> None:
    with pytest.raises(AdapterError, match=r"has no method change\(settings\)"):
        assert_equals(SETTINGS, lambda settings: lambda sp, pv: 0.0, scan=1.0, modes=("changes",), tolerance=1e9)


def test_what_is_wrong_with_card_or_interval_is_told_as_ever() -> None:
    with pytest.raises(pidemu.CardError, match="did you mean"):
        assert_equals("generic/standart", Mine)
    with pytest.raises(pidemu.ScanError):
        assert_equals(SETTINGS, Mine, scan=-1.0)


@pytest.mark.parametrize("card", card_files())
def test_the_emulator_of_every_card_equals_itself(card: str) -> None:
    """Whatever the settings, in manual and while they change: nothing of the driving differs between the two sides."""

    def make(settings: Settings, scan: float, limits: Any, action: Any, initial_output: float) -> pidemu.Controller:
        return pidemu.Controller(settings, scan, action, limits, initial_output=initial_output)

    modes: Any = ("automatic", "manual", "changes")
    assert_equals(card, make, scan=0.5, modes=modes, tolerance=0, examples=15, scans=20)
