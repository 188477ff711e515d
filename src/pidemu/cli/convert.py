"""``pidemu convert``."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.cli.certificate import print_conversion, print_explanation, print_plan, print_refusal
from pidemu.cli.common import (
    OutputArgument,
    PairArgument,
    RangeArgument,
    ScanArgument,
    assignments,
    echo,
    json_option,
    overridden,
    print_json,
    split_options,
    vendors_option,
)
from pidemu.cli.inputs import inputs
from pidemu.cli.questions import print_questions
from pidemu.conversion.convert import convert
from pidemu.conversion.match_method import read_aim
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.request import DIGITS
from pidemu.errors import ActionError, PidemuError, SettingError
from pidemu.files.outputs import check_outputs
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from pidemu.conversion.result import Conversion
    from pidemu.cutover.plan import TransferPlan


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
    help="Instead of CARD, where it is uncertain what the numbers mean: every reading is shown, none is chosen.",
)
@click.option("--loop", "loop_file", metavar="FILE.yaml", help="Read source, settings and target from a file instead.")
@click.option(
    "--scan",
    type=ScanArgument(),
    help="Scan interval that both, or source and target, compute with [s]. (Do not multiply the gain by their ratio: settings "
    "are per second, not per scan.)",
)
@click.option(
    "--runs-every",
    type=ScanArgument(),
    help="Interval at which the source, or source and target, are really executed, where that is not --scan [s].",
)
@click.option("--compensate", is_flag=True, help="With --scan: make up for scan intervals and rules that differ.")
@click.option(
    "--mode",
    type=click.Choice(["auto", "cascade", "both"]),
    default="both",
    show_default=True,
    help="Which setpoint counts: the operator's, a remote one, or both.",
)
@click.option(
    "--match",
    metavar="MATCH",
    callback=_match,
    help="exact, same-numbers (the source's own), low-frequency, textbook, frequency:0.02rad/s, constrained; with --process also "
    "frequency (at the crossover) and loop. By default the first that is near enough.",
)
@click.option("--process", metavar="gain=...,lag=...,delay=...", help="The process, for the loop before and after (times in s).")
@click.option("--explain", is_flag=True, help="Say why these options were chosen, and what every other choice would cost.")
@click.option("--assume", is_flag=True, help="Take the cards' defaults for everything that would be asked, and say so.")
@click.option("--allow-approximate", is_flag=True, help="Where the target refuses, give the nearest settings.")
@click.option(
    "--digits",
    type=click.IntRange(1, 17),
    default=DIGITS,
    show_default=True,
    help="Significant digits of dials whose card states no resolution; the certificate is about the rounded ones.",
)
@click.option("--bias", type=float, help="Output at SP = PV of a loop without integral action [%].")
@click.option(
    "--limits", type=PairArgument(), help="Output limits that the source is set to: the answer states those of the target."
)
@click.option("--tag", metavar="TAG", default="", help="The loop's name, for the certificate.")
@click.option("--pv-range", type=RangeArgument(), help='Measurement range of the source, such as "0,400 degC" or "0,16383 counts".')
@click.option("--op-range", type=RangeArgument(), help='Output range of the source, such as "0,100 %" or "0,255 pwm".')
@click.option("--to-pv-range", type=RangeArgument(), help="Measurement range of the target; by default the source's.")
@click.option("--to-op-range", type=RangeArgument(), help="Output range of the target; by default the source's.")
@click.option(
    "--cut-over",
    "now",
    metavar="SP,PV,OP",
    help="Setpoint, measurement and output now, as the old controller shows them: how to change over without a bump.",
)
@click.option(
    "--action",
    type=click.Choice(["reverse", "direct"]),
    help="Action of the loop. Reverse: the output falls when the measurement rises (error SP - PV). Needed where a cut-over "
    "depends on it; where the sign of the gain is the action it is known.",
)
@click.option(
    "--date",
    type=click.DateTime(["%Y-%m-%d"]),
    callback=lambda _ctx, _option, moment: moment and moment.date(),
    metavar="YYYY-MM-DD",
    help="Date of the certificate; by default today.",
)
@click.option("--html", "page", type=OutputArgument(), metavar="FILE.html", help="Write the certificate as a page with plots.")
@vendors_option
@json_option
def command(
    card: str | None,
    values: tuple[str, ...],
    target: str | None,
    fixed: tuple[str, ...],
    word: str | None,
    loop_file: str | None,
    scan: float | tuple[float, float] | None,
    runs_every: float | tuple[float, float] | None,
    compensate: bool,
    mode: str,
    match: str | None,
    process: str | None,
    explain: bool,
    assume: bool,
    allow_approximate: bool,
    digits: int,
    bias: float | None,
    limits: tuple[float, float] | None,
    tag: str,
    pv_range: SignalRange | None,
    op_range: SignalRange | None,
    to_pv_range: SignalRange | None,
    to_op_range: SignalRange | None,
    now: str | None,
    action: str | None,
    date: datetime.date | None,
    page: str | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Convert the settings NAME=VALUE of CARD to another card.

    Values are numbers in the card's unit, or have one: "RESET=20 s/repeat". Prints the target's settings, how near the two
    controllers are, and what will behave differently. Exit status 1 if something has to be answered first, or if the target
    refuses.
    """
    if card is not None and (word is not None or "=" in card):
        values, card = (card, *values), None  # what stands first is a value then
    if word is not None and assume:
        raise click.UsageError("--assume does not go with --from, which chooses no reading; state what is meant")
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
        "options": options, "given": dials, "scan": scan, "runs_every": runs_every, "compensate": compensate, "mode": mode,
        "action": action, "match": match, "digits": digits, **to_ranges,
        "bias": bias, "limits": limits, "allow_approximate": allow_approximate, "assume": assume, "tag": tag,
    }  # fmt: skip
    if loop is not None:
        arguments |= {name: value for name, value in loop.others.items() if not _was_given(name)}
    if process is not None:
        from pidemu.process.process import parse_process

        arguments["process"] = parse_process(process)
    if word is not None:
        source = _only_reading(word, {**given, **ranges}, goal, arguments, target, vendors, as_json)
    else:
        source = load_card(card or "", vendors).settings({**given, **ranges})
    check_outputs({"--html": page}, PidemuError, inputs(loop_file))  # now, and not after the work
    conversion = _converted(source, goal, arguments, as_json)
    plan, not_known = _plan(conversion, now)
    if page is not None:
        from pidemu.report.certificate import write_page

        write_page(page, conversion, plan, date=date)
    if as_json:
        print_json({**conversion.to_dict(date), **_plain_plan(plan, now)})
    else:
        _print(conversion, plan, explain=explain, page=page)
    if not_known is not None:
        echo(f"error: {not_known}", err=True)
        raise SystemExit(1)


