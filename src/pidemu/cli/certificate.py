"""How ``pidemu convert`` prints a conversion: settings, verdict and conditions first, what to do at the loop, figures below."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from pidemu.card.load import Card
from pidemu.certificate.figures import (
    BAND_COLUMNS,
    band_rows,
    decibels,
    degrees,
    emulation_line,
    kick_line,
    loop_rows,
    other_units,
    percent,
    rounding_line,
    textbook_line,
    unit_of,
)
from pidemu.certificate.models import EXACT, Certificate, LoopComparison
from pidemu.cli.common import heading, number, print_json, table, wrapped
from pidemu.conversion.explain import explained
from pidemu.conversion.result import Conversion
from pidemu.errors import ConversionRefusedError
from pidemu.settings import Settings

if TYPE_CHECKING:
    from pidemu.cutover.plan import TransferPlan


def print_refusal(error: ConversionRefusedError, source: Settings, goal: Card, as_json: bool) -> None:
    """Print why a target refuses, the nearest settings with their cost, and what could do instead."""
    nearest = error.nearest
    if as_json:
        print_json(
            {
                "from": source.to_dict(),
                "to": {"card": goal.id},
                "verdict": "refused",
                "reason": str(error),
                "nearest": None if nearest is None else nearest.to_dict(),
                "alternatives": list(error.alternatives),
            }
        )
    click.echo(f"error: refused: {error}", err=True)
    if as_json:
        return
    for text in error.alternatives:
        click.echo(f"instead: {text}", err=True)
    if nearest is None:
        return
    band = nearest.certificate.feedback.loop_band
    click.echo("nearest settings, which 'pidemu convert --allow-approximate' gives:", err=True)
    for name, value in nearest.settings.items():
        if value.active:
            click.echo(f"  {name} = {number(value.value)} {unit_of(value)}".rstrip(), err=True)
    cost = f"up to {percent(band.max_deviation)}, {decibels(band)}, {degrees(band)}" if band.max_deviation >= EXACT else "none"
    click.echo(f"their cost in the loop band: {cost}", err=True)


def print_conversion(c: Conversion) -> None:
    """Print a conversion with its certificate."""
    heading(f"{c.request.tag + ': ' if c.request.tag else ''}{c.source.card.id}  ->  {c.settings.card.id}")
    _side("From", c.source)
    _target(c)
    heading("\nVerdict")
    wrapped(f"{c.verdict}: {c.sentence}", "  ")
    _list("Other settings", tuple(f"{b.text}" + (f"  ({b.how})" if b.how else "") for b in c.beside))
    _list("Conditions", tuple(condition_line(x) for x in c.conditions))
    _list("At the loop", c.at_the_loop)
    _list("Watch for", c.warnings)
    _list("Read as", (*c.source.notes, *c.settings.notes))
    heading("\nFigures")
    _figures(c.certificate)
    _textbook(c)
    if c.certificate.loop is not None:
        _loop(c.certificate.loop)
    proof = c.certificate.proof
    if proof is not None and proof.decided and proof.feedback_equal:
        heading("\nProof")
        for line in proof.text:
            wrapped(line.strip(), " " * (2 + len(line) - len(line.lstrip())))


def condition_line(condition: object) -> str:
    """Return a condition with its reason and its spread, in one line."""
    from pidemu.conversion.conditions import Condition

    assert isinstance(condition, Condition)
    why = f": {condition.why}" if condition.why else ""
    spread = f"; {condition.spread}" if condition.spread else ""
    return f"{condition.text} ({condition.status}{why}){spread}"


def print_plan(plan: TransferPlan) -> None:
    """Print how to change over."""
    heading("\nCut-over")
    wrapped(f"for {plan.action_text}", "  ")
    for i, step in enumerate(plan.steps, 1):
        wrapped(step.do, f"  {i}. ")
    click.echo(f"  the output then moves by {_bump(plan.bump)} % of span; without this, by {_bump(plan.without_plan)} %")
    for note in plan.notes:
        wrapped(note, "  - ")


def _bump(x: float) -> str:
    return number(round(x, 9) + 0.0)


def print_explanation(c: Conversion) -> None:
    """Print every choice of the target's options, the best first, with what it would cost."""
    heading("\nWhy these options")
    rows = [[e.options, e.verdict, e.loop_band, e.setpoint, e.dials, e.why] for e in explained(c)]
    table(["options", "verdict", "loop band", "setpoint", "dials", "why not"], rows, right=(2, 3))


def _loop(loop: LoopComparison) -> None:
    heading(f"\nThe loop with the process {loop.process}")
    table(["", "before", "after"], loop_rows(loop), right=(1, 2))


def _side(title: str, s: Settings) -> None:
    heading(f"\n{title}: {s.card.title}" + (f"  [{s.variant.choice_text}]" if s.options else ""))
    rows = [
        [name, number(v.value), unit_of(v), other_units(v), "" if v.given else "card's default"]
        for name, v in s.items()
        if v.active
    ]
    table(["", "", "", "", ""], rows, right=(1,))
    if s.pace != 1:
        click.echo(f"  executed at {number(s.pace)} times the interval it computes with: its times are that much longer")


def _target(c: Conversion) -> None:
    s, book = c.settings, c.textbook.settings
    heading(f"\nTo: {s.card.title}" + (f"  [{s.variant.choice_text}]" if s.options else ""))
    if c.chosen:
        wrapped(
            f"chosen automatically: {', '.join(f'{n}={x}' for n, x in c.chosen.items())} (--set to change, --explain for why)", "  "
        )
    rows = []
    for name, v in s.items():
        if v.active:
            rule = number(book[name].value) if book is not None and name in book else "-"
            rows.append([name, number(v.value), unit_of(v), other_units(v), rule])
    table(["", f"{c.match} match", "", "", "textbook rule"], rows, right=(1, 4))
    if s.lag:
        click.echo(f"  in front of it, on PV: a first-order lag of {number(s.lag)} s")
    line = rounding_line(c.certificate, c.request.digits)
    if line:
        wrapped(line, "  ")


def _figures(c: Certificate) -> None:
    table(BAND_COLUMNS, band_rows(c), right=(3, 4, 5))
    if c.scan_by_scan is not None:
        wrapped(emulation_line(c), "  ")
    click.echo(f"  {kick_line(c)}")


def _textbook(c: Conversion) -> None:
    line = textbook_line(c)
    if line:
        wrapped(line, "  ")


def _list(title: str, items: tuple[str, ...]) -> None:
    if items:
        heading(f"\n{title}")
        for item in items:
            wrapped(item, "  - ")
