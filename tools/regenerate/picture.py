"""The picture of a certificate in the README, taken with a Chromium."""

from __future__ import annotations

import contextlib
import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path

import click
from click.testing import CliRunner

from pidemu.cli import cli
from tools.regenerate.pages import ROOT

PICTURE = ROOT / "docs" / "certificate.png"
PICTURED = "convert fisher/provox GAIN=2 RESET=4 RATE=0.1 --to emerson/deltav"
"""The conversion of the README, whose certificate is pictured."""


def take_picture(width: int = 1000, highest: int = 3000) -> None:
    """Take a picture of the first screen of the certificate, above its figures [pixels]."""
    from PIL import Image, ImageChops

    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        raise click.ClickException("no Chromium found; install it, or leave --picture out")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        CliRunner().invoke(cli, [*shlex.split(PICTURED), "--html", "page.html"], catch_exceptions=False)
        html = Path("page.html").read_text(encoding="utf-8")
        Path("page.html").write_text(html[: html.index("<h2>Figures</h2>")], encoding="utf-8")
        options = ["--headless", "--no-sandbox", "--hide-scrollbars", f"--window-size={width},{highest}", "--screenshot=page.png"]
        subprocess.run([browser, *options, Path("page.html").resolve().as_uri()], check=True, capture_output=True)
        with Image.open("page.png") as opened:
            taken = opened.convert("RGB")
    box = ImageChops.difference(taken, Image.new("RGB", taken.size, "white")).getbbox()
    assert box is not None, "the page is empty"
    taken.crop((0, 0, width, min(box[3] + 16, highest))).quantize(64).save(PICTURE, optimize=True)
