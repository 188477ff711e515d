"""What a developer does, by name: ``nox -s fast``, ``nox -l`` for all. What must hold before a change lands is ``.ci/run``."""

import tomllib
from collections.abc import Iterable
from pathlib import Path

import nox

PROJECT = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = ["3.11", "3.12", "3.13", "3.14"]
EXTRAS = ("plot", "loop", "report", "fast", "cluster", "parquet", "retrofit")
"""What is optional for users."""
WITHOUT_EXTRAS = (
    "pytest>=8", "pytest-xdist>=3.5", "hypothesis>=6.100", "jsonschema>=4.20", "simple-pid==2.0.1", "advanced-pid==0.0.8",
    "sympy>=1.12", "hatchling>=1.26",
)  # fmt: skip
"""What the fast tests need, without python-control, which brings the extras' libraries."""
CONVERT = ("pidemu", "convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav")


def oldest(requirements: Iterable[str]) -> list[str]:
    """Return requirements that are met by their lowest versions only; one of pidemu's own extras is none."""
    return [requirement.replace(">=", "==", 1) for requirement in requirements if ">=" in requirement]


nox.options.sessions = ["lint", "types", "fast"]


@nox.session
def lint(session: nox.Session) -> None:
    """Check style, format and every card."""
    session.install("-e", ".[dev]")
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("pidemu", "check")


@nox.session
def types(session: nox.Session) -> None:
    """Check all types, strictly."""
    session.install("-e", ".[dev]")
    session.run("mypy")


@nox.session
def fast(session: nox.Session) -> None:
    """Run the tests that take less than a minute together, in one process, and hold their coverage to its floor."""
    session.install("-e", ".[dev]")
    session.run("coverage", "run", "-m", "pytest", "-m", "fast", "-n", "0", *session.posargs)
    session.run("coverage", "report")


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """Run all tests, with the versions of Python that are there."""
    session.install("-e", ".[test]")
    session.run("pytest", *session.posargs)


@nox.session
def docs(session: nox.Session) -> None:
    """Name what is generated and stale; the conversions of every card to every card take minutes."""
    session.install("-e", ".[dev]")
    session.run("python", "-m", "tools.regenerate", "--check", *session.posargs)


@nox.session(python=PYTHONS[0])
def lowest(session: nox.Session) -> None:
    """Run fast tests with the oldest versions of everything that users install."""
    session.install("-e", ".[test]")
    session.install(*oldest(PROJECT["dependencies"]), *oldest(r for e in EXTRAS for r in PROJECT["optional-dependencies"][e]))
    session.run(*CONVERT)
    # what click says of wrong words, and what pydantic writes into schemas, is of the newest ones
    newest = ("--ignore=tests/cli", "--ignore=tests/tools", "--ignore=tests/card/test_schema.py")
    session.run("pytest", "-m", "fast", "-W", "default", *newest, *session.posargs)


@nox.session
def bare(session: nox.Session) -> None:
    """Run fast tests without any extra."""
    session.install("-e", ".", *WITHOUT_EXTRAS)
    session.run(*CONVERT)
    session.run("pytest", "-m", "fast", "--ignore=tests/simulation/test_process.py", *session.posargs)
