"""What repairs a bag that cannot be read: most often its recording was cut off."""
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..core.common.settings import InputError

STORAGES = {'.mcap': 'mcap', '.db3': 'sqlite3'}


@contextmanager
def with_advice(path: Path) -> Iterator[None]:
    """Add to errors of a reader's own which tool repairs a bag of this kind."""
    try:
        yield
    except InputError as error:
        # its own message names the index, a file beside the messages
        command = repair(path, index='metadata' in str(error))
        # without a cause it is no fault of the bytes: no such bag, no such topic
        if error.__cause__ is None or not command:
            raise
        raise InputError(f'{error}; if its recording was cut off, this may repair it: '
                         f'{command}') from error


def repair(path: Path, *, index: bool) -> str:
    """Return the command that repairs a bag, or its index; empty where the kind is unknown."""
    if path.suffix == '.bag':
        return f'rosbag reindex {path}'
    files = [path] if path.is_file() else sorted(
        file for file in path.glob('*') if file.suffix in STORAGES)
    if not files or files[0].suffix not in STORAGES:
        return ''
    if index or files[0].suffix == '.db3':
        folder = path if path.is_dir() else path.parent
        return f'ros2 bag reindex -s {STORAGES[files[0].suffix]} {folder}'
    return f'mcap recover {files[0]} -o FIXED.mcap'
