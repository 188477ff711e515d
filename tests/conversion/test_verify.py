"""A signed certificate is computed again: unchanged, or what changed and by which version; whatever else a file may hold."""

from __future__ import annotations

import contextlib
import copy
import json
import shutil
from collections.abc import Callable, Iterator
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.conversion import comparison, verify
from pidemu.errors import CertificateError, PidemuError
from tests.cli.helpers import said, strict_json, with_another_filter
from tests.conversion.commands import CONVERSIONS, OTHERS
from tests.helpers import copied

PROVOX = ("fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav", "--scan", "1,0.5")


@cache
def _signed(*words: str) -> str:
    return said("convert", *words, "--date", "2026-07-01", "--json").out


def signed(*words: str) -> Any:
    return strict_json(_signed(*(words or PROVOX)))


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Return a folder with copies of the two cards, to be changed."""
    for card in ("fisher/provox", "emerson/deltav"):
        file = Path(pidemu.load_card(card).document.path)
        (tmp_path / file.parent.name).mkdir()
        shutil.copy(file, tmp_path / file.parent.name)
    return tmp_path


@pytest.mark.parametrize("name", CONVERSIONS)
def test_a_certificate_that_nothing_happened_to_is_unchanged(name: str) -> None:
    found = pidemu.verify(signed(*CONVERSIONS[name]))
    assert [str(c) for c in found.changes] == []
    assert found.unchanged
    assert found.because == found.versions == ()


def test_from_python_a_conversion_verifies_with_all_its_digits() -> None:
    s = pidemu.load_card("generic/standard").settings(K=2.123456789012345, Ti=100 / 3, Td=2, Tf=0.2)
    c = pidemu.convert(s, "emerson/deltav", scan=(0.3, 0.1), runs_every=(0.03, 0.1))
    found = pidemu.verify(c.to_dict())
    assert found.changes == ()
    assert found.conversion is not None
    assert found.conversion.settings == c.settings
    assert found.conversion.source == c.source


def test_the_nearest_settings_of_a_refusal_can_be_signed() -> None:
    assert pidemu.verify(signed(*OTHERS["refused"])["nearest"]).changes == ()


@pytest.mark.parametrize("seen", [date(2026, 7, 1), None])
def test_the_date_is_no_part_of_what_is_compared(seen: date | None) -> None:
    s = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4)
    assert pidemu.verify(pidemu.convert(s, "emerson/deltav").to_dict(seen)).unchanged


EDITED: dict[str, tuple[tuple[Any, ...], Any, str]] = {
    "a dial": (("to", "settings", "RATE", "value"), 5.5, "dial RATE: 5.5 s on the certificate, 5.25 s now"),
    "its unit": (("to", "settings", "RATE", "unit"), "min", "dial RATE: 5.25 min on the certificate, 5.25 s now"),
    "an option": (("to", "options", "FORM"), "Standard", "option FORM: Standard on the certificate, Series now"),
    "the verdict": (("verdict",), "approximate", "verdict: approximate on the certificate, exact now"),
    "a refusal": (("refusal",), "too fast", "verdict: exact, refused on the certificate, exact now"),
    "the status of a condition": (
        ("conditions", 0, "status"), "inferred",
        "condition: PROVOX's derivative filter is RATE/8 (inferred) on the certificate, PROVOX's derivative filter is RATE/8 "
        "(assumed) now",
    ),
    "a figure": (
        ("certificate", "scan_by_scan", "scan", 0), 2.0, "figure scan_by_scan.scan[0]: 2 on the certificate, 1 now",
    ),
    "a figure that became infinite": (
        ("certificate", "setpoint_kick", "source"), "inf", "figure setpoint_kick.source: inf on the certificate, 2 now",
    ),
    "a figure of the bench check": (("bench_check", "jump"), 1.0, "bench check jump: 1 on the certificate, 5.4 now"),
    "a dial of the old controller": (
        ("from", "settings", "GAIN", "value"), 3.0, "dial before GAIN: 3 %/% on the certificate, 2 %/% now",
    ),
    "what it was matched by": (("match",), "textbook", "match: textbook on the certificate, exact now"),
}  # fmt: skip


@pytest.mark.parametrize("name", EDITED)
def test_an_edited_certificate_is_found_out(name: str) -> None:
    path, value, said_of_it = EDITED[name]
    plain = signed()
    place = plain
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value
    found = pidemu.verify(plain)
    assert [str(c) for c in found.changes] == [said_of_it]
    assert not found.unchanged
    assert "the file was edited" in found.because[0]


@pytest.mark.parametrize("name", ["sentence", "at_the_loop", "warnings", "command"])
def test_edited_words_are_found_out_by_the_pidemu_that_wrote_them(name: str) -> None:
    plain = signed()
    before = plain[name]
    plain[name] = [*before, "Nothing to watch for."] if isinstance(before, list) else "Both are the same."
    (change,) = pidemu.verify(plain).changes
    assert change.kind == name.replace("_", " ")
    assert (change.before, change.after) == (plain[name][-1], "nothing") if isinstance(before, list) else (plain[name], before)
    assert pidemu.verify(plain | {"pidemu": "0.0.1"}).changes == ()


def test_words_that_follow_from_a_card_that_changed_are_not_told_besides(own: Path) -> None:
    file = own / "fisher" / "provox.yaml"
    file.write_text(with_another_filter(file.read_text(encoding="utf-8")), encoding="utf-8")
    kinds = {c.kind for c in pidemu.verify(signed(), vendors=[own]).changes}
    assert kinds == {"dial", "condition", "bench check", "figure"}


def test_a_certificate_without_its_sentence_is_not_a_whole_one() -> None:
    plain = signed()
    del plain["sentence"]
    with pytest.raises(CertificateError, match="sentence: missing"):
        pidemu.verify(plain)


def test_what_another_machine_rounds_otherwise_is_no_change() -> None:
    """Figures are searched for on a grid and by roots; the last digits of a search are not a result."""
    plain = signed()
    plain["to"]["settings"]["RATE"]["value"] *= 1 + 5e-7
    band = plain["certificate"]["feedback_at_scan"]["full_band"]
    band |= {"gain_db": band["gain_db"] * (1 + 5e-5), "worst_at": band["worst_at"] * 0.9}
    assert pidemu.verify(plain).unchanged


def test_a_card_that_changed_the_result_is_named(own: Path) -> None:
    """PROVOX with another filter ratio: RATE and ALPHA are others, and it is PROVOX's card that is another version."""
    plain = signed()
    file = own / "fisher" / "provox.yaml"
    file.write_text(with_another_filter(file.read_text(encoding="utf-8")), encoding="utf-8")
    found = pidemu.verify(plain, vendors=[own])
    assert {c.name: (c.before, c.after) for c in found.changes if c.kind == "dial"} == {
        "RATE": ("5.25 s", "5.4 s"),
        "ALPHA": ("0.14286", "0.11111"),
    }
    before, now = plain["cards"]["fisher/provox"], pidemu.load_card(file).digest
    assert found.because == (f"fisher/provox is another version: {before[:12]} on the certificate, {now[:12]} now",)
    assert found.to_dict()["cards"]["fisher/provox"] == {"certificate": before, "now": now}


