"""From two scans to the matches that all methods share, and the truth that studies spoil."""
from dataclasses import dataclass
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.matching.correspondences import Correspondences
from ..core.matching.correspondences import match
from ..core.matching.correspondences import overlap_region
from ..core.prepared_scan import PreparedScan
from ..core.preprocessing import preprocess
from ..core.scan.labels import label_convention
from ..core.scan.labels import UNLABELLED
from ..core.scan.scan import SemanticScan
from ..io.datasets import DriveScan
from .methods import Matches
from .methods.sgor import random_labels
from .protocols.pairs import Pair
from .protocols.studies import Variant


@dataclass(frozen=True)
class Features:
    """Where features of somebody else lie: ``FOLDER/NAME.npz`` for each scan, by its name.

    Each has ``points`` (V, 3), metres in the scan's frame, and ``descriptors`` (V, D); other
    arrays are ignored, so that files of FCGF serve once ``xyz`` and ``features`` are renamed.
    """

    folder: Path

    def read(self, frame: DriveScan) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Return the keypoints and descriptors of a scan."""
        path = self.folder / f'{frame.name}.npz'
        try:
            with np.load(path) as file:
                return file['points'].astype(np.float64), file['descriptors'].astype(np.float32)
        except (OSError, KeyError, ValueError) as error:
            raise InputError(f'{path}: expected arrays points and descriptors: {error}'
                             ) from error


def shared_matches(pair: Pair, config: SgorConfig, inlier_m: float, variant: Variant,
                   features: Features | None = None) -> Matches:
    """Return what every method of a table gets for a pair."""
    rng = np.random.default_rng([variant.seed, *pair.name.encode()])
    if pair.matches is not None:
        found = _thinned(pair.matches.correspondences, variant.matches, rng)
        return replace(pair.matches, correspondences=found)
    source, target = (_prepared(frame, config, variant, rng, features)
                      for frame in pair.scans)
    p, q = source.features, target.features
    if config.correspondence_preprocessing and config.semantics != 'none':
        p, q = overlap_region(p, q)
    found = _thinned(match(p, q, config), variant.matches, rng)
    normals = (None if source.ground is None or target.ground is None
               else (source.ground.normal, target.ground.normal))
    return Matches(found, inlier_m, normals)


def _prepared(frame: DriveScan, config: SgorConfig, variant: Variant, rng: np.random.Generator,
              features: Features | None) -> PreparedScan:
    scan = frame.read()
    labels = scan.labels
    if labels is not None:
        if variant.random_labels:
            labels = random_labels(labels, variant.random_labels, rng)
        if variant.categories:
            labels = with_categories(labels, frame.label_convention, variant.categories)
    keypoints, descriptors = (None, None) if features is None else features.read(frame)
    return preprocess(SemanticScan(scan.points, labels),
                      config.replace(label_convention=frame.label_convention),
                      keypoints=keypoints, descriptors=descriptors)


def with_categories(labels: NDArray[np.int64], convention: str, count: int
                    ) -> NDArray[np.int64]:
    """Leave the labels of the ground and of the `count` most frequent other categories."""
    known = label_convention(convention)
    classes, _, _ = known.decode(labels)
    seen = np.bincount(classes, minlength=256)
    seen[[UNLABELLED, *known.ground]] = 0
    kept = [*known.ground, *np.argsort(-seen, kind='stable')[:count].tolist()]
    no_label = next(i for i in range(2**16) if i not in known.drop
                    and known.classes.get(i & known.mask, UNLABELLED) == UNLABELLED)
    return np.where(np.isin(classes, kept), labels, no_label)


def _thinned(found: Correspondences, count: int, rng: np.random.Generator) -> Correspondences:
    if not 0 < count < len(found):
        return found
    rows = np.sort(rng.permutation(len(found))[:count])
    return replace(found, **{name: getattr(found, name)[rows]
                             for name in found.__dataclass_fields__})
