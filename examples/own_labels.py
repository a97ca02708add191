"""Labels of your own segmentation network, half of them wrong.

Any integers do: name what they mean (`label_convention`). Here they are SemanticKITTI's train ids,
which most networks write; `label_convention.py` beside this file is for ids that nobody else has.
"""
import numpy as np
from numpy.typing import NDArray

from sgor_ros import register
from sgor_ros import Registration
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.world import simulate

# raw id -> train id, of the classes that the built-in street has
TRAIN_ID = {10: 0, 40: 8, 44: 9, 48: 10, 49: 11, 50: 12, 51: 13, 52: 255, 70: 14, 71: 15, 72: 16,
            80: 17, 81: 18, 99: 255}


def segment(raw: NDArray[np.uint32], rng: np.random.Generator) -> NDArray[np.int64]:
    """Stand in for your network: train ids (N,), every second one drawn at random."""
    ids = np.array([TRAIN_ID[int(label)] for label in raw])
    wrong = rng.random(len(ids)) < 0.5
    ids[wrong] = rng.integers(0, 19, int(wrong.sum()))
    return ids


def main() -> Registration:
    """Register two scans with such labels."""
    rng = np.random.default_rng(0)
    scans = list(simulate(2, seed=0, speed=60.0))
    target, source = (SemanticScan(points, segment(raw, rng)) for _, points, raw, _ in scans)
    result = register(source, target, SgorConfig(label_convention='semantickitti_train'))
    print('registered' if result.success else result.reason, f'{result.confidence:.2f}')
    # ids that the convention does not list and the like: read them, the wrong table costs recall
    print('warnings:', *result.warnings)
    return result


if __name__ == '__main__':
    main()
