"""How many cores the compiled loops may use, how they wait, and where they are kept.

Imported before numba's and small_gicp's OpenMP are loaded: they read the policy then.
"""
from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import tempfile
from typing import Any

# spinning threads slow everything down three- to fourfold when other processes need the cores
os.environ.setdefault('OMP_WAIT_POLICY', 'passive')

import numba
from threadpoolctl import ThreadpoolController

# its names are made as it is loaded, unseen by type checkers
_config: Any = numba.config
# OpenMP takes calls from several threads; numba's own pool aborts, an old TBB only warns
_config.THREADING_LAYER_PRIORITY = ['omp', 'tbb', 'workqueue']


def _writable(folder: Path) -> bool:
    """Return whether a folder can be written, or made where it is not there yet."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    return os.access(there, os.W_OK)


def _private_folder() -> Path:
    """Return a folder for temporary files of this user alone: what is in it will be run."""
    folder = Path(tempfile.gettempdir()) / f'sgor_ros_{os.getuid()}'
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    mine = found.st_uid == os.getuid() and found.st_mode & 0o777 == 0o700
    return folder if mine else Path(tempfile.mkdtemp())


# numba keeps compiled code beside the source or in the user's cache, and gives up where neither
# can be written, as in a container of which only /tmp can be
_USUAL = (Path(__file__).parent,
          Path(os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')))
if not _config.CACHE_DIR and not any(map(_writable, _USUAL)):
    _config.CACHE_DIR = str(_private_folder())


# of numpy, which numba has loaded by now
_blas = ThreadpoolController().select(user_api='blas')


@contextmanager
def cores(count: int) -> Iterator[None]:
    """Let the compiled loops of this thread use up to `count` cores, and BLAS one.

    Our matrices are small, and threads of BLAS spin for tens of milliseconds after each product:
    on two cores that doubled the CPU time of a scan. BLAS has one setting for the whole process:
    where several threads are in here at once, the last to leave may leave it at one.
    """
    before = numba.get_num_threads()
    numba.set_num_threads(min(count, _config.NUMBA_NUM_THREADS))
    try:
        with _blas.limit(limits=1):
            yield
    finally:
        numba.set_num_threads(before)
