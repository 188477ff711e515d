"""A process model as a line of text, read and written."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from pidemu.errors import ProcessError, UnitError, suggest
from pidemu.excerpt import quoted
from pidemu.formatting import exactly
from pidemu.plausible import plain_number, shown
from pidemu.process.roots import count, poles_of, zeros_of
from pidemu.units import Role, parse_quantity, to_canonical

if TYPE_CHECKING:
    from pidemu.process.process import Process

PERCENT: Final = "%/%"
"""Unit of the gain where measurement and output are in percent of their ranges."""
_NAMES: Final = ("gain", "lag", "lead", "integrators", "delay", "pole", "zero")


def read(text: str) -> tuple[float, list[complex], list[complex], float, str]:
    """Return gain, poles, zeros, dead time and unit of a process in words; see `pidemu.process.process.parse_process`."""
    given: dict[str, list[str]] = {name: [] for name in _NAMES}
    for item in text.split(","):
        name, equals, value = (part.strip() for part in item.partition("="))
        if not equals or not value:
            raise ProcessError(f"'{item.strip()}' in '{text}' is not NAME=VALUE; write for example gain=1.5,lag=10 s,delay=3 s")
        if "=" in value:
            raise ProcessError(
                f"'{quoted(item.strip(), 200)}' is more than one part; separate them by commas, such as gain=1.5,lag=10,delay=3"
            )
        if name not in given:
            raise ProcessError(f"unknown name '{name}' in '{text}'{suggest(name, _NAMES)}; names: {', '.join(_NAMES)}")
        if given[name] and name in ("gain", "integrators", "delay"):
            raise ProcessError(f"{name} comes twice in '{text}'; give it once")
        given[name].append(value)
    if not given["gain"]:
        raise ProcessError(f"'{text}' has no gain; add gain=1.5, for example")
    times = {name: [_seconds(name, value) for value in given[name]] for name in ("lag", "lead", "delay")}
    integrators = count(given["integrators"][0] if given["integrators"] else 0)
    poles = [*poles_of(times["lag"], integrators), *_with_conjugates("pole", given["pole"])]
    zeros = [*zeros_of(times["lead"]), *_with_conjugates("zero", given["zero"])]
    gain, unit = _gain(given["gain"][0])
    return gain, poles, zeros, sum(times["delay"]), unit


def gain_unit(given: Any) -> str:
    """Return the unit of a gain: of the measurement per unit of the output.

    Raises
    ------
    ProcessError
        It is not one unit per another.
    """
    parts = given.replace(" ", "").rsplit("/", 1) if isinstance(given, str) else []
    if parts in (["1"], [""]):
        return PERCENT
    if len(parts) != 2 or not all(parts) or any(c in given for c in ",=\n"):
        raise ProcessError(f"the unit of a process gain is {shown(given)}; give measurement per output, such as %/% or degC/%")
    return "/".join(parts)


def _gain(value: str) -> tuple[float, str]:
    number, _, unit = value.partition(" ")
    try:
        return plain_number(number, words=True), gain_unit(unit)
    except (ValueError, ProcessError):
        pass
    try:  # such as 2%/%, or what is no number at all
        found, known = parse_quantity(value)
    except UnitError as error:
        raise ProcessError(f"gain={value}: {error}") from None
    if known is not None and known.name not in ("1", PERCENT):
        raise ProcessError(f"gain={value}: a process gain is in %/% of the signal ranges; convert it and leave out the unit")
    return found, PERCENT


def _seconds(name: str, value: str) -> float:
    try:
        number, unit = parse_quantity(value)
        return number if unit is None else to_canonical(Role.PROCESS_TIME, number, unit)
    except UnitError as error:
        raise ProcessError(f"{name}={value}: {error}") from None


def _with_conjugates(name: str, values: Sequence[str]) -> list[complex]:
    """Return roots; a complex one whose conjugate is not given brings it along."""
    roots: list[complex] = []
    for value in values:
        try:
            if not value.isascii() or "_" in value:
                raise ValueError
            roots.append(complex(value.replace(" ", "")))
        except ValueError:
            raise ProcessError(f"{name}={value} is not a number [rad/s] such as -0.1 or -0.1+0.2j") from None
    missing = list(roots)
    for r in roots:
        if r.imag and r in missing and r.conjugate() in missing:
            missing.remove(r)
            missing.remove(r.conjugate())
    return roots + [r.conjugate() for r in missing if r.imag]


def written(p: Process) -> str:
    """Return a process as ``--process`` takes it.

    Parameters
    ----------
    p : Process
        The process.

    Examples
    --------
    >>> from pidemu.process.process import Process
    >>> written(Process.from_lags(1.5, lags=[10, 2], integrators=1, delay=3))
    'gain=1.5,lag=10,lag=2,integrators=1,delay=3'
    """
    words = [f"gain={exactly(p.gain)}" + ("" if p.unit == PERCENT else f" {p.unit}")]
    words += [_root(r, "lag", "pole") for r in p.poles if r and r.imag >= 0]
    words += [_root(r, "lead", "zero") for r in p.zeros if r.imag >= 0]
    if p.integrators:
        words.append(f"integrators={p.integrators}")
    if p.delay:
        words.append(f"delay={exactly(p.delay)}")
    return ",".join(words)


def _root(r: complex, time: str, root: str) -> str:
    """Return a root as a time constant where that is the same number, else in the s plane; a complex one brings its conjugate."""
    if r.imag:
        return f"{root}={r.real!r}{r.imag:+}j"
    if r.real and (root == "zero" or r.real < 0):
        for constant in (f"{-1 / r.real:.12g}", repr(-1 / r.real)):
            if -1 / float(constant) == r.real:
                return f"{time}={constant}"
    return f"{root}={r.real!r}"
