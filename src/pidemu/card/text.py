"""A card's equation in plain text, as a data sheet prints it."""

from __future__ import annotations

from pidemu.card.load import Variant
from pidemu.card.models import Equation, Filter, Form


def equation_lines(variant: Variant) -> list[str]:
    """Return the continuous equation, reverse acting, and what its symbols are (specs/equations.md, section 2).

    Parameters
    ----------
    variant : Variant
        The card with its options chosen.
    """
    q = variant.equation
    lines = [f"OUT = {_sum(q)}"]
    lines += _filter_lines(q)
    lines += _symbol_lines(q)
    return lines


def _signal(on: str, weight: str, pv: str) -> str:
    return {"error": f"(SP - {pv})", "pv": f"(-{pv})", "weighted": f"({weight} SP - {pv})"}[on]


def _derivative(q: Equation) -> str:
    filt = q.derivative.filter
    return "s/(1 + Tf s)" if filt is not None and filt.applies_to == "term" else "s"


def _pv(q: Equation) -> str:
    filt = q.derivative.filter
    return "PVf" if filt is not None and filt.applies_to == "measurement" else "PV"


def _sum(q: Equation) -> str:
    pv = _pv(q)
    if q.form is Form.SERIES and q.derivative.on != "none":
        total = _series(q, pv)
    else:
        parts = []
        parallel = q.form is Form.PARALLEL
        if q.proportional.on != "none":
            parts.append(("kp " if parallel else "") + _signal(q.proportional.on, "b", pv))
        if q.integral.on != "none":
            parts.append(f"{'ki/s' if parallel else '1/(Ti s)'} (SP - {pv})")
        if q.derivative.on != "none":
            parts.append(f"{'kd' if parallel else 'Td'} {_derivative(q)} {_signal(q.derivative.on, 'c', pv)}")
        total = " + ".join(parts)
        total = total if parallel else f"K [ {total} ]"
    filt = q.derivative.filter
    return f"1/(1 + Tf s) {{ {total} }}" if filt is not None and filt.applies_to == "output" else total


def _series(q: Equation, pv: str) -> str:
    lead = {"error": ("L SP", f"L {pv}"), "pv": ("SP", f"L {pv}"), "weighted": ("Lc SP", f"L {pv}")}
    sp, measured = lead[q.derivative.on]
    parts = []
    if q.proportional.on != "none":
        weighted = {"error": sp, "pv": sp if q.derivative.on != "pv" else "", "weighted": f"b {sp}"}[q.proportional.on]
        if q.proportional.on == "weighted" and q.derivative.on == "weighted":
            weighted = "(b + Lc - 1) SP"
        parts.append(f"({weighted} - {measured})" if weighted else f"(-{measured})")
    if q.integral.on != "none":
        parts.append(f"1/(Ti s) ({sp} - {measured})")
    return f"K [ {' + '.join(parts)} ]"


def _filter_lines(q: Equation) -> list[str]:
    if q.derivative.on == "none":
        return []
    filt = q.derivative.filter
    lines = []
    if q.form is Form.SERIES:
        lead_lag = filt is not None and filt.applies_to == "lead-lag"
        lead = "(1 + Td s)/(1 + Tf s)" if lead_lag else f"1 + Td {_derivative(q)}"
        lines.append(f"L = {lead}")
        if q.derivative.on == "weighted":
            lines.append("Lc = 1 + c (L - 1)")
    if filt is not None:
        if filt.applies_to == "measurement":
            lines.append(f"PVf = PV/(1 + Tf s{' + Tf^2 s^2/2' if filt.order == 2 else ''})")
        lines.append(f"Tf = {_filter_time(filt, q)}")
    return lines


def _filter_time(filt: Filter, q: Equation) -> str:
    time = "kd dial" if q.form is Form.PARALLEL else "Td"
    if filt.of == "effective-derivative":
        time = "Ti Td/(Ti + Td)"
    if filt.time is not None:
        return f"{filt.time} s" if isinstance(filt.time, float) else filt.time
    if filt.ratio is not None:
        return f"{filt.ratio:g} {time}" if isinstance(filt.ratio, float) else f"{filt.ratio} x {time}"
    return f"{time} / {filt.gain:g}" if isinstance(filt.gain, float) else f"{time} / {filt.gain}"


def _symbol_lines(q: Equation) -> list[str]:
    parallel = q.form is Form.PARALLEL
    symbols = {
        "gain": "kp" if parallel else "K",
        "integral": "ki" if parallel else "Ti",
        "derivative": "kd" if parallel else "Td",
    }
    multiplier = next((n for n, s in q.settings.items() if s.sets == "multiplier"), None)
    lines = []
    for name, s in q.settings.items():
        if s.sets in symbols:
            value = f"{multiplier} x {name}" if multiplier and (parallel or s.sets == "gain") else name
            lines.append(f"{symbols[s.sets]} from {value} [{s.unit}]")
    for term, symbol in ((q.proportional, "b"), (q.derivative, "c")):
        if term.on == "weighted":
            lines.append(f"{symbol} = {term.weight if isinstance(term.weight, str) else f'{term.weight:g}'}")
    return lines
