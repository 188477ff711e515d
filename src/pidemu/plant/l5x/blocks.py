"""A PID tag or a PIDE block by its members: settings, options, range, action; by name, or by position in L5K text."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

from pidemu.plant.l5x.literals import Positional, read_real, read_word, shortest
from pidemu.plant.l5x.tree import L5xElement
from pidemu.settings.action import Action

Block = Literal["PID", "PIDE"]
BLOCK_TYPES: Final[Mapping[str, Block]] = {"PID": "PID", "PID_ENHANCED": "PIDE"}
"""Block by data type."""
CARDS: Final[Mapping[Block, str]] = {"PID": "allen-bradley/logix-pid", "PIDE": "allen-bradley/pide"}
_BITS: Final = {
    "EN": 31, "CT": 30, "CL": 29, "PVT": 28, "DOE": 27, "SWM": 26, "CA": 25, "MO": 24, "PE": 23, "NDF": 22, "NOBC": 21, "NOZC": 20,
    "INI": 15, "SPOR": 14, "OLL": 13, "OLH": 12, "EWD": 11, "DVNA": 10, "DVPA": 9, "PVLA": 8, "PVHA": 7,
}  # fmt: skip
"""Bits of CTL: the control word of a PID tag."""
_DECIDING: Final = ("CL", "DOE", "SWM", "CA", "MO", "PE", "NDF", "NOBC", "NOZC")
"""Bits that are set by a person; the others change while the block runs."""
_REALS: Final = [
    "SP",
    "KP",
    "KI",
    "KD",
    "BIAS",
    "MAXS",
    "MINS",
    "DB",
    "SO",
    "MAXO",
    "MINO",
    "UPD",
    "PV",
    "ERR",
    "OUT",
    "PVH",
    "PVL",
    "DVP",
    "DVN",
    "PVDB",
    "DVDB",
    "MAXI",
    "MINI",
    "TIE",
    "MAXCV",
    "MINCV",
    "MINTIE",
    "MAXTIE",
]
_DATA: Final = 17
_GAINS: Final[Mapping[Block, tuple[str, ...]]] = {"PID": ("KP", "KI", "KD"), "PIDE": ("PGain", "IGain", "DGain")}


@dataclass
class BlockValues:
    """What a block is set to.

    Attributes
    ----------
    settings : dict of str to float or None
        Gains by member; ``None`` for what is no number.
    options : dict of str to str
        Options of the card.
    pv_range : tuple of float
        The measurement's range [its units].
    limits : tuple of float
        Output limits [%].
    action : str
        ``reverse`` or ``direct``.
    update, setpoint : float or None
        The interval that a PID computes with [s], and its setpoint.
    timing : int
        Timing mode of a PIDE.
    oversample, rts : float
        Its OversampleDT and RTSTime [s].
    cascade : bool
        Whether the tag says that it is the inner loop of a cascade.
    deadband : float
        Deadband of the error.
    fault : str
        What is wrong: ``not-a-number``, ``bits-contradict-CTL``, ``no-members``; empty where nothing is.
    why : str
        The same in a sentence.
    """

    settings: dict[str, float | None] = field(default_factory=dict)
    options: dict[str, str] = field(default_factory=dict)
    pv_range: tuple[float, float] = (0.0, 100.0)
    limits: tuple[float, float] = (0.0, 100.0)
    action: Action = "reverse"
    update: float | None = None
    setpoint: float | None = None
    timing: int = 0
    oversample: float = 0.0
    rts: float = 0.0
    cascade: bool = False
    deadband: float = 0.0
    fault: str = ""
    why: str = ""


def from_structure(block: Block, structure: L5xElement) -> BlockValues:
    """Return the values of a block whose members stand with their names."""
    texts = {m.get("Name"): m.get("Value") for m in structure.children if m.name == "DataValueMember"}
    return _values(block, texts)


def from_position(values: list[Positional]) -> BlockValues:
    """Return the values of a PID tag whose members stand by position, the bits in CTL alone."""
    texts = {name: str(value) for name, value in zip(("CTL", *_REALS), values, strict=False)}
    return _values("PID", texts)


def is_pid_shaped(values: Positional) -> bool:
    """Whether values by position are those of a PID tag: CTL, 28 numbers, and an array of 17."""
    if not isinstance(values, list) or len(values) != len(_REALS) + 2 or any(isinstance(v, list) for v in values[:-1]):
        return False
    last = values[-1]
    return isinstance(last, list) and len(last) == _DATA


def _values(block: Block, texts: Mapping[str, str]) -> BlockValues:
    gains = _GAINS[block]
    missing = [name for name in gains if name not in texts]
    if missing:
        return BlockValues(fault="no-members", why=f"no {', '.join(missing)}")
    found = BlockValues()
    numbers, bad = _numbers(texts, (*gains, *_NUMBERS[block]))
    found.settings = {name: numbers.get(name) for name in gains}
    if block == "PID":
        _read_pid(found, texts, numbers)
    else:
        _read_pide(found, texts, numbers)
    wrong = [name for name in bad if name in (*gains, *_NEEDED[block])]
    if wrong and not found.fault:
        found.fault = "not-a-number"
        found.why = ", ".join(f"{name} is '{texts[name]}'" for name in wrong)
    return found


_NUMBERS: Final[Mapping[Block, tuple[str, ...]]] = {
    "PID": ("SP", "MAXS", "MINS", "MAXO", "MINO", "UPD", "DB"),
    "PIDE": (
        "PVEUMax", "PVEUMin", "CVHLimit", "CVLLimit", "CVROCLimit", "OversampleDT", "RTSTime", "TimingMode", "SP", "ZCDeadband",
    ),
}  # fmt: skip
_NEEDED: Final[Mapping[Block, tuple[str, ...]]] = {"PID": ("MAXS", "MINS", "UPD"), "PIDE": ("PVEUMax", "PVEUMin")}


def _numbers(texts: Mapping[str, str], names: Iterable[str]) -> tuple[dict[str, float], list[str]]:
    """Return the members that are numbers, and the names of those that are none."""
    found: dict[str, float] = {}
    bad = []
    for name in names:
        if name not in texts:
            continue
        try:
            value = read_real(texts[name])
        except ValueError:
            value = math.nan
        if math.isfinite(value):
            found[name] = shortest(value)
        else:
            bad.append(name)
    return found, bad


def _read_pid(found: BlockValues, texts: Mapping[str, str], numbers: Mapping[str, float]) -> None:
    try:
        word = read_word(texts["CTL"]) if "CTL" in texts else None
    except ValueError:
        found.fault, found.why = "not-a-number", f"CTL is '{texts['CTL']}'"
        return
    named = {name: texts[name].strip() in ("1", "true") for name in _BITS if name in texts}
    bits = {name: bool(word >> place & 1) for name, place in _BITS.items()} if word is not None else {}
    against = [name for name in _DECIDING if name in named and name in bits and named[name] != bits[name]]
    bits |= named
    if against:
        found.fault = "bits-contradict-CTL"
        found.why = f"{', '.join(against)} contradict CTL, {texts['CTL']}"
    elif "PE" not in bits:
        found.fault, found.why = "no-members", "neither CTL nor PE"
    else:
        found.options = {
            "PE": "dependent" if bits["PE"] else "independent",
            "DOE": "error" if bits.get("DOE") else "PV",
            "NDF": "on" if bits.get("NDF") else "off",
        }
    found.action = "direct" if bits.get("CA") else "reverse"
    found.cascade = bits.get("CL", False)
    found.pv_range = (numbers.get("MINS", 0.0), numbers.get("MAXS", 100.0))
    low, high = numbers.get("MINO", 0.0), numbers.get("MAXO", 100.0)
    found.limits = (0.0, 100.0) if low == high else (low, high)
    found.update, found.setpoint, found.deadband = numbers.get("UPD"), numbers.get("SP"), numbers.get("DB", 0.0)


def _read_pide(found: BlockValues, texts: Mapping[str, str], numbers: Mapping[str, float]) -> None:
    for name in ("DependIndepend", "PVEProportional", "PVEDerivative", "DSmoothing"):
        default = "true" if name == "PVEDerivative" else "false"
        found.options[name] = {"1": "true", "0": "false"}.get(texts.get(name, "").strip(), default)
    found.action = "direct" if texts.get("ControlAction", "0").strip() == "1" else "reverse"
    found.pv_range = (numbers.get("PVEUMin", 0.0), numbers.get("PVEUMax", 100.0))
    found.limits = (numbers.get("CVLLimit", 0.0), numbers.get("CVHLimit", 100.0))
    if numbers.get("CVROCLimit"):
        found.settings["CVROCLimit"] = numbers["CVROCLimit"]
    found.timing = int(numbers.get("TimingMode", 0))
    found.oversample, found.rts = numbers.get("OversampleDT", 0.0), numbers.get("RTSTime", 0.0) / 1000
    found.setpoint, found.deadband = numbers.get("SP"), numbers.get("ZCDeadband", 0.0)
