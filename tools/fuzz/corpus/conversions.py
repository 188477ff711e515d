"""Conversions that were faults once."""

from __future__ import annotations

from tools.fuzz.case import Case

_TO = ("--to", "generic/parallel")


def corpus() -> dict[str, Case]:
    """Return the conversions by name, from Python and from the command line."""
    lines = {
        "loop-gain-of-one-per-scan": ("K=1", "Ti=10", *_TO, "--process", "gain=1,integrators=1", "--scan", "1"),
        "pole-at-zero": ("K=1", "Ti=10", *_TO, "--process", "gain=1,pole=0", "--scan", "1"),
        "unstable-process": ("K=1", "Ti=10", "--to", "emerson/deltav", "--process", "gain=1,pole=1", "--scan", "1,2"),
        "small-gain": ("K=1e-308", "Ti=10", *_TO),
        "smallest-gain": ("K=5e-324", "Ti=10", *_TO),
        "huge-gain": ("K=1e300", "Ti=10", *_TO),
        "smallest-time": ("K=1", "Ti=5e-324", *_TO),
        "huge-time": ("K=1", "Ti=1e300", *_TO),
        "fifty-integrators": ("K=1", "Ti=10", *_TO, "--process", "gain=1,integrators=50"),
        "small-process": ("K=1", "Ti=10", *_TO, "--process", "gain=1e-308,lag=1"),
        "huge-lag": ("K=1", "Ti=10", *_TO, "--process", "gain=1,lag=1e300"),
        "smallest-scan": ("K=1", "Ti=10", *_TO, "--scan", "5e-324"),
        "huge-scan": ("K=1", "Ti=10", *_TO, "--scan", "1e300"),
    }
    lines["action-against-default-gains"] = ("--to", "generic/standard", "--action", "direct")
    both = ((name, words, direct) for name, words in lines.items() for direct in (False, True))
    return {
        f"{name}{'-from-python' if direct else ''}": Case(
            ("convert", "simple-pid/simple-pid" if "default-gains" in name else "generic/standard", *words), direct=direct
        )
        for name, words, direct in both
    }
