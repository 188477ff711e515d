"""What is added around the program of a controller."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from pidemu.program.ir import Assign, Name, Operand, Program, Quantity, expr


@dataclass
class Parts:
    """What is added around a program."""

    coefficients: list[tuple[Quantity, float]] = field(default_factory=list)
    states: list[tuple[Quantity, float]] = field(default_factory=list)
    before: list[Assign] = field(default_factory=list)
    after: list[Assign] = field(default_factory=list)

    def coefficient(self, name: str, value: float, text: str, unit: str = "%") -> Name:
        """Add a number."""
        self.coefficients.append((Quantity(name, text, unit), value))
        return Name(name)

    def state(self, name: str, text: str, unit: str = "%", initial: float = 0.0) -> Name:
        """Add something kept from scan to scan."""
        self.states.append((Quantity(name, text, unit), initial))
        return Name(name)

    def first(self, name: str, value: Operand, text: str, unit: str = "%") -> Name:
        """Assign at the start of the scan."""
        self.before.append(Assign(name, expr(value), text, unit))
        return Name(name)

    def then(self, name: str, value: Operand, text: str, unit: str = "%") -> Name:
        """Assign at the end of the scan."""
        self.after.append(Assign(name, expr(value), text, unit))
        return Name(name)

    def added(self, program: Program, wide: tuple[str, ...] = ()) -> Program:
        """Return the program with the parts, which are float64 whatever the controller computes in."""
        names = {q.name for q, _ in (*self.coefficients, *self.states)} | {a.name for a in (*self.before, *self.after)} | set(wide)
        return replace(
            program,
            coefficients=(*program.coefficients, *(q for q, _ in self.coefficients)),
            values=(*program.values, *(x for _, x in self.coefficients)),
            states=(*program.states, *(q for q, _ in self.states)),
            initial=(*program.initial, *(x for _, x in self.states)),
            body=(*self.before, *program.body, *self.after),
            wide=program.wide | (names - {"sp", "pv"}) if program.precision == "float32" else program.wide,
        )
