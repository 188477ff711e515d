"""Vectors as data: cases with inputs, outputs, states and events; as JSON, as CSV, and under a hash."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pidemu import __version__
from pidemu.controller.signals import Event
from pidemu.errors import PidemuError, ScanError, suggest
from pidemu.excerpt import printable_json, visible
from pidemu.files.reading import reason
from pidemu.files.writing import beside
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings

SCHEMA: Final = "pidemu-vectors-1"
VERSION: Final = 1
"""Version of the standard cases: code that equals them can say so, with the hash."""
INPUTS: Final = ("sp", "pv", "auto", "manual", "cascade", "track", "external_reset", "feedforward", "hold", "interval")
"""Columns of every case, in their order; empty where there is no such signal."""


@dataclass(frozen=True)
class DialChange:
    """Settings that change before a scan.

    Attributes
    ----------
    scan : int
        Before which scan, counted from 0.
    settings : mapping
        New values by name, in the units of the dials.
    """

    scan: int
    settings: Mapping[str, float]


@dataclass(frozen=True)
class VectorCase:
    """One record with what the controller makes of it.

    Attributes
    ----------
    name, about : str
        Its name, and what happens in it.
    inputs : mapping
        CaseSignals by the names of the arguments of `pidemu.Controller.run`; NaN where there is none.
    outputs : tuple of float
        The output of every scan.
    states : mapping
        What the program holds after every scan, by name; NaN where it has no such state.
    events : tuple of Event
        What happened.
    changes : tuple of DialChange
        Changes of settings.
    """

    name: str
    about: str
    inputs: Mapping[str, tuple[float, ...]]
    outputs: tuple[float, ...]
    states: Mapping[str, tuple[float, ...]]
    events: tuple[Event, ...]
    changes: tuple[DialChange, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return {
            **self.pinned(),
            "about": self.about,
            "states": {name: _column(x, absent="nan") for name, x in self.states.items()},
            "events": [
                {"scan": e.scan, "kind": e.kind, "text": e.text, "bump": _word(e.bump), "scans": e.scans} for e in self.events
            ],
        }

    def pinned(self) -> dict[str, Any]:
        """Return what the hash is taken of: what code must be given and what it must give."""
        bad = ("sp", "pv")  # where NaN is what came, and not nothing
        return {
            "name": self.name,
            "inputs": {name: _column(x, absent="nan" if name in bad else None) for name, x in self.inputs.items()},
            "outputs": _column(self.outputs, absent="nan"),
            "changes": [{"scan": c.scan, "settings": dict(c.settings)} for c in self.changes],
        }

    def csv(self) -> str:
        """Return the case as CSV: a column per input, the output, then the states; `pidemu.read_record` reads it, too."""
        lines = [f"# before scan {c.scan}: {' '.join(f'{n}={x!r}' for n, x in c.settings.items())}" for c in self.changes]
        lines.append(",".join([*INPUTS, "output", *(f"state_{name}" for name in self.states)]))
        columns = [self.inputs.get(name) for name in INPUTS]
        for n, output in enumerate(self.outputs):
            cells = ["" if c is None else _cell(c[n], empty=INPUTS[k] not in ("sp", "pv")) for k, c in enumerate(columns)]
            cells += [_cell(output), *(_cell(x[n]) for x in self.states.values())]
            lines.append(",".join(cells))
        return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class VectorSet:
    """Vectors of one controller.

    Attributes
    ----------
    settings : Settings
        Its settings.
    scan : float
        Scan interval [s].
    action : {"reverse", "direct"}
        Control action.
    limits : tuple of float
        Output limits; infinite where there is none.
    precision : {"float64", "float32"}
        What its arithmetic rounds to.
    seed : int
        Seed of the noise.
    cases : tuple of VectorCase
        The cases.
    left_out : mapping
        Why other cases are not there, by name.
    """

    settings: Settings
    scan: float
    action: Action
    limits: tuple[float, float]
    precision: str
    seed: int
    cases: tuple[VectorCase, ...]
    left_out: Mapping[str, str]

    def __getitem__(self, name: str) -> VectorCase:
        found = {case.name: case for case in self.cases}
        if name in self.left_out:
            raise ScanError(f"no case '{name}': {self.left_out[name]}")
        if name not in found:
            raise ScanError(f"no case '{name}'{suggest(name, found)}; cases: {', '.join(found)}")
        return found[name]

    def _head(self) -> dict[str, Any]:
        limits = [x if math.isfinite(x) else None for x in self.limits]
        plain = self.settings.to_dict()
        for dial in plain["settings"].values():
            dial["value"] = _word(dial["value"])
        return {
            "version": VERSION,
            **plain,
            "scan": self.scan,
            "action": self.action,
            "limits": limits,
            "precision": self.precision,
            "seed": self.seed,
        }

    @property
    def hash(self) -> str:
        """SHA-256 of settings, inputs and outputs; states and events explain, and do not count."""
        pinned = {**self._head(), "cases": [case.pinned() for case in self.cases]}
        text = json.dumps(pinned, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, the form of ``vectors.json`` (``specs/vectors.schema.json``)."""
        head = {"schema": SCHEMA, "pidemu": __version__, "hash": self.hash, **self._head()}
        return {**head, "cases": [case.to_dict() for case in self.cases], "left_out": dict(self.left_out)}

    def files(self) -> dict[str, str]:
        """Return the files by name: ``vectors.json``, and a CSV file per case."""
        text = json.dumps(self.to_dict(), ensure_ascii=False, allow_nan=False)
        return {"vectors.json": printable_json(text) + "\n", **{f"{case.name}.csv": case.csv() for case in self.cases}}

    def write(self, folder: str | Path, read: Iterable[str | Path] = ()) -> list[Path]:
        """Write the files into a folder, which is made where it is not there.

        Parameters
        ----------
        folder : path
            Where to.
        read : iterable of path
            Files that must not be written.

        Returns
        -------
        list of Path
            What was written.

        Raises
        ------
        PidemuError
            A file cannot be written.
        """
        read, written = tuple(read), []
        for name, text in self.files().items():
            path = Path(folder) / name
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
            except (OSError, ValueError) as error:
                raise PidemuError(f"{visible(str(path))}: cannot be written: {reason(error)}") from None
            with beside(path, PidemuError, read) as stream:
                stream.write(text)
            written.append(path)
        return written


def _word(x: float) -> float | str:
    """Return a number as JSON holds it."""
    return x if math.isfinite(x) else "nan" if math.isnan(x) else "inf" if x > 0 else "-inf"


def _column(values: Iterable[float], absent: str | None) -> list[float | str | None]:
    return [absent if math.isnan(x) else _word(x) for x in values]


def _cell(x: float, *, empty: bool = False) -> str:
    return "" if empty and math.isnan(x) else repr(float(x))
