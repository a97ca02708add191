"""What repairs a bag that cannot be read: most often its recording was cut off."""
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..core.common.settings import InputError


@contextmanager
def with_advice(path: Path) -> Iterator[None]:
    """Add to errors of a reader's own which tool repairs a bag of this kind."""
    try:
        yield
    except InputError as error:
        command = repair(path)
        # without a cause it is no fault of the bytes: no such bag, no such topic
        if error.__cause__ is None or not command:
            raise
        raise InputError(f'{error}; if its recording was cut off, this may repair it: '
                         f'{command}') from error


def repair(path: Path) -> str:
    """Return the command that repairs what can be repaired, empty where the kind is unknown."""
    if path.suffix == '.bag':
        return f'rosbag reindex {path}'
    folder = path if path.is_dir() else path.parent
    files = [path] if path.is_file() else sorted(
        file for file in folder.glob('*') if file.suffix in ('.mcap', '.db3'))
    if not files or files[0].suffix not in ('.mcap', '.db3'):
        return ''
    if files[0].suffix == '.db3':
        return f'ros2 bag reindex -s sqlite3 {folder}'
    recover = f'mcap recover {files[0]} -o FIXED.mcap'
    if path.is_dir() and not (folder / 'metadata.yaml').is_file():
        return f'ros2 bag reindex -s mcap {folder}, or {recover}'
    return recover