def test_a_card_that_changed_without_effect_is_told_though_all_is_unchanged(own: Path) -> None:
    plain = signed()
    with (own / "emerson" / "deltav.yaml").open("a", encoding="utf-8") as file:
        file.write("# a comment\n")
    found = pidemu.verify(plain, vendors=[own])
    assert found.unchanged
    assert found.because == ()
    [version] = found.versions
    assert version.startswith("emerson/deltav is another version: ")


def test_another_pidemu_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = signed()
    plain["pidemu"] = "0.0.9"
    plain["to"]["settings"]["GAIN"]["value"] = 2.1
    del plain["certificate"]["scan_cost"]  # the old one did not know of it
    found = pidemu.verify(plain)
    assert [str(c) for c in found.changes] == ["dial GAIN: 2.1 %/% on the certificate, 2 %/% now"]
    assert found.because == (f"pidemu is another version: 0.0.9 on the certificate, {pidemu.__version__} now",)


def test_a_conversion_that_is_refused_or_asked_about_today_is_a_change() -> None:
    plain = signed()
    plain["request"] |= {"to": "emerson/deltav", "options": {"STRUCTURE": "PD Action on Error"}}
    found = pidemu.verify(plain)
    assert found.conversion is None
    [change] = found.changes
    assert (change.kind, change.before) == ("conversion", "exact")
    plain = signed(*CONVERSIONS["assumed"])
    plain["request"]["assume"] = False
    [change] = pidemu.verify(plain).changes
    assert change.after.startswith("a question: honeywell/tdc3000: FORM is not stated")


