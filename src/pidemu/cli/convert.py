"""``pidemu convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.cli.common import (
    Pair,
    Scan,
    assignments,
    heading,
    json_option,
    number,
    overridden,
    print_json,
    split_options,
    table,
    vendors_option,
    wrapped,
)
from pidemu.conversion.certificate import EXACT, Band, Certificate, PathComparison
from pidemu.conversion.convert import MATCHES, Conversion, convert
from pidemu.errors import ConversionRefusedError
from pidemu.settings import Settings, Value
from pidemu.units import Role

_VERDICTS = {
    "exact": "exact: the same law for measurement and setpoint",
    "exact-feedback": "exact-feedback: the same law for measurement (load response and stability), another for setpoint changes",
    "approximate": "approximate: see the figures",
}


@click.command("convert", short_help="Convert settings to another card, with a certificate.")
@click.argument("card", required=False)
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@click.option("--to", "target", metavar="CARD", help="The card to convert to.")
@click.option(
    "--set",
    "fixed",
    multiple=True,
    metavar="NAME=VALUE",
    help="An option of the target, or a dial that shall have this value. Repeatable.",
)
@click.option("--loop", "loop_file", metavar="FILE.yaml", help="Read source, settings and target from a file instead.")
@click.option("--scan", type=Scan(), help="Scan interval of both, or of source and target [s].")
@click.option(
    "--match",
    type=click.Choice(list(MATCHES)),
    help="How to match; by default exact where possible, else low-frequency.",
)
@click.option("--allow-approximate", is_flag=True, help="Where the target refuses, give the nearest settings.")
@click.option("--round", "round_dials", is_flag=True, help="Round to the target's resolution and state the effect.")
@click.option("--pv-range", type=Pair(), help="Measurement range of the source [engineering units].")
@click.option("--op-range", type=Pair(), help="Output range of the source [engineering units].")
@click.option("--to-pv-range", type=Pair(), help="Measurement range of the target; by default the source's.")
@click.option("--to-op-range", type=Pair(), help="Output range of the target; by default the source's.")
@vendors_option
@json_option
def command(
    card: str | None,
    values: tuple[str, ...],
    target: str | None,
    fixed: tuple[str, ...],
    loop_file: str | None,
    scan: tuple[float, float] | None,
    match: str | None,
    allow_approximate: bool,
    round_dials: bool,
    pv_range: tuple[float, float] | None,
    op_range: tuple[float, float] | None,
    to_pv_range: tuple[float, float] | None,
    to_op_range: tuple[float, float] | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Convert the settings NAME=VALUE of CARD to another card.

    Values are numbers in the card's unit, or have one: "RESET=20 s/repeat". Prints the target's settings, how near the two
    controllers are, and what will behave differently. Exit status 1 if the target refuses.
    """
    given = assignments(values)
    wanted = assignments(fixed, "NAME=VALUE after --set")
    if loop_file is not None:
        from pidemu.conversion.loopfile import read_loop

        loop = read_loop(Path(loop_file))
        card, given = card or loop.card, overridden(loop.settings, given)
        target, wanted = target or loop.to, overridden(loop.set, wanted)
        scan = scan or loop.scan
    if card is None:
        raise click.UsageError(
            "no CARD to convert from; for example: pidemu convert fisher/provox GAIN=2 RESET=4 --to emerson/deltav"
        )
    if target is None:
        raise click.UsageError("no card to convert to; add --to CARD, 'pidemu cards' lists them")
    ranges = {k: v for k, v in (("pv_range", pv_range), ("op_range", op_range)) if v is not None}
    source = load_card(card, vendors).settings({**given, **ranges})
    goal = load_card(target, vendors)
    options, dials = split_options(goal, wanted)
    arguments: dict[str, Any] = {
        "options": options, "given": dials, "scan": scan, "match": match, "round_dials": round_dials,
        "pv_range": to_pv_range, "op_range": to_op_range,
    }  # fmt: skip
    try:
        conversion = convert(source, goal, allow_approximate=allow_approximate, **arguments)
    except ConversionRefusedError as error:
        _refused(error, source, goal, as_json)
        raise SystemExit(1) from None
    if as_json:
        print_json(conversion.to_dict())
    else:
        _print(conversion, round_dials)


def _refused(error: ConversionRefusedError, source: Settings, goal: Card, as_json: bool) -> None:
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
            click.echo(f"  {name} = {number(value.value)} {_unit(value)}".rstrip(), err=True)
    click.echo(f"their cost: up to {_percent(band.max_deviation)}, {_db(band)}, {_deg(band)} in the loop band", err=True)


def _print(c: Conversion, round_dials: bool) -> None:
    heading(f"{c.source.card.id}  ->  {c.settings.card.id}")
    _side("From", c.source)
    _target(c)
    heading("\nVerdict")
    cert = c.certificate
    if c.verdict == "approximate" and cert.feedback.is_exact and cert.setpoint.is_exact:
        click.echo("  approximate at these scan intervals: the continuous laws are the same, scan intervals or rules differ")
    else:
        click.echo(f"  {_VERDICTS[c.verdict]}")
    _figures(c.certificate)
    _rounding(c, round_dials)
    _textbook(c)
    _list("Watch for", c.warnings)
    _list("Read as", (*c.source.notes, *c.settings.notes))
    _list("These settings rest on what is inferred, not stated", c.inferences)
    _list("These settings rest on what nobody says", c.law_assumptions)
    others = len(c.assumptions) - len(c.law_assumptions)
    if others:
        wrapped(
            f"{others} more assumptions concern scan rules, limits and transfers: 'pidemu show' and --json list them.",
            "  ",
        )


