"""Words of ``pidemu convert`` for every kind of outcome."""

from __future__ import annotations

CONVERSIONS: dict[str, tuple[str, ...]] = {
    "exact, with a condition": ("fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav"),
    "all figures": (
        "fisher/provox", "GAIN=2", "RESET=4", "RATE=6 s", "--to", "emerson/deltav", "--scan", "1,0.5", "--action", "reverse",
        "--process", "gain=1,lag=20,delay=3", "--tag", "TIC-101", "--cut-over", "50,48,40",
    ),
    "compensated": ("fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav", "--scan", "1,0.5", "--compensate"),
    "by mode": ("yokogawa/fieldbus-pid", "GAIN=0.6", "RESET=8", "--to", "emerson/deltav", "--mode", "cascade"),
    "infinite figures": ("generic/standard", "K=2", "Ti=inf", "Td=1", "--to", "emerson/deltav"),
    "nearest settings": ("generic/standard", "K=2", "Ti=10", "Td=4", "--to", "fisher/provox", "--allow-approximate"),
    "assumed": ("honeywell/tdc3000", "K=2", "T1=1", "T2=0.1", "--to", "emerson/deltav", "--assume"),
    "ranges": (
        "generic/standard", "K=2", "Ti=10", "--pv-range", "0,100 bar", "--to", "generic/series", "--to-pv-range", "0,200 bar",
    ),
    "executed at another interval": (
        "generic/standard", "K=2", "Ti=10", "--to", "emerson/deltav", "--scan", "0.2", "--runs-every", "0.1",
    ),
    "integers": (
        "generic/standard", "K=2.1", "Ti=33", "Td=2", "Tf=0.2", "--to", "iec/61131-3-pid", "--scan", "0.5", "--allow-approximate",
    ),
    "options and dials of the target": (
        "fisher/provox", "GAIN=2", "RESET=4", "--to", "emerson/deltav", "--set", "FORM=Standard", "--set", "ALPHA=0.2",
    ),
    "a filter taken into the dials beside": (
        "yokogawa/fieldbus-pid", "GAIN=2", "RESET=60", "RATE=10", "PV_FTIME=2", "--mode", "auto", "--to", "fisher/provox",
    ),
    "a match by name": (
        "generic/standard", "K=2", "Ti=30", "Td=2", "Tf=0.2", "--to", "fisher/provox", "--match", "frequency:0.07rad/s",
    ),
}  # fmt: skip
OTHERS: dict[str, tuple[str, ...]] = {
    "question": ("honeywell/tdc3000", "K=2", "T1=1", "T2=0.1", "--to", "emerson/deltav"),
    "refused": ("generic/standard", "K=2", "Ti=10", "Td=4", "--to", "fisher/provox"),
}
