"""What is kept of a keyframe, and which are kept: those of space that none covers yet."""
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.compact_scan import compact
from ..core.compact_scan import CompactScan
from ..core.prepared_scan import PreparedScan
from .retrieval import describe
from .retrieval import Descriptor
from .retrieval import Retrieval

Array = NDArray[np.float64]

RESTORED = 4
"""Keyframes that are held ready to be registered to; neighbours are asked for in a row."""


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A scan of the map; its pose is that of its node in the pose graph.

    Attributes
    ----------
    id : int
        Of its node.
    stamp_ns : int
    track_id : int
        The track that it came in by.
    scan : CompactScan
        A few hundred kilobytes, for `register` when it is restored.
    descriptor : (D,) float32
        What it looks like: see `retrieval`.
    frame_covariance : (6, 6) float64 or None
        As of `PreparedScan`.
    """

    id: int
    stamp_ns: int
    track_id: int
    scan: CompactScan
    descriptor: Descriptor
    frame_covariance: Array | None = None


class Keyframes:
    """Those that are kept."""

    def __init__(self) -> None:
        self._kept: dict[int, Keyframe] = {}
        self._retrieval = Retrieval()
        self._restored: dict[int, PreparedScan] = {}

    def __len__(self) -> int:
        return len(self._kept)

    def __iter__(self) -> Iterator[Keyframe]:
        return iter(self._kept.values())

    def __contains__(self, node: int) -> bool:
        return node in self._kept

    def __getitem__(self, node: int) -> Keyframe:
        return self._kept[node]

    @property
    def nbytes(self) -> int:
        """Bytes of scans and descriptors."""
        return sum(one.scan.nbytes + one.descriptor.nbytes for one in self)

    def add(self, node: int, stamp_ns: int, track_id: int, prepared: PreparedScan) -> None:
        """Keep a scan; one of the same node gives way to it."""
        keyframe = Keyframe(node, stamp_ns, track_id, compact(prepared), describe(prepared),
                            prepared.frame_covariance)
        self._kept[node] = keyframe
        self._restored.pop(node, None)
        self._retrieval.add(node, keyframe.descriptor)

    def alike(self, prepared: PreparedScan) -> list[int]:
        """Return those that look like a scan, the most alike first."""
        return self._retrieval.alike(describe(prepared))

    def restored(self, node: int) -> PreparedScan:
        """Return the scan of a keyframe as `register` takes it."""
        prepared = self._restored.pop(node, None) or self._kept[node].scan.restored()
        self._restored[node] = prepared    # the last that was asked for is the last to go
        while len(self._restored) > RESTORED:
            del self._restored[next(iter(self._restored))]
        return prepared
