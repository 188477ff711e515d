"""The plan for the cut-over, followed step by step on every card."""

from __future__ import annotations

import pidemu
from pidemu import Controller
from pidemu.cutover.plan import transfer_plan
from tests.cutover.bench import OP, PV, SP, WIDE, E, defined, followed, increment, numbers, on_every_card


@on_every_card
def test_following_the_plan_moves_the_output_by_one_increment_of_the_integral_at_most(name: str) -> None:
    for s in defined(pidemu.load_card(name)):
        plan = transfer_plan(s, SP, PV, OP, output_limits=WIDE, action="reverse")
        precision = s.algorithm().arithmetic.type
        # rounding of 24 bits in signals of 50 and terms of a few hundred; one count of the output
        assert plan.resolution <= {"float64": 1e-9, "float32": 1e-3, "integer": 0.011}[precision], s.summary
        bare = not s.algorithm().ki and s.algorithm().transfer.without_integral != "kept"
        assert plan.is_bumpless or bare, s.summary
        if not plan.is_bumpless:
            continue
        u = followed(plan, s)
        grown = increment(s, numbers(plan).get("SP", PV) - PV)
        assert min(abs(u[0] - OP), abs(u[0] - OP - grown)) <= plan.resolution + 1e-12, (s.summary, u, grown)
        assert abs(plan.bump) <= plan.resolution


@on_every_card
def test_what_the_plan_avoids_in_the_first_scan_does_not_come_in_the_second(name: str) -> None:
    for s in defined(pidemu.load_card(name)):
        plan = transfer_plan(s, SP, PV, OP, output_limits=WIDE, action="reverse")
        if plan.is_bumpless:
            u = followed(plan, s, scans=4)
            # with constant signals the integral goes on at one rate, behind a filter on the output at less; counts come singly
            allowed, grown = max(2 * plan.resolution, 1e-9), increment(s, numbers(plan).get("SP", PV) - PV)
            for moved in (u[1] - u[0], u[2] - u[1], u[3] - u[2]):
                assert min(0.0, grown) - allowed <= moved <= max(0.0, grown) + allowed, (s.summary, u)


@on_every_card
def test_without_the_plan_the_output_moves_as_a_plain_switch_to_automatic_shows(name: str) -> None:
    for s in defined(pidemu.load_card(name)):
        plan = transfer_plan(s, SP, PV, OP, output_limits=WIDE, action="reverse")
        ctl = Controller(s, output_limits=WIDE, initial_output=OP)
        if s.algorithm().transfer.start != "running":
            ctl.run(SP, [PV] * 400, auto=False, manual=OP)
        moved = ctl.scan(SP, PV) - OP
        # the integral's own increment is in the scan or not, as the card has it
        error = E if not s.algorithm().setpoint.tracks else 0.0
        shares = [0.0, 0.5, 1.0]
        assert min(abs(moved - plan.without_plan - x * increment(s, error)) for x in shares) <= plan.resolution + 1e-9, s.summary
