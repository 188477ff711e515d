"""Two controllers on every record that Hypothesis can think of, and the shortest one on which they differ."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any, Final, Generic, TypeVar

from hypothesis import HealthCheck, Phase, find
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.errors import HypothesisWarning, NoSuchExample

from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.controller.controller import Controller
from pidemu.errors import PidemuError
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings
from pidemu.testing.adapter import AdapterError, MadeFor, differs, name_of, outputs_of
from pidemu.testing.record import SignalRecord
from pidemu.testing.shown import report
from pidemu.testing.strategies import TestedMode, records, settings

_EXAMPLES: Final = 200
_PART: Final = {"float64": 1e-9, "float32": 1e-5, "integer": 1e-9}
"""The default tolerance, in parts of the width of the output limits: rounding in another order of operations stays far below it."""
_NO_LIMITS: Final = (0.0, 100.0)


class DifferenceError(AssertionError):
    """Two controllers differ; the message tells where, scan by scan.

    Attributes
    ----------
    settings : Settings or None
        The settings with which they do.
    record : SignalRecord
        The shortest record found that shows it.
    expected, found : list of float
        The outputs of pidemu, or of the first controller, and of the other one; shorter than the record where it stopped with an
        error.
    """

    def __init__(
        self, message: str, settings: Settings | None, record: SignalRecord, expected: list[float], found: list[float]
    ) -> None:
        super().__init__(message)
        self.settings, self.record, self.expected, self.found = settings, record, expected, found


T = TypeVar("T")


@dataclass(frozen=True)
class _Pair(Generic[T]):
    """Two ways to compute the outputs of a record with settings, and what counts as a difference."""

    expected: Callable[[T, SignalRecord], list[float]]
    found: Callable[[T, SignalRecord], list[float]]
    tolerance: Callable[[T], float]

    def outputs(self, case: tuple[T, SignalRecord]) -> tuple[list[float], list[float], BaseException | None]:
        """Return the outputs of both, and what the second one raised."""
        ours = self.expected(*case)
        try:
            return ours, self.found(*case), None
        except AdapterError:
            raise
        except Exception as error:
            return ours, [], error

    def differ(self, case: tuple[T, SignalRecord]) -> bool:
        """Tell whether they differ somewhere."""
        ours, theirs, raised = self.outputs(case)
        tolerance = self.tolerance(case[0])
        return raised is not None or any(differs(a, b, tolerance) for a, b in zip(ours, theirs, strict=True))


def assert_equals(
    card: str | Card | Settings,
    my_pid: Any,
    *,
    scan: float | None = None,
    tolerance: float | None = None,
    modes: Sequence[TestedMode] = ("automatic",),
    limits: tuple[float, float] | None = None,
    action: Action = "reverse",
    initial_output: float = 0.0,
    scans: int = 60,
    examples: int = _EXAMPLES,
    seed: int = 0,
) -> None:
    """Assert that a controller of the user's own does, scan by scan, what a card does.

    Hypothesis draws records, and settings where a card is given; what differs is made as short and plain as can be. The same seed
    tries the same records.

    Parameters
    ----------
    card : str, Card or Settings
        A card, whose settings are drawn, or settings.
    my_pid : callable
        What makes a new controller: it is called with those of ``settings``, ``scan``, ``limits``, ``action`` and
        ``initial_output`` that it names, or with the settings where it has one argument of another name. What it returns has a
        method ``scan`` (or ``step``, ``update``), or is itself called, for each scan, with those of ``sp``, ``pv``, ``auto`` and
        ``manual`` that this names, or with setpoint and measurement; with ``modes`` that hold ``"changes"`` it has a method
        ``change(settings)`` as well. A function over whole records is given as ``over_arrays(function)``.
    scan : float, optional
        Scan interval [s]; by default the card's.
    tolerance : float, optional
        How far the outputs may be apart [units of the output]; by default 1e-9 of the width of the output limits, and 1e-5 of it
        for cards whose arithmetic is float32.
    modes : sequence of {"automatic", "manual", "changes"}
        What happens: with ``"manual"`` the loop goes to manual and back, with ``"changes"`` settings change while it runs.
    limits : tuple of float, optional
        Output limits; by default the card's.
    action : {"reverse", "direct"}
        Control action.
    initial_output : float
        Output before the first scan.
    scans : int
        Scans of the longest record.
    examples : int
        How many records are tried at least where none differs.
    seed : int
        Which.

    Raises
    ------
    DifferenceError
        They differ: an `AssertionError` whose message shows the shortest record found, with what pidemu computed in each scan.
    AdapterError
        The controller cannot be made or driven, or returns what is not a number.
    PidemuError
        Card, settings, interval or limits cannot be used.

    Examples
    --------
    >>> import pidemu
    >>> class Mine:
    ...     def __init__(self, settings):
    ...         self.gain = settings["K"].value
    ...     def scan(self, sp, pv):
    ...         return min(max(self.gain * (sp - pv), 0.0), 100.0)
    >>> p_only = pidemu.load_card("generic/standard").settings(K=2, Ti="inf", Td=0)
    >>> assert_equals(p_only, Mine, scan=1.0)
    """
    drawn, known = _settings_of(card)
    example = _plainest(drawn)

    def asked(s: Settings) -> MadeFor:
        return MadeFor(s, scan, limits, action, initial_output)

    def emulated(s: Settings, record: SignalRecord) -> list[float]:
        controller = Controller(s, scan, action, limits, initial_output=initial_output)
        found = []
        for now in record.scans:
            if now.changes is not None:
                controller.change(now.changes)
            found.append(controller.scan(now.sp, now.pv, now.auto, now.manual))
        return found

    def allowed(s: Settings) -> float:
        return _tolerance(s, limits) if tolerance is None else tolerance

    ends = _ends(example, limits)
    changed = settings(known).filter(lambda s: _runs(s, scan))
    signals = records((1, scans), pv_range=example.own_ranges.pv.ends, output_range=ends, modes=modes, changes=changed)
    usable = drawn if isinstance(card, Settings) else drawn.filter(lambda s: _runs(s, scan))
    pair: _Pair[Settings] = _Pair(emulated, lambda s, record: outputs_of(my_pid, asked(s), record), allowed)
    case = _different(pair, st.tuples(usable, signals), examples, seed)
    if case is not None:
        ours, theirs, raised = pair.outputs(case)
        text = report(
            case[0], asked(case[0]), case[1], (ours, theirs), ("pidemu", name_of(my_pid)), pair.tolerance(case[0]), raised
        )
        raise DifferenceError(text, *case, ours, theirs) from raised


def assert_equivalent(
    first: Any,
    second: Any,
    *,
    card: str | Card | Settings | None = None,
    scan: float | None = None,
    tolerance: float = 1e-9,
    modes: Sequence[TestedMode] = ("automatic",),
    limits: tuple[float, float] | None = None,
    action: Action = "reverse",
    initial_output: float = 0.0,
    pv_range: tuple[float, float] = (0.0, 100.0),
    scans: int = 60,
    examples: int = _EXAMPLES,
    seed: int = 0,
) -> None:
    """Assert that two controllers of the user's own do the same, scan by scan.

    Parameters
    ----------
    first, second : callable
        What makes them, as in `assert_equals`.
    card : str, Card or Settings, optional
        Where both are made with settings: these, or drawn ones of a card. Without it ``settings`` is ``None``.
    scan, modes, limits, action, initial_output, scans, examples, seed
        As in `assert_equals`; they are handed on to what makes the controllers.
    tolerance : float
        How far the outputs may be apart.
    pv_range : tuple of float
        What setpoint and measurement lie within.

    Raises
    ------
    DifferenceError
        They differ.
    AdapterError
        A controller cannot be made or driven, or returns what is not a number.
    """
    drawn: st.SearchStrategy[Settings | None] = st.none()
    changed = None
    if card is not None:
        drawn, known = _settings_of(card)
        changed = settings(known)

    def outputs(mine: Any) -> Callable[[Settings | None, SignalRecord], list[float]]:
        return lambda s, record: outputs_of(mine, MadeFor(s, scan, limits, action, initial_output), record)

    signals = records((1, scans), pv_range=pv_range, output_range=limits or _NO_LIMITS, modes=modes, changes=changed)
    pair: _Pair[Settings | None] = _Pair(outputs(first), outputs(second), lambda _: tolerance)
    case = _different(pair, st.tuples(drawn, signals), examples, seed)
    if case is not None:
        ours, theirs, raised = pair.outputs(case)
        text = report(case[0], None, case[1], (ours, theirs), (name_of(first), name_of(second)), tolerance, raised)
        raise DifferenceError(text, *case, ours, theirs) from raised


def _different(
    pair: _Pair[T], cases: st.SearchStrategy[tuple[T, SignalRecord]], examples: int, seed: int
) -> tuple[T, SignalRecord] | None:
    """Return the plainest case found in which two controllers differ."""
    raised: list[AdapterError] = []

    def differ(case: tuple[T, SignalRecord]) -> bool:
        try:
            return pair.differ(case)
        except AdapterError as error:  # told as it is, and not as a case of Hypothesis
            raised.append(error)
            return True

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", HypothesisWarning)  # of its own reports, which nobody sees
            found = find(cases, differ, settings=_searching(examples), random=Random(seed))
    except NoSuchExample:
        return None
    if raised:
        raise raised[-1]
    return found


def _searching(examples: int) -> hypothesis_settings:
    """Return how Hypothesis searches: without a database, a deadline and opinions about health."""
    return hypothesis_settings(
        max_examples=examples,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        phases=(Phase.generate, Phase.shrink),
    )


def _settings_of(card: str | Card | Settings) -> tuple[st.SearchStrategy[Settings], Card]:
    """Return where settings come from, and their card."""
    if isinstance(card, Settings):
        return st.just(card), card.card
    known = load_card(card) if isinstance(card, str) else card
    return settings(known), known


def _plainest(drawn: st.SearchStrategy[Settings]) -> Settings:
    """Return what a strategy shrinks to."""
    return find(drawn, lambda _: True, settings=_searching(5), random=Random(0))


def _runs(s: Settings, scan: float | None) -> bool:
    """Tell whether settings can be run at an interval: some filters are unstable at some."""
    try:
        Controller(s, scan)
    except PidemuError:
        return False
    return True


def _ends(s: Settings, limits: tuple[float, float] | None) -> tuple[float, float]:
    low, high = s.equation.output.limits if limits is None else limits
    return (low, high) if abs(low) < 1e9 and abs(high) < 1e9 else s.own_ranges.op.ends


def _tolerance(s: Settings, limits: tuple[float, float] | None) -> float:
    low, high = _ends(s, limits)
    return _PART[s.algorithm().arithmetic.type] * (high - low)
