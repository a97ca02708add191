"""Peak memory of methods on raw scans."""
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
import multiprocessing
from pathlib import Path

from .methods import Answer
from .methods import Method
from .methods import ScanPair


def peak_memory_mb(methods: Iterable[Method], pair: ScanPair) -> dict[str, float]:
    """Return the peak memory of a process of its own for each method, by name, and for none.

    A high-water mark cannot be reset, so methods in one process would share it.
    """
    spawn = multiprocessing.get_context('spawn')
    nothing = Method('', on_scans=_nothing)
    found = {}
    for method in (nothing, *methods):
        with ProcessPoolExecutor(1, mp_context=spawn) as process:
            found[method.name] = process.submit(_peak, method, pair).result()
    return found


def _nothing(_: ScanPair) -> Answer:
    return Answer(None)


def _peak(method: Method, pair: ScanPair) -> float:
    assert method.on_scans is not None
    for _ in range(3):
        method.on_scans(pair)
    # ru_maxrss would start from that of the parent
    status = Path('/proc/self/status').read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in status if line.startswith('VmHWM'))
