"""Settings that can be read in several ways: all of them in print, each with its result, and none chosen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, NoReturn

import click

from pidemu.ambiguity.readings import Apart, Reading, apart, command_line
from pidemu.card.load import Card
from pidemu.cli.common import number, print_json
from pidemu.conversion.convert import convert
from pidemu.conversion.request import Request
from pidemu.conversion.result import Conversion
from pidemu.errors import ConversionRefusedError
from pidemu.plain import json_safe
from pidemu.settings import Settings


def refuse_to_choose(
    found: Sequence[Reading],
    goal: Card,
    arguments: Mapping[str, Any],
    *,
    to: str,
    as_json: bool = False,
) -> NoReturn:
    """Print every reading with the result of its conversion, refuse to choose, and exit with status 1.

    Parameters
    ----------
    found : sequence of Reading
        The readings, two at least.
    goal : Card
        The target.
    arguments : mapping
        What else `convert` is to be given, by name.
    to : str
        The target as the user named it, for the commands that state a reading.
    as_json : bool
        Print JSON on stdout, and the refusal alone on stderr.

    Raises
    ------
    SystemExit
        Always, with status 1.
    """
    results = [_result(reading, goal, arguments) for reading in found]
    reason = (
        f"these settings can be read in {len(found)} ways, and nothing given says which is meant; "
        "state it, as the command of each reading does"
    )
    click.echo(f"error: refused: {reason}", err=True)
    commands = [f"pidemu convert {r.command} {command_line(_target_words(to, arguments))}" for r in found]
    if as_json:
        _as_json(found, results, commands, reason)
    else:
        _in_print(found, results, commands)
    raise SystemExit(1)


def _result(reading: Reading, goal: Card, arguments: Mapping[str, Any]) -> Conversion | str:
    try:
        return convert(reading.settings, goal, **arguments)
    except ConversionRefusedError as error:
        return str(error)


def _in_print(found: Sequence[Reading], results: Sequence[Conversion | str], commands: Sequence[str]) -> None:
    for k, (reading, result) in enumerate(zip(found, results, strict=True), start=1):
        click.echo(f"\n{k}. {reading.text}", err=True)
        for text in reading.alike:
            click.echo(f"   or {text}", err=True)
        if isinstance(result, str):
            click.echo(f"   refused: {result}", err=True)
        else:
            click.echo(f"   -> {_dials(result.settings)}", err=True)
            click.echo(f"   {result.verdict}", err=True)
    click.echo(f"\n{_how_far(apart(found))}", err=True)
    click.echo("pidemu does not choose between them. Whoever knows which is meant runs", err=True)
    for k, line in enumerate(commands, start=1):
        click.echo(f"  {k}. {line}", err=True)


def _as_json(found: Sequence[Reading], results: Sequence[Conversion | str], commands: Sequence[str], reason: str) -> None:
    far = apart(found)
    plain = [
        {
            "text": reading.text,
            "alike": list(reading.alike),
            "command": command,
            "conversion": None if isinstance(result, str) else result.to_dict(),
            "refusal": result if isinstance(result, str) else None,
        }
        for reading, result, command in zip(found, results, commands, strict=True)
    ]
    apart_by = {"integral_gain_ratio": far.integral, "max_deviation": far.deviation}
    print_json(json_safe({"verdict": "ambiguous", "reason": reason, "readings": plain, "apart": apart_by}))


def _dials(s: Settings) -> str:
    """Return a target's settings and options in one line."""
    dials = [f"{name} = {number(v.value)} {v.unit}".removesuffix(" 1") for name, v in s.items() if v.active]
    return f"{s.card.id}: {', '.join(dials)}" + (f" [{s.variant.choice_text}]" if s.options else "")


def _how_far(far: Apart) -> str:
    if math.isinf(far.integral):
        return "Not all of them have integral action."
    if far.integral > 1 + 1e-9:
        return f"Their integral gains are apart by a factor of up to {far.integral:.3g}."
    deviation = f"up to {number(float(f'{100 * far.deviation:.2g}'))} %" if far.deviation < 10 else "over 1000 %"
    return f"Their integral gains are the same; their laws for measurement differ by {deviation} in the loop band."


def _target_words(to: str, arguments: Mapping[str, Any]) -> list[str]:
    """Return the target and what else was asked of the conversion as words of the command line."""
    names = {f.name for f in fields(Request)}
    return ["--to", to, *Request(**{n: x for n, x in arguments.items() if n in names and x is not None}).words()]
