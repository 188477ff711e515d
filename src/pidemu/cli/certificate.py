"""How ``pidemu convert`` prints a conversion: settings, verdict, figures, what to watch for."""

from __future__ import annotations

import click

from pidemu.card.load import Card
from pidemu.cli.common import heading, number, print_json, table, wrapped
from pidemu.conversion.certificate import EXACT, Band, Certificate, LoopComparison, PathComparison
from pidemu.conversion.choices import Attempt
from pidemu.conversion.convert import Conversion
from pidemu.conversion.cutover import TransferPlan
from pidemu.errors import ConversionRefusedError
from pidemu.settings import Settings, Value
from pidemu.units import Role


def print_refusal(error: ConversionRefusedError, source: Settings, goal: Card, as_json: bool) -> None:
    """Print why a target refuses, and the nearest settings with their cost."""
    nearest = error.nearest
    if as_json:
        plain = nearest.to_dict() if nearest else {"from": {"card": source.card.id}, "to": {"card": goal.id}}
        print_json({**plain, "verdict": "refused", "reason": str(error)})
    click.echo(f"error: refused: {error}", err=True)
    if nearest is None or as_json:
        return
    band = nearest.certificate.feedback.loop_band
    click.echo("nearest settings, which 'pidemu convert --allow-approximate' gives:", err=True)
    for name, value in nearest.settings.items():
        if value.active:
            click.echo(f"  {name} = {number(value.value)} {_unit(value)}".rstrip(), err=True)
    click.echo(f"their cost: up to {_percent(band.max_deviation)}, {_db(band)}, {_deg(band)} in the loop band", err=True)


def print_conversion(c: Conversion, round_dials: bool) -> None:
    """Print a conversion with its certificate."""
    heading(f"{c.source.card.id}  ->  {c.settings.card.id}")
    _side("From", c.source)
    _target(c)
    heading("\nVerdict")
    wrapped(f"{c.verdict}: {c.sentence}", "  ")
    _figures(c.certificate)
    _rounding(c, round_dials)
    _textbook(c)
    if c.certificate.loop is not None:
        _loop(c.certificate.loop)
    _list("Watch for", c.warnings)
    _list("Read as", (*c.source.notes, *c.settings.notes))
    _list("These settings rest on what is inferred, not stated", c.inferences)
    _list("These settings rest on what nobody says", c.law_assumptions)
    others = len(c.assumptions) - len(c.law_assumptions)
    if others:
        wrapped(
            f"{others} more assumptions concern scan rules, limits and transfers: 'pidemu show' and --json list them.",
            "  ",
        )


def print_plan(plan: TransferPlan) -> None:
    """Print how to change over."""
    heading("\nCut-over")
    for i, step in enumerate(plan.steps, 1):
        wrapped(step.do, f"  {i}. ")
    click.echo(f"  the output then moves by {number(plan.bump)} % of span; without this, by {number(plan.without_plan)} %")
    for note in plan.notes:
        wrapped(note, "  - ")


def print_ranking(c: Conversion) -> None:
    """Print every choice of the target's options, the best first."""
    heading("\nChoices of the options, the best first")
    table(["options", "verdict", "loop band", "setpoint path"], [_ranked(a) for a in c.ranking], right=(2, 3))


def _ranked(a: Attempt) -> list[str]:
    changes = ", ".join(f"{n}={x}" for n, x in a.changed.items()) or "as the card delivers them"
    if a.certificate is None:
        return [changes, "refused", "-", "-"]
    setpoint = a.certificate.setpoint_at_scan or a.certificate.setpoint
    verdict = f"{a.verdict}, scan rules differ" if a.rules_differ else a.verdict
    return [changes, verdict, *(_percent(p.loop_band.max_deviation) for p in (a.certificate.headline, setpoint))]


def _loop(loop: LoopComparison) -> None:
    heading(f"\nThe loop with the process {loop.process}")
    names = (
        "gain margin",
        "phase margin [deg]",
        "delay margin [s]",
        "crossover [rad/s]",
        "Ms",
        "Mt",
        "IAE, load step of 1 % [% s]",
    )
    rows = []
    for name, attribute in zip(names, ("gain_margin", "phase_margin", "delay_margin", "crossover", "Ms", "Mt", "iae"), strict=True):
        rows.append([name, *(number(float(f"{getattr(x, attribute):.4g}")) for x in (loop.source, loop.target))])
    rows.append(["stable", *("yes" if x.stable else "NO" for x in (loop.source, loop.target))])
    table(["", "before", "after"], rows, right=(1, 2))


def _unit(v: Value) -> str:
    return "" if v.unit == "1" else v.unit


def _other_units(v: Value) -> str:
    """Return an integral or gain dial in the other usual unit, so that nobody has to convert in the head."""
    if v.off:
        return "off"
    if v.role is Role.INTEGRAL and "repeat" in v.unit:
        other = "repeat/min" if v.unit == "s/repeat" else "s/repeat"
    elif v.role is Role.INTEGRAL and v.unit in ("s", "min"):
        other = "repeat/min"
    elif v.role in (Role.DERIVATIVE, Role.INTEGRAL) and "min" in v.unit:
        other = v.unit.replace("min", "s")
    elif v.role is Role.GAIN and v.unit == "%":
        other = "%/%"
    else:
        return ""
    return f"= {number(v.to(other))} {other}"


