"""The certificate as a page: what it says is the conversion, it stands alone, and its command makes it again."""

from __future__ import annotations

import hashlib
import math
import os
import re
import shlex
import subprocess
import sys
from datetime import date
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pidemu
from pidemu.card.library import ENVIRONMENT
from pidemu.certificate.models import Band
from pidemu.certificate.unverified import facts, unverified_law, unverified_program
from pidemu.conversion.convert import convert
from pidemu.conversion.result import Conversion
from pidemu.conversion.statement import condition_line, sections
from pidemu.errors import PidemuError
from pidemu.process.process import Process, parse_process
from pidemu.process.text import written
from pidemu.report.certificate import certificate_page, write_page
from pidemu.report.curves import bode, closed_loops, responses
from tests.cli.helpers import said, strict_json, told
from tests.conversion.support import continuous, outputs
from tests.helpers import copied, made_up_card

DAY = date(2026, 7, 1)
PROCESS = Process.from_lags(1.0, lags=[20, 5], delay=3)
PROVOX: dict[str, object] = {"GAIN": 2, "RESET": 4, "RATE": 0.1}
SERIES: dict[str, object] = {"K": 2, "Ti": 15, "Td": 5}
STANDARD: dict[str, object] = {"K": 2.1234567, "Ti": 100 / 3, "Td": 2, "Tf": 0.2}
MADE: dict[str, tuple[str, dict[str, object], str, dict[str, Any]]] = {
    "at scans": ("fisher/provox", PROVOX, "emerson/deltav", {"scan": (1.0, 0.5)}),
    "approximate": ("generic/standard", {"K": 2, "Ti": 40, "Td": 8, "Tf": 0.5}, "emerson/deltav", {"scan": (1.0, 0.5)}),
    "exact": ("generic/series", SERIES, "generic/standard", {}),
    "refused": ("generic/standard", {"K": 2, "Ti": 10, "Td": 4}, "fisher/provox", {"allow_approximate": True}),
    "proportional": ("generic/standard", {"K": 2, "Ti": "inf", "Td": 0}, "emerson/deltav", {}),
    "integers and signs": ("generic/standard", STANDARD, "iec/61131-3-pid", {"scan": 0.5, "allow_approximate": True}),
    "arduino": ("generic/standard", STANDARD, "arduino/pid", {"allow_approximate": True}),
    "a process": ("fisher/provox", PROVOX, "emerson/deltav", {"scan": (1.0, 0.5), "process": PROCESS}),
    "rounded": ("generic/standard", {**STANDARD, "Td": 8, "Tf": 1}, "honeywell/udc", {}),
    "asked": (
        "honeywell/tdc3000",
        {"K": 2, "T1": 1, "T2": "6 s", "pv_range": (0, 400), "op_range": (0, 100)},
        "emerson/deltav",
        {"assume": True, "action": "direct", "tag": "TIC-101", "mode": "auto"},
    ),
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv(ENVIRONMENT, raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@cache
def made(name: str) -> Conversion:
    card, values, target, how = MADE[name]
    return convert(pidemu.load_card(card).settings(values), target, digits=5, **how)


@cache
def page(name: str) -> str:
    c = made(name)
    return certificate_page(c, c.transfer_plan(50, 48, 40, "reverse") if name == "arduino" else None, date=DAY)


def tree(text: str) -> ElementTree.Element:
    return ElementTree.fromstring(text)


def words(element: ElementTree.Element | None) -> str:
    assert element is not None
    return " ".join("".join(element.itertext()).split())


def table(text: str, name: str) -> list[list[str]]:
    """Return the cells of the rows of a table."""
    found = tree(text).find(f".//table[@id='{name}']/tbody")
    assert found is not None
    return [[words(cell) for cell in row] for row in found]


def section(text: str, title: str) -> list[str]:
    """Return the list under a heading."""
    return [words(item) for item in below(text, title).iter("li")]


def below(text: str, title: str) -> ElementTree.Element:
    """Return the section with a heading."""
    [found] = [s for s in tree(text).iter("section") if words(s.find("h2")) == title]
    return found


def listed(element: ElementTree.Element) -> dict[str, str]:
    """Return a list of names with what they are."""
    return {words(name): words(text) for name, text in zip(element.iter("dt"), element.iter("dd"), strict=True)}


def number_in(text: str) -> float:
    return float(text.partition(" ")[0])


class _Tags(HTMLParser):
    """Which tags are open, and what refers to elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()
        self.references: list[tuple[str, str]] = []
        self.ids: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        self._look(tag, attrs)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._look(tag, attrs)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def _look(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.add(tag)
        names = ("src", "href", "xlink:href", "srcset", "data", "action", "style", "clip-path")
        self.references += [(n, v or "") for n, v in attrs if n in names]
        self.ids += [v or "" for n, v in attrs if n == "id"]


def parsed(text: str) -> _Tags:
    parser = _Tags()
    parser.feed(text)
    parser.close()
    return parser


@pytest.mark.parametrize("name", MADE)
def test_every_tag_is_closed(name: str) -> None:
    assert page(name).startswith("<!DOCTYPE html>\n")
    assert parsed(page(name)).open == []
    assert tree(page(name)).tag == "html"


@pytest.mark.parametrize("name", MADE)
def test_the_page_needs_nothing_from_elsewhere(name: str) -> None:
    found = parsed(page(name))
    assert not {"script", "link", "img", "iframe", "object", "image"} & found.seen
    assert "@import" not in page(name)
    assert {n for n, v in found.references if not v.startswith("#")} <= {"style", "clip-path"}
    assert "http" not in " ".join(v for _, v in found.references)
    assert "http" not in words(tree(page(name)).find("head/style"))
    targets = {v[1:] for _, v in found.references if v.startswith("#")} | set(re.findall(r"url\(#([^)]*)\)", page(name)))
    assert targets
    assert targets <= set(found.ids)


@pytest.mark.parametrize("name", MADE)
def test_no_two_things_on_the_page_have_the_same_id(name: str) -> None:
    ids = parsed(page(name)).ids
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize("name", MADE)
def test_the_verdict_is_said_in_a_band_of_its_own(name: str) -> None:
    c, band = made(name), tree(page(name)).find(".//p[@id='verdict']")
    assert band is not None
    assert band.get("class") == f"verdict {'refused' if c.refusal else c.verdict}"
    assert words(band).endswith(c.sentence)


@pytest.mark.parametrize("name", MADE)
def test_the_dials_are_those_of_the_conversion_to_the_last_digit(name: str) -> None:
    c, found = made(name), tree(page(name))
    for which, settings in (("source", c.source), ("target", c.settings)):
        rows = found.findall(f".//table[@id='{which}']/tbody/tr")
        shown = {words(row.find("th")): (float(row.find(".//data").get("value") or ""), words(row[2])) for row in rows}  # type: ignore[union-attr]
        active = {n: (v.value, "" if v.unit == "1" else v.unit) for n, v in settings.items() if v.active}
        assert shown == {n: x for n, x in active.items() if n in shown}
        hidden = [settings[n] for n in active.keys() - shown.keys()]
        assert all(v.off and not v.given for v in hidden)  # which stand in a line below the table
        for row in rows:  # what is read is the same number in six digits
            data = row.find(".//data")
            assert data is not None
            if words(data) == "off":  # nobody can type an infinity
                assert settings[words(row.find("th"))].off
                continue
            assert float(words(data)) == pytest.approx(float(data.get("value") or ""), rel=5e-6)


@pytest.mark.parametrize("name", ["approximate", "exact", "a process"])
def test_the_textbook_rule_has_a_column_beside_the_dials(name: str) -> None:
    book = made(name).textbook.settings
    assert book is not None
    shown = {row[0]: float(row[4]) for row in table(page(name), "target") if row[4] not in ("-", "off")}
    finite = {n: v for n, v in book.items() if v.active and math.isfinite(v.value) and (n in shown or v.given)}
    assert shown == {n: pytest.approx(v.value, rel=5e-6) for n, v in finite.items()}


def test_another_unit_and_a_default_are_said() -> None:
    assert ["RESET", "4", "repeat/min", "= 15 s/repeat", ""] in table(page("at scans"), "source")
    assert ["b", "1", "", "", "card's default"] in table(page("refused"), "source")


def test_the_dials_are_printed_as_they_were_found() -> None:
    """On the night of the cut-over they are the way back: what was typed, the options, what the action was set to, the ranges."""
    assert ["T2", "0.1", "min", "= 6 s", "found as 6 s"] in table(page("asked"), "source")
    found = listed(below(page("asked"), "Before, as found (the way back)"))
    assert found == {
        "options": "FORM=interactive (not stated), CTEQN=A (not stated)",
        "action": "direct acting, PV - SP: CTLACTN DIRECT",
        "ranges": "PV 0 to 400, OP 0 to 100",
        "scan": "not given",
    }


def test_the_head_names_loop_date_and_versions() -> None:
    c, head = made("asked"), words(tree(page("asked")).find("body/header"))
    assert head.startswith("TIC-101: conversion certificate honeywell/tdc3000 → emerson/deltav")
    cards = [
        f"{s.card.id} {hashlib.sha256(Path(s.card.document.path).read_bytes()).hexdigest()[:12]}" for s in (c.source, c.settings)
    ]
    assert f"2026-07-01, pidemu {pidemu.__version__} cards: {', '.join(cards)}" in head
    assert words(tree(page("exact")).find("body/header/div/h1")) == "Conversion certificate"


def test_without_a_date_it_is_todays() -> None:
    assert words(tree(certificate_page(made("exact"))).find("body/header")).count(date.today().isoformat()) == 1


def test_what_was_given_and_what_was_chosen_is_on_the_page() -> None:
    found = listed(below(page("asked"), "Given and chosen"))
    assert found["given, before"] == "K=2, T1=1, T2=6 s; not given, so as the card delivers them: FORM=interactive, CTEQN=A"
    assert found["given, after"] == "nothing but the card"
    assert (found["mode"], found["action"]) == ("automatic: the operator sets the setpoint", "direct, as stated")
    assert listed(below(page("exact"), "Given and chosen"))["mode"] == "automatic and cascade, as nothing was stated"
    assert listed(below(page("at scans"), "Given and chosen"))["chosen"] == "chosen automatically: FORM=Series"


def test_the_page_has_the_order_and_the_words_of_the_terminal() -> None:
    c = made("at scans")
    printed = " ".join(told("convert", *shlex.split(c.command)[2:]).split())
    for title, items in sections(c):
        assert section(page("at scans"), title) == [" ".join(item.split()) for item in items]
        assert title in printed
        assert all(" ".join(item.split()) in printed.replace("- ", "") or "-" in item for item in items)
    order = [words(h) for h in tree(page("at scans")).iter("h2")]
    titles = [title for title, _ in sections(c)]
    assert [t for t in order if t in titles] == titles
    assert printed.index("Verdict") < printed.index(titles[0])
    assert [printed.index(f" {t} ") for t in titles] == sorted(printed.index(f" {t} ") for t in titles)


def test_the_proof_is_on_the_page_where_there_is_one() -> None:
    shown, proof = tree(page("exact")).find(".//pre[@id='proof']"), made("exact").proof
    assert shown is not None
    assert proof is not None
    assert (shown.text or "").strip().splitlines() == [line.rstrip() for line in proof.text]
    assert 'id="proof"' not in page("arduino")


def test_what_to_do_comes_before_the_figures() -> None:
    order = [words(h) for h in tree(page("arduino")).iter("h2")]
    assert order.index("After") < order.index("At the loop") < order.index("Cut-over") < order.index("Figures")
    assert page("arduino").index('id="verdict"') < page("arduino").index("At the loop") < page("arduino").index("<figure")


def test_a_conversion_that_was_not_rounded_is_rounded_for_the_page() -> None:
    """The page is about the numbers that it prints."""
    card, values, target, how = MADE["at scans"]
    exact = convert(pidemu.load_card(card).settings(values), target, **how)
    assert exact.request.digits is None
    assert certificate_page(exact, date=DAY) == page("at scans")


@pytest.mark.parametrize("name", MADE)
def test_the_figures_are_those_of_the_certificate(name: str) -> None:
    c = made(name).certificate
    compared = [p for p in (c.feedback_at_scan, c.setpoint_at_scan, c.feedback, c.setpoint) if p is not None]
    bands: list[Band] = [b for p in compared for b in (p.loop_band, p.full_band)]
    rows = table(page(name), "figures")
    assert len(rows) == len(bands)
    for (_, _, ends, deviation, gain, phase), band in zip(rows, bands, strict=True):
        assert [float(x) for x in ends.split(" to ")] == pytest.approx([band.low, band.high], rel=5e-3)  # three digits
        if deviation == "none":
            assert band.max_deviation < 1e-9
        elif deviation == "over 1000 %":
            assert band.max_deviation >= 10
        else:
            assert number_in(deviation) == pytest.approx(100 * band.max_deviation, rel=0.05)  # two digits
        assert number_in(gain) == pytest.approx(band.gain_db, abs=0.005)
        assert number_in(phase) == pytest.approx(band.phase_deg, abs=0.05)


def test_the_loop_before_and_after_is_in_a_table() -> None:
    loop = made("a process").certificate.loop
    assert loop is not None
    rows = {row[0]: row[1:] for row in table(page("a process"), "loop")}
    assert rows["stable"] == ["yes", "yes"]
    for name, attribute in (("gain margin", "gain_margin"), ("phase margin [deg]", "phase_margin"), ("Ms", "Ms")):
        expected = [getattr(loop.source, attribute), getattr(loop.target, attribute)]
        assert [float(x) for x in rows[name]] == pytest.approx(expected, rel=5e-4)  # four digits
    assert 'id="loop"' not in page("approximate")


def test_rounded_dials_are_shown_before_and_after() -> None:
    c = made("rounded").certificate
    assert c.dials
    rows = table(page("rounded"), "rounded")
    assert [row[0] for row in rows] == [d.name for d in c.dials]
    shown = [float(x) for row in rows for x in row[1:]]
    assert shown == pytest.approx([x for d in c.dials for x in (d.exact, d.rounded)], rel=5e-6)  # six digits
    assert 'id="rounded"' not in page("proportional")


@pytest.mark.parametrize("name", MADE)
def test_everything_that_the_result_rests_on_is_on_the_page(name: str) -> None:
    c = made(name)
    for title, items in (
        ("Conditions", [condition_line(x) for x in c.conditions]),
        ("Other settings", [f"{b.text} ({b.how})" if b.how else b.text for b in c.beside]),
        ("At the loop", c.at_the_loop),
        ("Watch for", c.warnings),
        ("Read as", (*c.source.notes, *c.settings.notes)),
    ):
        if items:
            assert section(page(name), title) == [" ".join(item.split()) for item in items]
        else:
            assert f"<h2>{title}</h2>" not in page(name)


@pytest.mark.parametrize("name", MADE)
def test_every_assumed_field_of_both_cards_is_a_condition_or_in_the_small_print(name: str) -> None:
    c = made(name)
    small = "Other unverified assumptions"
    shown = section(page(name), small) if f"<h2>{small}</h2>" in page(name) else []
    for s in (c.source, c.settings):
        named = {(x.card, x.path) for x in c.conditions}
        conditions = {x.key for x in s.variant.statements if (s.card.id, x.path) in named}
        for x in (*unverified_law(s), *unverified_program(s, scan=c.scan is not None)):
            [fact] = facts([x])
            assert x.key in conditions or " ".join(f"{s.card.id}: {fact}".split()) in shown


def test_what_was_not_given_is_not_covered() -> None:
    without, with_all = (" ".join(section(page(n), "What this page does not cover")) for n in ("exact", "a process"))
    assert "the process: none was given" in without
    assert "the real scan intervals: none were given" in without
    assert "none w" not in with_all


def test_a_plan_for_the_cut_over_is_printed_where_there_is_one() -> None:
    plan = made("arduino").transfer_plan(50, 48, 40, "reverse")
    found = below(page("arduino"), "Cut-over")
    assert [words(item) for item in found.findall("ol/li")] == [" ".join(step.do.split()) for step in plan.steps]
    assert [words(item) for item in found.findall("ul/li")] == [" ".join(note.split()) for note in plan.notes]
    assert f"the output then moves by {plan.bump:g} % of span; without this, by {plan.without_plan:g} %" in words(found)
    assert "Cut-over" not in page("exact")


def test_there_is_room_to_sign() -> None:
    found = tree(page("exact")).find(".//table[@class='sign']")
    assert found is not None
    assert [words(cell) for cell in found.iter("th")] == ["", "name", "date", "signature", "settings entered", "checked"]
    assert [words(cell) for cell in found.iter("td")] == [""] * 6


@pytest.mark.parametrize("name", MADE)
def test_the_page_is_small(name: str) -> None:
    assert len(page(name).encode()) < 400_000


def test_markup_in_a_card_is_only_text() -> None:
    card = made_up_card(product='<b>bench</b> & "co"', algorithm="<script>alert(1)</script>")
    c = convert(card.settings(kp=2, ki=0.1), "generic/standard")
    text = certificate_page(c)
    assert "<script" not in text
    assert "<b>bench" not in text
    assert '<b>bench</b> & "co": <script>alert(1)</script>' in words(below(text, "Before, as found (the way back)"))


@pytest.mark.parametrize("name", MADE)
def test_every_picture_says_in_words_what_it_shows(name: str) -> None:
    figures = list(tree(page(name)).iter("figure"))
    assert len(figures) == 2 + (made(name).process is not None)
    for figure in figures:
        assert figure.get("role") == "img"
        assert figure.get("aria-label") == words(figure.find("figcaption"))
        assert len(figure.get("aria-label") or "") > 60


def test_the_text_of_pictures_is_text() -> None:
    shown = [words(t) for t in tree(page("a process")).iter("{http://www.w3.org/2000/svg}text")]
    assert shown.count("before: fisher/provox") == shown.count("after: emerson/deltav") == 3
    assert {"gain [dB]", "phase [deg]", "loop band", "Nyquist: half the scan rate", "frequency [rad/s]", "time [s]"} <= set(shown)
    assert {"after, textbook rule", "setpoint +5 %", "load +5 %"} <= set(shown)


def test_lines_are_told_apart_without_colours() -> None:
    """Next to its name in the legend each line has a dash of its own, or none."""
    [picture] = re.findall(r'<svg.*?<g id="responses-figure_1.*?</svg>', page("approximate"), re.S)
    legend = picture[picture.index('<g id="responses-legend_1">') :]
    styles = [
        re.sub(r"stroke: #\w+|stroke-linecap: \w+|\s", "", s)
        for s in re.findall(r'<path d="[^"]*" style="(fill: none[^"]*)"', legend)
    ]
    assert len(styles) == len(set(styles)) == 3


def test_the_same_conversion_gives_the_same_bytes() -> None:
    card, values, target, how = MADE["a process"]
    again = convert(pidemu.load_card(card).settings(values), target, digits=5, **how)
    assert certificate_page(again, date=DAY) == page("a process")


def test_another_process_writes_the_same_bytes(folder: Path) -> None:
    order = [
        "convert",
        "fisher/provox",
        "GAIN=2",
        "RESET=4",
        "RATE=0.1",
        "--to",
        "emerson/deltav",
        "--scan",
        "1,0.5",
        "--date",
        "2026-07-01",
    ]
    environment = os.environ | {"PYTHONHASHSEED": "7", "TZ": "Asia/Tokyo", "LC_ALL": "C"}
    command = [sys.executable, "-m", "pidemu", *order, "--html", "x.html"]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert result.stdout.endswith("\nwritten: x.html\n")
    assert (folder / "x.html").read_bytes() == page("at scans").encode()


ASKED: dict[str, tuple[str, dict[str, object], str, dict[str, Any]]] = {
    "an option that is not the best": ("fisher/provox", PROVOX, "emerson/deltav", {"options": {"STRUCTURE": 1}}),
    "a dial": ("fisher/provox", PROVOX, "emerson/deltav", {"given": {"ALPHA": 0.2}, "scan": 1}),
    "a dial at its default": ("fisher/provox", PROVOX, "emerson/deltav", {"given": {"ALPHA": 0.125}}),
    "compensation": ("fisher/provox", PROVOX, "emerson/deltav", {"scan": (1, 0.5), "compensate": True}),
    "another interval than declared": ("generic/standard", STANDARD, "emerson/deltav", {"scan": 0.2, "runs_every": 0.02}),
    "mode, action and tag": ("fisher/provox", PROVOX, "emerson/deltav", {"mode": "auto", "action": "direct", "tag": "TIC 7"}),
    "textbook": ("fisher/provox", PROVOX, "emerson/deltav", {"match": "textbook", "options": {"FORM": "Standard"}}),
    "a frequency": ("generic/standard", STANDARD, "fisher/provox", {"match": "frequency:0.07rad/s", "scan": 0.5}),
    "an uneven frequency": ("generic/standard", STANDARD, "fisher/provox", {"match": "frequency:13mHz"}),
    "crossover": ("generic/standard", STANDARD, "fisher/provox", {"match": "frequency", "process": PROCESS}),
    "the nearest": ("generic/standard", STANDARD, "honeywell/tdc3000", {"match": "constrained"}),
    "low-frequency": ("generic/standard", STANDARD, "gnc-tools/cpid", {"match": "low-frequency"}),
    "options of the source": (
        "honeywell/tdc3000", {"K": 2, "T1": 1, "T2": 0.1, "CTEQN": "B", "FORM": "ideal"}, "generic/standard", {},
    ),
    "ranges": (
        "generic/standard", {**STANDARD, "pv_range": (-50, 150, "K"), "op_range": "0,10 V = 0..10 kg/h"}, "arduino/pid",
        {"to_pv_range": (0, 100, "K"), "to_op_range": (-5, 5, "V"), "allow_approximate": True},
    ),
    "a process with all there is": (
        "generic/standard", {"K": 0.5, "Ti": 40}, "emerson/deltav",
        {"process": Process(-0.5, [0, -1 / 3, -0.1 + 0.2j, -0.1 - 0.2j], [0.3], 0.7), "scan": 1},
    ),
}  # fmt: skip


def _from_the_command(command: str) -> dict[str, Any]:
    program, *rest = shlex.split(command)
    assert program == "pidemu"
    found: dict[str, Any] = strict_json(told(*rest, "--json"))
    return found


@pytest.mark.parametrize("name", MADE)
def test_the_command_on_the_page_gives_the_same_settings(name: str) -> None:
    c = made(name)
    found = _from_the_command("".join(tree(page(name)).find(".//pre[@id='command']").itertext()))  # type: ignore[union-attr]
    plain = c.to_dict()
    assert (found["from"], found["to"]) == (plain["from"], plain["to"])
    assert (found["verdict"], found["scan"], found["process"]) == (plain["verdict"], plain["scan"], plain["process"])


@pytest.mark.parametrize("name", ASKED)
def test_the_command_gives_what_was_asked_for_beside_the_settings(name: str) -> None:
    card, values, target, how = ASKED[name]
    c = convert(pidemu.load_card(card).settings(values), target, emulate=False, digits=5, **how)
    command = c.command
    found = _from_the_command(command)
    assert found["from"] == c.source.to_dict() | {"settings": found["from"]["settings"]}
    assert found["to"]["options"] == c.settings.options
    shown = {n: float(v["value"]) for n, v in found["to"]["settings"].items()}
    # numbers are printed so that they read back the same
    assert shown == {n: pytest.approx(v.value, rel=1e-12) for n, v in c.settings.items() if v.active}
    assert found["process"] == (None if c.process is None else str(c.process))


def test_a_card_in_a_file_is_named_by_its_file(folder: Path) -> None:
    (folder / "acme").mkdir()
    text = copied(Path(pidemu.load_card("generic/series").document.path))
    (folder / "acme" / "own block.yaml").write_text(text.replace("vendor: Generic", "vendor: Acme"), encoding="utf-8")
    c = convert(pidemu.load_card("acme/own block.yaml").settings(SERIES), "generic/standard", digits=5)
    command = c.command
    assert command.startswith("pidemu convert 'acme/own block.yaml' K=2 ")
    assert _from_the_command(command)["to"] == c.to_dict()["to"]


_TIMES = st.floats(0.01, 1e4)


@given(
    gain=st.floats(-10, 10).filter(lambda x: abs(x) > 1e-20),
    lags=st.lists(_TIMES, max_size=3),
    leads=st.lists(_TIMES | _TIMES.map(lambda x: -x), max_size=1),
    integrators=st.integers(1, 2),
    delay=st.just(0.0) | _TIMES,
    pair=st.none() | st.tuples(_TIMES.map(lambda x: -x), _TIMES),
)
def test_a_process_is_written_so_that_it_reads_back_the_same(
    gain: float, lags: list[float], leads: list[float], integrators: int, delay: float, pair: tuple[float, float] | None
) -> None:
    p = Process.from_lags(gain, lags, leads, integrators, delay)
    if pair is not None:
        p = Process(p.gain, [*p.poles, complex(*pair), complex(*pair).conjugate()], p.zeros, p.delay)
    again = parse_process(written(p))
    assert (again.gain, again.delay) == (p.gain, p.delay)
    assert sorted(again.poles, key=str) == sorted(p.poles, key=str)
    assert sorted(again.zeros, key=str) == sorted(p.zeros, key=str)


def test_without_scans_the_bode_curves_are_the_continuous_laws() -> None:
    c = made("exact")
    b = bode(c)
    assert b.nyquist == ()
    assert b.loop_band == (c.certificate.feedback.loop_band.low, c.certificate.feedback.loop_band.high)
    assert b.w[0] <= b.loop_band[0] < b.loop_band[1] < b.w[-1]
    np.testing.assert_allclose(b.source, continuous(c.source, b.w), rtol=1e-9)
    np.testing.assert_allclose(b.target, continuous(c.settings, b.w), rtol=1e-9)
    np.testing.assert_allclose(b.ratio, 2.6667 / (2 + 2 / 3), rtol=1e-9)  # rounded to five digits


def test_at_the_scans_the_bode_curves_are_the_held_discrete_laws_up_to_half_the_scan_rate() -> None:
    c = made("at scans")
    b = bode(c)
    assert b.nyquist == (math.pi, 2 * math.pi)
    for settings, h, shown in ((c.source, 1.0, b.source), (c.settings, 0.5, b.target)):
        known = b.w <= math.pi / h
        law, q = settings.law(h).feedback, np.exp(-1j * b.w[known] * h)
        hold = (1 - q) / (1j * b.w[known] * h)
        expected = hold * np.polyval(law.num[::-1], q) / np.polyval(law.den[::-1], q)
        np.testing.assert_allclose(shown[known], expected, rtol=1e-6)  # expanded polynomials cancel at low frequencies
        assert np.isnan(shown[~known]).all()
    in_band = (b.w >= b.loop_band[0]) & (b.w <= b.loop_band[1])
    assert c.certificate.feedback_at_scan is not None
    largest = c.certificate.feedback_at_scan.loop_band.max_deviation
    assert np.max(np.abs(b.ratio[in_band] - 1)) == pytest.approx(largest, rel=1e-3)  # of a coarser grid


@pytest.mark.parametrize("name", ["approximate", "exact", "refused"])
def test_the_responses_are_runs_of_the_controllers(name: str) -> None:
    c = made(name)
    r, both = responses(c), c.certificate.scan_by_scan
    assert r is not None
    assert both is not None
    for moves, traces in (("setpoint", r.setpoint), ("measurement", r.measurement)):
        for trace in traces:
            settings = {"source": c.source, "target": c.settings, "textbook": c.textbook.settings}[trace.who]
            assert settings is not None
            h = both.scan[0 if trace.who == "source" else 1]
            np.testing.assert_allclose(trace.times, np.arange(trace.times.size) * h, rtol=1e-12)
            moved = np.where(trace.times >= r.at - 1e-9, 50 + r.size, 50.0)
            rest = np.full_like(moved, 50.0)
            signals = (moved, rest) if moves == "setpoint" else (rest, moved)
            np.testing.assert_allclose(trace.values, outputs(settings, *signals, h), rtol=1e-9)


def test_the_textbook_settings_are_a_third_line_only_where_they_are_others() -> None:
    lines = {name: [t.who for t in r.setpoint] for name in MADE if (r := responses(made(name))) is not None}
    assert lines["approximate"] == ["source", "target", "textbook"]
    assert lines["proportional"] == lines["refused"] == ["source", "target"]


def test_with_other_ranges_the_source_is_shown_in_the_targets_percent() -> None:
    """An exact conversion to a range twice as wide: in the target's percent both curves are one."""
    source = pidemu.load_card("generic/series").settings({**SERIES, "pv_range": (0, 100, "bar")})
    c = convert(source, "generic/standard", to_pv_range=(0, 200, "bar"), process=PROCESS)
    assert c.factor == 2
    r, loops = responses(c), closed_loops(c)
    assert r is not None
    assert loops is not None
    for pair in (r.setpoint[:2], r.measurement[:2], loops.measurement, loops.output):
        np.testing.assert_allclose(pair[0].values, pair[1].values, rtol=1e-9)
    np.testing.assert_allclose(bode(c).ratio, 1, rtol=1e-9)


def test_the_closed_loops_are_those_of_a_controller_and_an_exact_process() -> None:
    """A first-order process without dead time, written out: ``y+ = a y + (1 - a) k (u + d)``."""
    c = convert(
        pidemu.load_card("generic/series").settings(SERIES),
        "generic/standard",
        process=Process.from_lags(0.8, lags=[20]),
        scan=(1.0, 0.5),
    )
    loops = closed_loops(c)
    assert loops is not None
    assert loops.scan == (1.0, 0.5)
    for settings, h, pv, out in zip((c.source, c.settings), loops.scan, loops.measurement, loops.output, strict=True):
        controller = pidemu.Controller(settings, h, output_limits=(-1e12, 1e12), initial_output=50.0)
        keep, y = math.exp(-h / 20), 0.0
        for k, t in enumerate(pv.times):
            assert pv.values[k] == pytest.approx(50 + y, abs=1e-7)
            u = controller.scan(50 + 5 * (t >= loops.setpoint_at - 1e-9), 50 + y)
            assert out.values[k] == pytest.approx(u, abs=1e-6)
            y = keep * y + (1 - keep) * 0.8 * (u - 50 + 5 * (t >= loops.load_at - 1e-9))
        before_load = pv.values[int(loops.load_at / h) - 1]
        assert [before_load, pv.values[-1]] == pytest.approx([55, 55], abs=0.2)  # both responses have settled


def test_a_gain_of_the_wrong_sign_for_the_process_gets_no_page() -> None:
    source = pidemu.load_card("iec/61131-3-pid").settings(KP=-2, TR=20, TD=0)  # reverse acting: its error is PV - SP
    with pytest.raises(PidemuError, match="is positive feedback: the loop runs away"):
        convert(source, "generic/standard", process=Process.from_lags(-1.0, [20]), allow_approximate=True)


def test_without_an_emulation_there_is_no_picture_of_one() -> None:
    text = certificate_page(convert(pidemu.load_card("generic/series").settings(SERIES), "generic/standard", emulate=False))
    assert "Outputs, the loop open" not in text
    assert "running both against each other: it was not asked for" in section(text, "What this page does not cover")


@pytest.mark.parametrize("name", ["x.htm", "x", "x.html.txt", "html", "x.pdf"])
def test_another_ending_is_refused(name: str, folder: Path) -> None:
    message = f"^{re.escape(name)}: the certificate is written as .html; give the file this ending$"
    with pytest.raises(PidemuError, match=message):
        write_page(name, made("exact"))
    assert list(folder.iterdir()) == []


def test_a_page_is_written_as_utf_8(folder: Path) -> None:
    write_page(folder / "x.HTML", made("exact"), date=DAY)
    assert (folder / "x.HTML").read_bytes() == page("exact").encode("utf-8")


def test_a_folder_that_is_not_there_is_named() -> None:
    status, out, err = said("convert", "generic/series", "K=2", "Ti=15", "--to", "generic/standard", "--html", "nowhere/x.html")
    assert (status, out) == (2, "")
    assert err == "error: nowhere/x.html: cannot be written: No such file or directory\n"


@pytest.mark.parametrize(("module", "name"), [("jinja2", "Jinja"), ("matplotlib.figure", "matplotlib")])
def test_without_the_extra_it_is_said_how_to_install_it(
    module: str, name: str, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    message = rf"^the page needs {name}, which is not installed; pip install 'pidemu\[report\]'$"
    with pytest.raises(PidemuError, match=message):
        write_page("x.html", made("exact"))
    assert list(folder.iterdir()) == []


def test_neither_jinja_nor_matplotlib_is_imported_before_a_page_is_made() -> None:
    code = "import sys, pidemu.report.certificate\nassert not {'jinja2', 'matplotlib'} & set(sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
