"""``pidemu verify``."""

from __future__ import annotations

import click

from pidemu.cli.common import echo, heading, json_option, print_json, vendors_option, wrapped
from pidemu.conversion.verify import Verification, verify

_SHOWN = 8
"""Changes of a kind that are printed; ``--json`` has all."""


@click.command("verify", short_help="Compute a signed certificate again, and say what changed.")
@click.argument("certificate", metavar="CERTIFICATE.json")
@vendors_option
@json_option
def command(certificate: str, vendors: tuple[str, ...], as_json: bool) -> None:
    """Compute the certificate that ``pidemu convert --json`` wrote again, and say what changed.

    It holds all that was asked, and the version of each card. Everything else in it is computed and compared: dials (to 1e-6),
    figures (to 1e-4: what computing on another machine may move), options, verdict, conditions and the rest. What is not compared
    is named. Exit status 0 if all is unchanged, 1 if not.
    """
    found = verify(certificate, vendors)
    if as_json:
        print_json(found.to_dict())
    else:
        _print(found)
    raise SystemExit(0 if found.unchanged else 1)


def _print(v: Verification) -> None:
    heading(v.title)
    if v.unchanged:
        wrapped("unchanged: dials, options, verdict, conditions, action, bench check and figures are those of the certificate", "")
        for text in v.versions:
            wrapped(f"though {text}", "  - ")
        _print_not_compared(v)
        return
    echo("changed:")
    shown = {kind: [c for c in v.changes if c.kind == kind] for kind in dict.fromkeys(c.kind for c in v.changes)}
    for kind, changes in shown.items():
        for change in changes[:_SHOWN]:
            wrapped(str(change), "  - ")
        if len(changes) > _SHOWN:
            echo(f"    and {len(changes) - _SHOWN} more of kind '{kind}' (--json lists all)")
    echo("because:")
    for text in v.because:
        wrapped(text, "  - ")
    _print_not_compared(v)


def _print_not_compared(v: Verification) -> None:
    echo("not compared:")
    for text in v.not_compared:
        wrapped(text, "  - ")
