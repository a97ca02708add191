"""What is kept of a keyframe, and which are kept: those of space that none covers yet."""
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import replace

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
    held : CompactScan or callable
        Its scan, or what reads it from a file each time: see `scan`.
    descriptor : (D,) float32
        What it looks like: see `retrieval`.
    frame_covariance : (6, 6) float64 or None
        As of `PreparedScan`.
    """

    id: int
    stamp_ns: int
    track_id: int
    held: CompactScan | Callable[[], CompactScan]
    descriptor: Descriptor
    frame_covariance: Array | None = None

    @property
    def scan(self) -> CompactScan:
        """A few hundred kilobytes, for `register` when it is restored."""
        return self.held if isinstance(self.held, CompactScan) else self.held()

    @property
    def nbytes(self) -> int:
        """Bytes of scan and descriptor in memory."""
        scan = self.held.nbytes if isinstance(self.held, CompactScan) else 0
        return scan + self.descriptor.nbytes


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

    def copy(self, nodes: Iterable[int] | None = None) -> 'Keyframes':
        """Return others of the same keyframes, or of those among some nodes."""
        copied = Keyframes()
        for node in self._kept if nodes is None else nodes:
            if node in self._kept:
                copied.put(self._kept[node])
        return copied

    @property
    def nbytes(self) -> int:
        """Bytes of scans and descriptors in memory."""
        return sum(one.nbytes for one in self)

    def add(self, node: int, stamp_ns: int, track_id: int, prepared: PreparedScan) -> None:
        """Keep a scan; one of the same node gives way to it."""
        self.put(Keyframe(node, stamp_ns, track_id, compact(prepared), describe(prepared),
                          prepared.frame_covariance))

    def put(self, keyframe: Keyframe) -> None:
        """Take one that is kept elsewhere too; one of the same node gives way to it."""
        self._kept[keyframe.id] = keyframe
        self._restored.pop(keyframe.id, None)
        self._retrieval.add(keyframe.id, keyframe.descriptor)

    def alike(self, prepared: PreparedScan, most: int | None = None) -> dict[int, float]:
        """Return those that look like a scan with their likeness, the most alike first.

        All of them, or so many.
        """
        return self._retrieval.alike(describe(prepared), most)

    def restored(self, node: int) -> PreparedScan:
        """Return the scan of a keyframe as `register` takes it."""
        prepared = self._restored.pop(node, None)
        if prepared is None:
            kept = self._kept[node]
            prepared = replace(kept.scan.restored(), frame_covariance=kept.frame_covariance)
        self._restored[node] = prepared    # the last that was asked for is the last to go
        while len(self._restored) > RESTORED:
            del self._restored[next(iter(self._restored))]
        return prepared
