"""Yesterday's map: a drive is mapped and saved; today's finds itself in it, and is added."""
from pathlib import Path
from tempfile import TemporaryDirectory

from sgor_ros import Map
from sgor_ros import Mapper
from sgor_ros import SemanticScan
from sgor_ros.world import Lidar
from sgor_ros.world import simulate


def main(folder: Path) -> Map:
    """Save, locate, go on, merge."""
    lidar = Lidar(beams=32, columns=900)
    scans = [(SemanticScan(points, labels), round(1e9 * seconds))
             for seconds, points, labels, _ in simulate(16, lidar=lidar, speed=25.0)]

    # yesterday: the first part of the street
    yesterday = Mapper()
    for scan, stamp_ns in scans[:10]:
        yesterday.track(scan, stamp_ns)
    yesterday.map.save(folder / 'yesterday')

    # today: where is this scan in yesterday's map?
    known = Map.load(folder / 'yesterday')
    found = known.locate(scans[8][0])
    print(found if found.success else f'not found: {found.reason}')

    # drive on in that map: begins lost, finds itself, adds what is new
    today = Mapper(map=known)
    for scan, stamp_ns in scans[5:]:
        mapped = today.track(scan, stamp_ns)
        if mapped.T_map_odom is not None and mapped.T_odom_sensor is not None:
            print('in the map at', (mapped.T_map_odom @ mapped.T_odom_sensor)[:3, 3].round(2))
    today.map.save(folder / 'today')

    # two maps that were made apart become one, or there is a reason why not
    alone = Mapper()
    for scan, stamp_ns in scans[4:]:
        alone.track(scan, stamp_ns)
    merged = known.merge(alone.map)
    print(merged.map if merged.success else f'not merged: {merged.reason}')
    return today.map


if __name__ == '__main__':
    with TemporaryDirectory() as temporary:
        main(Path(temporary))