def test_a_card_of_ones_own_is_found_in_its_folder(tmp_path: Path) -> None:
    (tmp_path / "acme").mkdir()
    text = copied(Path(pidemu.load_card("generic/series").document.path))
    (tmp_path / "acme" / "block.yaml").write_text(text.replace("vendor: Generic", "vendor: Acme"), encoding="utf-8")
    card = pidemu.load_card("acme/block", vendors=[tmp_path])
    plain = pidemu.convert(card.settings(K=2, Ti=15, Td=5), "generic/standard").to_dict()
    assert pidemu.verify(plain, vendors=[tmp_path]).unchanged
    message = r"^certificate: request.from.card: there is no card 'acme/block'; name the folder that it lies in with --vendors DIR$"
    with pytest.raises(CertificateError, match=message):
        pidemu.verify(plain)


AGAIN = r"; write the certificate again with 'pidemu convert \.\.\. --json'$"
WRONG: dict[str, tuple[bytes, str]] = {
    "empty": (b"", rf"^c\.json: the file is empty{AGAIN}"),
    "blank": (b" \n", rf"^c\.json: the file is empty{AGAIN}"),
    "no JSON": (b"GAIN 2\n", rf"^c\.json:1:1: not JSON: expecting value{AGAIN}"),
    "a list": (b"[]", rf'^c\.json: not a certificate, as it does not begin with "schema": "pidemu-conversion-1"{AGAIN}'),
    "other JSON": (b'{"a": 1}', rf'^c\.json: not a certificate, as it does not begin with "schema": "pidemu-conversion-1"{AGAIN}'),
    "another version": (
        b'{"schema": "pidemu-conversion-2"}',
        r"^c\.json: schema: the form is 'pidemu-conversion-2', and pidemu \S+ reads 'pidemu-conversion-1'; verify it with the "
        r"pidemu that wrote it, or convert again$",
    ),
    "another version as a number": (b'{"schema": 2}', r"^c\.json: schema: the form is '2', and pidemu "),
    "nothing but the form": (b'{"schema": "pidemu-conversion-1"}', rf"^c\.json: pidemu: missing{AGAIN}"),
    "binary": (b"\xff\xfe\x00", r"^c\.json: text in UTF-16, little-endian; save the file as UTF-8$"),
    "a long number": (b'{"schema": ' + 100_000 * b"1" + b"}", rf"^c\.json: a number of 100,000 digits{AGAIN}"),
    "not a number": (b'{"schema": NaN}', rf"^c\.json: not JSON: NaN is not a number in JSON{AGAIN}"),
    "a key twice": (b'{"schema": 1, "schema": 2}', rf"^c\.json: not JSON: the key 'schema' stands twice in one place{AGAIN}"),
    "deep": (b"[" * 200_000, rf"^c\.json: nested too deeply for a certificate{AGAIN}"),
    "huge": (b" " * (16 * 2**20 + 1), rf"^c\.json: larger than 16 MB, which is too much for a certificate{AGAIN}"),
    "a page": (b"<!DOCTYPE html>", rf"^c\.json: a web page \(HTML\), not a certificate{AGAIN}"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_is_not_a_certificate_is_refused_with_place_and_remedy(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    content, message = WRONG[name]
    Path("c.json").write_bytes(content)
    with pytest.raises(CertificateError, match=message):
        pidemu.verify("c.json")


@pytest.mark.parametrize("part", [0.1, 0.5, 0.9, 0.999])
def test_a_truncated_file_says_where_it_ends(part: float, tmp_path: Path) -> None:
    text = _signed(*PROVOX)
    file = tmp_path / "c.json"
    file.write_text(text[: int(part * len(text))], encoding="utf-8")
    with pytest.raises(CertificateError) as error:
        pidemu.verify(file)
    head = f"{file}:{text[: int(part * len(text))].count(chr(10)) + 1}:"
    assert str(error.value).startswith(head)


@pytest.mark.parametrize(("name", "what"), [("question", "a question that has to be answered first"), ("refused", "a refusal")])
def test_a_question_and_a_refusal_are_not_certificates(name: str, what: str) -> None:
    with pytest.raises(CertificateError, match=f"^certificate: verdict: this is {what}, not a certificate; convert again"):
        pidemu.verify(signed(*OTHERS[name]))


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    for name, reason in (
        ("none.json", "No such file or directory"),
        (".", "it is a folder"),
        ("a\0b", "no file can have this name"),
    ):
        with pytest.raises(CertificateError, match=f"cannot be read: {reason}"):
            pidemu.verify(name if "\0" in name else tmp_path / name)


TYPES: dict[tuple[Any, ...], tuple[Any, str]] = {
    ("request", "scan"): ([1.0], "request.scan: list should have at least 2 items"),
    ("request", "mode"): ("manual", "request.mode: should be 'auto', 'cascade' or 'both', and is \"manual\""),
    ("request", "more"): (1, "request.more: an unknown key"),
    ("request", "digits"): ("5", 'request.digits: should be a valid integer, and is "5"'),
    ("cards", "fisher/provox"): ("1", "cards.fisher/provox: string should match pattern"),
    ("to", "settings"): ([], "to.settings: should be a valid dictionary, and is a list"),
    ("cards",): ({}, "cards: the version of fisher/provox is missing"),
    ("certificate",): (None, "certificate: should be a valid dictionary, and is null"),
}


@pytest.mark.parametrize("path", TYPES, ids=".".join)
def test_a_wrong_value_is_named_with_its_place(path: tuple[str, ...]) -> None:
    value, message = TYPES[path]
    plain = signed()
    place = plain
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value
    with pytest.raises(CertificateError) as error:
        pidemu.verify(plain)
    assert str(error.value).startswith(f"certificate: {message}")


def test_a_card_that_is_a_file_is_not_read() -> None:
    plain = signed()
    plain["request"]["to"] = "/etc/passwd.yaml"
    plain["cards"]["/etc/passwd.yaml"] = plain["cards"].pop("emerson/deltav")
    with pytest.raises(CertificateError, match=r"^certificate: request.to: '/etc/passwd.yaml' is a file, not the id of a card"):
        pidemu.verify(plain)


def paths(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the place of everything in nested plain values."""
    if path:
        yield path
    for key, item in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from paths(item, (*path, key))


def at(value: Any, path: tuple[Any, ...]) -> Any:
    """Return what stands at a place."""
    for step in path:
        value = value[step]
    return value


PLACES = list(paths(signed()))
READ = [p for p in PLACES if p[0] in ("request", "to", "cards", "conditions", "bench_check", "action", "schema", "pidemu", "date")]
HOSTILE: list[Any] = [
    None, True, 0, -1, 1e308, 1e-308, 10**400, "", "nan", "inf", "-inf", "1e999", "x" * 3000, 1e-9, 1e9, [1e-9, 1e9], [1e9, 1e-9],
    "gain=1e300,lag=1e-300", "0,1e300", "../../etc", "\x00", "\ud800", "=", ",", [], {}, [[]] * 3, {"": None}, [1, 2], [-1.0, 0.0],
    ["a", "b"], {"a": {"b": {"c": 1}}},
]  # fmt: skip


@given(
    places=st.lists(st.sampled_from(READ) | st.sampled_from(PLACES), min_size=1, max_size=3),
    values=st.lists(st.sampled_from(HOSTILE), min_size=3, max_size=3),
)
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_no_file_makes_a_traceback(places: list[tuple[Any, ...]], values: list[Any]) -> None:
    plain = signed()
    for path, value in zip(places, values, strict=False):
        place = plain
        try:
            for step in path[:-1]:
                place = place[step]
            place[path[-1]] = copy.deepcopy(value)
        except (KeyError, IndexError, TypeError):  # a value before took the place away
            continue
    try:
        found = pidemu.verify(plain)
    except PidemuError:
        return
    assert json.dumps(found.to_dict(), allow_nan=False)
    assert all(str(c) for c in found.changes)


NOT_COMPARED: dict[tuple[str, ...], str] = {
    ("date",): "when it was made is not computed",
    ("worst_at",): "where a largest value lies jumps between equal ones; verify says that it does not look",
    ("largest_at",): "the same",
}
"""What may be edited without a change being found, and why."""


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the place of every number, word, truth and null."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else None
    if items is None:
        yield path
    else:
        for key, item in items:
            yield from leaves(item, (*path, key))


def edited(value: Any) -> Any:
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return 2 * value + 1
    return "edited" if value is None else f"{value} edited" if value else "edited"


def without_objection(plain: Any, paths: list[tuple[Any, ...]], change: Callable[[Any, Any], None]) -> set[tuple[Any, ...]]:
    """Return where `verify` takes a change for nothing."""
    found = set()
    for path in paths:
        place = changed = copy.deepcopy(plain)
        for step in path[:-1]:
            place = place[step]
        change(place, path[-1])
        with contextlib.suppress(CertificateError):
            verified = pidemu.verify(changed)
            if verified.unchanged and not verified.versions:
                found.add(path)
    return found


@pytest.fixture
def once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute each conversion that is asked for once."""
    known: dict[str, Any] = {}

    def again(*asked: Any) -> Any:
        key = repr(asked[0].request)
        if key not in known:
            known[key] = real(*asked)
            plain = known[key].to_dict()
            object.__setattr__(known[key], "to_dict", lambda: plain)
        return known[key]

    real = verify._again
    monkeypatch.setattr(verify, "_again", again)


@pytest.mark.usefixtures("once")
@pytest.mark.parametrize("name", ["all figures", "nearest settings", "ranges"])
def test_no_leaf_of_a_certificate_can_be_edited_unseen(name: str) -> None:
    plain = signed(*CONVERSIONS[name])

    def edit(place: Any, key: Any) -> None:
        place[key] = edited(place[key])

    unseen = without_objection(plain, list(leaves(plain)), edit)
    assert {path for path in unseen if path not in NOT_COMPARED and path[-1:] not in NOT_COMPARED} == set()


@pytest.mark.usefixtures("once")
def test_no_key_of_a_certificate_can_be_taken_out_or_put_in_unseen() -> None:
    plain = signed(*CONVERSIONS["all figures"])
    groups = [p for p in [(), *paths(plain)] if isinstance(at(plain, p), dict)]
    keys = [(*p, key) for p in groups for key, value in at(plain, p).items() if value is not None]
    assert without_objection(plain, keys, lambda place, key: place.pop(key)) == {("transfer_plan",)}  # as without --cut-over
    assert without_objection(plain, [(*p, "more") for p in groups], lambda place, key: place.update({key: 1.0})) == set()


def test_what_verify_does_not_look_at_is_said() -> None:
    found = pidemu.verify(signed())
    assert found.not_compared == ("its date, and where in a band a largest value lies (worst_at, largest_at)",)
    assert len(pidemu.verify(signed() | {"pidemu": "0.0.1"}).not_compared) == 2


def test_a_key_that_is_not_known_is_refused_wherever_it_stands() -> None:
    for path in ((), ("request",), ("to",), ("to", "settings", "GAIN"), ("textbook",)):
        plain = signed()
        at(plain, path)["more"] = 1
        with pytest.raises(CertificateError, match=rf"^certificate: {'.'.join([*path, 'more'])}: an unknown key"):
            pidemu.verify(plain)
    plain = signed()
    plain["cards"]["generic/series"] = "0" * 64
    with pytest.raises(CertificateError, match=r"^certificate: cards: 'generic/series' has no part in this conversion"):
        pidemu.verify(plain)


def test_tolerances_are_those_that_the_command_states() -> None:
    assert (comparison.DIAL, comparison.FIGURE) == (1e-6, 1e-4)
    text = " ".join(said("verify", "--help").out.split())
    assert "dials (to 1e-6)" in text
    assert "figures (to 1e-4" in text
