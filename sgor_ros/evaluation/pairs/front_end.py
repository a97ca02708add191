"""What methods are given of a pair: its scans, or matches that all of them share."""
from dataclasses import dataclass
from dataclasses import replace
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...core.common import se3
from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ...core.matching.correspondences import Correspondences
from ...core.matching.correspondences import match
from ...core.matching.correspondences import overlap_region
from ...core.prepared_scan import PreparedScan
from ...core.preprocessing import preprocess
from ...core.scan.labels import label_convention
from ...core.scan.labels import UNLABELLED
from ...core.scan.scan import SemanticScan
from ...io.datasets import DriveScan
from .pair import Matches
from .pair import Pair
from .pair import Scans

Array = NDArray[np.float64]

TILT_RAD = math.radians(2.0)


@dataclass(frozen=True)
class Variant:
    """What a study changes; the default changes nothing.

    Attributes
    ----------
    name : str
        What it is called in tables.
    matches : int
        So many of them, drawn at random; 0: all.
    categories : int
        The most frequent categories that are not ground stay, the others lose their labels; 0:
        all stay.
    random_labels : float
        Share of the points whose label is drawn from those that occur.
    seed : int
    """

    name: str = ''
    matches: int = 0
    categories: int = 0
    random_labels: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class Features:
    """Where features of somebody else lie: ``FOLDER/NAME.npz`` for each scan, by its name.

    Each has ``points`` (V, 3), metres in the scan's frame, and ``descriptors`` (V, D); other
    arrays are ignored, so that files of FCGF serve once ``xyz`` and ``features`` are renamed.
    """

    folder: Path

    def read(self, scan: DriveScan) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Return the keypoints and descriptors of a scan."""
        path = self.folder / f'{scan.name}.npz'
        try:
            with np.load(path) as file:
                return file['points'].astype(np.float64), file['descriptors'].astype(np.float32)
        except (OSError, KeyError, ValueError) as error:
            raise InputError(f'{path}: expected arrays points and descriptors: {error}'
                             ) from error


def scans_of(pair: Pair, seed: int | None) -> tuple[Scans, Array | None]:
    """Read the scans of a pair; return them with the true T_target_source.

    With a seed the source is turned: by a uniform yaw, a roll and pitch of 2 degrees (normal).
    """
    source, target = (scan.read() for scan in pair.scans)
    truth = pair.T_target_source
    if seed is not None:
        rng = np.random.default_rng(seed)
        R = Rotation.from_euler('zyx', [rng.uniform(0, 2 * np.pi), *rng.normal(0, TILT_RAD, 2)])
        T_turned_source = se3.compose(R.as_matrix(), np.zeros(3))
        turned = se3.transform(T_turned_source, source.points.astype(np.float64))
        source = SemanticScan(turned.astype(np.float32), source.labels)
        truth = None if truth is None else truth @ se3.inverse(T_turned_source)
    of_source, of_target = (scan.label_convention for scan in pair.scans)
    return Scans(source, target, of_source, of_target, seed or 0), truth


def shared_matches(pair: Pair, config: SgorConfig, inlier_m: float, variant: Variant,
                   features: Features | None = None) -> Matches:
    """Return what every method of a table gets for a pair."""
    rng = np.random.default_rng([variant.seed, *pair.name.encode()])
    if pair.matches is not None:
        found = _thinned(pair.matches.correspondences, variant.matches, rng)
        return replace(pair.matches, correspondences=found)
    source, target = (_prepared(scan, config, variant, rng, features)
                      for scan in pair.scans)
    p, q = source.features, target.features
    if config.correspondence_preprocessing and config.semantics != 'none':
        p, q = overlap_region(p, q)
    found = _thinned(match(p, q, config), variant.matches, rng)
    normals = (None if source.ground is None or target.ground is None
               else (source.ground.normal, target.ground.normal))
    return Matches(found, inlier_m, normals)


def _prepared(drive_scan: DriveScan, config: SgorConfig, variant: Variant,
              rng: np.random.Generator, features: Features | None) -> PreparedScan:
    scan = drive_scan.read()
    labels = scan.labels
    if labels is not None:
        if variant.random_labels:
            labels = random_labels(labels, variant.random_labels, rng)
        if variant.categories:
            labels = with_categories(labels, drive_scan.label_convention, variant.categories)
    keypoints, descriptors = (None, None) if features is None else features.read(drive_scan)
    return preprocess(SemanticScan(scan.points, labels),
                      config.replace(label_convention=drive_scan.label_convention),
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


def random_labels(labels: NDArray[np.int64], share: float, rng: np.random.Generator
                  ) -> NDArray[np.int64]:
    """Replace a share of the labels (N,) by random ones of those that occur."""
    wrong = rng.random(len(labels)) < share
    return np.where(wrong, rng.choice(np.unique(labels), len(labels)), labels)
