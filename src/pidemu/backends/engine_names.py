"""The names of the engines, for those that ask for one and need none of them yet."""

from __future__ import annotations

from typing import Final, Literal, get_args

Engine = Literal["python", "numpy", "numba", "c"]
ENGINES: Final[tuple[Engine, ...]] = get_args(Engine)