def _was_given(name: str) -> bool:
    """Whether an option stands on the command line, so that it counts before the loop file's."""
    return click.get_current_context().get_parameter_source(name) is ParameterSource.COMMANDLINE


def _converted(source: Settings, goal: Card, arguments: dict[str, Any], as_json: bool) -> Conversion:
    """Return the conversion; a question or a refusal is printed, and ends the command."""
    try:
        return convert(source, goal, **arguments)
    except QuestionError as error:
        print_questions(error, source, goal.id, as_json)
    except ConversionRefusedError as error:
        print_refusal(error, source, goal, as_json)
    raise SystemExit(1)


def _print(conversion: Conversion, plan: TransferPlan | None, *, explain: bool, page: str | None) -> None:
    print_conversion(conversion)
    if plan is not None:
        print_plan(plan)
    if explain:
        print_explanation(conversion)
    if page is not None:
        echo(f"\nwritten: {page}")


def _plan(conversion: Conversion, now: str | None) -> tuple[TransferPlan | None, ActionError | None]:
    """Return how to change over, or why that is not known; the conversion itself does not depend on the action."""
    if now is None:
        return None, None
    try:
        return conversion.transfer_plan(*_signals(now)), None
    except ActionError as error:
        return None, error


def _plain_plan(plan: TransferPlan | None, now: str | None) -> dict[str, Any]:
    """Return the cut-over plan as plain values, with the signals that it is for."""
    return {} if plan is None or now is None else {"transfer_plan": {"at": list(_signals(now)), **plan.to_dict()}}


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
    from pidemu.cli.readings import refuse_to_choose
    from pidemu.conversion.ambiguity.readings import readings

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
