"""Start `load-output`: it loads the output into the integral and bumps by its other terms."""

from __future__ import annotations

from pidemu.card.transfer.start import Start


class LoadOutputStart(Start):
    """The integral sum is loaded with the last output and the terms come on top, a bump of `P + D`."""

    word = "load-output"
    meaning = "the integral sum is loaded with the last output and the terms come on top, a bump of `P + D`."
    of_a_controller = "loads the output into the integral and bumps by its other terms"
    at_the_transfer = "the integral is loaded with the last output, {loaded}, and the terms come on top: a bump"
    loads_output = True
