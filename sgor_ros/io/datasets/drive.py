"""What every layout is read into: the scans of one place, with stamps and poses."""
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
from functools import partial
from typing import Self
import warnings

import numpy as np
from numpy.typing import NDArray

from ...core.common.settings import InputError
from ...core.scan.scan import SemanticScan
from ..sequence import StampedScan

PERIOD_NS = 100_000_000
"""Between scans whose times nobody knows: spinning LiDARs mostly turn at 10 Hz."""

FRAME_ID = 'lidar'
"""Of the sensor, which files don't name."""


@dataclass(frozen=True, eq=False)
class DriveScan:
    """One scan of a drive.

    Attributes
    ----------
    name : str
    data_set : str
        What it is counted under in tables.
    label_convention : str
    read : callable
        Returns the `SemanticScan`.
    """

    name: str
    data_set: str
    label_convention: str
    read: Callable[[], SemanticScan]

    def without_labels(self) -> Self:
        """Return the same scan without labels."""
        return replace(self, read=partial(_unlabelled, self))


@dataclass(frozen=True, eq=False)
class Drive:
    """Scans of one place in the order of recording; other drives are other places.

    It is a `ScanSequence`: iterating gives each scan with its stamp.

    Attributes
    ----------
    name : str
    scans : sequence of DriveScan
    T_world_sensor : (N, 4, 4) float64 or None
        True poses.
    heights_known : bool
        Whether the heights of the poses are as good as the rest.
    stamps_ns : (N,) int64 or None
        When the scans were taken, nanoseconds, increasing; None where nothing tells.
    warnings : tuple of str
        What may be wrong with the drive as a whole, in words.
    """

    name: str
    scans: Sequence[DriveScan]
    T_world_sensor: NDArray[np.float64] | None
    heights_known: bool = True
    stamps_ns: NDArray[np.int64] | None = None
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.scans)

    def __iter__(self) -> Iterator[StampedScan]:
        """Iterate over the scans; those without stamps come at 10 Hz from 1 s on."""
        stamps = ([(i + 10) * PERIOD_NS for i in range(len(self))] if self.stamps_ns is None
                  else self.stamps_ns.tolist())
        for stamp_ns, scan in zip(stamps, self.scans, strict=True):
            yield StampedScan(stamp_ns, FRAME_ID, scan.read, stamp_ns)

    def read(self, index: int) -> SemanticScan:
        """Return a scan.

        Raises
        ------
        InputError
            Its file is broken, or its labels do not fit.
        """
        return self.scans[index].read()

    def without_labels(self) -> Self:
        """Return the same drive with scans that have no labels."""
        return replace(self, scans=[scan.without_labels() for scan in self.scans])

    @property
    def frames(self) -> Sequence[DriveScan]:
        """The scans, by the name that they had before."""
        warnings.warn('Drive.frames is Drive.scans now', DeprecationWarning, stacklevel=2)
        return self.scans

    @property
    def expected(self) -> int:
        """How many scans there are."""
        return len(self)

    @property
    def label_convention(self) -> str:
        """What the ids of all its scans mean.

        Raises
        ------
        InputError
            They do not all mean the same.
        """
        found = list(dict.fromkeys(scan.label_convention for scan in self.scans))
        if len(found) > 1:
            raise InputError(f'{self.name}: its scans have labels of several conventions '
                             f'({", ".join(found)}); choose one folder by labels')
        return found[0]


def _unlabelled(scan: DriveScan) -> SemanticScan:
    return SemanticScan(scan.read().points)
