"""A card with one thing wrong is refused at its place, or works in everything that cards are for."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.backends import c, python
from pidemu.card.document import Path_
from pidemu.card.library import card_files, load_card
from pidemu.card.load import Card, load_file, variants
from pidemu.checks.runs import plausible
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import CardError, PidemuError
from tests.card.mutations import ABSURD, changed, document, scalars, written_out, wrong_names
from tests.cli.helpers import said

T = TypeVar("T")
_CARDS = sorted(card_files())


@cache
def _count(card_id: str) -> int:
    return sum(1 for _ in wrong_names(document(card_id)))


@cache
def _paths(card_id: str) -> tuple[Any, list[Path_]]:
    value = document(card_id)
    return value, list(scalars(value))


def stands(folder: Path, card_id: str, value: Any) -> Card | CardError:
    """Write a card and load it, or return what is wrong with it: problems that all lie in its text."""
    file = folder / f"{card_id}.yaml"
    file.parent.mkdir(parents=True, exist_ok=True)
    text = written_out(value)
    file.write_text(text, encoding="utf-8")
    card = attempt(lambda: load_card(file))
    if isinstance(card, Card):
        return card
    assert isinstance(card, CardError)
    assert card.problems
    assert all(1 <= p.line <= len(text.splitlines()) and p.message for p in card.problems)
    return card


def attempt(work: Callable[[], T]) -> T | PidemuError:
    """Return what work gives, or the error that says in words why it gives nothing; any other error passes."""
    try:
        return work()
    except PidemuError as error:
        return error


def use(card: Card, file: Path) -> None:
    """Do with a card what cards are for: nothing fails but with a reason."""
    assert said("show", str(file)).status == 0
    for variant in itertools.islice(variants(card), 2):
        given = attempt(lambda variant=variant: plausible(variant))  # type: ignore[misc]
        controller = attempt(lambda given=given: pidemu.Controller(given))  # type: ignore[misc]
        if isinstance(given, PidemuError) or isinstance(controller, PidemuError):
            assert str(given if isinstance(given, PidemuError) else controller)
            continue
        program = controller.program
        compile(python.source(program), "printed", "exec")
        assert c.single(program, "loop")
        assert len(controller.run(50.0, [49.0] * 20)) == 20
        assert pidemu.explain(given).text


@settings(max_examples=30)
@given(st.sampled_from(_CARDS), st.floats(0, 1, exclude_max=True))
def test_a_name_that_is_missing_or_another_is_refused_or_does_no_harm(
    tmp_path_factory: pytest.TempPathFactory, card_id: str, where: float
) -> None:
    folder = tmp_path_factory.mktemp("vendors")
    _, value = next(itertools.islice(wrong_names(document(card_id)), int(where * _count(card_id)), None))
    card = stands(folder, card_id, value)
    if isinstance(card, Card):
        use(card, folder / f"{card_id}.yaml")


@settings(max_examples=100)
@given(st.sampled_from(_CARDS), st.floats(0, 1, exclude_max=True), st.sampled_from(ABSURD))
def test_an_absurd_value_is_refused_or_does_no_harm(
    tmp_path_factory: pytest.TempPathFactory, card_id: str, where: float, absurd: Any
) -> None:
    folder = tmp_path_factory.mktemp("vendors")
    value, paths = _paths(card_id)

    def replaced(at: Any, key: Any) -> None:
        at[key] = absurd

    card = stands(folder, card_id, changed(value, paths[int(where * len(paths))], replaced))
    if isinstance(card, Card):
        use(card, folder / f"{card_id}.yaml")


@pytest.mark.parametrize("card_id", _CARDS)
def test_without_a_setting_a_card_is_refused_or_runs_though_the_rules_were_not_asked(card_id: str, tmp_path: Path) -> None:
    """A card that comes with pidemu is not checked when it is loaded."""
    value = document(card_id)
    file = tmp_path / f"{card_id}.yaml"
    file.parent.mkdir()

    def deleted(at: Any, key: Any) -> None:
        del at[key]

    def run() -> float:
        variant = next(variants(load_file(file)))
        return pidemu.Controller(plausible(variant)).scan(50.0, 49.0)

    for name in value["settings"]:
        file.write_text(written_out(changed(value, ("settings", name), deleted)), encoding="utf-8")
        outcome = attempt(run)
        assert math.isfinite(outcome) if isinstance(outcome, float) else str(outcome)


def test_a_deleted_setting_is_named_where_it_is_missed(tmp_path: Path) -> None:
    value = document("emerson/deltav")
    del value["settings"]["ALPHA"]
    value["settings"]["ALPHB"] = {"sets": "filter-ratio", "unit": "1", "default": 0.125}
    card = stands(tmp_path, "emerson/deltav", value)
    assert isinstance(card, CardError)
    assert "no setting 'ALPHA' (did you mean 'ALPHB'?)" in [p.message for p in card.problems]


def test_a_conversion_to_and_from_a_card_without_a_dial_is_refused_with_a_reason(tmp_path: Path) -> None:
    source = load_card("generic/standard").settings(K=2, Ti=60, Td=5)
    value = document("generic/series")
    del value["examples"], value["settings"]["Td"]
    value["examples"] = [{"given": {"K": 1, "Ti": 10}, "canonical": {"kp": 1, "ki": 0.1, "kd": 0}}]
    card = stands(tmp_path, "generic/series", value)
    assert isinstance(card, CardError)
    assert "no setting sets the derivative" in str(card)
    with pytest.raises((CardError, ConversionRefusedError)):
        pidemu.convert(source, tmp_path / "generic" / "series.yaml")


@pytest.mark.parametrize("number", ["9" * 5000, "1e300", "-1e300", "1e-300", "5e-324", ".nan", "9" * 200])
def test_a_number_of_any_size_is_refused_or_read(number: str, tmp_path: Path) -> None:
    file = tmp_path / "generic" / "standard.yaml"
    file.parent.mkdir()
    text = card_files()["generic/standard"].read_text(encoding="utf-8")
    assert text.count("K: 2,") >= 1
    file.write_text(text.replace("K: 2,", f"K: {number},", 1), encoding="utf-8")
    with pytest.raises(CardError) as caught:
        load_card(file)
    assert caught.value.problems[0].line > 1
    assert math.isfinite(len(str(caught.value)))
