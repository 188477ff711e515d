"""Start `bumpless`: it does not bump."""

from __future__ import annotations

from pidemu.card.transfer.start import Start


class BumplessStart(Start):
    """The first automatic output equals the last output, `I = u - P - D`."""

    word = "bumpless"
    meaning = "the first automatic output equals the last output, `I = u - P - D`."
    of_a_controller = "does not bump"
    at_the_transfer = "bumpless: the integral is set to what the last output leaves for it"
    can_hold = False
    is_bumpless = True
