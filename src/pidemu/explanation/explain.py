"""``explain``: one controller at its settings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from pidemu.algorithm.model import Algorithm
from pidemu.analysis.open_loop import low_frequency_sign
from pidemu.card.model.base import LARGEST, SMALLEST, Form
from pidemu.card.model.card_file import default_scan
from pidemu.certificate.unverified import facts, unverified_law
from pidemu.errors import ScanError
from pidemu.explanation.dials import dials_of, not_stated, ranges_missing
from pidemu.explanation.forms import Forms, Times, forms_of
from pidemu.explanation.model import Explanation, FilterFacts, Mode
from pidemu.explanation.responses import ramp_of, responses_of
from pidemu.explanation.words import action_sentence, summary_of
from pidemu.plausible import INTERVAL, plausible
from pidemu.settings.settings import Settings


def explain(settings: Settings, scan: float | None = None) -> Explanation:
    """Explain one controller at its settings: gains in every form, filters, kicks, noise gain, and what that rests on.

    Parameters
    ----------
    settings : Settings
        Card, dials and options; with ``pv_range`` and ``op_range`` where gains depend on them.
    scan : float, optional
        Scan interval [s]: kicks and noise gain at it are given too.

    Returns
    -------
    Explanation
        The figures, and the same in words (``text``).

    Raises
    ------
    ScanError
        The scan interval is not a positive number, or a filter is unstable at it.
    SettingError
        The settings do not make a controller.

    Examples
    --------
    J. Beall and M. Coughran, Getting the Converted PID Values Right (2013): from PROVOX, reset in seconds is 60/RESET.

    >>> import pidemu
    >>> e = pidemu.explain(pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4))
    >>> e.forms.standard
    Times(K=2.0, Ti=15.0, Td=0.0)
    >>> print(e.summary.splitlines()[1])
    A 10 % step of PV moves the output by 20 % at once, and then on at 80 % per minute.
    """
    if scan is not None and not 0 < scan < float("inf"):
        raise ScanError(f"scan interval {scan:g} s is not a positive number")
    scan = None if scan is None else plausible("scan interval", scan, INTERVAL, ScanError)
    a = settings.algorithm(scan=scan).linear
    dahlin = a.dahlin is not None
    h = default_scan(settings.equation) if dahlin and scan is None else scan
    lead_lag = settings.equation.form is Form.SERIES and _filter_place(settings) == "lead-lag"
    forms = None if dahlin else forms_of(a, settings.equation.form.value, lead_lag=lead_lag)
    found = Explanation(
        card=settings.card.id,
        title=settings.card.title,
        options=dict(settings.options),
        scan=h,
        gain_unit="output units per PV unit" if len(ranges_missing(settings)) == 2 else "%/%",
        dials=dials_of(settings),
        kind=_kind(a),
        forms=forms,
        filters=tuple(_filters(settings, a, forms)),
        automatic=_mode(a, h),
        cascade=_mode(a.in_cascade, h),
        ramp=None if dahlin else ramp_of(a),
        reverse_with_gains=_reverse_with_gains(settings, a),
        beyond=tuple(settings.algorithm(own_units=True, scan=scan).beyond_the_law),
        not_stated=tuple(not_stated(settings, scan)),
        notes=settings.notes,
        rests_on=facts(unverified_law(settings, rules=scan is not None, action=True)),
    )
    found = replace(found, action=action_sentence(settings, found.reverse_with_gains))
    return replace(found, summary="\n".join(summary_of(found, a)))


def _kind(a: Algorithm) -> str:
    if a.dahlin is not None:
        return "pole cancellation"
    return "".join(letter for letter, gain in (("P", a.kp), ("I", a.ki), ("D", a.kd)) if gain) or "none"


def _mode(a: Algorithm, scan: float | None) -> Mode:
    dahlin = a.dahlin is not None
    return Mode(
        b=a.b if a.kp and not dahlin else None,
        c=a.c if a.kd and not dahlin else None,
        responses=None if dahlin else responses_of(a),
        at_scan=None if scan is None else responses_of(a, scan),
    )


def _reverse_with_gains(settings: Settings, a: Algorithm) -> bool | None:
    sign = low_frequency_sign(a)
    return sign > 0 if settings.equation.action.fixed or sign < 0 else None


def _filter_place(settings: Settings) -> str:
    filt = settings.equation.derivative.filter
    return "" if filt is None else {"term": "derivative"}.get(filt.applies_to, filt.applies_to)


def _filters(settings: Settings, a: Algorithm, forms: Forms | None) -> Iterator[FilterFacts]:
    """Yield the filters at work, that of the derivative first."""
    filt = settings.equation.derivative.filter
    if filt is not None and (a.has_term_filter or a.has_signal_filter):
        own = "standard" if filt.of == "effective-derivative" or not a.series else "series"
        yield FilterFacts(_filter_place(settings), a.Tf, _ratio(a, forms, own), a.filter_order)
    for on, lag in (("measurement", a.measurement.filter), ("error", a.error.filter), ("setpoint", a.setpoint.filter)):
        if lag is not None:
            yield FilterFacts(on, lag.seconds)


def _ratio(a: Algorithm, forms: Forms | None, own: str) -> float | None:
    """Return the filter time per derivative time of a form, where there are both."""
    times: Times | None = None if forms is None else getattr(forms, own)
    ratio = a.Tf / times.Td if times is not None and times.Td else 0.0
    return ratio if SMALLEST <= ratio <= LARGEST else None