def _side(title: str, s: Settings) -> None:
    heading(f"\n{title}: {s.card.title}" + (f"  [{s.variant.choice_text}]" if s.options else ""))
    rows = [
        [name, number(v.value), _unit(v), _other_units(v), "" if v.given else "card's default"] for name, v in s.items() if v.active
    ]
    table(["", "", "", "", ""], rows, right=(1,))


def _target(c: Conversion) -> None:
    s, book = c.settings, c.textbook.settings
    heading(f"\nTo: {s.card.title}" + (f"  [{s.variant.choice_text}]" if s.options else ""))
    if c.chosen:
        wrapped(f"chosen, as nobody said otherwise: {', '.join(f'{n}={x}' for n, x in c.chosen.items())}; --set decides", "  ")
    rows = []
    for name, v in s.items():
        if v.active:
            rule = number(book[name].value) if book is not None and name in book else "-"
            rows.append([name, number(v.value), _unit(v), _other_units(v), rule])
    table(["", f"{c.match} match", "", "", "textbook rule"], rows, right=(1, 4))


def _figures(c: Certificate) -> None:
    rows = [*_rows("feedback (PV)", c.feedback), *_rows("setpoint", c.setpoint)]
    if c.feedback_at_scan is not None and c.setpoint_at_scan is not None:
        rows += [
            *_rows("feedback, at the scans", c.feedback_at_scan),
            *_rows("setpoint, at the scans", c.setpoint_at_scan),
        ]
    table(["path", "band", "rad/s", "deviation", "gain", "phase"], rows, right=(3, 4, 5))
    _emulation(c)
    if c.setpoint_kick_at_scan is not None:
        first = c.setpoint_kick_at_scan
        click.echo(
            "  setpoint kick, output step in the first scan: "
            f"{number(first.source)} on the source, {number(first.target)} on the target"
        )
        return
    kick = c.setpoint_kick
    click.echo(
        "  setpoint kick (output step per setpoint step, at once): "
        f"{number(kick.source)} on the source, {number(kick.target)} on the target"
    )


def _emulation(c: Certificate) -> None:
    e = c.scan_by_scan
    if e is None:
        return
    scans = f"{number(e.scan[0])} s" if e.scan[0] == e.scan[1] else f"{number(e.scan[0])} s and {number(e.scan[1])} s"
    taken = " (taken, as none was given)" if e.taken else ""
    if e.is_exact:
        wrapped(f"run against each other every {scans}{taken} without limits: the same output, scan by scan", "  ")
        return
    still = "none" if e.is_exact_on_measurement else f"{number(float(f'{e.on_measurement:.2g}'))} %"
    wrapped(
        f"run against each other every {scans}{taken} without limits: outputs differ by up to "
        f"{number(float(f'{e.largest:.2g}'))} % of span ({e.segment}, at {number(e.largest_at)} s; the source moves by "
        f"{number(float(f'{e.size:.3g}'))} %), while the setpoint rests: {still}",
        "  ",
    )


def _rows(title: str, p: PathComparison) -> list[list[str]]:
    out = []
    for name, band in (("loop band", p.loop_band), ("full band", p.full_band)):
        out.append([title, name, f"{band.low:.3g} to {band.high:.3g}", _percent(band.max_deviation), _db(band), _deg(band)])
        title = ""
    return out


def _percent(deviation: float) -> str:
    if deviation < EXACT:
        return "none"
    return f"{number(float(f'{100 * deviation:.2g}'))} %" if deviation < 10 else "over 1000 %"


def _db(band: Band) -> str:
    return f"{band.gain_db:.2f} dB"


def _deg(band: Band) -> str:
    return f"{band.phase_deg:.1f} deg"


def _rounding(conversion: Conversion, asked: bool) -> None:
    c = conversion.certificate
    unknown = [n for n, v in conversion.settings.items() if v.active and v.setting.resolution is None]
    if asked and unknown:
        click.echo(f"  not rounded, since the card states no resolution: {', '.join(unknown)}")
    if not c.dials:
        return
    heading("\nRounded to the dials' resolution")
    table(["", "exact", "rounded"], [[d.name, number(d.exact), number(d.rounded)] for d in c.dials], right=(1, 2))
    before = c.feedback_before_rounding
    if before is not None:
        old, new = before.loop_band.max_deviation, c.feedback.loop_band.max_deviation
        click.echo(f"  deviation in the loop band before rounding: {_percent(old)}, after: {_percent(new)}")


def _textbook(c: Conversion) -> None:
    book = c.textbook
    if book.certificate is None:
        wrapped(f"the textbook rule has no answer: {book.reason}", "  ")
    elif c.match != "textbook" and book.certificate.feedback.loop_band.max_deviation < EXACT:
        click.echo("  the textbook rule gives the same law for measurement")
    elif c.match != "textbook":
        band = book.certificate.feedback.loop_band
        click.echo(
            f"  the textbook rule would deviate by {_percent(band.max_deviation)}, {_db(band)}, {_deg(band)} in the loop band"
        )


def _list(title: str, items: tuple[str, ...]) -> None:
    if items:
        heading(f"\n{title}")
        for item in items:
            wrapped(item, "  - ")
