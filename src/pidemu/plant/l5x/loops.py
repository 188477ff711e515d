"""The loops of an export: every PID and PIDE, with settings, execution, and what is remarkable about it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from pidemu.plant.l5x.blocks import CARDS, Block, BlockValues
from pidemu.plant.l5x.execution import CONTROLLER, ControllerCode, Execution, LoopKey, read_code
from pidemu.plant.l5x.tree import L5xElement
from pidemu.plant.l5x.types import FoundBlock, TypeTable


@dataclass
class L5xLoop:
    """A loop of an export.

    Attributes
    ----------
    path, scope : str
        Its path, and ``controller`` or ``Program:NAME``.
    block, card : str
        ``PID`` or ``PIDE``, and the card.
    values : BlockValues
        What it is set to.
    interval_s : float or None
        Interval at which it is executed [s]; ``None`` where that is not to be had from the file.
    executed : list of str
        The calls that execute it.
    outcome : str
        ``loop``, ``unused``, ``not executed`` or ``error``.
    flags : list of str
        What is remarkable.
    values_from : str
        Where the values stand.
    aliases : list of str
        Other names of it.
    master : str
        The master of its cascade; empty where none is named.
    description : str
        Its description.
    line : int
        Line of its tag in the file.
    """

    path: str
    scope: str
    block: Block
    values: BlockValues
    interval_s: float | None = None
    executed: list[str] = field(default_factory=list)
    outcome: str = "loop"
    flags: list[str] = field(default_factory=list)
    values_from: str = "decorated"
    aliases: list[str] = field(default_factory=list)
    master: str = ""
    description: str = ""
    line: int = 1

    @property
    def card(self) -> str:
        """The card of the block."""
        return CARDS[self.block]

    @property
    def key(self) -> LoopKey:
        """Scope and path."""
        return self.scope, self.path


@dataclass
class L5xExport:
    """What an export holds.

    Attributes
    ----------
    file : str
        The file.
    controller : str
        Name of the controller.
    kind, date : str
        What was exported (``Controller``, ``Program``, ...), and when, in the words of the file.
    loops : list of L5xLoop
        The loops.
    notes : list of str
        What else is to be known.
    has_tasks : bool
        Whether it tells what is executed how often.
    """

    file: str
    controller: str
    kind: str
    date: str
    loops: list[L5xLoop]
    notes: list[str]
    has_tasks: bool


def loops_of(root: L5xElement, file: str) -> L5xExport:
    """Return the loops of an export.

    Parameters
    ----------
    root : L5xElement
        The root of the file.
    file : str
        Its name.
    """
    controller = next(iter(root.all("Controller")), L5xElement("Controller", {}, root.line))
    types = TypeTable(controller)
    code = read_code(controller, types)
    loops = [
        _loop(block, scope, tag, code, types)
        for scope, tag in _tags(controller)
        for block in (types.blocks(tag) if tag.get("TagType") != "Alias" else ())
    ]
    twice = Counter(loop.path for loop in loops)
    for loop in loops:
        if twice[loop.path] > 1:
            loop.flags.append("same-name-in-two-scopes")
    notes = [f"{file}: {kind} {name} is not read: no card has it yet" for kind, name in _unread(controller)]
    if not code.has_tasks:
        notes.append(
            f"{file}: a {root.get('TargetType') or 'partial'} export holds no tasks, so how often a block is executed is not known"
        )
    name = controller.get("Name")
    return L5xExport(file, name, root.get("TargetType"), root.get("ExportDate"), loops, notes, code.has_tasks)


def _tags(controller: L5xElement) -> list[tuple[str, L5xElement]]:
    found = [(CONTROLLER, tag) for tag in controller.all("Tags", "Tag")]
    for program in controller.all("Programs", "Program"):
        found += [(f"Program:{program.get('Name')}", tag) for tag in program.all("Tags", "Tag")]
    return found


def _unread(controller: L5xElement) -> list[tuple[str, str]]:
    """Return the loops of PlantPAx, which have a block of their own."""
    return [(tag.get("DataType"), tag.get("Name")) for _, tag in _tags(controller) if tag.get("DataType") in ("P_PID", "P_PIDE")]


def _loop(found: FoundBlock, scope: str, tag: L5xElement, code: ControllerCode, types: TypeTable) -> L5xLoop:
    values = found.values
    loop = L5xLoop(found.path, scope, found.block, values, values_from=found.origin, line=tag.line)
    loop.description = " ".join("".join(d.text for d in tag.all("Description")).split())
    loop.aliases = list(code.aliases.get(loop.key, ()))
    calls = code.executions.get(loop.key, [])
    running = [call for call in calls if not call.state]
    loop.executed = [call.path for call in running]
    loop.master = next((call.master[1] for call in running if call.master is not None), "")
    if values.fault:
        loop.outcome, loop.flags = "error", [values.fault]
        return loop
    _flag_origin(loop, running, types, tag)
    zero = all(not v for name, v in values.settings.items() if name != "CVROCLimit")
    if zero:
        loop.flags.append("all-gains-zero")
    if not running:
        _flag_idle(loop, calls, code)
    else:
        _flag_running(loop, running)
    if zero:
        loop.outcome = "unused"
    return loop


def _flag_origin(loop: L5xLoop, running: list[Execution], types: TypeTable, tag: L5xElement) -> None:
    if loop.values_from == "L5K text of the instance" or tag.get("DataType") in types.instructions:
        loop.flags.append("aoi-local")
    if loop.values_from != "decorated":
        loop.flags.append("values-in-L5K-only")
    if any(call.by_inout for call in running) and "aoi-local" not in loop.flags:
        loop.flags.append("by-inout")


def _flag_idle(loop: L5xLoop, calls: list[Execution], code: ControllerCode) -> None:
    """Say why nothing executes a block, or why that cannot be told."""
    states = list(dict.fromkeys(call.state for call in calls))
    if states:
        loop.flags += states
        loop.outcome = "not executed"
    elif loop.scope.removeprefix("Program:") in code.protected:
        loop.flags.append("protected-routine")
    elif not code.has_tasks:
        loop.flags.append("no-tasks")
    else:
        loop.flags.append("not-executed")
        loop.outcome = "not executed"


def _flag_running(loop: L5xLoop, running: list[Execution]) -> None:
    """Find the interval at which a block runs, and say why where there is none."""
    values, call = loop.values, running[0]
    kinds = {c.kind for c in running}
    if loop.block == "PIDE" and values.timing == 1:
        loop.flags.append("oversample")
        loop.interval_s = values.oversample or None
        if not values.oversample:
            loop.outcome = "not executed"
        return
    if loop.block == "PIDE" and values.timing == 2:
        loop.flags.append("real-time-sampling")
        loop.interval_s = values.rts or None
        return
    if "CONTINUOUS" in kinds:
        loop.flags.append("continuous-task")
    if "EVENT" in kinds:
        loop.flags.append("event-task")
    if "" in kinds:
        loop.flags.append("no-tasks")
    if any(c.conditional for c in running):
        loop.flags.append("conditional-rung")
    if len(running) > 1:
        loop.flags.append("executed-twice")
    if kinds == {"PERIODIC"} and len(running) == 1 and not call.conditional:
        loop.interval_s = call.period
    if loop.block == "PID" and loop.interval_s is not None and values.update is not None and values.update != loop.interval_s:
        loop.flags.append("update-time-not-interval")
    if loop.master or values.cascade:
        loop.flags.append("cascade")
