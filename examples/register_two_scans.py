"""Where is one scan relative to another? From numpy arrays, without an initial guess."""
import numpy as np

from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import Registration
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.world import simulate


def main() -> Registration:
    """Register two scans of the built-in street that are 12 m apart."""
    # stand-ins for yours: points (N, 3) in metres, in the sensor frame; one class id a point
    scans = list(simulate(3, seed=0, speed=60.0))
    _, target_points, target_labels, T_world_target = scans[0]
    _, source_points, source_labels, T_world_source = scans[2]

    config = SgorConfig()    # or SgorConfig.paper(): the paper's steps only
    # once a scan, however often it is registered; the first call compiles for a minute or two
    target = preprocess(SemanticScan(target_points, target_labels), config)
    source = preprocess(SemanticScan(source_points, source_labels), config)
    result = register(source, target, config)

    if result.success:
        assert result.T_target_source is not None
        truth = np.linalg.inv(T_world_target) @ T_world_source
        off = np.linalg.norm(result.T_target_source[:3, 3] - truth[:3, 3])
        print(result.T_target_source.round(3))
        print(f'confidence {result.confidence:.2f}, {100 * off:.1f} cm off the truth')
    else:
        # no exception: failing is a result, and says why
        print('not to be trusted:', result.reason)
        print('slides along', result.degenerate)    # (K, 6) directions, or none
        print('or else', [other.T_target_source for other in result.alternatives])
    return result


if __name__ == '__main__':
    main()
