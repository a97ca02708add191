"""What every layout is read into: the scans of one place, with stamps and poses."""
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.common.settings import InputError
from ...core.scan.scan import SemanticScan


@dataclass(frozen=True, eq=False)
class Frame:
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


@dataclass(frozen=True, eq=False)
class Drive:
    """Scans of one place in the order of recording; other drives are other places.

    Attributes
    ----------
    name : str
    frames : sequence of Frame
    T_world_sensor : (N, 4, 4) float64 or None
        True poses.
    heights_known : bool
        Whether the heights of the poses are as good as the rest.
    stamps_ns : (N,) int64 or None
        When the scans were taken, nanoseconds, increasing; None where nothing tells.
    """

    name: str
    frames: Sequence[Frame]
    T_world_sensor: NDArray[np.float64] | None
    heights_known: bool = True
    stamps_ns: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.frames)

    def read(self, index: int) -> SemanticScan:
        """Return a scan.

        Raises
        ------
        InputError
            Its file is broken, or its labels do not fit.
        """
        return self.frames[index].read()

    @property
    def label_convention(self) -> str:
        """What the ids of all its scans mean.

        Raises
        ------
        InputError
            They do not all mean the same.
        """
        found = list(dict.fromkeys(frame.label_convention for frame in self.frames))
        if len(found) > 1:
            raise InputError(f'{self.name}: its scans have labels of several conventions '
                             f'({", ".join(found)}); choose one folder of labels')
        return found[0]
