"""Compile, or load from the cache, everything that a registration runs.

Compiling takes memory that a process never gives back, and one thread: it is done by processes of
its own, as many as there is work for, and what they leave in the cache is loaded.
"""
from dataclasses import asdict
import json
import os
from pathlib import Path
import subprocess
import sys
import threading

import numpy as np
from numpy.typing import NDArray

from .config import SgorConfig
from .execution.compiling import drop_damaged
from .execution.compiling import loading_only
from .execution.compiling import NotCompiledError
from .execution.compiling import tell
from .preprocessing import preprocess
from .registration import register
from .registration import register_correspondences
from .scan.deskewing import deskewed
from .scan.scan import SemanticScan


def warm_up(config: SgorConfig | None = None) -> None:
    """Compile what is not compiled yet, so that the first real scan does not wait.

    Registers a small made-up scene to itself. In a fresh environment that takes about half a
    minute, and the logger ``sgor_ros`` says it; afterwards, less than a second.

    Parameters
    ----------
    config : SgorConfig, optional
        The one that is used later: what it turns off is not compiled.
    """
    config = config or SgorConfig()
    if not compiled(config):
        tell()
        _compile_apart(config)
        _register_all(config)


def compiled(config: SgorConfig | None = None) -> bool:
    """Return whether `warm_up` has nothing to compile; what there is in the cache is loaded.

    What is damaged there is removed, so that it is compiled again.
    """
    try:
        with loading_only():
            # one thread: the others would compile
            _register_all((config or SgorConfig()).replace(threads=1))
    except NotCompiledError:
        return False
    except Exception:
        if drop_damaged():
            return False
        raise
    return True


def _register_all(config: SgorConfig) -> None:
    walls, size = _walls(config)
    near = config.replace(min_range=0.0, max_range=4 * size)
    scan = SemanticScan(walls, np.zeros(len(walls), np.int64), times=np.zeros(len(walls)))
    prepared = preprocess(deskewed(scan, np.zeros(6)), near)
    register(prepared, prepared, near)
    _solve(config)


def _solve(config: SgorConfig) -> None:
    """Run what needs no scans: the solver, which is near half of all code."""
    walls, _ = _walls(config)
    up = np.array([0.0, 0.0, 1.0])
    register_correspondences(walls[::8], walls[::8], ground_normals=(up, up), config=config)


def _walls(config: SgorConfig) -> tuple[NDArray[np.float64], float]:
    """Return (3000, 3) points on a floor and two walls, and how far they reach, metres."""
    size = 40 * min(config.voxel_size, 5.0)    # max_range has a bound
    walls = np.random.default_rng(0).uniform(-size, size, (3000, 3))
    walls[:1000, 2], walls[1000:2000, 0], walls[2000:, 1] = -size / 4, size, size
    return walls, size


def _compile_apart(config: SgorConfig) -> None:
    """Fill the cache from two other processes; what they fail to do is left to this one."""
    command = [sys.executable, '-P', '-m', __name__]
    # the same package, and the same libraries
    paths = [str(Path(__file__).parents[2]), *filter(None, sys.path)]
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(paths)}
    order = json.dumps(asdict(config)).encode() + b'\n'
    running: list[subprocess.Popen[bytes]] = []
    try:
        for part in ('solver', 'all'):
            running.append(subprocess.Popen(
                [*command, part], env=environment, stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                start_new_session=True))    # Ctrl-C is for us
            channel = running[-1].stdin
            assert channel is not None
            channel.write(order)
            channel.flush()
        for child in running:
            child.wait()
    except OSError:
        pass
    finally:
        for child in running:
            child.kill()
            child.communicate()


def _end_with_parent() -> None:
    """Wait until the other end of stdin is closed, as it is however the parent ends."""
    sys.stdin.read()
    os._exit(1)


if __name__ == '__main__':
    ordered = SgorConfig.from_values(json.loads(sys.stdin.readline()))
    threading.Thread(target=_end_with_parent, daemon=True).start()
    (_solve if sys.argv[1] == 'solver' else _register_all)(ordered)
