"""How ``pidemu convert`` prints a conversion: settings, verdict, figures, what to watch for."""

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
from pidemu.certificate.models import Certificate, LoopComparison
from pidemu.cli.common import heading, number, print_json, table, wrapped
from pidemu.conversion.choices import Attempt
from pidemu.conversion.result import Conversion
from pidemu.errors import ConversionRefusedError
from pidemu.settings import Settings

if TYPE_CHECKING:
    from pidemu.cutover.plan import TransferPlan


def print_refusal(error: ConversionRefusedError, source: Settings, goal: Card, as_json: bool) -> None:
    """Print why a target refuses, and the nearest settings with their cost."""
    nearest = error.nearest
    if as_json:
        plain = nearest.to_dict() if nearest else {"from": {"card": source.card.id}, "to": {"card": goal.id}}
        print_json({**plain, "verdict": "refused", "reason": str(error)})
    click.echo(f"error: refused: {error}", err=True)
    if nearest is None or as_json:
        return
    band = nearest.certificate.feedback.loop_band
    click.echo("nearest settings, which 'pidemu convert --allow-approximate' gives:", err=True)
    for name, value in nearest.settings.items():
        if value.active:
            click.echo(f"  {name} = {number(value.value)} {unit_of(value)}".rstrip(), err=True)
    click.echo(f"their cost: up to {percent(band.max_deviation)}, {decibels(band)}, {degrees(band)} in the loop band", err=True)


def print_conversion(c: Conversion, round_dials: bool) -> None:
    """Print a conversion with its certificate."""
    heading(f"{c.source.card.id}  ->  {c.settings.card.id}")
    _side("From", c.source)
    _target(c)
    heading("\nVerdict")
    wrapped(f"{c.verdict}: {c.sentence}", "  ")
    _figures(c.certificate)
    _rounding(c, round_dials)
    _textbook(c)
    if c.certificate.loop is not None:
        _loop(c.certificate.loop)
    _list("Watch for", c.warnings)
    _list("Read as", (*c.source.notes, *c.settings.notes))
    _list("These settings rest on what is inferred, not stated", c.inferences)
    _list("These settings rest on what nobody says", c.law_assumptions)
    others = len(c.assumptions) - len(c.law_assumptions)
    if others:
        wrapped(
            f"{others} more assumption{'s concern' if others > 1 else ' concerns'} scan rules, limits and transfers: 'pidemu show' "
            "and --json list them.",
            "  ",
        )


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


def print_ranking(c: Conversion) -> None:
    """Print every choice of the target's options, the best first."""
    heading("\nChoices of the options, the best first")
    table(["options", "verdict", "loop band", "setpoint path"], [_ranked(a) for a in c.ranking], right=(2, 3))


def _ranked(a: Attempt) -> list[str]:
    changes = ", ".join(f"{n}={x}" for n, x in a.changed.items()) or "as the card delivers them"
    if a.certificate is None:
        return [changes, "refused", "-", "-"]
    setpoint = a.certificate.setpoint_at_scan or a.certificate.setpoint
    verdict = f"{a.verdict}, scan rules differ" if a.rules_differ else a.verdict
    return [changes, verdict, *(percent(p.loop_band.max_deviation) for p in (a.certificate.headline, setpoint))]


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


def _target(c: Conversion) -> None:
    s, book = c.settings, c.textbook.settings
    heading(f"\nTo: {s.card.title}" + (f"  [{s.variant.choice_text}]" if s.options else ""))
    if c.chosen:
        wrapped(f"chosen, as nobody said otherwise: {', '.join(f'{n}={x}' for n, x in c.chosen.items())}; --set decides", "  ")
    rows = []
    for name, v in s.items():
        if v.active:
            rule = number(book[name].value) if book is not None and name in book else "-"
            rows.append([name, number(v.value), unit_of(v), other_units(v), rule])
    table(["", f"{c.match} match", "", "", "textbook rule"], rows, right=(1, 4))


def _figures(c: Certificate) -> None:
    table(BAND_COLUMNS, band_rows(c), right=(3, 4, 5))
    if c.scan_by_scan is not None:
        wrapped(emulation_line(c), "  ")
    click.echo(f"  {kick_line(c)}")


def _rounding(conversion: Conversion, asked: bool) -> None:
    c = conversion.certificate
    unknown = [n for n, v in conversion.settings.items() if v.active and v.setting.resolution is None]
    if asked and unknown:
        click.echo(f"  not rounded, since the card states no resolution: {', '.join(unknown)}")
    if not c.dials:
        return
    heading("\nRounded to the dials' resolution")
    table(["", "exact", "rounded"], [[d.name, number(d.exact), number(d.rounded)] for d in c.dials], right=(1, 2))
    if c.feedback_before_rounding is not None:
        click.echo(f"  {rounding_line(c)}")


def _textbook(c: Conversion) -> None:
    line = textbook_line(c)
    if line:
        wrapped(line, "  ")


def _list(title: str, items: tuple[str, ...]) -> None:
    if items:
        heading(f"\n{title}")
        for item in items:
            wrapped(item, "  - ")
