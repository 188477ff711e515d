"""What every start of a transfer says of itself: the base of the files beside this one."""

from __future__ import annotations

from typing import ClassVar


class Start:
    """What the integral does at the transfer to automatic (specs/equations.md, section 6).

    The file says what the start is. What it does scan by scan stands in the file of the same name in `pidemu.program.transfer`.
    """

    word: ClassVar[str]
    """What a card writes under `transfer.start`."""
    meaning: ClassVar[str]
    """A sentence for the reference of the card language."""
    of_a_controller: ClassVar[str]
    """What a transfer does, as in "PROVOX does not bump"."""
    in_manual: ClassVar[str] = ""
    """What the integral does in manual, after "the output is the operator's"."""
    at_the_transfer: ClassVar[str]
    """What happens at the transfer, as a data sheet has it; ``{loaded}`` is how the output is limited before."""
    can_hold: ClassVar[bool] = True
    """Whether there can be a first scan in which the integral does not grow."""
    loads_output: ClassVar[bool] = False
    """Whether the last output is loaded into the integral."""
    tracks: ClassVar[bool] = False
    """Whether the integral follows the output in manual."""
    runs_on: ClassVar[bool] = False
    """Whether the algorithm runs on in manual, and only its output is not used."""
    clears: ClassVar[bool] = False
    """Whether the integral is zero until the transfer."""
    keeps: ClassVar[bool] = False
    """Whether the integral stands as it stood."""
    is_bumpless: ClassVar[bool] = False
    """Whether the first automatic output is the last output."""
    can_preset: ClassVar[bool] = False
    """Whether the transfer leaves an integral alone that was set by hand."""
