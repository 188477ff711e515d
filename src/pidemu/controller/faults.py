"""What a card does with signals that are not numbers and with intervals that are none (specs/equations.md, section 6)."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from math import isfinite

from pidemu.card.load import Card
from pidemu.card.model.operation import Faults
from pidemu.errors import ScanError
from pidemu.plausible import SIGNAL

_DONE = {"hold": "output held", "propagate": "computed with", "nan": "output NaN", "zero": "output 0"}


def largest_signal(card: Card) -> float:
    """Return the largest size of a signal that a card computes with; a larger one is a bad signal, as NaN and infinity are.

    A program whose code is known does with any finite number what its code does. Of any other controller nobody knows what it does
    with numbers that no signal reaches.
    """
    known = card.verification.class_ in ("V1", "V2")
    return sys.float_info.max if card.data.kind == "software" and known else SIGNAL


def bad_signal(faults: Faults, signals: Mapping[str, float], largest: float) -> str:
    """Return what is wrong with the signals of a scan and what the card does about it; empty where they are numbers.

    Parameters
    ----------
    faults : Faults
        The card's policies.
    signals : mapping
        Signals by the names that people know them by.
    largest : float
        Size up to which a number is a signal.
    """
    found = next(((name, value) for name, value in signals.items() if not abs(value) <= largest), None)
    return "" if found is None else f"{found[0]} is {found[1]}: {_DONE[faults.signal]}"


def usable_interval(faults: Faults, card: str, interval: float) -> tuple[float | None, str]:
    """Return the interval that a card computes with [s], ``None`` where it does nothing, and a remark.

    Parameters
    ----------
    faults : Faults
        The card's policies.
    card : str
        Its id, for the message.
    interval : float
        Time since the last scan [s].

    Raises
    ------
    ScanError
        The interval is negative and the card refuses that.
    """
    if interval < 0 and faults.negative_interval == "refuse":
        raise ScanError(f"{card} refuses a scan interval of {interval:g} s; give a positive one")
    as_zero = interval < 0 and faults.negative_interval == "zero"
    remark = f"interval of {interval:g} s: counted as 0" if as_zero else ""
    h = 0.0 if as_zero else interval
    if (h == 0 and faults.zero_interval == "compute") or (h > 0 and isfinite(h)):
        return h, remark
    return None, f"interval of {interval:g} s: nothing computed, output held"
