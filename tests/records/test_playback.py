"""A record played to a controller: when its scans are, what happened, and what a controller starts from."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pidemu
from pidemu.arrays import Floats
from pidemu.controller.signals import Event
from pidemu.errors import RecordError, ScanError
from pidemu.records.files import Record
from pidemu.records.playback import Playback, Saturation, even_step, modes, play, spells, timing

NAN = math.nan
PI = pidemu.load_card("generic/standard").settings(K=2, Ti=10)
MEASURES = pidemu.load_card("epics/epid").settings(KP=2, KI=0.1)


def of(*values: float) -> Floats:
    return np.array(values, dtype=float)


def still(count: int, **columns: Floats) -> Record:
    return Record(np.full(count, 50.0), np.full(count, 50.0), **columns)  # type: ignore[arg-type]


# --- when ----------------------------------------------------------------------------------------------------------------


def test_the_interval_is_that_of_the_time_column_whatever_its_rounding() -> None:
    record = still(1001, time=np.arange(1001, dtype=np.float64) * 0.1 + 1.7e9)  # seconds since 1970, in steps of 2.4e-7 s
    found = timing(record, "r.csv", None, PI)
    assert found.interval is None
    assert found.scan == pytest.approx(0.1, abs=1e-6)


def test_without_a_column_the_interval_is_the_given_one_or_none() -> None:
    assert [timing(still(3), "r.csv", h, PI).scan for h in (None, 2.0)] == [None, 2.0]
    assert even_step(still(3)) is None


def test_uneven_steps_go_to_a_card_that_measures_them_with_the_median_first() -> None:
    found = timing(still(5, time=of(0, 1, 2, 4, 5)), "r.csv", None, MEASURES)
    assert found.scan == 1
    assert found.interval is not None
    assert found.interval.tolist() == [1, 1, 1, 2, 1]


def test_the_nominal_interval_may_be_given_with_uneven_steps() -> None:
    found = timing(still(4, interval=of(NAN, 1, 3, 1)), "r.csv", 1.0, MEASURES)
    assert found.interval is not None
    assert (found.scan, found.interval.tolist()) == (1, [1, 1, 3, 1])
    assert math.isnan(even_step(still(4, interval=of(NAN, 1, 3, 1))) or 0)


def test_an_even_interval_column_is_the_interval_of_any_card() -> None:
    record = still(3, interval=of(0, 0.5, 0.5))
    assert timing(record, "r.csv", None, PI).interval is None  # nothing comes before the first scan
    assert timing(record, "r.csv", None, PI).scan == 0.5


@pytest.mark.parametrize(
    ("record", "given", "message"),
    [
        (
            still(3, time=of(0, 1, 3)),
            None,
            "r.csv: the time column goes on by 1 s after sample 0 (counted from 0), elsewhere by 1.5 s",
        ),
        (still(3, time=of(0, 2, 4)), 1.0, "r.csv: the time column has a step of 2 s, --scan says 1 s"),
        (still(2, interval=of(1, 1)), 2.0, "r.csv: the column interval has a step of 1 s, --scan says 2 s"),
        (still(2, interval=of(1, -1)), None, "r.csv: the column interval goes on by -1 s after sample 0"),
    ],
)
def test_a_column_that_is_no_clock_for_a_nominal_card_is_refused(record: Record, given: float | None, message: str) -> None:
    with pytest.raises(RecordError) as caught:
        timing(record, "r.csv", given, PI)
    assert str(caught.value).startswith(message)


def test_a_refused_interval_names_the_file() -> None:
    library = pidemu.load_card("ros/control-toolbox").settings(p=1, i=0, d=0)
    record = still(4, interval=of(1, 1, -1, 1))
    found = timing(record, "r.csv", None, library)
    with pytest.raises(
        RecordError, match=r"^r\.csv: sample 2 \(counted from 0\): ros/control-toolbox refuses a scan interval of -1 s"
    ):
        play(pidemu.Controller(library, found.scan), record, "r.csv", found.interval)


# --- what happened -------------------------------------------------------------------------------------------------------


def test_modes_are_those_of_the_columns_in_their_order_of_rank() -> None:
    record = still(5, auto=of(1, 0, 0, 1, 1), track=of(NAN, NAN, 9, 9, NAN), hold=of(0, 0, 0, 1, 1))
    assert modes(record).tolist() == ["automatic", "manual", "tracking", "hold", "hold"]


@pytest.mark.parametrize(
    ("mask", "expected"), [("", []), ("0", []), ("1", [(0, 0)]), ("0110010", [(1, 2), (5, 5)]), ("1101", [(0, 1), (3, 3)])]
)
def test_spells_are_first_and_last_place(mask: str, expected: list[tuple[int, int]]) -> None:
    assert list(spells(np.array([c == "1" for c in mask], dtype=bool))) == expected


def test_saturation_counts_automatic_scans_at_a_limit_only() -> None:
    record = Record(
        of(50, 99, 99, 99, 99, 1), of(50, 50, 50, 50, 50, 50), auto=of(1, 1, 1, 0, 1, 1), manual=of(NAN, NAN, NAN, 100, NAN, NAN)
    )
    found = play(pidemu.Controller(PI, 2.0, initial_output=50.0), record, "r.csv")
    assert found.outputs.tolist() == [50, 100, 100, 100, 100, 0]
    assert found.saturations == (Saturation(1, 2, "high"), Saturation(4, 4, "high"), Saturation(5, 5, "low"))
    assert (found.saturated("high"), found.saturated("low")) == (6.0, 2.0)


def test_saturation_is_seen_in_a_program_that_rounds_its_limits() -> None:
    settings = pidemu.load_card("iec/61131-3-pid").settings(KP=2, TR=10)  # float32
    controller = pidemu.Controller(settings, 1.0, output_limits=(0.1, 0.7), initial_output=0.5)
    found = play(controller, Record(of(0, 9, -9), of(0, 0, 0)), "r.csv")
    assert found.outputs.max() == float(np.float32(0.7)) < 0.7
    assert found.saturations == (Saturation(0, 1, "low"), Saturation(2, 2, "high"))  # it is direct acting


def test_plain_values_hold_events_and_saturations() -> None:
    happened = Playback(of(0), of(0), (Event(0, "transfer", "a to b", 1.5),), (Saturation(0, 0, "low"),))
    assert happened.to_dict() == {
        "events": [{"scan": 0, "kind": "transfer", "text": "a to b", "bump": 1.5}],
        "saturations": [{"from": 0, "to": 0, "limit": "low"}],
    }
    assert happened.saturated("low") == 0  # how long a single scan lasts is not known


def test_signals_without_a_use_are_named_with_the_reason() -> None:
    record = still(1, feedforward=of(1), external_reset=of(2), cascade=of(3), track=of(4))
    assert PI.without_use_for(record.signals) == {
        "external_reset": "generic/standard takes no external reset: its windup scheme is 'back-calculation'",
        "feedforward": "generic/standard states no feedforward input",
    }
    assert list(pidemu.load_card("fisher/provox").settings(GAIN=1, RESET=1).without_use_for(record.signals)) == ["feedforward"]


# --- what a controller starts from ---------------------------------------------------------------------------------------


def controller(**dials: object) -> pidemu.Controller:
    return pidemu.Controller(pidemu.load_card("generic/standard").settings(K=2, Ti=10, **dials), 1.0, initial_output=40.0)


def test_a_controller_started_with_its_integral_goes_on_from_it() -> None:
    ctl = controller()
    ctl.start(I=30.0)
    assert ctl.state == {"u": 40, "on": 1, "I": 30}
    assert ctl.scan(sp=51.0, pv=50.0) == pytest.approx(30 + 0.2 + 2, rel=1e-15)


def test_a_controller_started_with_an_output_makes_a_transfer_from_there() -> None:
    ctl = controller()
    ctl.start(u=55.0)
    assert [ctl.scan(sp=51.0, pv=50.0), ctl.scan(sp=51.0, pv=50.0)] == pytest.approx([55, 55.2], rel=1e-15)


@pytest.mark.parametrize("card", ["generic/standard", "generic/series", "honeywell/tdc3000", "iec/61131-3-pid"])
def test_all_states_of_another_controller_let_this_one_go_on_bit_by_bit(card: str) -> None:
    dials: dict[str, dict[str, object]] = {
        "generic/standard": {"K": 2, "Ti": 10, "Td": 3, "Tf": 1},
        "generic/series": {"K": 2, "Ti": 10, "Td": 3, "alpha": 0.1},
        "honeywell/tdc3000": {"K": 2, "T1": 1, "T2": 0.1},
        "iec/61131-3-pid": {"KP": 2, "TR": 10, "TD": 3},
    }
    settings = pidemu.load_card(card).settings(dials[card])
    sp, pv = np.linspace(50, 52, 40), 50 + np.sin(np.arange(40))
    whole, part, rest = (pidemu.Controller(settings, 1.0, output_limits=(-500, 500)) for _ in range(3))
    outputs = whole.run(sp, pv)
    part.run(sp[:17], pv[:17])
    rest.start(**part.state)
    np.testing.assert_array_equal(rest.run(sp[17:], pv[17:]), outputs[17:])


@pytest.mark.parametrize(
    ("states", "message"),
    [
        ({"i": 1.0}, r"no state 'i' \(did you mean 'I'\?\); states: u, on, I"),
        ({"I": NAN}, "the state I = nan is not a finite number"),
        ({"u": math.inf}, "the state u = inf is not a finite number"),
    ],
)
def test_a_state_that_is_none_is_refused(states: dict[str, float], message: str) -> None:
    with pytest.raises(ScanError, match=f"^{message}$"):
        controller().start(**states)


def test_states_are_set_before_the_first_scan() -> None:
    ctl = controller()
    ctl.scan(sp=50.0, pv=50.0)
    with pytest.raises(ScanError, match=r"^states are set before the first scan, and there have been 1; reset\(\) first$"):
        ctl.start(I=3.0)
    ctl.reset()
    ctl.start(I=3.0)
    assert ctl.scan(sp=50.0, pv=50.0) == 3


def test_times_that_no_loop_has_are_refused_from_python_too() -> None:
    record = Record(np.array([50.0, 50.0]), np.array([50.0, 50.0]), time=np.array([0.0, 1.7e308]))
    with pytest.raises(RecordError, match=r"^time column: 1\.7e\+308 s is not a time that a loop has"):
        even_step(record)
