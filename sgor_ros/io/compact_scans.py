"""Compact scans in files: `.npz` with plain arrays and no pickle, one file a scan."""
from pathlib import Path

import numpy as np

from ..core.common.settings import InputError
from ..core.compact_scan import CompactScan
from .broken import readable
from .writing import new_file


def write_compact_scan(path: str | Path, scan: CompactScan) -> None:
    """Write a compact scan to a file, which replaces one of that name."""
    with new_file(path) as beside, beside.open('wb') as file:
        np.savez(file, **scan.as_arrays())  # type: ignore[arg-type]


def read_compact_scan(path: str | Path) -> CompactScan:
    """Read a compact scan.

    Raises
    ------
    InputError
        No such file, one that holds something else, or one of another version.
    """
    with readable(path), np.load(path, allow_pickle=False) as arrays:
        found = {name: np.asarray(arrays[name]) for name in arrays.files}
    try:
        return CompactScan.from_arrays(found)
    except InputError as error:
        raise InputError(f'{path}: {error}') from error
