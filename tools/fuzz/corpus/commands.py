"""Command lines that were faults once."""

from __future__ import annotations

from tools.fuzz.case import Case

_STANDARD = ("generic/standard", "K=1", "Ti=10", "Td=0")
_PROVOX = ("fisher/provox", "GAIN=2", "RESET=4")
_TO = ("--to", "generic/parallel")
_LAG = ("--process", "gain=1,lag=10,delay=1")


def corpus() -> dict[str, Case]:
    """Return the command lines by name."""
    lines: dict[str, tuple[str, ...]] = {
        "loop-gain-of-one-per-scan": (
            "convert", *_STANDARD, *_TO, "--process", "gain=1,integrators=1", "--scan", "1",
        ),
        "pole-at-zero": ("convert", *_STANDARD, *_TO, "--process", "gain=1,pole=0", "--scan", "1"),
        "unstable-process": (
            "convert", *_STANDARD, "--to", "emerson/deltav", "--process", "gain=1,pole=1", "--scan", "1,2",
        ),
        "epid-to-cpid": ("convert", "epics/epid", "KP=1", "KI=6", "--to", "gnc-tools/cpid", "--process", "gain=1,lag=10"),
        "huge-lag": ("convert", *_STANDARD, *_TO, "--process", "gain=1,lag=1e300"),
        "fifty-integrators": ("convert", *_STANDARD, *_TO, "--process", "gain=1,integrators=50"),
        "small-gain": ("convert", *_STANDARD, *_TO, "--process", "gain=1e-308,lag=1"),
        "smallest-gain": ("convert", *_STANDARD, *_TO, "--process", "gain=5e-324,lag=1"),
        "huge-scan": ("convert", *_STANDARD, *_TO, "--scan", "1e300"),
        "smallest-scan": ("convert", *_STANDARD, *_TO, "--scan", "5e-324"),
        "small-derivative-gain": ("convert", "bailey/fc19", "K=1", "KP=1", "KI=1", "KD=1", "MAXDGAIN=1e-300", *_TO),
        "delay-longer-than-the-run": (
            "simulate", *_PROVOX, "--process", "gain=3,delay=4", "--time", "1", "--engine", "numpy",
        ),
        "short-run": ("simulate", *_STANDARD, *_LAG, "--time", "1e-9"),
        "simulated-fifty-integrators": ("simulate", *_STANDARD, "--process", "gain=1,integrators=50", "--time", "10"),
        "simulated-small-gain": ("simulate", *_STANDARD, "--process", "gain=1e-308,lag=1", "--time", "10"),
        "simulated-smallest-gain": ("simulate", *_STANDARD, "--process", "gain=5e-324,lag=1", "--time", "10"),
        "simulated-huge-scan": ("simulate", *_STANDARD, *_LAG, "--scan", "1e300"),
        "simulated-smallest-scan": ("simulate", *_STANDARD, *_LAG, "--scan", "5e-324"),
        "simulated-huge-lag": ("simulate", *_STANDARD, "--process", "gain=1,lag=1e300"),
        "simulated-long-run": ("simulate", *_STANDARD, *_LAG, "--time", "1e12"),
        "setpoint-that-is-no-number": ("simulate", *_STANDARD, *_LAG, "--setpoint", "nan"),
        "limits-upside-down": ("simulate", *_STANDARD, *_LAG, "--limits", "100,0"),
        "disk-full": ("simulate", *_STANDARD, *_LAG, "--time", "10", "-o", "/dev/full"),
        "per-scan": ("show", *_PROVOX, "RATE=1 1/scan"),
        "null-in-a-card-name": ("show", "a/b\x00"),
        "long-card-name": ("show", "a/" + "b" * 300),
        "not-utf-8": ("show", "\udcff.yaml"),
        "escape-in-a-card-name": ("show", "a/\x1b[31mb"),
        "escape-in-a-setting": ("show", *_PROVOX, "R\x1b[2J=1"),
        "escape-in-a-command": ("\x1b[31mshow",),
        "escape-in-an-option": ("show", "--\x1b[31m"),
        "turned-tag": ("convert", *_PROVOX, "--to", "generic/standard", "--tag", "\u202eevil"),
        "escape-in-a-tag": ("convert", *_PROVOX, "--to", "generic/standard", "--tag", "\x1b[31mred"),
        "long-name-to-check": ("check", "a" * 300 + ".yaml"),
        "null-in-the-name-of-a-record": ("compare", *_PROVOX, *_STANDARD, "--record", "x\0.csv"),
        "gain-beyond-floating-point": ("show", "modelica/limpid", "k=7e307"),
        "listed": ("cards",),
        "listed-of-a-hostile-word": ("cards", "\x1b[31m"),
        "matrix-of-two": ("matrix", "generic/standard", "generic/series", "--jobs", "1", "--no-emulation"),
    }  # fmt: skip
    return {name: Case(words, limit=10.0 if words[0] == "matrix" else 2.0) for name, words in lines.items()}
