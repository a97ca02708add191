"""Compile, or load from the cache, everything that a registration runs."""
import numpy as np

from .config import SgorConfig
from .registration import register
from .scan.preprocessing import preprocess
from .scan.scan import SemanticScan


def warm_up(config: SgorConfig | None = None) -> None:
    """Compile what is not compiled yet, so that the first real scan does not wait.

    Registers a small made-up scene to itself. In a fresh environment that takes a minute or two,
    and the logger `sgor_ros` says so; afterwards, a second.

    Parameters
    ----------
    config : SgorConfig, optional
        The one that is used later: what it turns off is not compiled.
    """
    config = config or SgorConfig()
    rng = np.random.default_rng(0)
    size = 40 * min(config.voxel_size, 5.0)    # max_range has a bound
    walls = rng.uniform(-size, size, (3000, 3))
    walls[:1000, 2], walls[1000:2000, 0], walls[2000:, 1] = -size / 4, size, size
    prepared = preprocess(SemanticScan(walls, np.zeros(len(walls), np.int64)),
                          config.replace(min_range=0.0, max_range=4 * size))
    register(prepared, prepared, config)
