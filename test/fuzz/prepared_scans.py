"""A small prepared scan, the file of it, and archives of which one array is spoilt."""
from functools import cache
import io
from pathlib import Path
import tempfile
import zipfile

import numpy as np

from sgor_ros.core.compact_scan import compact
from sgor_ros.core.preprocessing import preprocess
from sgor_ros.core.scan.scan import SemanticScan
from sgor_ros.io.compact_scans import write_compact_scan


@cache
def prepared():
    rng = np.random.default_rng(0)
    points = rng.uniform(-20, 20, (3000, 3))
    points[:1500, 2] = -2.0
    return preprocess(SemanticScan(points, np.repeat([40, 50], 1500)))


@cache
def compact_scan():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'a.npz'
        write_compact_scan(path, compact(prepared()))
        return path.read_bytes()


def made_archive(good, mutate, rng):
    """Return an archive that is whole, of arrays that are not; `good` returns one of good ones."""
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(good())) as whole, zipfile.ZipFile(file, 'w') as archive:
        spoilt = rng.choice(whole.namelist())
        for name in whole.namelist():
            content = whole.read(name)
            archive.writestr(name, mutate(content, [content], rng) if name == spoilt else content)
    return file.getvalue()
