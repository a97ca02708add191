"""What `preprocess` makes of one scan (`PreparedScan`)."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from .common.settings import InputError
from .config import first_difference
from .config import SgorConfig
from .execution.lazy import Lazy
from .features.features import Features
from .index.scan_index import ScanIndex
from .index.surface import Surface
from .scan.ground import Ground
from .scan.ground import Up
from .scan.scan import SemanticScan

Given = tuple[ArrayLike | None, ArrayLike | None]
"""Keypoints and descriptors of the caller, before they are checked."""


@dataclass(frozen=True, eq=False, repr=False)
class PreparedScan:
    """Everything of one scan that does not depend on the other: the result of `preprocess`.

    Attributes
    ----------
    scan : SemanticScan or None
        What it was made from; None where it is restored from a `CompactScan`.
    config : SgorConfig
        What it was made with, but for the scale.
    scale : float
        What the lengths of the configuration were multiplied by.
    features : Features
        Keypoints with labels, descriptors and heights.
    ground : Ground or None
        None where no ground plane was found.
    index : ScanIndex
        What it can say about transformations.
    surfaced : Lazy of Surface or None
        Makes `surface`.
    warnings : tuple of str
        What was odd about the scan, in words.
    timings : dict of str to float
        Stage to seconds.
    given : pair of arrays or None
        Keypoints and descriptors of the caller.
    up : Up or None
        What was known of the direction up.
    frame_covariance : (6, 6) array or None
        Of its frame, in itself, for what is not known of the motion during the sweep, m^2 and
        rad^2; None where there is none to know.
    """

    scan: SemanticScan | None
    config: SgorConfig
    scale: float
    features: Features
    ground: Ground | None
    index: ScanIndex
    surfaced: Lazy[Surface | None]
    warnings: tuple[str, ...]
    timings: dict[str, float]
    given: Given | None = None
    up: Up | None = None
    frame_covariance: NDArray[np.float64] | None = None

    def check(self, config: SgorConfig, name: str) -> None:
        """Refuse a configuration that this scan was not prepared with.

        Label conventions may differ: labels are classes by now. So may scales, of which the larger
        is taken.

        Parameters
        ----------
        config : SgorConfig
        name : str
            What to call the scan.

        Raises
        ------
        InputError
            Naming the first setting that differs.
        """
        if item := first_difference(self.config, config):
            mine, asked = getattr(self.config, item), getattr(config, item)
            raise InputError(f'{name}: prepared with {item} = {mine!r}, not with {asked!r}; '
                             'preprocess it with the configuration of the registration')

    def raw(self, why: str) -> SemanticScan:
        """Return the scan, which is to be prepared again.

        Raises
        ------
        InputError
            It is restored from a compact one, without its points; with the reason `why`.
        """
        if self.scan is None:
            raise InputError(f'scan: {why}, and a compact scan has no points to prepare again')
        return self.scan

    @property
    def surface(self) -> Surface | None:
        """Cloud for the local refinement; None where there are too few points."""
        return self.surfaced()

    def __repr__(self) -> str:
        return (f'PreparedScan({self.scan or "compact"}, {len(self.features.points)} keypoints, '
                f'scale {self.scale:g})')


def as_scan(scan: SemanticScan | PreparedScan | ArrayLike,
            name: str) -> SemanticScan | PreparedScan:
    """Return a scan as it is, and (N, 3) points as one without labels.

    Raises
    ------
    InputError
        Naming `name`, what is neither.
    """
    if isinstance(scan, SemanticScan | PreparedScan):
        return scan
    try:
        return SemanticScan(scan)
    except InputError as error:
        raise InputError(f'{name}: neither a SemanticScan nor an (N, 3) array of points '
                         f'({error})') from error
