"""``pidemu retrofit``."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from pidemu.cli.common import OutputArgument, echo, heading, json_option, print_json, table, wrapped
from pidemu.cli.inputs import inputs
from pidemu.errors import ListError
from pidemu.excerpt import printable_json, visible
from pidemu.files.outputs import check_outputs
from pidemu.files.tables import write_table
from pidemu.files.writing import beside

if TYPE_CHECKING:
    from pidemu.plant.decisions import Decisions
    from pidemu.plant.job import RetrofitResult
    from pidemu.plant.mapping import PlantWords
    from pidemu.plant.rules import PlantRules

_FILES: Final = {
    "job.json": "the whole job, for programs",
    "converted.csv": "the converted loops",
    "decisions.csv": "what people have to decide; fill in answer, name, date and reason, and give it back with --decisions",
    "errors.csv": "what cannot be read",
    "skipped.csv": "the other lines of the lists",
    "exceptions.txt": "what needs a person, the greatest risk first",
    "workbook.xlsx": "all of it, for the configuration team",
}
_SHOWN: Final = 10
_MANY: Final = 100
"""Loops from which on the progress is shown."""


@click.command("retrofit", short_help="Convert a plant's loop lists, every line accounted for.")
@click.argument("lists", nargs=-1, metavar="LIST...")
@click.option("--to", "target", metavar="CARD", help="The card to convert to; by default that of the rules.")
@click.option("--map", "mapping", metavar="FILE.yaml", help="What the words of the lists mean; --draft-map writes one.")
@click.option(
    "--rules", metavar="FILE.yaml", help="The plant's rules: options of the target, digits, scan classes, what stops a loop."
)
@click.option("--decisions", metavar="FILE.csv", help="What people decided.")
@click.option(
    "--out", "folder", type=OutputArgument("folder"), metavar="FOLDER", help="Write it all there: CSV, JSON, exceptions, workbook."
)
@click.option(
    "--workbook/--no-workbook", "workbook", default=None, help="Write the workbook, too; by default where xlsxwriter is installed."
)
@click.option(
    "--draft-map", "draft", type=OutputArgument(), metavar="FILE.yaml", help="Write a mapping that explains itself, and stop."
)
@click.option("--list-rules", is_flag=True, help="List all that stops a loop or flags it, and how it is answered.")
@json_option
def command(
    lists: tuple[str, ...],
    target: str | None,
    mapping: str | None,
    rules: str | None,
    decisions: str | None,
    folder: str | None,
    workbook: bool | None,
    draft: str | None,
    list_rules: bool,
    as_json: bool,
) -> None:
    """Convert the loops of LIST..., a plant's loop lists as they are: xlsx, xls, ods, CSV, L5X.

    What is doubtful stops its loop and no other. Exit status 0 where all loops are converted, 1 where some wait or cannot be
    read, 2
    where the job cannot run.
    """
    from pidemu.plant.decisions import Decisions, read_decisions
    from pidemu.plant.mapping import PlantWords, read_mapping
    from pidemu.plant.rules import read_rules

    if list_rules:
        _list_rules()
        return
    if not lists:
        raise click.UsageError("name a loop list: xlsx, xls, ods, CSV or L5X")
    words = PlantWords() if mapping is None else read_mapping(mapping)
    if draft is not None:
        _draft(lists, words, draft)
        return
    ruled = read_rules(rules, target)
    decided = Decisions() if decisions is None else read_decisions(decisions)
    read = inputs(*lists, mapping, rules, decisions)
    paths = {} if folder is None else _prepared(folder, workbook, read)
    result = _run(lists, ruled, words, decided)
    from pidemu.plant.document import job_document

    document = job_document(result.rows, result.summary, ruled, words, decided)
    if paths:
        _write(paths, result, document, ruled, read)
    if as_json:
        print_json(document)
    else:
        _print(result, ruled, paths)
    waiting = result.summary.counts["decision"] + result.summary.counts["error"]
    if waiting:
        raise SystemExit(1)


def _run(lists: tuple[str, ...], rules: PlantRules, words: PlantWords, decided: Decisions) -> RetrofitResult:
    """Read and convert; of many loops the progress is shown on a terminal."""
    from pidemu.fleet.progress import Progress
    from pidemu.plant.job import retrofit

    terminal = sys.stderr is not None and sys.stderr.isatty()
    with contextlib.ExitStack() as stack:
        bars: list[Progress] = []

        def show(_done: int, of: int) -> None:
            if not bars:
                bars.append(stack.enter_context(Progress(of, terminal and of >= _MANY)))
            bars[0].advance(1)

        return retrofit(lists, rules=rules, mapping=words, decisions=decided, progress=show)


def _list_rules() -> None:
    from pidemu.plant.codes import CODES

    rows = [[c.name, c.level, str(c.risk), c.about, c.answers] for c in CODES.values()]
    table(["rule", "level", "risk", "what it means", "how it is answered"], rows)
    wrapped("A level may be raised or lowered in the rules, levels: {F-scan-slow: decision}; what is lowered is told.")


def _draft(lists: tuple[str, ...], words: PlantWords, path: str) -> None:
    from pidemu.plant.draft import draft_mapping
    from pidemu.plant.sources import read_sources

    check_outputs({"--draft-map": path}, ListError, inputs(*lists))
    text = draft_mapping(read_sources(lists), words)
    with beside(path, ListError, lists) as stream:
        stream.write(text)
    echo(f"wrote {visible(path)}; read it, correct it, and give it with --map")


def _prepared(folder: str, workbook: bool | None, read: list[str | Path]) -> dict[str, str]:
    """Return the files to write, by name, after a look whether they can be written."""
    from pidemu.plant.workbook_file import check_installed

    names = [name for name in _FILES if name != "workbook.xlsx"]
    if workbook is not False:
        try:
            check_installed()
            names.append("workbook.xlsx")
        except ListError:
            if workbook:
                raise
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise ListError(f"{visible(folder)}: cannot be made: {error.strerror}") from None
    paths = {name: os.path.join(folder, name) for name in names}
    check_outputs(dict(paths), ListError, read)
    return paths


def _write(
    paths: dict[str, str], result: RetrofitResult, document: dict[str, Any], rules: PlantRules, read: list[str | Path]
) -> None:
    from pidemu.plant.columns import DECIDE, ERRORS, SKIPPED, converted_columns, converted_values, decision_rows, error_rows
    from pidemu.plant.exceptions import exception_report
    from pidemu.plant.workbook_file import write_workbook

    converted = [row for row in result.rows if row.row_class == "converted"]
    with beside(paths["job.json"], ListError, read) as stream:
        stream.write(printable_json(json.dumps(document, indent=1, ensure_ascii=False)) + "\n")
    values = (converted_values(row, n) for n, row in enumerate(converted, 1))
    write_table(paths["converted.csv"], converted_columns(converted), values, ListError, read)
    write_table(paths["decisions.csv"], DECIDE, decision_rows(result.rows), ListError, read)
    write_table(paths["errors.csv"], ERRORS, error_rows(result.rows), ListError, read)
    write_table(paths["skipped.csv"], SKIPPED, document["skipped"], ListError, read)
    with beside(paths["exceptions.txt"], ListError, read) as stream:
        stream.write("\n".join(exception_report(result.rows, result.summary, rules.levels)) + "\n")
    if "workbook.xlsx" in paths:
        write_workbook(paths["workbook.xlsx"], result.rows, document, read)


def _print(result: RetrofitResult, rules: PlantRules, paths: dict[str, str]) -> None:
    from pidemu.plant.exceptions import exception_report

    summary = result.summary
    heading(f"To {rules.target.id}")
    echo(summary.sentence)
    for note in summary.notes:
        echo(f"note: {note}", err=True)
    if summary.codes:
        from pidemu.plant.codes import CODES

        table(["rule", "loops", ""], [[code, str(n), CODES[code].about] for code, n in summary.codes.items()], right=(1,))
    if paths:
        echo("")
        table(["written", ""], [[visible(path), _FILES[name]] for name, path in paths.items()])
        return
    lines = exception_report(result.rows, summary, rules.levels)[3:]
    echo("\n" + "\n".join(lines[:_SHOWN]))
    if len(lines) > _SHOWN:
        echo(f"... {len(lines) - _SHOWN} more lines; --out FOLDER writes everything")
