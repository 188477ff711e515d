"""A card's equation in plain text, as a data sheet prints it."""

from __future__ import annotations

from pidemu.card.datasheet.legend import SignalNames, filter_at_work, legend
from pidemu.card.load import Variant
from pidemu.card.model.base import Form, Reference
from pidemu.card.model.card_file import Equation
from pidemu.card.model.terms import Proportional


def equation_heading(variant: Variant) -> str:
    """Return what kind of equation it is, and for which action.

    Parameters
    ----------
    variant : Variant
        The card with its options chosen.
    """
    q = variant.equation
    kind = "from scan to scan" if q.form is Form.DAHLIN else "continuous"
    if not q.action.fixed:
        return f"Equation ({kind}, reverse acting)"
    return f"Equation ({kind}; the error is {q.action.reverse.upper()}, and the sign of the gain decides the action)"


def equation_lines(variant: Variant) -> list[str]:
    """Return the equation, and what its symbols are (specs/equations.md, sections 2, 4 and 8).

    It is continuous and reverse acting. Where there is no choice of action, it has the vendor's error and gain as they stand.

    Parameters
    ----------
    variant : Variant
        The card with its options chosen.
    """
    q = variant.equation
    if q.form is Form.DAHLIN:
        return [f"OUT = D(z) {_bracketed(_shaped(q, SignalNames.of(q).on('error'), 'integral'))}{_feedforward(q)}", *legend(q)]
    lines = [f"OUT = {_sum(q, q.proportional, 'b')}"]
    other = another_structure(q)
    if other is not None:
        lines.append(f"OUT = {_sum(q, other, 'bc')}   in cascade, with a remote SP")
    return [*lines, *_series_lines(q), *legend(q)]


def another_structure(q: Equation) -> Proportional[Reference] | None:
    """Return the proportional term in cascade, where it acts on something else than in automatic."""
    if q.cascade is None:
        return None
    other = q.cascade.proportional
    return None if (other.on, other.weight) == (q.proportional.on, q.proportional.weight) else other


def _sum(q: Equation, proportional: Proportional[Reference], weight: str) -> str:
    s, parallel = SignalNames.of(q), q.form is Form.PARALLEL
    parts = _factored(q, proportional, s, weight) if _as_a_lead(q) else _terms(q, proportional, s, weight)
    total = " + ".join(parts) or "0"
    total = total if parallel else f"K [ {total} ]"
    filt = filter_at_work(q)
    if filt is not None and filt.applies_to == "output":
        total = f"1/(1 + Tf s) {{ {total} }}"
    if q.integral.on == "none" and q.implementation == "positional":
        total += " + bias"
    return total + _feedforward(q)


def _feedforward(q: Equation) -> str:
    if q.feedforward is None:
        return ""
    return " + FF" if q.feedforward.gain == 1 else " + kFF FF"


def _is_series(q: Equation) -> bool:
    return q.form is Form.SERIES and q.derivative.on != "none"


def _as_a_lead(q: Equation) -> bool:
    """Tell whether the derivative of a series form can be written as a lead L on the signals."""
    return _is_series(q) and q.error is None and not q.action.fixed


def _terms(q: Equation, proportional: Proportional[Reference], s: SignalNames, weight: str) -> list[str]:
    parallel, series = q.form is Form.PARALLEL, _is_series(q)
    parts = []
    if proportional.on != "none":
        acts = s.on(proportional.on, weight)
        acts = acts if proportional.on == "pv" else _shaped(q, acts, "proportional")  # P on the measurement is no error
        parts.append(("kp " if parallel else "") + _bracketed(acts))
    if series:
        parts.append("Dx")
    if q.integral.on != "none":
        acts = _shaped(q, s.on("error"), "integral")
        acts = f"({acts} + Dx)" if series else _bracketed(acts)
        parts.append(f"{'ki/s' if parallel else '1/(Ti s)'} {acts}")
    if q.derivative.on != "none" and not series:
        parts.append(f"{'kd' if parallel else 'Td'} {_derivative(q)} {_bracketed(s.on(q.derivative.on, 'c'))}")
    return parts


def _bracketed(acts: str) -> str:
    return acts if acts == "E" or acts.startswith("S(") else f"({acts})"


def _shaped(q: Equation, acts: str, term: str) -> str:
    """Return what a term acts on, with its shape where the term has one (specs/equations.md, section 8)."""
    e = q.error
    return f"S({acts})" if e is not None and e.shape != "linear" and e.on in ("error", term) else acts


def _derivative(q: Equation) -> str:
    filt = q.derivative.filter
    return "s/(1 + Tf s)" if filt is not None and filt.applies_to in ("term", "lead-lag") else "s"


def _factored(q: Equation, proportional: Proportional[Reference], s: SignalNames, weight: str) -> list[str]:
    """Return the terms of the series form with the derivative as a lead L on the signals.

    With ``Dx = (L - 1)(c SP - PV)`` and ``Lc = 1 + c (L - 1)``, P and Dx are together ``(b + Lc - 1) SP - L PV``.
    """
    lead = {"error": "L", "pv": "", "weighted": "Lc"}[q.derivative.on]
    sp = f"{lead} {s.sp}".strip()
    error = f"L ({s.sp} - {s.pv})" if lead == "L" else f"({sp} - L {s.pv})"
    b = {"error": "1", "pv": "0", "weighted": weight}.get(proportional.on, "")
    parts = []
    if b == "1":
        parts.append(error)
    elif b == "0":
        parts.append(f"(({lead} - 1) {s.sp} - L {s.pv})" if lead else f"(-L {s.pv})")
    elif b:
        parts.append(f"(({b} + {lead} - 1) {s.sp} - L {s.pv})" if lead else f"({b} {s.sp} - L {s.pv})")
    if q.integral.on != "none":
        parts.append(f"1/(Ti s) {error}")
    return parts


def _series_lines(q: Equation) -> list[str]:
    if not _is_series(q):
        return []
    filt = q.derivative.filter
    lead_lag = filt is not None and filt.applies_to == "lead-lag"
    if not _as_a_lead(q):
        return [
            f"Dx = {'(Td - Tf)' if lead_lag else 'Td'} {_derivative(q)} {_bracketed(SignalNames.of(q).on(q.derivative.on, 'c'))}"
        ]
    lines = ["L = (1 + Td s)/(1 + Tf s)" if lead_lag else f"L = 1 + Td {_derivative(q)}"]
    return [*lines, "Lc = 1 + c (L - 1)"] if q.derivative.on == "weighted" else lines
