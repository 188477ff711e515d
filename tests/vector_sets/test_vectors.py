"""Test vectors are what the controller does, reach what their cases are named after, and have one hash for one behaviour."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.card.library import card_files
from pidemu.errors import ScanError
from pidemu.vector_sets.block_test import block_test
from pidemu.vector_sets.signals import CASES
from pidemu.vector_sets.vector_set import INPUTS, VectorCase, VectorSet

STANDARD = ("linear", "saturation", "manual", "cascade", "tracking", "faults", "changed-settings")


def provox(**changes: Any) -> VectorSet:
    settings = pidemu.load_card("fisher/provox").settings({"GAIN": 2, "RESET": 4, **changes})
    return pidemu.vectors(settings, 0.5)


def replayed(found: VectorSet, case: VectorCase) -> tuple[list[float], list[Any]]:
    """Play a case as a whole record, in spells between changes of settings."""
    limits = found.limits
    controller = pidemu.Controller(found.settings, found.scan, found.action, limits, engine="python")
    edges = [0, *(c.scan for c in case.changes), len(case.outputs)]
    outputs: list[float] = []
    for k, start in enumerate(edges[:-1]):
        if k:
            controller.change(case.changes[k - 1].settings)
        columns = {name: np.array(x[start : edges[k + 1]]) for name, x in case.inputs.items()}
        outputs += controller.run(**columns).tolist()
    return outputs, controller.events


@pytest.mark.parametrize("card_id", list(card_files()))
def test_every_card_has_the_standard_cases_and_a_run_of_the_record_gives_their_outputs(card_id: str) -> None:
    found = pidemu.vectors(card_id)
    names = [case.name for case in found.cases]
    assert [name for name in STANDARD if name not in names] == []
    assert sorted([*names, *found.left_out]) == sorted(CASES)
    for case in found.cases:
        outputs, events = replayed(found, case)
        assert [x.hex() for x in outputs] == [x.hex() for x in case.outputs]
        assert repr(tuple(events)) == repr(case.events)


@pytest.mark.parametrize("card_id", list(card_files()))
def test_cases_reach_what_they_are_named_after(card_id: str) -> None:
    t = pidemu.load_card(card_id).variant().equation.transfer
    from_zero = t.power_up == "zero" and t.start in ("keep", "running", "zero")  # and not from the middle of the card's limits
    found = pidemu.vectors(card_id, output_limits=(-1.0, 1.0) if from_zero else None)
    low, high = found.limits
    linear, saturation = (np.array(found[name].outputs) for name in ("linear", "saturation"))
    assert ((low < linear[6:]) & (linear[6:] < high)).all()
    assert np.ptp(linear[6:]) > 0
    for limit in (low, high):
        assert math.isinf(limit) or limit in saturation
    texts = {name: " ".join(e.text for e in found[name].events) for name in ("manual", "cascade", "tracking", "faults")}
    assert texts["manual"].count("automatic to manual") == 2
    assert texts["cascade"].count("to cascade") == 3
    assert texts["tracking"].count("to tracking") == 2
    assert "measurement is nan" in texts["faults"]
    assert "measurement is inf" in texts["faults"]
    assert "to hold" in texts["faults"]
    assert len([e for e in found["changed-settings"].events if e.kind == "settings"]) == len(found["changed-settings"].changes) > 0


def test_the_same_controller_has_the_same_hash_and_another_one_another() -> None:
    one = provox()
    assert provox().hash == one.hash
    others = [provox(GAIN=2.5), provox(RATE=0.1), pidemu.vectors(one.settings, 1.0), pidemu.vectors(one.settings, 0.5, seed=2)]
    others += [pidemu.vectors(one.settings, 0.5, action="direct"), pidemu.vectors(one.settings, 0.5, output_limits=(0, 50))]
    assert len({one.hash, *(v.hash for v in others)}) == 7


def test_version_1_of_a_card_without_rounding_beyond_the_basic_operations_has_this_hash() -> None:
    assert provox().hash == "38d2c57f3000b7b89acb247b3890f29b7fc179b460562806122d67391e8f160a"


def test_a_card_that_is_named_alone_has_the_settings_of_its_first_example() -> None:
    card = pidemu.load_card("fisher/provox")
    assert pidemu.vectors("fisher/provox").settings == card.settings(card.data.examples[0].given)


def test_what_a_card_has_no_use_for_is_left_out_and_told() -> None:
    found = pidemu.vectors("generic/standard")
    assert dict(found.left_out) == {
        "intervals": "generic/standard takes the scan interval as it is set",
        "external-reset": "generic/standard takes no external reset: its windup scheme is 'back-calculation'",
        "feedforward": "generic/standard states no feedforward input",
    }


def test_a_case_that_is_not_there_is_told() -> None:
    found = pidemu.vectors("generic/standard")
    with pytest.raises(ScanError, match="no case 'feedforward': generic/standard states no feedforward input"):
        found["feedforward"]
    with pytest.raises(ScanError, match=r"no case 'liner' \(did you mean 'linear'\?\); cases: linear, "):
        found["liner"]


def test_what_cannot_be_run_is_refused() -> None:
    with pytest.raises(ScanError):
        pidemu.vectors("fisher/provox", scan=-1)


def test_the_files_hold_json_and_a_record_for_each_case(tmp_path: Path) -> None:
    found = provox()
    written = found.write(tmp_path / "new" / "folder")
    assert [path.name for path in written] == ["vectors.json", *(f"{case.name}.csv" for case in found.cases)]
    assert json.loads(written[0].read_text(encoding="utf-8")) == json.loads(json.dumps(found.to_dict()))
    for case in found.cases:
        path = tmp_path / "new" / "folder" / f"{case.name}.csv"
        record = pidemu.read_record(path)
        header = next(line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#"))
        assert header.split(",")[:11] == [*INPUTS, "output"]
        assert record.output is not None
        np.testing.assert_array_equal(record.output, case.outputs)
        for name, column in case.inputs.items():
            read = getattr(record, name)
            assert (read is None and np.isnan(column).all()) or np.array_equal(read, column, equal_nan=True)


def test_what_is_not_a_number_is_a_word_in_json_and_what_is_absent_null() -> None:
    inputs = provox()["faults"].to_dict()["inputs"]
    assert (inputs["pv"][20], inputs["pv"][30], inputs["pv"][50], inputs["pv"][60]) == ("nan", "inf", "-inf", 1e31)
    assert inputs["manual"][10] is None
    json.dumps(provox().to_dict(), allow_nan=False)


def test_states_are_there_scan_by_scan() -> None:
    linear = provox()["linear"]
    assert set(linear.states) == {"u", "on", "I"}
    assert linear.states["u"] == linear.outputs


def test_the_record_of_a_block_is_its_cases_in_a_row() -> None:
    found = provox()
    controller = pidemu.Controller(found.settings, 0.5)
    controller.listen("cascade", "track")
    test = block_test(controller.program, found)
    lengths = [len(found[name].outputs) for name in ("linear", "saturation", "manual", "cascade", "tracking")]
    assert len(test.outputs) == sum(lengths)
    assert {len(column) for column in test.signals.values()} == {sum(lengths)}
    assert test.outputs[: lengths[0]] == list(found["linear"].outputs)
