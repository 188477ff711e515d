"""How ``pidemu convert`` prints a conversion: settings, verdict and conditions first, what to do at the loop, figures below."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pidemu.analysis.loop_figures import LoopComparison
from pidemu.card.load import Card
from pidemu.certificate.figures import (
    BAND_COLUMNS,
    band_rows,
    decibels,
    degrees,
    loop_rows,
    percent,
    rounding_line,
    unit_of,
)
from pidemu.certificate.models import EXACT
from pidemu.cli.common import echo, heading, number, print_json, table, wrapped
from pidemu.conversion.document import refusal_document
from pidemu.conversion.explain import explained
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.result import Conversion
from pidemu.conversion.statement import (
    bump_line,
    chosen_line,
    figure_lines,
    lag_line,
    neutral_line,
    pace_line,
    proof_lines,
    ranges_line,
    sections,
    side_title,
    source_rows,
    target_rows,
)
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from pidemu.cutover.plan import TransferPlan


def print_refusal(error: ConversionRefusedError, source: Settings, goal: Card, as_json: bool) -> None:
    """Print why a target refuses, the nearest settings with their cost, and what could do instead."""
    nearest = error.nearest
    if as_json:
        print_json(refusal_document(error, {"from": source.to_dict(), "to": {"card": goal.id}}))
    echo(f"error: refused: {error}", err=True)
    if as_json:
        return
    for text in error.alternatives:
        echo(f"instead: {text}", err=True)
    if nearest is None:
        return
    band = nearest.certificate.feedback.loop_band
    echo("nearest settings, which 'pidemu convert --allow-approximate' gives:", err=True)
    for name, value in nearest.settings.items():
        if value.active:
            echo(f"  {name} = {number(value.value)} {unit_of(value)}".rstrip(), err=True)
    cost = f"up to {percent(band.max_deviation)}, {decibels(band)}, {degrees(band)}" if band.max_deviation >= EXACT else "none"
    echo(f"their cost in the loop band: {cost}", err=True)


def print_conversion(c: Conversion) -> None:
    """Print a conversion with its certificate."""
    heading(f"{c.request.tag + ': ' if c.request.tag else ''}{c.source.card.id}  ->  {c.settings.card.id}")
    _side("From", c.source)
    _target(c)
    heading("\nVerdict")
    wrapped(f"{c.verdict}: {c.sentence}", "  ")
    for title, items in sections(c):
        _list(title, items)
    _figures(c)
    if c.certificate.loop is not None:
        _loop(c.certificate.loop)
    proof = proof_lines(c)
    if proof:
        heading("\nProof")
    for line in proof:
        wrapped(line.strip(), " " * (2 + len(line) - len(line.lstrip())))


def print_plan(plan: TransferPlan) -> None:
    """Print how to change over."""
    heading("\nCut-over")
    wrapped(f"for {plan.action_text}", "  ")
    for i, step in enumerate(plan.steps, 1):
        wrapped(step.do, f"  {i}. ")
    echo(f"  {bump_line(plan)}")
    for note in plan.notes:
        wrapped(note, "  - ")


def print_explanation(c: Conversion) -> None:
    """Print every choice of the target's options, the best first, with what it would cost."""
    heading("\nWhy these options")
    rows = [[e.options, e.verdict, e.loop_band, e.setpoint, e.dials, e.why] for e in explained(c)]
    table(["options", "verdict", "loop band", "setpoint", "dials", "why not"], rows, right=(2, 3))


def _loop(loop: LoopComparison) -> None:
    heading(f"\nThe loop with the process {loop.process}")
    table(["", "before", "after"], loop_rows(loop), right=(1, 2))


def _side(title: str, s: Settings) -> None:
    heading(f"\n{title}: {side_title(s)}")
    table(["", "", "", "", ""], [row.cells for row in source_rows(s)], right=(1,))
    for line in filter(None, (ranges_line(s), pace_line(s))):
        wrapped(line, "  ")


def _target(c: Conversion) -> None:
    heading(f"\nTo: {side_title(c.settings)}")
    if c.chosen:
        wrapped(f"{chosen_line(c)} (--set to change, --explain for why)", "  ")
    table(["", f"{c.match} match", "", "", "textbook rule"], [row.cells for row in target_rows(c)], right=(1, 4))
    s = c.settings
    for line in filter(None, (neutral_line(s), lag_line(s), ranges_line(s), rounding_line(c.certificate, c.request.digits))):
        wrapped(line, "  ")


def _figures(c: Conversion) -> None:
    heading("\nFigures")
    table(BAND_COLUMNS, band_rows(c.certificate), right=(3, 4, 5))
    for line in figure_lines(c):
        wrapped(line, "  ")


def _list(title: str, items: tuple[str, ...]) -> None:
    if items:
        heading(f"\n{title}")
        for item in items:
            wrapped(item, "  - ")
