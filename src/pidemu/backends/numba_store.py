"""What Numba compiled, kept from one process to the next: a file per function, signature, processor and version.

Numba's own files hold pickles, and are unpickled unseen, so that a damaged one fails in any way and a foreign one runs anything.
These go through `pidemu.files.cache`: a file is this user's own and holds what its name says, or it is not looked into.
"""

from __future__ import annotations

import contextlib
import hashlib
import pickle
import sys
from typing import Any, Final

from pidemu import __version__
from pidemu.files.cache import keep, load

SUFFIX: Final = ".numba"


def python_version() -> str:
    """Return the version of Python that machine code belongs to, such as ``py312``."""
    return f"py{sys.version_info.major}{sys.version_info.minor}"


class Store:
    """Stands in for the cache of one of Numba's functions, and has its methods.

    Parameters
    ----------
    name : str
        Module and function.
    """

    def __init__(self, name: str) -> None:
        self.cache_path: str | None = None
        self._name = name

    def attach(self, function: Any) -> None:
        """Make a compiled function look here before it compiles, and put here what it compiled."""
        function._cache = self

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the machine code for a signature, or ``None`` where it has to be compiled."""
        from numba.core import compiler

        rebuild: Any = compiler.CompileResult._rebuild
        target_context.refresh()
        found = load(self._stem(signature, target_context.codegen()), SUFFIX)
        if found is None:
            return None
        try:
            return rebuild(target_context, *pickle.loads(found[1]))
        except Exception:  # whatever it is: compiling again mends it
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep the machine code of a signature, where there is room for it."""
        from numba.core import serialize

        dumps: Any = serialize.dumps
        with contextlib.suppress(Exception):  # the function is there, and runs
            keep(self._stem(signature, compiled.library.codegen), SUFFIX, dumps(compiled._reduce()))

    def enable(self) -> None:
        """Do nothing: it is always on."""

    def disable(self) -> None:
        """Do nothing: a function without it is made by not attaching it."""

    def flush(self) -> None:
        """Do nothing: what a function is made of is in its name, so nothing kept is ever out of date."""

    def _stem(self, signature: Any, codegen: Any) -> str:
        """Return the name for a signature on this machine's processor."""
        import numba

        what = "\0".join(map(str, (signature, codegen.magic_tuple(), numba.__version__, __version__)))
        return f"{self._name}.{python_version()}.{hashlib.sha256(what.encode()).hexdigest()[:16]}"
