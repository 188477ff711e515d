"""The heat map: a page that needs nothing but itself and the files of the cards."""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest

from pidemu.errors import PidemuError
from pidemu.matrix.cell import OUTCOMES, Cell
from pidemu.matrix.matrix import Matrix, matrix
from pidemu.report.matrix_page import page, shade, write_page
from tests.checks.bench import VALID, edited, written

FOUR = ("fisher/provox", "emerson/deltav", "generic/standard", "bailey/fc19")


class Reader(HTMLParser):
    """Collects what the tests look at: ids, links, cells of the map, and rows of the lists below."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.marks: dict[str, tuple[str, str]] = {}
        self.rows: dict[str, list[str]] = {}
        self.tags: set[str] = set()
        self._row = self._title = ""
        self._shade = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {k: v or "" for k, v in attrs}
        self.tags.add(tag)
        self.ids += [found["id"]] if "id" in found else []
        self.links += [found["href"]] if tag == "a" else []
        if tag == "tr":
            self._row = found.get("id", "")
            self.rows.setdefault(self._row, [])
        if tag == "td":
            self._shade = found.get("class", "").split(" ")[0]
            self.rows[self._row].append("")
        self._title = found.get("title", "") if tag == "a" else "" if tag == "small" else self._title

    def handle_endtag(self, tag: str) -> None:
        self._title = "" if tag == "a" else self._title

    def handle_data(self, data: str) -> None:
        if self._title:
            self.marks[self._title] = (self._shade, data)
        if self._row and self.rows[self._row]:
            self.rows[self._row][-1] += data


def read(text: str) -> Reader:
    reader = Reader()
    reader.feed(text)
    return reader


@pytest.fixture(scope="module")
def four() -> Matrix:
    return matrix(FOUR, emulate=False)


def test_every_cell_leads_to_its_row_and_every_head_to_its_section(four: Matrix, tmp_path: Path) -> None:
    found = read(page(four, tmp_path))
    inside = [link.removeprefix("#") for link in found.links if link.startswith("#")]
    assert len(found.ids) == len(set(found.ids))
    assert set(found.ids) == set(inside)
    assert len(inside) == 2 * 4 + 16
    for i, source in enumerate(FOUR):
        for j, target in enumerate(FOUR):
            cells = found.rows[f"{i}-{j}"]
            assert (cells[0], cells[1]) == (f"{target}from {source}", four.row(source)[j].verdict)


def test_links_to_cards_start_where_the_page_stands(four: Matrix, tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    write_page(folder / "m.html", four)
    outside = [link for link in read((folder / "m.html").read_text(encoding="utf-8")).links if not link.startswith("#")]
    assert [(folder / unquote(link)).resolve().stem for link in outside] == [c.split("/")[1] for c in FOUR]
    assert all((folder / unquote(link)).is_file() for link in outside)


def test_the_page_needs_no_script_and_nothing_from_elsewhere(four: Matrix, tmp_path: Path) -> None:
    text = page(four, tmp_path)
    assert read(text).tags.isdisjoint({"script", "link", "img", "iframe"})
    assert "url(" not in text
    assert "@import" not in text


def test_the_same_matrix_gives_the_same_bytes(four: Matrix, tmp_path: Path) -> None:
    again = matrix(FOUR, emulate=False, jobs=2)
    assert page(again, tmp_path) == page(four, tmp_path)


def test_words_of_a_card_cannot_break_the_page(tmp_path: Path) -> None:
    file = written(tmp_path, edited(VALID, ("product: test bench", 'product: "<script>& bench"')))
    text = page(matrix([file], emulate=False), tmp_path)
    assert "Nobody &lt;script&gt;&amp; bench" in text


def test_without_jinja2_it_says_what_to_install(four: Matrix, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with pytest.raises(PidemuError, match=r"pip install 'pidemu\[report\]'"):
        page(four, tmp_path)


@pytest.mark.parametrize(
    ("deviation", "name"),
    [(0.0, "s"), (1e-8, "a0"), (0.001, "a0"), (0.0011, "a1"), (0.02, "a3"), (0.3, "a5"), (0.31, "a6"), (1e9, "a6")],
)
def test_the_shade_of_an_approximate_conversion_goes_by_the_deviation(deviation: float, name: str) -> None:
    assert shade(Cell("a/a", "b/b", "approximate", deviation)) == name


def test_every_outcome_has_a_shade_that_the_page_defines(four: Matrix, tmp_path: Path) -> None:
    text = page(four, tmp_path)
    assert all(f".{shade(Cell('a/a', 'b/b', outcome, 0.5))} {{" in text for outcome in OUTCOMES)


def test_every_mark_of_the_map_is_what_the_conversion_came_to(four: Matrix, tmp_path: Path) -> None:
    marks = read(page(four, tmp_path)).marks
    assert len(marks) == len(four.cells)
    for c in four.cells:
        name, mark = marks[f"{c.source} to {c.target}: {c.verdict}"]
        if c.verdict == "approximate":
            assert name == shade(c)
            assert float(mark) == pytest.approx(100 * (c.deviation or 0), rel=0.06, abs=0.005)  # two digits, two decimals
        else:
            assert (name, mark) == {"exact": ("e", "="), "exact-feedback": ("f", "="), "refused": ("r", "x")}[c.verdict]
