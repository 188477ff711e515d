"""Start `running`: it computes on in manual, so that the output jumps to what it has computed."""

from __future__ import annotations

from pidemu.card.transfer.start import Start


class RunningStart(Start):
    """The algorithm runs on in manual, and only its output is not used."""

    word = "running"
    meaning = "the algorithm runs on in manual, and only its output is not used."
    of_a_controller = "computes on in manual, so that the output jumps to what it has computed"
    in_manual = "; the algorithm runs on, unused"
    at_the_transfer = "the algorithm takes over as it ran: a bump"
    runs_on = True
    can_preset = True
