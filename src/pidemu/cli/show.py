"""``pidemu show``."""

from __future__ import annotations

import click

from pidemu.card.library import load_card
from pidemu.card.load import Card, Variant
from pidemu.card.models import Setting
from pidemu.card.text import equation_lines
from pidemu.cli.common import assignments, heading, json_option, number, print_json, table, vendors_option, wrapped
from pidemu.plain import json_safe
from pidemu.settings import is_active, off_values


@click.command("show", short_help="Show a card as a data sheet, with its evidence.")
@click.argument("card")
@click.argument("options", nargs=-1, metavar="[OPTION=CHOICE]...")
@vendors_option
@json_option
def command(card: str, options: tuple[str, ...], vendors: tuple[str, ...], as_json: bool) -> None:
    """Show CARD (an id such as fisher/provox, or a file) with the options chosen: equation, settings, evidence, what is assumed."""
    found = load_card(card, vendors)
    variant = found.variant(assignments(options, "OPTION=CHOICE", "FORM=Series"))
    if as_json:
        print_json(_plain(variant))
        return
    heading(f"{found.id}   {found.title}")
    if found.data.about:
        wrapped(found.data.about)
    _options(found, variant)
    heading("\nEquation (continuous, reverse acting)")
    for line in equation_lines(variant):
        click.echo(f"  {line}")
    _facts(variant)
    _settings(variant)
    _evidence(variant)
    _rest(found)


def _options(card: Card, variant: Variant) -> None:
    if not card.options:
        return
    heading("\nOptions")
    rows = []
    for name, choices in card.options.items():
        about = card.data.options[name].about or ""
        rows.append([name, variant.chosen[name], ", ".join(choices), about])
    table(["option", "shown", "choices (default first)", ""], rows)


def _facts(variant: Variant) -> None:
    q = variant.equation
    words = q.action.names
    heading("\nScan by scan")
    start = {
        "bumpless": "bumpless, where there is integral action",
        "load-output": "the integral is loaded with the output, the terms come on top",
    }
    rows = [
        ["form", q.form.value],
        ["implementation", q.implementation],
        [
            "integral",
            f"{q.integral.rule.value}, windup: {q.integral.windup.scheme}" if q.integral.on != "none" else "none",
        ],
        ["derivative", q.derivative.rule.value if q.derivative.on != "none" else "none"],
        ["to automatic", start[q.transfer.start]],
        ["action", f"reverse (output falls when PV rises) is called '{words['reverse']}', direct '{words['direct']}'"],
        ["signals", "% of span" if q.signals == "percent" else "engineering units"],
        ["default scan", q.scan.default],
        ["default limits", f"{number(q.output.limits[0])} to {number(q.output.limits[1])}"],
    ]
    table(["", ""], rows)


def _settings(variant: Variant) -> None:
    heading("\nSettings")
    rows = []
    for name, s in variant.equation.settings.items():
        about = s.about or ""
        if not is_active(variant.equation, name, s):
            about = f"not used with these options. {about}".strip()
        rows.append([name, s.sets, s.unit, _default(s), _range(s), ", ".join(number(x) for x in off_values(s)), about])
    table(["name", "sets", "unit", "default", "range", "off", ""], rows)


def _default(s: Setting) -> str:
    return "required" if s.default is None else number(s.default)


def _range(s: Setting) -> str:
    return f"{number(s.range[0])} to {number(s.range[1])}" if s.range else ""


def _evidence(variant: Variant) -> None:
    heading("\nEvidence")
    rows = {}
    for statement in variant.statements():
        e = statement.evidence
        if e is not None:
            place = f"[{e.source}] {e.at or ''}".strip() if e.source else ""
            rows[statement.key] = [statement.key, e.status.value, place, e.note or ""]
    table(["field", "status", "source", "note"], list(rows.values()))
    assumed = variant.assumptions()
    if assumed:
        heading("\nAssumed - nobody says so, and results rest on it")
        for a in assumed:
            wrapped(str(a), "  - ")


def _rest(card: Card) -> None:
    heading("\nSources")
    for key, s in card.data.sources.items():
        wrapped(
            f"[{key}] {s.title}" + (f", {s.address}" if s.address else "") + f" (read {s.read})" + (f". {s.note}" if s.note else "")
        )
    if card.data.quirks:
        heading("\nQuirks")
        for quirk in card.data.quirks:
            wrapped(quirk.text + (f" [{quirk.source}]" if quirk.source else ""), "  - ")
    heading("\nExamples")
    for example in card.data.examples:
        given = ", ".join(f"{k}={v if isinstance(v, str) else number(v)}" for k, v in example.given.items())
        c = example.canonical
        gains = f"kp {number(c.kp)}, ki {number(c.ki)} 1/s, kd {number(c.kd)} s" + (f", Tf {number(c.Tf)} s" if c.Tf else "")
        wrapped(f"{given}: {gains}" + (f" [{example.source}]" if example.source else ""), "  - ")


def _plain(variant: Variant) -> dict[str, object]:
    card = variant.card
    return {
        "card": card.id,
        "title": card.title,
        "options": dict(variant.chosen),
        "equation": equation_lines(variant),
        "content": json_safe(card.data.model_dump(mode="python", by_alias=True, exclude_none=True)),
        "assumed": [a.path for a in variant.assumptions()],
    }
