"""The folder for generated code: what a back end compiled once is there the next time."""

from __future__ import annotations

import atexit
import functools
import os
import shutil
import tempfile
from pathlib import Path

from pidemu import __version__


@functools.cache
def folder() -> Path:
    """Return the folder for generated code of this version of pidemu; it exists and can be written.

    It is that of the environment variable ``PIDEMU_CACHE``, or the user's cache folder where the system has one; where that cannot
    be written, a folder among the temporary files, for this process alone and removed at its end.
    """
    import platformdirs

    try:
        chosen = os.environ.get("PIDEMU_CACHE") or platformdirs.user_cache_dir("pidemu", appauthor=False)
        path = Path(chosen).expanduser().absolute() / __version__
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            return path
    except (OSError, RuntimeError):  # the latter where the user has no home
        path = Path(tempfile.mkdtemp(prefix="pidemu-"))
        atexit.register(shutil.rmtree, path, ignore_errors=True)
        return path


def written(name: str, text: str) -> Path:
    """Return the path of a file of the folder that holds a text; it is written where it is not there yet.

    Parameters
    ----------
    name : str
        The file's name, which tells its text: it is not written again.
    text : str
        What it holds.
    """
    path = folder() / name
    if not path.exists():
        with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=path.suffix, encoding="utf-8", delete=False) as file:
            file.write(text)
        os.replace(file.name, path)  # at once: another process never reads half a file
    return path
