"""What a conversion refuses: loops that it cannot judge, and a target that cannot hold what the source held."""

from __future__ import annotations

from pidemu.card.library import cards, load_card
from pidemu.card.load import Card
from pidemu.card.model.base import Form
from pidemu.certificate.scanwise import common_interval
from pidemu.conversion.merit import forgets
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.request import DIGITS, Request
from pidemu.conversion.rounding import rounded
from pidemu.errors import ScanError, SettingError
from pidemu.settings.action import carried_action
from pidemu.settings.settings import Settings, off_values
from pidemu.units import Role


def forgotten_output(source: Settings, settings: Settings, request: Request, factor: float) -> str:
    """Return why a target cannot hold what the source held at a limit; empty where it can, or where an integral makes up for it."""
    if not forgets(source, settings):
        return ""
    reason = f"{settings.card.id} cannot hold the output of a loop without integral action"
    if not settings.algorithm().velocity:
        return f"{reason}: it has no place for a bias, and its output is 0 at SP = PV"
    from pidemu.certificate.limit_shift import limit_shift

    scans = request.scan or (common_interval(source, settings),) * 2
    on_the_block, _ = rounded(settings, request.digits or DIGITS, request.given)  # integer arithmetic runs nothing else
    try:
        shift = limit_shift(source, on_the_block, scans, factor)
    except ScanError:  # it cannot be run at this interval
        return f"{reason}: it counts from its last output, so what a limit cuts off is lost"
    return f"{reason}. {shift.text}" if shift.refuses else ""


def what_holds(settings: Settings) -> tuple[str, ...]:
    """Return what can hold the output of a loop without integral action."""
    from pidemu.certificate.limit_shift import choices_that_hold

    choices = choices_that_hold(settings.card, settings.options)
    options = [f"--set {n}={x} makes {settings.card.id} positional" for choice in choices for n, x in choice.items()]
    vendor = settings.card.id.partition("/")[0]
    blocks = [i for i in cards() if i.startswith(f"{vendor}/") and _holds_a_bias(load_card(i))]
    named = f", such as {' or '.join(blocks)}" if blocks else ""
    return (*options, f"a positional block with a bias holds the output{named}; set the bias to the output at SP = PV")


def _holds_a_bias(card: Card) -> bool:
    """Whether a block is positional and its integral can be switched off."""
    dial = next((s for s in card.data.settings.values() if s.sets == Role.INTEGRAL.value), None)
    return card.data.implementation == "positional" and (dial is None or bool(off_values(dial)))


def refuse_recursions(source: Settings, target: Card) -> None:
    """Refuse cards that have no PID settings."""
    for card in (source.card, target):
        if card.data.form is Form.DAHLIN:
            raise ConversionRefusedError(
                f"{card.id} cancels the pole of a process model and has no PID settings; tune the other card for that process "
                f"instead"
            )


def refuse_positive_feedback(source: Settings, request: Request) -> None:
    """Refuse a process whose sign contradicts the action: with it the loop runs away, and margins say nothing."""
    action = request.action or carried_action(source)
    if request.process is None or action is None:
        return
    needed = "reverse" if request.process.feedback_sign > 0 else "direct"
    if action != needed:
        raise SettingError(
            f"{source.card.id}: {action} acting with the process {request.process.text} is positive feedback: the loop runs away. "
            f"Turn the sign of the process gain, or of the action: this process needs {needed} acting"
        )


def refuse_two_intervals(source: Settings, settings: Settings, request: Request) -> None:
    """Refuse to guess two scan intervals, where dials of both controllers count in scans."""
    both = source.counts_scans and settings.counts_scans
    if request.scan is None and both and source.scan != settings.scan:
        cards = f"{source.card.id} and of {settings.card.id}"
        raise SettingError(f"dials of {cards} count in scans; give both scan intervals, --scan H,H2")
