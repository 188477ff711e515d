"""Random processes, and what python-control makes of them."""

from __future__ import annotations

import math
from typing import Any

import control
from hypothesis import strategies as st

from pidemu.process.process import Process

sizes = st.floats(0.02, 5)
pairs = st.builds(lambda size, z: size * complex(-z, math.sqrt(1 - z * z)), sizes, st.floats(0.05, 0.95))


@st.composite
def processes(draw: st.DrawFn) -> Process:
    """Stable or integrating processes of up to four poles, without dead time."""
    upper = draw(st.lists(pairs, max_size=1))
    real = draw(st.lists(sizes.map(lambda x: -x) | st.just(0.0), min_size=1, max_size=2))
    zeros = draw(st.lists(sizes.map(lambda x: -x) | sizes, max_size=len(real) - 1))
    poles = [*real, *(x for p in upper for x in (p, p.conjugate()))]
    return Process(draw(sizes | sizes.map(lambda x: -x)), poles, zeros)


def transfer_function(p: Process) -> Any:
    return control.tf(list(p.rational.num[::-1]), list(p.rational.den[::-1]))
