"""Names of a program in a language that keeps some words for itself."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from pidemu.program.ir import Program


def names_of(program: Program) -> list[str]:
    """Return every name of a program once: inputs, coefficients, states, delay lines, then what is assigned.

    Parameters
    ----------
    program : Program
        The program.
    """
    groups = (program.inputs, program.coefficients, program.states, program.lines, program.body)
    return list(dict.fromkeys(x.name for group in groups for x in group))


def respelt(names: Iterable[str], taken: Collection[str], *, case_blind: bool = False) -> dict[str, str]:
    """Return each name as it is spelt where some words are taken: with a number behind it where the name is not free.

    Parameters
    ----------
    names : iterable of str
        Names, each once.
    taken : collection of str
        Words that none of them may be; in small letters where case does not count.
    case_blind : bool
        ``kp`` and ``KP`` are one name.
    """
    names = list(names)
    found: dict[str, str] = {}
    used = set(taken)
    plain = {_key(name, case_blind) for name in names}
    for name in names:
        spelt, number = name, 2
        while _key(spelt, case_blind) in used or (spelt != name and _key(spelt, case_blind) in plain):
            spelt, number = f"{name}_{number}", number + 1
        found[name] = spelt
        used.add(_key(spelt, case_blind))
    return found


def _key(name: str, case_blind: bool) -> str:
    return name.casefold() if case_blind else name
