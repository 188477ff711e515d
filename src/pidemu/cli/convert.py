"""``pidemu convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.cli.certificate import print_conversion, print_plan, print_ranking, print_refusal
from pidemu.cli.common import Range, Scan, assignments, json_option, overridden, print_json, split_options, vendors_option
from pidemu.conversion.aim import read_aim
from pidemu.conversion.convert import convert
from pidemu.errors import ConversionRefusedError, SettingError
from pidemu.ranges import SignalRange
from pidemu.settings import Settings


def _match(_ctx: click.Context, _option: click.Parameter, text: str | None) -> str | None:
    try:
        read_aim(text)
    except SettingError as error:
        raise click.BadParameter(str(error)) from None
    return text


@click.command("convert", short_help="Convert settings to another card, with a certificate.")
@click.argument("card", required=False)
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@click.option("--to", "target", metavar="CARD", help="The card to convert to.")
@click.option(
    "--set",
    "fixed",
    multiple=True,
    metavar="NAME=VALUE",
    help="An option of the target, or a dial that shall have this value. Options that are not given are chosen. Repeatable.",
)
@click.option(
    "--from",
    "word",
    metavar="WORD",
    help="Instead of CARD, where it is not sure what the numbers mean: every reading is shown, none is chosen.",
)
@click.option("--loop", "loop_file", metavar="FILE.yaml", help="Read source, settings and target from a file instead.")
@click.option(
    "--scan",
    type=Scan(),
    help="Scan interval of both, or of source and target [s]: the settings make up for intervals and rules that differ. "
    "(The gain is not multiplied by the ratio of the intervals: settings are per second, not per scan.)",
)
@click.option("--no-compensation", "plain", is_flag=True, help="With --scan: the settings of the continuous law all the same.")
@click.option(
    "--match",
    metavar="MATCH",
    callback=_match,
    help="exact, low-frequency, textbook, frequency:0.02rad/s, constrained; with --process also frequency (at the crossover) "
    "and loop. By default exact where possible, else low-frequency.",
)
@click.option("--process", metavar="gain=...,lag=...,delay=...", help="The process, for the loop before and after (times in s).")
@click.option("--all-options", is_flag=True, help="Rank every choice of the target's options.")
@click.option("--allow-approximate", is_flag=True, help="Where the target refuses, give the nearest settings.")
@click.option("--round", "round_dials", is_flag=True, help="Round to the target's resolution and state the effect.")
@click.option("--pv-range", type=Range(), help='Measurement range of the source, such as "0,400 degC" or "0,16383 counts".')
@click.option("--op-range", type=Range(), help='Output range of the source, such as "0,100 %" or "0,255 pwm".')
@click.option("--to-pv-range", type=Range(), help="Measurement range of the target; by default the source's.")
@click.option("--to-op-range", type=Range(), help="Output range of the target; by default the source's.")
@click.option(
    "--cut-over", "now", metavar="SP,PV,OP", help="Setpoint, measurement and output now: how to change over without a bump."
)
@click.option("--html", "page", metavar="FILE.html", help="Write the certificate as a page with plots.")
@vendors_option
@json_option
def command(
    card: str | None,
    values: tuple[str, ...],
    target: str | None,
    fixed: tuple[str, ...],
    word: str | None,
    loop_file: str | None,
    scan: tuple[float, float] | None,
    plain: bool,
    match: str | None,
    process: str | None,
    all_options: bool,
    allow_approximate: bool,
    round_dials: bool,
    pv_range: SignalRange | None,
    op_range: SignalRange | None,
    to_pv_range: SignalRange | None,
    to_op_range: SignalRange | None,
    now: str | None,
    page: str | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Convert the settings NAME=VALUE of CARD to another card.

    Values are numbers in the card's unit, or have one: "RESET=20 s/repeat". Prints the target's settings, how near the two
    controllers are, and what will behave differently. Exit status 1 if the target refuses.
    """
    if word is not None and card is not None:
        values, card = (card, *values), None  # what stands first is a value then
    given = assignments(values)
    wanted = assignments(fixed, "NAME=VALUE after --set")
    loop = None
    if loop_file is not None:
        from pidemu.conversion.loopfile import read_loop

        loop = read_loop(Path(loop_file))
        card, given = card or loop.card, overridden(loop.settings, given)
        target, wanted = target or loop.to, overridden(loop.set, wanted)
        scan = scan or loop.scan
        process = process or loop.process
    if card is None and word is None:
        raise click.UsageError(
            "no CARD to convert from; for example: pidemu convert fisher/provox GAIN=2 RESET=4 --to emerson/deltav"
        )
    if target is None:
        raise click.UsageError("no card to convert to; add --to CARD, 'pidemu cards' lists them")
    to_ranges: dict[str, SignalRange | str | None] = {"to_pv_range": to_pv_range, "to_op_range": to_op_range}
    if loop is not None:
        to_ranges = {"to_pv_range": to_pv_range or loop.to_pv_range, "to_op_range": to_op_range or loop.to_op_range}
    ranges = {k: v for k, v in (("pv_range", pv_range), ("op_range", op_range)) if v is not None}
    goal = load_card(target, vendors)
    options, dials = split_options(goal, wanted)
    arguments: dict[str, Any] = {
        "options": options, "given": dials, "scan": scan, "compensate": not plain, "match": match, "round_dials": round_dials,
        **to_ranges, "allow_approximate": allow_approximate, "all_options": all_options,
    }  # fmt: skip
    if process is not None:
        from pidemu.loop.process import parse_process

        arguments["process"] = parse_process(process)
    if word is not None:
        source = _only_reading(word, {**given, **ranges}, goal, arguments, target, vendors, as_json)
    else:
        source = load_card(card or "", vendors).settings({**given, **ranges})
    try:
        conversion = convert(source, goal, **arguments)
    except ConversionRefusedError as error:
        print_refusal(error, source, goal, as_json)
        raise SystemExit(1) from None
    plan = None if now is None else conversion.transfer_plan(*_signals(now))
    if page is not None:
        from pidemu.report.certificate import write_page

        write_page(page, conversion, plan)
    if as_json:
        print_json({**conversion.to_dict(), **({} if plan is None else {"transfer_plan": plan.to_dict()})})
        return
    print_conversion(conversion, round_dials)
    if plan is not None:
        print_plan(plan)
    if all_options:
        print_ranking(conversion)
    if page is not None:
        click.echo(f"\nwritten: {page}")


def _only_reading(
    word: str,
    given: dict[str, object],
    goal: Card,
    arguments: dict[str, Any],
    to: str,
    vendors: tuple[str, ...],
    as_json: bool,
) -> Settings:
    """Return the settings that can be meant; where there are several, print them all and exit."""
    from pidemu.ambiguity.readings import readings
    from pidemu.cli.readings import refuse_to_choose

    found = readings(word, given, vendors=vendors)
    if len(found) > 1:
        refuse_to_choose(found, goal, arguments, to=to, as_json=as_json)
    return found[0].settings


def _signals(text: str) -> tuple[float, float, float]:
    try:
        sp, pv, op = (float(x) for x in text.split(","))
    except ValueError:
        raise click.UsageError(
            f"'{text}' is not three numbers; write setpoint, measurement and output: --cut-over 50,48.5,40"
        ) from None
    return sp, pv, op
