"""Signals that were faults once."""

from __future__ import annotations

from tools.fuzz.case import Case
from tools.fuzz.library import examples

_GOOD = "50,50,1,\n60,50,1,\n60,52,1,\n60,54,0,30\n60,56,1,\n"


def corpus() -> dict[str, Case]:
    """Return records with one extreme measurement, for every card."""
    found = {}
    for card, settings in examples().items():
        for name, value in (("1e300", "1e300"), ("minus-1e308", "-1e308"), ("nan", "nan"), ("infinite", "inf"), ("zero", "-0.0")):
            record = f"sp,pv,auto,manual\n{_GOOD}60,{value},1,\n{_GOOD * 3}".encode()
            words = (
                "run",
                card,
                *(settings[0] if settings else ()),
                "--record",
                "record.csv",
                "--scan",
                "1",
                "--action",
                "reverse",
            )
            found[f"{name}-{card.replace('/', '-')}"] = Case(
                (*words, "--engine", "numpy"), {"record.csv": record}, direct=True, limit=6.0
            )
    return found
