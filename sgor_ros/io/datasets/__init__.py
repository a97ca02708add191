"""Scans on disk, one file for each layout; which it is, is seen from the path."""
from dataclasses import replace
from pathlib import Path
from types import ModuleType

from ...core.common.settings import InputError
from ..bags import compressed_or_ros1
from . import bags
from . import helipr
from . import mulran
from . import nuscenes
from . import rellis
from . import scans
from . import semantickitti
from .drive import Drive
from .drive import DriveScan
from .names import missing_numbers

__all__ = ['Drive', 'DriveScan', 'Frame', 'open_drive', 'open_drives']

Frame = DriveScan
"""Its name before: evaluation still says so."""

LAYOUTS: tuple[ModuleType, ...] = (nuscenes, semantickitti, rellis, helipr, mulran)
"""Those that the names of folders tell; whatever else holds scans is a folder of scans."""

LEVELS = 2
"""Drives are looked for so far below a folder."""


def open_drive(path: str | Path, sequence: str | None = None,
               labels: str | Path | None = None) -> Drive:
    """Open the scans of a path; which layout it is, is seen from the names in it.

    Parameters
    ----------
    path : str or Path
        A bag or a folder: a sequence of KITTI, SemanticKITTI, RELLIS-3D, MulRan or HeLiPR, a
        download of nuScenes, or any folder of ``.bin``, ``.npz``, ``.pcd`` and ``.ply``.
    sequence : str, optional
        Which drive, where the path holds several: its name or the last part of it.
    labels : str or Path, optional
        Folder with a ``.label`` for each scan, by its name: a path, or the name of one in the
        folder of the drive.

    Returns
    -------
    Drive
        Its scans are read when they are asked for.

    Raises
    ------
    InputError
        Nothing to read there, several drives and none chosen, or files that do not fit together.
    """
    found = open_drives(path, labels)
    if sequence is not None:
        chosen = [drive for drive in found
                  if sequence in (drive.name, drive.name.rpartition('/')[2])]
        if len(chosen) == 1:
            return chosen[0]
        problem = f'no drive {sequence}' if not chosen else f'several drives {sequence}'
    elif len(found) == 1:
        return found[0]
    else:
        problem = 'several drives, choose one'
    raise InputError(f'{path}: {problem}; there are {", ".join(drive.name for drive in found)}')


def open_drives(path: str | Path, labels: str | Path | None = None) -> list[Drive]:
    """Open all drives of a path, itself or up to two levels below; otherwise as `open_drive`."""
    path = Path(path)
    if bags.recognises(path):
        if labels is not None:
            raise InputError(f'labels {labels}: the clouds of a bag have theirs in a field')
        return bags.drives(path, path.stem)
    if not path.exists():
        raise InputError(f'{path}: no such file or folder')
    if advice := compressed_or_ros1(path):
        raise InputError(f'{path}: {advice}')
    if not path.is_dir():
        raise InputError(f'{path}: neither a bag nor a folder')
    folders = _folders(path)
    for layouts in (LAYOUTS, (scans,)):
        found: list[Drive] = []
        taken: list[Path] = []
        for folder in folders:
            layout = next((each for each in layouts if each.recognises(folder)), None)
            if layout is not None and not any(folder.is_relative_to(above) for above in taken):
                taken.append(folder)
                found += _drives(layout, folder, _name(folder, path), labels)
        if found:
            return [_checked(drive) for drive in found]
    raise InputError(f'{path}: no folder velodyne in it or in {LEVELS} levels below, and nothing '
                     f'else that is a drive: see docs/data.md')


def _drives(layout: ModuleType, folder: Path, name: str, labels: str | Path | None
            ) -> list[Drive]:
    if labels is None:
        found: list[Drive] = layout.drives(folder, name)
    elif layout in (semantickitti, scans):
        found = layout.drives(folder, name, labels)
    else:
        raise InputError(f'labels {labels}: {folder} has its own, in the layout of '
                         f'{layout.__name__.rpartition(".")[2]}')
    return found


def _checked(drive: Drive) -> Drive:
    """Return the drive with a warning where scans are missing, which times would tell."""
    if drive.stamps_ns is not None:
        return drive
    return replace(drive, warnings=missing_numbers([scan.name for scan in drive.scans]))


def _folders(path: Path) -> list[Path]:
    """Return a folder and those below it, level by level."""
    levels = [[path]]
    for _ in range(LEVELS):
        levels.append([child for folder in levels[-1] for child in sorted(folder.glob('*/'))])
    return [folder for level in levels for folder in level]


def _name(folder: Path, root: Path) -> str:
    return str(folder.relative_to(root)) if folder != root else folder.resolve().name
