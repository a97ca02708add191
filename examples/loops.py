"""A drive down a street and back in the other lane: loops are closed, and all poses corrected."""
import numpy as np

from sgor_ros import Mapper
from sgor_ros import SemanticScan
from sgor_ros.world import Lidar
from sgor_ros.world.return_trip import there_and_back
from sgor_ros.world.street import loop_trajectory
from sgor_ros.world.street import street_scene


def main() -> Mapper:
    """Map a built-in street and print the loops."""
    street, lidar, rng = street_scene(0), Lidar(beams=32, columns=900), np.random.default_rng(0)
    mapper = Mapper()
    for i, T in enumerate(there_and_back(loop_trajectory(street, 20, speed=20.0), left=2.6)):
        scan = mapper.track(SemanticScan(*lidar.scan(street, T, rng)), stamp_ns=i * 100_000_000)
        for loop in scan.loops:
            sigma = np.sqrt(np.trace(loop.covariance[:3, :3]))
            print(f'{loop.source_stamp_ns * 1e-9:.1f} s is at the place of '
                  f'{loop.target_stamp_ns * 1e-9:.1f} s, to {100 * sigma:.0f} cm')
    stamps_ns, T_map_sensor = mapper.trajectory()
    print(f'{len(stamps_ns)} poses, the last at {T_map_sensor[-1, :3, 3].round(2)}')
    return mapper


if __name__ == '__main__':
    main()
