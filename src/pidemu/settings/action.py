"""What control action means on a card: the error formula, and the card's own word, bit or sign for it.

The words "direct" and "reverse" mean different things on different products, so nothing here says them without the error that the
output follows (specs/equations.md, section 1).
"""

from __future__ import annotations

from typing import Final, Literal

from pidemu.card.model.card_file import Equation
from pidemu.errors import SettingError
from pidemu.settings.settings import Settings

Action = Literal["reverse", "direct"]

ACTIONS: Final[tuple[Action, Action]] = ("reverse", "direct")
FORMULA: Final[dict[Action, str]] = {"reverse": "SP - PV", "direct": "PV - SP"}
"""The error that the output follows: it rises with it."""
_OTHER: Final[dict[Action, Action]] = {"reverse": "direct", "direct": "reverse"}


def read_action(text: object) -> Action | None:
    """Return an action as it was written, or ``None`` for none.

    Raises
    ------
    SettingError
        It is neither ``"reverse"`` nor ``"direct"``.
    """
    if text is None:
        return None
    for action in ACTIONS:
        if str(text).strip().casefold() == action:
            return action
    raise SettingError(
        f"action is '{text}'; write reverse (the output falls when the measurement rises, error SP - PV) or direct (it rises, "
        "error PV - SP)"
    )


def carried_action(settings: Settings) -> Action | None:
    """Return the action that the sign of the gains carries.

    Parameters
    ----------
    settings : Settings
        The settings, with their gains.

    Returns
    -------
    {"reverse", "direct"} or None
        ``None`` where the card has a switch for the action, and where all gains are zero.
    """
    sign = _sign(settings)
    if not settings.equation.action.fixed or not sign:
        return None
    return "reverse" if sign > 0 else "direct"


def switch_position(settings: Settings, action: Action) -> Action:
    """Return what a card's switch has to stand at, as in ``Controller(action=)``, so that the controller acts as wanted.

    With negative gains it is the other position. Where there is no switch, the action is returned as it is.
    """
    turned = not settings.equation.action.fixed and _sign(settings) < 0
    return _OTHER[action] if turned else action


def acting_alike(target: Settings, factor: float) -> tuple[Action, Action]:
    """Return the actions to run two controllers with so that both act alike.

    Parameters
    ----------
    target : Settings
        The second of the two, whose gains were made from the first one's.
    factor : float
        What the source's gains were multiplied by to give the target's; negative where one of the two is switched to direct.
    """
    if factor > 0:
        return "reverse", "reverse"
    return ("direct", "reverse") if target.equation.action.fixed else ("reverse", "direct")


def action_words(card: Settings | Equation, action: Action) -> str:
    """Return how a card is set to an action, with the error formula.

    Parameters
    ----------
    card : Settings or Equation
        The controller. With settings, negative gains on a card with a switch turn what the switch has to stand at.
    action : {"reverse", "direct"}
        Control action in the ISA sense: reverse acting, the output falls when the measurement rises.

    Returns
    -------
    str
        Such as ``"reverse acting, SP - PV: CA 0"``.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("allen-bradley/logix-pid").settings(KP=2, KI=0.1, PE="independent")
    >>> action_words(s, "direct")
    'direct acting, PV - SP: CA 1'
    >>> action_words(pidemu.load_card("epics/epid").settings(KP=-2), "direct")
    'direct acting, PV - SP: negative KP'
    """
    equation = card.equation if isinstance(card, Settings) else card
    position = switch_position(card, action) if isinstance(card, Settings) else action
    word, formula = equation.action.names[position], FORMULA[action]
    if formula in word:  # the card's own word is the formula
        return f"{action} acting: {word}"
    return f"{action} acting, {formula}: {word}"


def action_line(settings: Settings, action: Action | None = None) -> str:
    """Return the action that is known, or both where it is not, in the card's words.

    Parameters
    ----------
    settings : Settings
        The controller.
    action : {"reverse", "direct"}, optional
        The loop's action. Where the sign of the gains is the action, it is known without.

    Returns
    -------
    str
        Such as ``"reverse acting, SP - PV: CA 0; direct acting, PV - SP: CA 1"``.
    """
    known = action or carried_action(settings)
    return "; ".join(action_words(settings, a) for a in ((known,) if known else ACTIONS))


def check_action(settings: Settings, action: Action | None) -> str:
    """Return what contradicts an action in the sign of the gains; empty where nothing does.

    Parameters
    ----------
    settings : Settings
        The controller.
    action : {"reverse", "direct"} or None
        The action that was stated; ``None``: none was.

    Returns
    -------
    str
        One sentence with both readings.
    """
    carried = carried_action(settings)
    if action is None or carried is None or carried == action:
        return ""
    return (
        f"the action was stated as {action} acting ({FORMULA[action]}), but on {settings.card.id} the sign of the gain is the "
        f"action, and these settings are {action_words(settings, carried)}; give the gains their other sign, or state "
        f"{carried} action"
    )


def _sign(settings: Settings) -> float:
    """Return the sign of the gains, positive where the output falls when the measurement rises; 0 without any."""
    a = settings.algorithm()
    gain = a.dahlin.gain if a.dahlin is not None else a.kp or a.ki or a.kd
    return (gain > 0) - (gain < 0)
