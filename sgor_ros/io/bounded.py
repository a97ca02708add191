"""Files that give no more than they hold: a length in a broken record is only a claim."""
import io
import os
from pathlib import Path
from typing import Any

ALWAYS_FINE = 1 << 20
"""Bytes that may be asked for without a look at what is left."""


class BoundedPath(Path):
    """A path that opens as `BoundedFile` for who reads bytes, such as rosbags."""

    def open(self, mode: str = 'r', *arguments: Any, **named: Any) -> Any:
        """Open the file."""
        return BoundedFile(self) if mode == 'rb' else super().open(mode, *arguments, **named)


class BoundedFile(io.BufferedReader):
    """A file to read, which allocates only what it can fill."""

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self._size = os.fstat(self.fileno()).st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """Read bytes, or as many as there are."""
        if size is not None and size > ALWAYS_FINE:
            size = min(size, max(self._size - self.tell(), 0))
        return super().read(size)
