"""Where work is done that takes long: in this process, in several, or on a Dask cluster."""
from collections.abc import Iterator
from concurrent.futures import Executor
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
import multiprocessing
from typing import Any

from ..core.common.settings import InputError


@contextmanager
def executor(processes: int = 1, dask: str = '') -> Iterator[Executor | None]:
    """Yield where to submit work; None where it is to be done here.

    Parameters
    ----------
    processes : int
        On this machine.
    dask : str
        Address of a scheduler, to run on its workers instead. They have this package, and see
        files by the same paths.

    Raises
    ------
    InputError
        There is no Dask here, or no scheduler there.
    """
    if dask:
        with _client(dask) as client:
            yield client.get_executor(pure=False)
    elif processes > 1:
        # threads of the parent do not survive a fork
        with ProcessPoolExecutor(processes, multiprocessing.get_context('spawn')) as pool:
            yield pool
    else:
        yield None


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(f'--dask needs distributed ({error}): pip install distributed'
                         ) from error
    connect: Any = Client
    try:
        return connect(address, timeout='10s')
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f'--dask {address}: no scheduler there: {error}') from error
