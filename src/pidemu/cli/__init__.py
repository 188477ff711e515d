"""The command line. Each command lives in a module of its own, imported when it is called."""

from __future__ import annotations

import gc
import io
import sys
from importlib import import_module
from typing import Final

import click

from pidemu.cli import interrupts, streams
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import CardError, CardNotFoundError, PidemuError, suggest
from pidemu.excerpt import printable

_COMMANDS: Final = {
    "cards": "List the cards, and how sure they are.",
    "show": "Show a card as a data sheet, with its evidence.",
    "check": "Check cards, the built-in ones or those given.",
    "convert": "Convert settings to another card, with a certificate.",
    "run": "Run a card on recorded signals.",
    "compare": "Run cards on the same signals and compare their outputs.",
    "simulate": "Run a card in a closed loop with a process.",
    "cascade": "Run two cards in cascade.",
    "fit": "Fit a process to the record of a bump test.",
    "relay": "Put a relay in place of the controller, and read the oscillation.",
    "optimise": "Find the best settings of a card for a process, within limits.",
    "tune": "Tune a card for a process, by a rule or by all of them.",
    "robustness": "How far gain and dead time may change: the robustness plot.",
    "bode": "A loop over frequency: Bode, Nyquist, gang of four.",
    "fleet": "Run a file of closed loops, on all cores or on a cluster.",
    "retrofit": "Convert a plant's loop lists, every line accounted for.",
    "matrix": "Convert typical settings of every card to every card.",
    "verify": "Compute a signed certificate again, and say what changed.",
    "code": "Print the scan program of a card with its settings.",
    "vectors": "Test vectors of a card, for code in any language.",
}


class _Lazy(click.Group):
    """A group that imports a command when it is called, so that ``--help`` is quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 (click's signature)
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in _COMMANDS:
            return None
        command: click.Command = import_module(f"pidemu.cli.{cmd_name}").command
        gc.enable()
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError:
            raise click.UsageError(
                f"no command '{args[0]}'{suggest(args[0], _COMMANDS)}; commands: {', '.join(_COMMANDS)}", ctx
            ) from None

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # the reader of the pipe had enough
            sys.stdout = None  # nothing to flush at exit
            raise SystemExit(0) from None
        except EOFError as error:  # such as half a file; click would take it for Ctrl-D at a prompt, and end without a word
            raise RuntimeError("a file or stream ended too early") from error
        except KeyboardInterrupt:
            click.echo("interrupted", err=True)
            raise SystemExit(interrupts.status()) from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))


@click.group(cls=_Lazy, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="pidemu", prog_name="pidemu", message="%(prog)s %(version)s")
def cli() -> None:
    """What a PID setting means on whose controller.

    Emulates the PID algorithms of industrial controllers and converts settings between them, with proof.
    Exit status: 0; 1 for a refusal, a question, a wrong card or loop file, a failed check or loop, a changed certificate; 2 for
    options, settings or files that cannot be used; 130 after Ctrl-C, 143 after SIGTERM.
    """


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit.

    Parameters
    ----------
    arguments : list of str, optional
        What follows ``pidemu``; by default what was typed.
    """
    streams.prepare()
    try:
        with interrupts.terminable():
            status = _status(arguments)
        streams.flush()
    except OSError as error:
        status = streams.report(error)
    sys.exit(status if isinstance(status, int) else 0)


def _status(arguments: list[str] | None) -> object:
    """Run the command line and return its exit status."""
    try:
        return cli.main(arguments, prog_name="pidemu", standalone_mode=False)
    except SystemExit as end:
        return end.code
    except click.exceptions.Abort:
        return interrupts.status()
    except click.ClickException as error:
        shown = io.StringIO()
        error.show(shown)
        click.echo(printable(shown.getvalue()), err=True, nl=False)
        return error.exit_code
    except Exception as error:
        return _report(error)


def _report(error: Exception) -> int:
    """Print an error of ours and return the exit status; pass on what is none of ours."""
    if not isinstance(error, PidemuError):
        raise error
    click.echo(printable(f"error: {error}"), err=True)
    failed = isinstance(error, ConversionRefusedError | CardError) and not isinstance(error, CardNotFoundError)
    return 1 if failed else 2
