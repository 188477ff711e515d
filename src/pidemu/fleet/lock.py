"""One run at a time writes into a folder."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Final

from pidemu.errors import FleetError

_TAKEN: Final = (errno.EACCES, errno.EAGAIN)


class FolderLock:
    """Keeps other runs out of a folder until it is released, or the process ends, however it does.

    Where the system has no locks for folders, as Windows, or the folder's file system has none, it does nothing.

    Parameters
    ----------
    folder : Path
        The folder; it exists.

    Raises
    ------
    FleetError
        Another run has it.
    """

    def __init__(self, folder: Path) -> None:
        self._number: int | None = None
        if os.name != "posix":
            return
        import fcntl

        try:
            self._number = os.open(folder, os.O_RDONLY)
            fcntl.flock(self._number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self.release()
            if error.errno in _TAKEN:
                raise FleetError(
                    f"{folder}: another run is writing there; wait until it has ended, or give another place"
                ) from None

    def release(self) -> None:
        """Let others in."""
        if self._number is not None:
            os.close(self._number)
            self._number = None