def _unit(v: Value) -> str:
    return "" if v.unit == "1" else v.unit


def _other_units(v: Value) -> str:
    """Return an integral or gain dial in the other usual unit, so that nobody has to convert in the head."""
    if v.off:
        return "off"
    if v.role is Role.INTEGRAL and "repeat" in v.unit:
        other = "repeat/min" if v.unit == "s/repeat" else "s/repeat"
    elif v.role is Role.INTEGRAL and v.unit in ("s", "min"):
        other = "repeat/min"
    elif v.role in (Role.DERIVATIVE, Role.INTEGRAL) and "min" in v.unit:
        other = v.unit.replace("min", "s")
    elif v.role is Role.GAIN and v.unit == "%":
        other = "%/%"
    else:
        return ""
    return f"= {number(v.to(other))} {other}"


def _side(title: str, s: Settings) -> None:
    heading(f"\n{title}: {s.card.title}" + (f"  [{s.variant.choice_text}]" if s.options else ""))
    rows = [
        [name, number(v.value), _unit(v), _other_units(v), "" if v.given else "card's default"] for name, v in s.items() if v.active
    ]
    table(["", "", "", "", ""], rows, right=(1,))


def _target(c: Conversion) -> None:
    s, book = c.settings, c.textbook.settings
    heading(f"\nTo: {s.card.title}" + (f"  [{s.variant.choice_text}]" if s.options else ""))
    rows = []
    for name, v in s.items():
        if v.active:
            rule = number(book[name].value) if book is not None and name in book else "-"
            rows.append([name, number(v.value), _unit(v), _other_units(v), rule])
    table(["", f"{c.match} match", "", "", "textbook rule"], rows, right=(1, 4))


def _figures(c: Certificate) -> None:
    rows = [*_rows("feedback (PV)", c.feedback), *_rows("setpoint", c.setpoint)]
    if c.feedback_at_scan is not None and c.setpoint_at_scan is not None:
        rows += [
            *_rows("feedback, at the scans", c.feedback_at_scan),
            *_rows("setpoint, at the scans", c.setpoint_at_scan),
        ]
    table(["path", "band", "rad/s", "deviation", "gain", "phase"], rows, right=(3, 4, 5))
    if c.setpoint_kick_at_scan is not None:
        first = c.setpoint_kick_at_scan
        click.echo(
            "  setpoint kick, output step in the first scan: "
            f"{number(first.source)} on the source, {number(first.target)} on the target"
        )
        return
    kick = c.setpoint_kick
    click.echo(
        "  setpoint kick (output step per setpoint step, at once): "
        f"{number(kick.source)} on the source, {number(kick.target)} on the target"
    )


def _rows(title: str, p: PathComparison) -> list[list[str]]:
    out = []
    for name, band in (("loop band", p.loop_band), ("full band", p.full_band)):
        out.append([title, name, f"{band.low:.3g} to {band.high:.3g}", _percent(band.max_deviation), _db(band), _deg(band)])
        title = ""
    return out


def _percent(deviation: float) -> str:
    if deviation < EXACT:
        return "none"
    return f"{number(float(f'{100 * deviation:.2g}'))} %" if deviation < 10 else "over 1000 %"


def _db(band: Band) -> str:
    return f"{band.gain_db:.2f} dB"


def _deg(band: Band) -> str:
    return f"{band.phase_deg:.1f} deg"


def _rounding(conversion: Conversion, asked: bool) -> None:
    c = conversion.certificate
    unknown = [n for n, v in conversion.settings.items() if v.active and v.setting.resolution is None]
    if asked and unknown:
        click.echo(f"  not rounded, since the card states no resolution: {', '.join(unknown)}")
    if not c.dials:
        return
    heading("\nRounded to the dials' resolution")
    table(["", "exact", "rounded"], [[d.name, number(d.exact), number(d.rounded)] for d in c.dials], right=(1, 2))
    before = c.feedback_before_rounding
    if before is not None:
        old, new = before.loop_band.max_deviation, c.feedback.loop_band.max_deviation
        click.echo(f"  deviation in the loop band before rounding: {_percent(old)}, after: {_percent(new)}")


def _textbook(c: Conversion) -> None:
    book = c.textbook
    if book.certificate is None:
        wrapped(f"the textbook rule has no answer: {book.reason}", "  ")
    elif c.match != "textbook" and book.certificate.feedback.loop_band.max_deviation < EXACT:
        click.echo("  the textbook rule gives the same law for measurement")
    elif c.match != "textbook":
        band = book.certificate.feedback.loop_band
        click.echo(
            f"  the textbook rule would deviate by {_percent(band.max_deviation)}, {_db(band)}, {_deg(band)} in the loop band"
        )


def _list(title: str, items: tuple[str, ...]) -> None:
    if items:
        heading(f"\n{title}")
        for item in items:
            wrapped(item, "  - ")
