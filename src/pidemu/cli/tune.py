"""``pidemu tune``."""

from __future__ import annotations

import math
from typing import Any, Final

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
    wrapped,
)
from pidemu.conversion.request import DIGITS
from pidemu.process.process import parse_process
from pidemu.process.text import written
from pidemu.settings.ranges import SignalRange
from pidemu.tuning.compare import SORTS, RuleTable, check_parameters, tune_all
from pidemu.tuning.tune import SCHEMA, Tuning, tune

_FIGURES: Final = {
    "IAE, load step of 1 % [% s]": "iae",
    "gain margin": "gain_margin",
    "phase margin [deg]": "phase_margin",
    "delay margin [s]": "delay_margin",
    "Ms": "Ms",
    "Mt": "Mt",
}


@click.command("tune", short_help="Tune a card for a process, by a rule or by all of them.")
@click.argument("card")
@click.option(
    "--process",
    "model",
    required=True,
    metavar="gain=...,lag=...,delay=...",
    help="The process, from output to measurement (times in s, or with a unit; the gain, too, such as 2 degC/%, with --pv-range).",
)
@click.option("--rule", default="simc", show_default=True, help="The rule, such as simc, lambda, amigo-pi; --all-rules lists them.")
@click.option("--all-rules", is_flag=True, help="All rules that serve the process, in one table.")
@click.option(
    "--sort", type=click.Choice(SORTS), default="iae", show_default=True, help="With --all-rules: the best first by this."
)
@click.option("--controller", type=click.Choice(["P", "PI", "PID"]), help="Which rule of a family; with --all-rules only these.")
@click.option("--parameter", "wishes", multiple=True, metavar="NAME=TIME", help="A parameter of the rule: Tcl=20. Repeatable.")
@click.option(
    "--set",
    "fixed",
    multiple=True,
    metavar="NAME=VALUE",
    help="An option of the card, or a dial that shall have this value. Repeatable.",
)
@click.option(
    "--scan", type=TimeArgument(positive=True), help="Scan interval for the figures [s]; by default the card's, or a shorter one."
)
@click.option(
    "--action", type=click.Choice(["reverse", "direct"]), help="By default that of negative feedback; another is refused."
)
@click.option("--digits", type=click.IntRange(1, 17), default=DIGITS, show_default=True, help="Significant digits of the dials.")
@click.option("--allow-approximate", is_flag=True, help="Where the card cannot do what the rule says, give the nearest settings.")
@click.option("--pv-range", type=RangeArgument(), help='Range of the measurement, such as "0,400 degC".')
@click.option("--op-range", type=RangeArgument(), help='Range of the output, such as "0,100 %".')
@vendors_option
@json_option
def command(
    card: str,
    model: str,
    rule: str,
    all_rules: bool,
    sort: str,
    controller: str | None,
    wishes: tuple[str, ...],
    fixed: tuple[str, ...],
    scan: float | None,
    action: str | None,
    digits: int,
    allow_approximate: bool,
    pv_range: SignalRange | None,
    op_range: SignalRange | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Tune CARD for a process by a rule, and print its own dials with the figures of the emulated loop.

    A process gain without a unit is in percent per percent.
    """
    target, process = load_card(card, vendors), parse_process(model, any_unit=True)
    parameters = assignments(wishes, "NAME=TIME after --parameter", "Tcl=20")
    options, dials = split_options(target, assignments(fixed, "NAME=VALUE after --set"))
    arguments: dict[str, Any] = {
        "controller": controller, "options": options, "given": dials, "pv_range": pv_range, "op_range": op_range, "scan": scan,
        "action": action, "digits": digits, "allow_approximate": allow_approximate, **parameters,
    }  # fmt: skip
    check_parameters(None if all_rules else rule, parameters)
    if all_rules:
        found = tune_all(target, process, sort, **arguments)
        if as_json:
            rules = [t.to_dict() for t in found.tunings]
            print_json({"schema": SCHEMA, "card": target.id, "process": written(process), "rules": rules, "refused": found.refused})
        else:
            _print_all(found, target.title, process.text)
        return
    one = tune(target, process, rule, **arguments)
    if as_json:
        print_json(one.to_dict())
    else:
        _print(one)


def _print(t: Tuning) -> None:
    s = t.settings
    heading(s.card.title + (f"  [{s.variant.choice_text}]" if s.options else ""))
    rows = [[name, number(v.value), unit_of(v), other_units(v)] for name, v in s.items() if v.active]
    table([""] * 4, rows, right=(1,))
    heading("\nThe rule")
    told = ", ".join(f"{name} {number(x, 5)}" + ("" if name == "K" else " s") for name, x in t.standard.items())
    chosen = [[name, f"{number(x, 5)} s"] for name, x in t.parameters.items()]
    rows = [["rule", f"{t.rule.title}, {t.rule.controller}"], ["source", t.source], ["aims at", t.rule.criterion]]
    table(["", ""], [*rows, *chosen, ["says", told], ["process", t.process.text], ["action", t.action]])
    heading(f"\nThe loop, at a scan every {number(t.scan)} s")
    figures = [[name, _short(getattr(t.figures, of))] for name, of in _FIGURES.items()]
    table(["", ""], [*figures, ["stable", "yes" if t.figures.stable else "NO"]])
    if t.notes:
        heading("\nNotes")
        for note in t.notes:
            wrapped(note, "  - ")


def _print_all(found: RuleTable, title: str, process: str) -> None:
    heading(f"{title}, {process}")
    rows = [[t.rule.name, _dials(t), *(_short(getattr(t.figures, of)) for of in _FIGURES.values())] for t in found.tunings]
    table(["rule", "dials", "IAE", "GM", "PM", "DM [s]", "Ms", "Mt"], rows, right=(2, 3, 4, 5, 6, 7))
    if found.refused:
        heading("\nNot for this process or this card")
        for name, reason in found.refused.items():
            wrapped(f"{name}: {reason.splitlines()[0]}", "  - ")


def _dials(t: Tuning) -> str:
    return ", ".join(
        f"{n} {number(v.value, 4)}" for n, v in t.settings.items() if v.active and not v.off and _is_gain(v.role.value)
    )


def _is_gain(role: str) -> bool:
    return role in ("gain", "integral", "derivative") or role.endswith("-gain")


def _short(x: float) -> str:
    return "-" if math.isnan(x) else number(x, 4)
