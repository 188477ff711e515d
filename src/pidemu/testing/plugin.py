"""The pytest plugin: a marker that names card and settings, fixtures that compare with them, and how hard to look.

::

    @pytest.mark.pidemu("emerson/deltav", GAIN=2, RESET=10, scan=0.5)
    def test_my_block(pidemu_equals):
        pidemu_equals(MyBlock)
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import pytest

if TYPE_CHECKING:
    from pidemu.controller.controller import Controller
    from pidemu.settings.settings import Settings

_MARKER: Final = "pidemu(card, *, scan=..., tolerance=..., modes=..., limits=..., action=..., initial_output=..., NAME=VALUE...)"
_ABOUT: Final = (
    "the card, and the settings if any are given, that the fixtures pidemu_equals, pidemu_settings and pidemu_controller take; "
    "the other arguments are those of pidemu.testing.assert_equals"
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--pidemu-examples``."""
    parser.getgroup("pidemu").addoption(
        "--pidemu-examples",
        type=int,
        default=None,
        metavar="N",
        help="How many records each comparison with a card tries at least; by default 200.",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line("markers", f"{_MARKER}: {_ABOUT}")
    if (given := config.getoption("--pidemu-examples")) is not None and given < 1:
        raise pytest.UsageError(f"--pidemu-examples {given}: give a number of records from 1 on")


@pytest.fixture
def pidemu_equals(request: pytest.FixtureRequest) -> Callable[..., None]:
    """A function that asserts that a controller equals the marker's card: `pidemu.testing.assert_equals` with what it says."""
    card, asked = _said(request)
    examples = request.config.getoption("--pidemu-examples")

    def equals(my_pid: Any, **more: Any) -> None:
        __tracebackhide__ = True
        from pidemu.testing import assert_equals

        assert_equals(card, my_pid, **({} if examples is None else {"examples": examples}) | asked | more)

    return equals


@pytest.fixture
def pidemu_settings(request: pytest.FixtureRequest) -> Settings:
    """The settings that the marker gives."""
    from pidemu.settings.settings import Settings

    card, _ = _said(request)
    if not isinstance(card, Settings):
        raise pytest.UsageError(
            f'{request.node.nodeid}: the marker gives no settings; write @pytest.mark.pidemu("{card}", NAME=VALUE)'
        )
    return card


@pytest.fixture
def pidemu_controller(request: pytest.FixtureRequest, pidemu_settings: Settings) -> Controller:
    """The emulated controller of the marker, before its first scan."""
    from pidemu.controller.controller import Controller

    _, asked = _said(request)
    given = {"scan": "scan", "action": "action", "output_limits": "limits", "initial_output": "initial_output"}
    return Controller(pidemu_settings, **{name: asked[word] for name, word in given.items() if word in asked})


def _said(request: pytest.FixtureRequest) -> tuple[Any, dict[str, Any]]:
    """Return the marker's card, or settings where it gives any, and what else it says."""
    from pidemu.card.library import load_card
    from pidemu.testing import assert_equals

    marker = request.node.get_closest_marker("pidemu")
    if marker is None or len(marker.args) != 1:
        raise pytest.UsageError(
            f'{request.node.nodeid}: name the card, such as @pytest.mark.pidemu("emerson/deltav", GAIN=2, scan=0.5)'
        )
    keywords = {p.name for p in inspect.signature(assert_equals).parameters.values() if p.kind is p.KEYWORD_ONLY}
    asked = {name: x for name, x in marker.kwargs.items() if name in keywords}
    dials = {name: x for name, x in marker.kwargs.items() if name not in keywords}
    card = marker.args[0]
    if not dials:
        return card, asked
    return (load_card(card) if isinstance(card, str) else card).settings(dials), asked
