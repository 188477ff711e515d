"""``pidemu verify``: what it prints, its exit status, and the files it refuses."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

import pidemu
from tests.cli.helpers import said, strict_json, told, with_another_filter
from tests.helpers import copied

PROVOX = ("fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav", "--tag", "TIC-101", "--date", "2026-07-01")
NOT_COMPARED = "not compared:\n  - its date, and where in a band a largest value lies (worst_at, largest_at)\n"
HEAD = f"TIC-101: fisher/provox -> emerson/deltav, certificate of 2026-07-01 by pidemu {pidemu.__version__}\n"


@pytest.fixture
def certificate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "TIC-101.json"
    file.write_text(told("convert", *PROVOX, "--json"), encoding="utf-8")
    return file


def test_an_unchanged_certificate_exits_with_0(certificate: Path) -> None:
    assert said("verify", "TIC-101.json") == (
        0,
        HEAD
        + "unchanged: dials, options, verdict, conditions, action, bench check and figures are those of the certificate\n"
        + NOT_COMPARED,
        "",
    )


def test_a_changed_one_exits_with_1_and_says_what_and_by_which_version(certificate: Path, tmp_path: Path) -> None:
    own = tmp_path / "cards" / "fisher"
    own.mkdir(parents=True)
    text = Path(pidemu.load_card("fisher/provox").document.path).read_text(encoding="utf-8")
    (own / "provox.yaml").write_text(with_another_filter(text), encoding="utf-8")
    status, out, err = said("verify", "TIC-101.json", "--vendors", "cards")
    assert (status, err) == (1, "")
    assert out.startswith(f"{HEAD}changed:\n  - dial RATE: 5.25 s on the certificate, 5.4 s now\n")
    assert "  - condition: PROVOX's derivative filter is RATE/8 (assumed) on the certificate, " in out
    before, now = (pidemu.load_card(x).digest[:12] for x in ("fisher/provox", own / "provox.yaml"))
    because, _, rest = out.partition("not compared:\n")
    assert because.endswith(f"because:\n  - fisher/provox is another version: {before} on the certificate, {now} now\n")
    assert "wording, assumptions" in rest


def test_many_changed_figures_are_counted_not_listed(certificate: Path) -> None:
    text = certificate.read_text(encoding="utf-8")
    certificate.write_text(re.sub(r'("gain_db"|"phase_deg"|"high"): [^,]+', r"\1: 9", text), encoding="utf-8")
    status, out, _ = said("verify", "TIC-101.json")
    changes = strict_json(said("verify", "TIC-101.json", "--json").out)["changes"]
    assert status == 1
    assert len(changes) > 8
    assert {c["kind"] for c in changes} == {"figure", "textbook rule"}
    changes = [c for c in changes if c["kind"] == "figure"]
    assert out.count("  - figure ") == 8
    assert f"    and {len(changes) - 8} more of kind 'figure' (--json lists all)\n" in out


def test_a_card_that_changed_without_effect_is_mentioned(certificate: Path, tmp_path: Path) -> None:
    (tmp_path / "cards" / "emerson").mkdir(parents=True)
    file = tmp_path / "cards" / "emerson" / "deltav.yaml"
    shutil.copy(pidemu.load_card("emerson/deltav").document.path, file)
    with file.open("a", encoding="utf-8") as stream:
        stream.write("# a comment\n")
    status, out, _ = said("verify", "TIC-101.json", "--vendors", "cards")
    assert status == 0
    assert "\n  - though emerson/deltav is another version: " in out


def test_json_says_the_same(certificate: Path) -> None:
    status, out, _ = said("verify", "TIC-101.json", "--json")
    found = strict_json(out)
    assert status == 0
    digests = {card: pidemu.load_card(card).digest for card in ("fisher/provox", "emerson/deltav")}
    assert found == {
        "unchanged": True,
        "changes": [],
        "because": [],
        "not_compared": ["its date, and where in a band a largest value lies (worst_at, largest_at)"],
        "date": "2026-07-01",
        "pidemu": {"certificate": pidemu.__version__, "now": pidemu.__version__},
        "cards": {card: {"certificate": digest, "now": digest} for card, digest in digests.items()},
    }


def test_a_card_of_ones_own_comes_from_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cards" / "acme").mkdir(parents=True)
    text = copied(Path(pidemu.load_card("generic/series").document.path))
    (tmp_path / "cards" / "acme" / "block.yaml").write_text(text.replace("vendor: Generic", "vendor: Acme"), encoding="utf-8")
    signed = told("convert", "acme/block", "K=2", "Ti=15", "--to", "generic/standard", "--vendors", "cards", "--json")
    (tmp_path / "c.json").write_text(signed, encoding="utf-8")
    assert said("verify", "c.json", "--vendors", "cards").status == 0
    assert said("verify", "c.json") == (
        2,
        "",
        "error: c.json: request.from.card: there is no card 'acme/block'; name the folder that it lies in with --vendors DIR\n",
    )


def test_a_truncated_file_is_one_error_with_place_and_remedy(certificate: Path) -> None:
    certificate.write_text(certificate.read_text(encoding="utf-8")[:2000], encoding="utf-8")
    status, out, err = said("verify", "TIC-101.json")
    assert (status, out) == (2, "")
    assert err.startswith("error: TIC-101.json:")
    assert err.endswith(": the file ends in the middle; write the certificate again with 'pidemu convert ... --json'\n")
    assert err.count("\n") == 1


def test_a_name_that_is_not_there_is_an_error() -> None:
    assert said("verify", "none.json") == (2, "", "error: none.json: cannot be read: No such file or directory\n")


def test_the_commands_list_names_it() -> None:
    lines = [line.split(maxsplit=1) for line in told("--help").splitlines()]
    assert ["verify", "Compute a signed certificate again, and say what changed."] in lines
