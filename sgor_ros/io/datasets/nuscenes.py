"""Keyframes of nuScenes, from its tables: a drive for each scene."""
from functools import partial
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...core.common import se3
from ...core.common.settings import InputError
from ..scans import read_scan
from .drive import Drive
from .drive import DriveScan
from .names import increasing

SENSOR = 'samples/LIDAR_TOP/'
TABLES = ('scene', 'sample', 'sample_data', 'ego_pose', 'calibrated_sensor')

Row = dict[str, Any]


def recognises(path: Path) -> bool:
    """Whether a folder is that of a download: it holds tables such as ``v1.0-mini``."""
    return bool(_versions(path))


def drives(path: Path, name: str) -> list[Drive]:
    """Return each scene that has scans here, by its own name such as ``scene-0061``.

    Raises
    ------
    InputError
        A table is missing or broken, or no scan that they tell of is here.
    """
    found = [drive for tables in _versions(path) for drive in _scenes(path, tables)]
    if not found:
        raise InputError(f'{path}/{SENSOR}: none of the scans that the tables tell of is here')
    return found


def _versions(path: Path) -> list[Path]:
    return sorted(table.parent for table in path.glob('v1.0-*/sample_data.json'))


def _scenes(path: Path, tables: Path) -> list[Drive]:
    scene, sample, sample_data, ego_pose, mount = (_table(tables, name) for name in TABLES)
    labels = ({row['sample_data_token']: path / row['filename']
               for row in _table(tables, 'lidarseg').values()}
              if (tables / 'lidarseg.json').is_file() else {})
    try:
        scans: dict[str, list[Row]] = {}
        for row in sample_data.values():
            if row['filename'].startswith(SENSOR) and (path / row['filename']).is_file():
                scans.setdefault(sample[row['sample_token']]['scene_token'], []).append(row)
        found = []
        for token, rows in scans.items():
            rows.sort(key=lambda row: row['timestamp'])
            name = scene[token]['name']
            files = [path / row['filename'] for row in rows]
            poses = [_matrix(ego_pose[row['ego_pose_token']])
                     @ _matrix(mount[row['calibrated_sensor_token']]) for row in rows]
            drive_scans = [DriveScan(f'{name}/{i:03d}', 'nuscenes', 'nuscenes',
                            partial(read_scan, file, labels.get(row['token'])))
                      for i, (row, file) in enumerate(zip(rows, files, strict=True))]
            # of the vehicle only the place on a plane is known
            found.append(Drive(name, drive_scans, np.array(poses), False, increasing(
                [int(row['timestamp']) * 1000 for row in rows], tables, files)))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f'{tables}: not the tables of nuScenes: {error!r}') from error
    return sorted(found, key=lambda drive: drive.name)


def _table(tables: Path, name: str) -> dict[str, Row]:
    """Return the rows of a table by their tokens."""
    path = tables / f'{name}.json'
    try:
        return {row['token']: row for row in json.loads(path.read_text())}
    except OSError as error:
        raise InputError(f'{path}: cannot be read: {error}') from error
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f'{path}: no table of nuScenes: {error!r}') from error


def _matrix(row: Row) -> NDArray[np.float64]:
    w, x, y, z = row['rotation']
    return se3.compose(Rotation.from_quat([x, y, z, w]).as_matrix(),
                       np.array(row['translation'], np.float64))
