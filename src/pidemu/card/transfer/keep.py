"""Start `keep`: it keeps the integral as it stood."""

from __future__ import annotations

from pidemu.card.transfer.start import Start


class KeepStart(Start):
    """The integral stands as it stood."""

    word = "keep"
    meaning = "the integral stands as it stood."
    of_a_controller = "keeps the integral as it stood"
    in_manual = "; the integral stands still"
    at_the_transfer = "the integral goes on from where it stood: a bump"
    keeps = True
    can_preset = True
