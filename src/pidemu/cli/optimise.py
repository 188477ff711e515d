"""``pidemu optimise``."""

from __future__ import annotations

import math
from typing import Final

import click

from pidemu.card.library import load_card
from pidemu.certificate.figures import other_units, unit_of
from pidemu.cli.common import (
    RangeArgument,
    TimeArgument,
    assignments,
    heading,
    json_option,
    number,
    print_json,
    split_options,
    table,
    vendors_option,
)
from pidemu.conversion.request import DIGITS
from pidemu.plausible import plain_number
from pidemu.process.process import parse_process
from pidemu.settings.ranges import SignalRange
from pidemu.tuning.criteria import CRITERIA, DISTURBANCES, LIMITS
from pidemu.tuning.optimise import OptimalTuning, optimise

_FIGURES: Final = {
    "IAE, load step of 1 % [% s]": "iae",
    "gain margin": "gain_margin",
    "phase margin [deg]": "phase_margin",
    "delay margin [s]": "delay_margin",
    "Ms": "Ms",
    "Mt": "Mt",
}
_MOST_RULES: Final = 8


@click.command("optimise", short_help="Find the best settings of a card for a process, within limits.")
@click.argument("card")
@click.option(
    "--process",
    "models",
    required=True,
    multiple=True,
    metavar="gain=...,lag=...,delay=...",
    help="The process, from output to measurement, as for tune. Given again: a further process that the settings have to serve.",
)
@click.option(
    "--criterion",
    type=click.Choice(list(CRITERIA)),
    default="iae",
    show_default=True,
    help="What is least: the integral of the absolute, squared or time-weighted error, or of the error itself.",
)
@click.option(
    "--disturbance", type=click.Choice(DISTURBANCES), default="load", show_default=True, help="After a step of 1 % of what."
)
@click.option(
    "--limit",
    "bounds",
    multiple=True,
    metavar="NAME=VALUE",
    help=f"What must not be exceeded: {', '.join(LIMITS)}; such as Ms=1.6. Repeatable.",
)
@click.option("--controller", type=click.Choice(["P", "PI", "PID"]), help="Which terms; by default all that the card has.")
@click.option(
    "--set",
    "fixed",
    multiple=True,
    metavar="NAME=VALUE",
    help="An option of the card, or a dial that shall have this value. Repeatable.",
)
@click.option("--scan", type=TimeArgument(positive=True), help="Scan interval [s]; by default the card's, or a shorter one.")
@click.option(
    "--action", type=click.Choice(["reverse", "direct"]), help="By default that of negative feedback; another is refused."
)
@click.option("--digits", type=click.IntRange(1, 17), default=DIGITS, show_default=True, help="Significant digits of the dials.")
@click.option("--pv-range", type=RangeArgument(), help='Range of the measurement, such as "0,400 degC".')
@click.option("--op-range", type=RangeArgument(), help='Range of the output, such as "0,100 %".')
@vendors_option
@json_option
def command(
    card: str,
    models: tuple[str, ...],
    criterion: str,
    disturbance: str,
    bounds: tuple[str, ...],
    controller: str | None,
    fixed: tuple[str, ...],
    scan: float | None,
    action: str | None,
    digits: int,
    pv_range: SignalRange | None,
    op_range: SignalRange | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Find the settings of CARD that are best for a process by a criterion, within limits, and print them with what rules give.

    The search runs on the exact sampled loop in its linear range; a limit that its exact figure would break is kept.
    """
    target = load_card(card, vendors)
    process, *family = (parse_process(model, any_unit=True) for model in models)
    limits = {name: _number(text) for name, text in assignments(bounds, "NAME=VALUE after --limit", "Ms=1.6").items()}
    options, dials = split_options(target, assignments(fixed, "NAME=VALUE after --set"))
    found = optimise(
        target, process, criterion, disturbance, limits, scan, controller=controller, options=options, given=dials, family=family,
        pv_range=pv_range, op_range=op_range, action=action, digits=digits,
    )  # fmt: skip
    if as_json:
        print_json(found.to_dict())
    else:
        _print(found)


def _number(text: object) -> object:
    """Return a limit as a number where it is one; what it is not is told by name."""
    try:
        return plain_number(str(text))
    except ValueError:
        return text


def _print(o: OptimalTuning) -> None:
    s = o.settings
    heading(s.card.title + (f"  [{s.variant.choice_text}]" if s.options else ""))
    rows = [[name, number(v.value), unit_of(v), other_units(v)] for name, v in s.items() if v.active]
    table([""] * 4, rows, right=(1,))
    heading("\nBest by")
    what, _, unit = CRITERIA[o.criterion_name].partition(" [")
    rows = [
        [f"{what}, {o.disturbance} step of 1 %", f"{number(o.criterion, 4)} {unit.partition(']')[0]}"],
        *([f"{LIMITS[name]}, at most {number(most)}", number(o.bounded[name], 4)] for name, most in o.limits.items()),
        ["process", o.process.text],
        *(["and", p.text] for p in o.family),
        ["action", o.action],
    ]
    table(["", ""], rows)
    heading(f"\nThe loop, at a scan every {number(o.scan)} s")
    table(["", ""], [[name, _short(float(getattr(o.figures, of)))] for name, of in _FIGURES.items()])
    if o.rules:
        heading("\nWhat rules would give")
        rows = [[r.rule, _short(r.criterion), "yes" if r.within_limits else "NO"] for r in o.rules[:_MOST_RULES]]
        table(["rule", "criterion", "within the limits"], rows, right=(1,))
        if len(o.rules) > _MOST_RULES:
            click.echo(f"and {len(o.rules) - _MOST_RULES} more; --json lists all")


def _short(x: float) -> str:
    return "-" if math.isnan(x) else number(x, 4)
