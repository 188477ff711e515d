"""Start `zero`: it starts with an integral of zero."""

from __future__ import annotations

from pidemu.card.transfer.start import Start


class ZeroStart(Start):
    """The integral starts at zero."""

    word = "zero"
    meaning = "the integral starts at zero."
    of_a_controller = "starts with an integral of zero"
    in_manual = "; the integral is 0"
    at_the_transfer = "the integral starts at zero: a bump"
    clears = True
    can_preset = True
