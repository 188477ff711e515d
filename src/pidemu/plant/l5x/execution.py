"""What executes a block, and how often: from tasks over programs and routines to the call."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from pidemu.plant.l5x.blocks import Block
from pidemu.plant.l5x.calls import Call, calls_of
from pidemu.plant.l5x.tree import L5xElement
from pidemu.plant.l5x.types import TypeTable

CONTROLLER: Final = "controller"
_INSTRUCTIONS: Final[Mapping[str, Block]] = {"PID": "PID", "PIDE": "PIDE"}
_DEEPEST: Final = 12
_MASTER: Final = 4
"""Operand of a PID that names the master of a cascade."""

LoopKey = tuple[str, str]
"""Scope and path."""


@dataclass(frozen=True, slots=True)
class Execution:
    """A call that executes a block.

    Attributes
    ----------
    path : str
        Task, program, routine and place: ``Slow/Thermal/Main rung 0``.
    period : float or None
        Period of the task [s]; ``None`` where it has none.
    kind : str
        ``PERIODIC``, ``CONTINUOUS``, ``EVENT``, or empty where the file holds no tasks.
    conditional : bool
        Whether something decides if it is executed.
    state : str
        ``task-inhibited``, ``program-disabled``, ``routine-not-called``; empty where it runs.
    by_inout : bool
        Whether an Add-On Instruction is handed the block.
    master : LoopKey or None
        The master of the cascade that the call names.
    """

    path: str
    period: float | None
    kind: str
    conditional: bool
    state: str = ""
    by_inout: bool = False
    master: LoopKey | None = None


@dataclass
class ControllerCode:
    """All calls of blocks in a controller, and its aliases.

    Attributes
    ----------
    executions : dict
        Calls by scope and path.
    aliases : dict
        Aliases that stand for a block, by scope and path.
    protected : set of str
        Programs with a routine that is called and cannot be read.
    has_tasks : bool
        Whether the file holds tasks.
    """

    executions: dict[LoopKey, list[Execution]] = field(default_factory=lambda: defaultdict(list))
    aliases: dict[LoopKey, list[str]] = field(default_factory=lambda: defaultdict(list))
    protected: set[str] = field(default_factory=set)
    has_tasks: bool = False


@dataclass(frozen=True)
class _Where:
    """Where a call is looked at: its program, and what names mean within an instruction."""

    program: str
    path: str
    period: float | None
    kind: str
    state: str
    conditional: bool = False
    bound: Mapping[str, LoopKey] | None = None
    by_inout: bool = False
    depth: int = 0


def read_code(controller: L5xElement, types: TypeTable) -> ControllerCode:
    """Return what a controller executes.

    Parameters
    ----------
    controller : L5xElement
        The controller.
    types : TypeTable
        Its types and instructions.
    """
    return _CodeReader(controller, types).read()


class _CodeReader:
    def __init__(self, controller: L5xElement, types: TypeTable) -> None:
        self.controller = controller
        self.types = types
        self.found = ControllerCode()
        self.tags: dict[str, dict[str, str]] = {CONTROLLER: _tags(controller)}
        self.programs = {p.get("Name"): p for p in controller.all("Programs", "Program")}
        for name, program in self.programs.items():
            self.tags[name] = _tags(program)
        self._logic: dict[str, list[Call]] = {}

    def read(self) -> ControllerCode:
        tasks = list(self.controller.all("Tasks", "Task"))
        self.found.has_tasks = bool(tasks)
        scheduled: dict[str, list[L5xElement]] = defaultdict(list)
        for task in tasks:
            for program in task.all("ScheduledPrograms", "ScheduledProgram"):
                scheduled[program.get("Name")].append(task)
        for name, program in self.programs.items():
            for task in scheduled[name]:
                self._program(name, program, task)
            if not scheduled[name]:
                self._program(name, program, None)
        for scope, tags in self.tags.items():
            for alias, target in tags.items():
                if target:
                    self.found.aliases[self.resolve(alias, "" if scope == CONTROLLER else scope)].append(alias)
        return self.found

    def _program(self, name: str, program: L5xElement, task: L5xElement | None) -> None:
        kind, period, state = "", None, ""
        if task is not None:
            kind = task.get("Type")
            period = _period(task)
            state = "task-inhibited" if task.get("InhibitTask") == "true" else ""
        elif self.found.has_tasks:
            state = "not-executed"
        if program.get("Disabled") == "true":
            state = "program-disabled"
        routines = {r.get("Name"): calls_of(r) for r in program.all("Routines", "Routine")}
        locked = {e.get("Name") for e in program.all("Routines", "EncodedData")}
        reached = _reached(program.get("MainRoutineName"), routines)
        if reached & locked:
            self.found.protected.add(name)
        prefix = f"{task.get('Name')}/{name}" if task is not None else name
        for routine, calls in routines.items():
            own = state or ("" if routine in reached else "routine-not-called")
            where = _Where(name, f"{prefix}/{routine}", period, kind, own)
            for call in calls:
                self._call(call, where)

    def _call(self, call: Call, where: _Where) -> None:
        conditional = where.conditional or call.conditional
        place = where.path if where.depth else f"{where.path} {call.place}".replace(" sheet", "").strip()
        if call.name in _INSTRUCTIONS and call.operands:
            key = self._operand(call.operands[0], where)
            master = call.operands[_MASTER] if call.name == "PID" and len(call.operands) > _MASTER else "0"
            named = None if master in ("0", "", "?") else self._operand(master, where)
            self.found.executions[key].append(
                Execution(
                    place, where.period, where.kind, conditional, where.state, where.by_inout and self._is_bound(call, where), named
                )
            )
        elif call.name in self.types.instructions and call.operands and where.depth < _DEEPEST:
            self._instruction(call, where, place, conditional)

    def _is_bound(self, call: Call, where: _Where) -> bool:
        return where.bound is not None and _base(call.operands[0]) in where.bound

    def _instruction(self, call: Call, where: _Where, place: str, conditional: bool) -> None:
        """Follow the call of an Add-On Instruction into its logic."""
        definition = self.types.instructions[call.name]
        instance = self._operand(call.operands[0], where)
        parameters = [p for p in definition.all("Parameters", "Parameter") if p.get("Name") not in ("EnableIn", "EnableOut")]
        if call.place == "sheet":
            parameters = [p for p in parameters if p.get("Usage") == "InOut"]
        else:
            parameters = [p for p in parameters if p.get("Required") == "true" or p.get("Usage") == "InOut"]
        bound = {
            p.get("Name"): self._operand(operand, where)
            for p, operand in zip(parameters, call.operands[1:], strict=False)
            if p.get("Usage") == "InOut"
        }
        for local in definition.all("LocalTags", "LocalTag"):
            bound[local.get("Name")] = (instance[0], f"{instance[1]}.{local.get('Name')}")
        inner = _Where(
            where.program,
            f"{place} ({call.name})",
            where.period,
            where.kind,
            where.state,
            conditional,
            bound,
            True,
            where.depth + 1,
        )
        for found in self._logic_of(call.name):
            self._call(found, inner)

    def _logic_of(self, name: str) -> list[Call]:
        if name not in self._logic:
            routines = self.types.instructions[name].all("Routines", "Routine")
            self._logic[name] = [call for routine in routines if routine.get("Name") == "Logic" for call in calls_of(routine)]
        return self._logic[name]

    def _operand(self, text: str, where: _Where) -> LoopKey:
        """Return scope and path of what an operand names."""
        base = _base(text)
        if where.bound is not None:
            scope, path = where.bound.get(base, (CONTROLLER, base))
            return scope, path + text[len(base) :]
        return self.resolve(text, where.program)

    def resolve(self, text: str, program: str) -> LoopKey:
        """Return scope and path of a tag that is named in a program; aliases are followed."""
        text = text.strip()
        for _ in range(_DEEPEST):
            base = _base(text)
            scope = program if base in self.tags.get(program, {}) else CONTROLLER
            target = self.tags.get(scope, {}).get(base, "")
            if not target:
                return (CONTROLLER if scope == CONTROLLER else f"Program:{scope}"), text
            text = target + text[len(base) :]
        return CONTROLLER, text


def _tags(scope: L5xElement) -> dict[str, str]:
    """Return the tags of a scope, each with what it is an alias for."""
    return {t.get("Name"): t.get("AliasFor") if t.get("TagType") == "Alias" else "" for t in scope.all("Tags", "Tag")}


def _base(text: str) -> str:
    """Return the name of a tag, without members and indices."""
    return text.strip().partition(".")[0].partition("[")[0]


def _period(task: L5xElement) -> float | None:
    """Return the period of a periodic task [s]."""
    if task.get("Type") != "PERIODIC":
        return None
    try:
        rate = float(task.get("Rate"))
    except ValueError:
        return None
    return rate / 1000 if rate > 0 else None


def _reached(main: str, routines: Mapping[str, list[Call]]) -> set[str]:
    """Return the routines that a program comes to from its main routine."""
    reached: set[str] = set()
    waiting = [main] if main else []
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += _jumps(routines.get(name, ()))
    return reached


def _jumps(calls: list[Call] | tuple[Call, ...]) -> Iterator[str]:
    return (call.operands[0] for call in calls if call.name == "JSR" and call.operands)
