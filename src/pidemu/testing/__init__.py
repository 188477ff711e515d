"""Test your own controller against a card: strategies for Hypothesis, comparisons that shrink a difference, a pytest plugin.

Names are imported when first used; the strategies and the comparisons need Hypothesis (``pip install 'pidemu[testing]'``).

- `strategies`: `cards`, `settings`, `records`, `processes`
- `comparison`: `assert_equals`, `assert_equivalent`, and the `DifferenceError` that they raise
- `adapter`: how a controller of yours is made and driven, scan by scan or over arrays (`over_arrays`)
- `plugin`: the marker, fixtures and options for pytest
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from pidemu.testing.adapter import AdapterError, over_arrays
    from pidemu.testing.comparison import DifferenceError, assert_equals, assert_equivalent
    from pidemu.testing.record import ScanSignals, SignalRecord
    from pidemu.testing.strategies import cards, processes, records, settings

_HOMES: Final = {
    "AdapterError": "adapter",
    "over_arrays": "adapter",
    "DifferenceError": "comparison",
    "assert_equals": "comparison",
    "assert_equivalent": "comparison",
    "ScanSignals": "record",
    "SignalRecord": "record",
    "cards": "strategies",
    "processes": "strategies",
    "records": "strategies",
    "settings": "strategies",
}

__all__ = [
    "AdapterError",
    "DifferenceError",
    "ScanSignals",
    "SignalRecord",
    "assert_equals",
    "assert_equivalent",
    "cards",
    "over_arrays",
    "processes",
    "records",
    "settings",
]


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'pidemu.testing' has no attribute '{name}'")
    try:
        value = getattr(import_module(f"pidemu.testing.{home}"), name)
    except ModuleNotFoundError as error:
        if error.name != "hypothesis":
            raise
        raise ImportError(f"pidemu.testing.{name} needs Hypothesis: pip install 'pidemu[testing]'") from error
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
