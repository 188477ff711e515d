"""Many conversions at once: each is that of `convert`, and one that is wrong costs no other."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.conversion import many
from pidemu.errors import PidemuError, SettingError

LOOPS: dict[str, list[object]] = {
    "GAIN": [2.0, 1.5, 0.0, "abc", 0.7, 3],
    "RESET": [4, 2, 1, 4, "", "20 s/repeat"],
    "RATE": [0.1, "6 s", 0, 0, None, 0],
}
FIGURES = ("feedback", "gain", "phase", "setpoint")


def one(i: int, **how: Any) -> pidemu.Conversion | PidemuError:
    given = {name: column[i] for name, column in LOOPS.items() if column[i] not in (None, "")}
    try:
        return pidemu.convert(pidemu.load_card("fisher/provox").settings(given), "emerson/deltav", **how)
    except PidemuError as error:
        return error


@pytest.mark.parametrize("how", [{}, {"options": {"FORM": "Series", "STRUCTURE": "1"}}, {"scan": (1, 0.5)}, {"digits": 4}])
def test_every_row_is_what_convert_gives(how: dict[str, Any]) -> None:
    table = pidemu.convert_many(LOOPS, "emerson/deltav", source="fisher/provox", **how)
    assert len(table) == 6
    for i in range(6):
        alone = one(i, **how)
        if isinstance(alone, PidemuError):
            assert table.failed[i] == str(alone)
            assert table.columns["verdict"][i] == ""
            assert math.isnan(table.columns["GAIN"][i])
            with pytest.raises(type(alone)):
                table[i]
            continue
        assert table[i].settings == alone.settings
        assert (table.columns["verdict"][i], table.columns["match"][i]) == (alone.verdict, alone.match)
        for name, value in alone.settings.items():
            assert not value.active or table.columns[name][i] == value.value
        for name, choice in alone.settings.options.items():
            assert table.columns[name][i] == choice
        band, setpoint = alone.certificate.headline.loop_band, alone.certificate.setpoint_headline.loop_band
        figures = [table.columns[name][i] for name in FIGURES]
        assert figures == [band.max_deviation, band.gain_db, band.phase_deg, setpoint.max_deviation]


def test_what_is_asked_refused_or_wrong_is_told_row_by_row() -> None:
    logix = pidemu.load_card("allen-bradley/logix-pid")
    sources = [logix.settings(KP=2, KI=0.05, KD=0), logix.settings(KP=2, KI=0.05, KD=0, pv_range=(0, 100), op_range=(0, 100))]
    assert pidemu.convert_many(sources, "emerson/deltav").columns["outcome"].tolist()[0] == "question"
    wrong = pidemu.convert_many({"GAIN": [1, "x"], "RESET": [1, 1]}, "generic/series", source="fisher/provox")
    assert [row.outcome for row in wrong.rows] == ["converted", "failed"]
    assert wrong.failed[1].startswith("fisher/provox: GAIN: 'x' is not a number")


def test_processes_give_the_same_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many, "_SHARE", 2)
    alone, shared = (pidemu.convert_many(LOOPS, "generic/series", source="fisher/provox", jobs=jobs) for jobs in (1, 2))
    assert [(r.outcome, r.verdict, r.reason, r.dials, r.options) for r in shared.rows] == [
        (r.outcome, r.verdict, r.reason, r.dials, r.options) for r in alone.rows
    ]


class Deadly(pidemu.Settings):
    """Settings that end the process which reads them."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os._exit, (3,)


def test_a_process_that_dies_costs_its_own_rows_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many, "_SHARE", 1)
    good = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0)
    deadly = Deadly(good.variant, good.values_by_name)
    table = pidemu.convert_many([deadly, *[good] * 3], "generic/series", jobs=2)
    assert table.rows[0].outcome == "failed"
    assert [row.outcome for row in table.rows[1:]] == ["converted"] * 3


def test_progress_is_told_and_an_empty_table_is_one() -> None:
    seen: list[tuple[int, int]] = []
    pidemu.convert_many(LOOPS, "generic/series", source="fisher/provox", progress=lambda done, of: seen.append((done, of)))
    assert seen[-1] == (6, 6)
    empty = pidemu.convert_many([], "generic/series")
    assert (len(empty), empty.failed, empty.columns["feedback"].shape) == (0, {}, (0,))


def test_columns_need_their_card_and_one_length() -> None:
    with pytest.raises(SettingError, match="columns are settings of a card; name it"):
        pidemu.convert_many({"GAIN": [1]}, "generic/series")
    with pytest.raises(SettingError, match="the columns have different lengths: GAIN 1, RESET 2"):
        pidemu.convert_many({"GAIN": [1], "RESET": [1, 2]}, "generic/series", source="fisher/provox")


def test_columns_may_be_arrays() -> None:
    gains = np.linspace(0.5, 2, 4)
    table = pidemu.convert_many(
        {"GAIN": gains, "RESET": np.full(4, 3.0), "RATE": np.zeros(4)}, "generic/series", source="fisher/provox"
    )
    np.testing.assert_array_equal(table.columns["K"], gains)
