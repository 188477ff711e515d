"""How lists spell the units of settings, and which spellings can mean two things."""

from __future__ import annotations

import re
from typing import Final, Literal

Setting = Literal["gain", "integral", "derivative"]

_GAIN: Final = {
    "%": "%; PB %; PB; P.B.; %PB; % PB; PB%; Prop band; Xp; Xp %; percent; PB PCT; % band; band; PB (%)",
    "1": "gain; -; none; K; Kp; Kc; 1; dimensionless",
    "%/%": "%/%; %OP/%PV",
    "eu/eu": "eu/eu; EU per EU",
    "%/eu": "%/eu",
}
_INTEGRAL: Final = {
    "repeat/min": "rep/min; rpt/min; R/MIN; repeats/min; repeat/min; RPM; RPTS/MIN; Rpts/Min; reps/min; repeats per minute; "
    "rep./min; "
    "repeats per min; Wdh/min",
    "1/min": "1/min; per minute; min^-1; min-1; /min",
    "repeat/s": "rep/s; rpt/s; repeats/s; repeats/sec; rep/sec; rpt/sec; repeats per second",
    "1/s": "1/s; 1/sec; per second; s^-1; s-1; /s",
    "min/repeat": "min/rep; MIN/RPT; Mins/Rpt; MPR; m/r; min per repeat; minutes per repeat; min/repeat; mins/rep; min/rpt.",
    "min": "min; mins; minutes; minute; MIN; Min.",
    "s": "s; sec; secs; seconds; second; sek; sec.",
    "s/repeat": "s/rep; sec/rep; s/repeat; sec/repeat; sec/rpt; s/rpt; seconds per repeat",
    "ms": "ms; msec",
    "h": "h; hr; hours",
}
_DERIVATIVE: Final = {name: _INTEGRAL[name] for name in ("min", "s", "ms", "h")}
_TABLES: Final[dict[Setting, dict[str, str]]] = {"gain": _GAIN, "integral": _INTEGRAL, "derivative": _DERIVATIVE}
AMBIGUOUS: Final[dict[Setting, dict[str, tuple[str, ...]]]] = {
    "gain": {"p": ("%", "1")},
    "integral": {
        "m": ("min/repeat", "repeat/min"),
        "r": ("repeat/min", "min/repeat"),
        "rep": ("repeat/min", "min/repeat"),
        "reps": ("repeat/min", "min/repeat"),
        "repeats": ("repeat/min", "min/repeat"),
        "rpt": ("repeat/min", "min/repeat"),
        "reset": ("repeat/min", "min/repeat"),
        "ti": ("min/repeat", "s/repeat"),
    },
    "derivative": {"m": ("min", "s")},
}
"""Words that can mean several units."""


def _plain(text: str) -> str:
    return re.sub(r"[\s.]+", "", text.casefold())


_SPELLED: Final = {
    setting: {_plain(word): unit for unit, words in table.items() for word in words.split("; ")}
    for setting, table in _TABLES.items()
}


def unit_of(setting: Setting, text: str) -> str | None:
    """Return the unit that a spelling stands for, as cards write it; ``None`` where none is known.

    Examples
    --------
    >>> unit_of("integral", "Rpts/Min"), unit_of("gain", "PB %"), unit_of("integral", "barg")
    ('repeat/min', '%', None)
    """
    return _SPELLED[setting].get(_plain(text))


def readings_of(setting: Setting, text: str) -> tuple[str, ...]:
    """Return the units that a spelling can stand for: one, several, or none.

    A question mark makes any unit doubtful: beside it stands its reciprocal.

    Examples
    --------
    >>> readings_of("integral", "min?")
    ('min/repeat', 'repeat/min')
    """
    known = unit_of(setting, text)
    if known is not None:
        return (known,)
    bare = re.sub(r"[?~*!]+", "", text).strip()
    several = AMBIGUOUS[setting].get(_plain(bare))
    if several is not None:
        return several
    marked = unit_of(setting, bare) if bare != text.strip() else None
    if marked is None:
        return ()
    return (
        (_per_repeat(marked), _OTHER_WAY.get(marked, marked)) if setting == "integral" else (marked, _OTHER_WAY.get(marked, marked))
    )


_OTHER_WAY: Final = {
    "min": "repeat/min", "min/repeat": "repeat/min", "repeat/min": "min/repeat", "1/min": "min/repeat", "s": "repeat/s",
    "s/repeat": "repeat/s", "repeat/s": "s/repeat", "1/s": "s/repeat", "%": "1", "1": "%", "%/%": "%",
}  # fmt: skip


def _per_repeat(unit: str) -> str:
    return f"{unit}/repeat" if unit in ("min", "s") else unit
