"""Start `tracked`: it lets the integral track the output in manual and goes on from there."""

from __future__ import annotations

from pidemu.card.transfer.start import Start


class TrackedStart(Start):
    """In manual the integral follows the output, and the first automatic scan moves on from there."""

    word = "tracked"
    meaning = (
        "in manual the integral is set every scan to what the output leaves for it, and the first automatic scan moves on from "
        "there."
    )
    of_a_controller = "lets the integral track the output in manual and goes on from there"
    in_manual = "; the integral follows it"
    at_the_transfer = "the integral goes on from where it followed the output"
    can_hold = False
    tracks = True
