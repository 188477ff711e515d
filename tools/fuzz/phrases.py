"""What people write behind options and in cells: processes, ranges, scan intervals, limits, steps."""

from __future__ import annotations

from random import Random

from tools.fuzz.vocabulary import UNITS, misspelt, number, plausible, text


def process(rng: Random, hostile: float) -> str:
    """Return a process, such as ``gain=1,lag=10,delay=1``."""
    parts = [f"gain={number(rng, hostile)}"]
    for name, most, share in (("lag", 3, 0.8), ("lead", 2, 0.15), ("delay", 1, 0.6), ("pole", 2, 0.1), ("zero", 1, 0.1)):
        if rng.random() < share:
            parts += [f"{name}={_root(rng, name, hostile)}" for _ in range(rng.randint(1, most))]
    if rng.random() < 0.1:
        parts.append(f"integrators={rng.choice(('1', '1', '2', number(rng, 0.5)))}")
    if rng.random() < hostile:
        parts[rng.randrange(len(parts))] = misspelt(rng, rng.choice(parts))
    if rng.random() < hostile / 4:
        parts.append(rng.choice((text(rng), "lag=1," * 12 + "lag=2", parts[0], "")))
    return ",".join(parts)


def _root(rng: Random, name: str, hostile: float) -> str:
    if name in ("pole", "zero"):
        sign = rng.choice(("-", "-", ""))
        return rng.choice((f"{sign}{plausible(rng)}", f"{sign}0.1+0.2j", f"{sign}1", "0", number(rng, hostile)))
    unit = f" {rng.choice(UNITS)}" if rng.random() < 0.05 + hostile / 4 else ""
    return number(rng, hostile) + unit


def limits(rng: Random, hostile: float) -> str:
    """Return a pair of limits."""
    if rng.random() > hostile:
        return rng.choice(("0,100", "0,100", "-10,110", "20,80", "-100,100", "0,1"))
    return rng.choice((f"{number(rng, 1)},{number(rng, 1)}", "100,0", "0,0", "-inf,inf", "0", "0,1,2", "0;100", text(rng)))


def span(rng: Random, hostile: float) -> str:
    """Return a signal range with its unit."""
    if rng.random() > hostile:
        return rng.choice(
            ("0,100 %", "0,400 degC", "0,16383 counts", "-50,150 degF", "0,100", "32,212 degF", "0,255 pwm", "4,20 mA")
        )
    return rng.choice((limits(rng, 1), f"{limits(rng, 1)} {rng.choice(UNITS)}", f"0,{number(rng, 1)} %", text(rng)))


def time(rng: Random, hostile: float) -> str:
    """Return a time."""
    if rng.random() > hostile:
        return rng.choice(("1", "0.5", "0.1", "2", "500 ms", "1 s", "5", plausible(rng)))
    return f"{number(rng, 1)}{rng.choice(('', ' ', ''))}{rng.choice(UNITS) if rng.random() < 0.5 else ''}"


def scan(rng: Random, hostile: float) -> str:
    """Return one scan interval, or two."""
    return time(rng, hostile) if rng.random() < 0.7 else f"{time(rng, hostile)},{time(rng, hostile)}"


def step(rng: Random, hostile: float) -> str:
    """Return a step: its size, or when it comes and its size."""
    if rng.random() > hostile:
        return rng.choice(("", "5", "-10", "0", "5,10", "2 s,5"))
    return rng.choice((number(rng, 1), f"{time(rng, 1)},{number(rng, 1)}", f"{number(rng, 1)},5", text(rng)))
