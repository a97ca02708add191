"""`preprocess`: everything of one scan that does not depend on the other (Sec. III-B)."""
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .common.checks import as_numbers
from .common.checks import finite_points
from .common.settings import InputError
from .config import SgorConfig
from .execution.lazy import Lazy
from .execution.stopwatch import Stopwatch
from .execution.tasks import run_both
from .execution.threads import cores
from .features.descriptors import fpfh
from .features.descriptors import normals
from .features.descriptors import regional_labels
from .features.descriptors import unit_rows
from .features.features import Features
from .features.neighbours import radius_neighbours
from .features.semantic_context import context_classes
from .features.semantic_context import semantic_context
from .index.range_image import range_image
from .index.scan_index import scan_index
from .index.surface import Surface
from .index.surface import surface
from .prepared_scan import as_scan
from .prepared_scan import Given
from .prepared_scan import PreparedScan
from .scan.directions import by_direction
from .scan.ground import Ground
from .scan.ground import printed_ground
from .scan.ground import segment_ground
from .scan.ground import Up
from .scan.isolated_returns import not_isolated
from .scan.labels import label_convention
from .scan.labels import LabelConvention
from .scan.point_filter import usable_points
from .scan.scale import scale_of
from .scan.scale import STREET_VOXEL
from .scan.scan import rounding_warning
from .scan.scan import SemanticScan
from .scan.voxels import shift_of
from .scan.voxels import thin
from .scan.voxels import voxel_grid
from .scan.voxels import VoxelCloud


def preprocess(scan: SemanticScan | ArrayLike, config: SgorConfig | None = None, *,
               keypoints: ArrayLike | None = None, descriptors: ArrayLike | None = None,
               scale_before: float | None = None, up_before: ArrayLike | None = None
               ) -> PreparedScan:
    """Segment the ground and describe the rest of one scan, once for all its registrations.

    Parameters
    ----------
    scan : SemanticScan or (N, 3) array
        An array is points without labels, metres.
    config : SgorConfig, optional
        ``SgorConfig()`` where none is given.
    keypoints : (V, 3) array, optional
        Keypoints of the caller, metres, in place of the voxels.
    descriptors : (V, D) array, optional
        Their learned features, such as FCGF; both scans need the same D.
    scale_before : float, optional
        The scale of the scan before, to keep where it fits nearly as well.
    up_before : (3,) array, optional
        Which way was up for the scan before, to keep where a plane agrees with it.

    Returns
    -------
    PreparedScan

    Raises
    ------
    InputError
        What is no scan or no configuration; only one of keypoints and descriptors is given, or
        their lengths differ.
    """
    config = SgorConfig.given(config)
    semantic = as_scan(scan, 'scan')
    if isinstance(semantic, PreparedScan):
        raise InputError('scan: it has been preprocessed already')
    with cores(config.threads):
        given = None if keypoints is None and descriptors is None else (keypoints, descriptors)
        up = _up(semantic, up_before)
        return _prepare(semantic, config, given, scale_before, up)


def at_scale(prepared: PreparedScan, scale: float) -> PreparedScan:
    """Prepare a scan again where its scale is another.

    Raises
    ------
    InputError
        It is restored from a compact one, without its points.
    """
    if prepared.scale == scale:
        return prepared
    again = _prepare(prepared.raw('its scale is another'), prepared.config.replace(scale=scale),
                     prepared.given, None, prepared.up)
    return replace(again, config=prepared.config, frame_covariance=prepared.frame_covariance)


def _up(scan: SemanticScan, before: ArrayLike | None) -> Up | None:
    """Return what is known of the direction up: from the mount, or from the scan before."""
    if scan.up is not None:
        return Up(scan.up, told=True)
    return None if before is None else Up(np.asarray(before, np.float64), told=False)


def _prepare(scan: SemanticScan, asked: SgorConfig, given: Given | None,
             scale_before: float | None, up: Up | None) -> PreparedScan:
    convention = label_convention(asked.label_convention)
    clock = Stopwatch()
    scale = asked.scale or 1.0
    config, points, labels, warnings, cloud, ranges = _gridded(scan, convention, asked, scale,
                                                                clock)
    if asked.scale == 0:
        with clock('voxel grid'):
            even = cloud if config.voxel_size == STREET_VOXEL else voxel_grid(
                points, labels, STREET_VOXEL)
            scale = scale_of(even.points, scale_before)
        if scale != 1:
            config, points, labels, warnings, cloud, ranges = _gridded(
                scan, convention, asked, scale, clock)
    if rounded := rounding_warning(scan):
        warnings.append(rounded)
    if len(cloud.points) > config.max_voxels:
        warnings.append(f'{len(cloud.points)} voxels thinned to {config.max_voxels}')
        cloud = cloud[thin(len(cloud.points), config.max_voxels)]
    cloud, regional, directions, ground = _segmented(scan, cloud, points, labels, convention,
                                                        up, config, clock)
    if given is None:
        features = Features(cloud.points, cloud.labels, regional, partial(
            fpfh_descriptors, cloud.points, directions, config.descriptor_radius))
    else:
        features = _given(*given, cloud, regional, config)
        directions = normals(scan.seen_from_sensor(features.points), radius_neighbours(
            features.points, config.normal_radius), config.normal_radius)
    if ground is None:
        warnings.append('no ground plane found: no ground check')
    else:
        features = _over_ground(features, ground, convention, config)
        if ground.source == 'geometry' and features.labelled_share > 0:
            warnings.append('no ground labels: ground plane found by geometry')
    with clock('index'):
        index = scan_index(ranges, features, directions,
                           None if ground is None else ground.normal,
                           config.max_correspondence_distance, scan.origin)
    return PreparedScan(
        scan, asked, scale, features, ground, index,
        Lazy(partial(_fixed_surface, scan, points, labels, convention, config)), tuple(warnings),
        clock.seconds, given, up)


def _gridded(scan: SemanticScan, convention: LabelConvention, asked: SgorConfig, scale: float,
             clock: Stopwatch) -> tuple[SgorConfig, NDArray[np.float32], NDArray[np.uint8],
                                        list[str], VoxelCloud, NDArray[np.float32]]:
    """Return settings of a scale, usable points, labels, warnings, voxels and range image."""
    config = asked.scaled(scale)
    with clock('voxel grid'):
        points, labels, warnings = usable_points(scan, convention, config)
        rays = by_direction(scan.seen_from_sensor(points))
        kept = np.ones(len(points), np.bool_)
        if config.drop_isolated:
            kept = not_isolated(rays, config.voxel_size)
            points, labels = np.compress(kept, points, axis=0), labels[kept]
        cloud, ranges = run_both(
            config.threads, partial(voxel_grid, points, labels, config.voxel_size),
            partial(range_image, rays, kept))
    return config, points, labels, warnings, cloud, ranges


def _segmented(scan: SemanticScan, cloud: VoxelCloud, points: NDArray[np.float32],
               labels: NDArray[np.uint8], convention: LabelConvention, up: Up | None,
               config: SgorConfig, clock: Stopwatch
               ) -> tuple[VoxelCloud, NDArray[np.uint8], NDArray[np.float64], Ground | None]:
    """Return the voxels that may be matched, their regional labels and normals; the ground."""
    with clock('ground'):
        ground = (segment_ground(cloud, convention.ground, config, up, scan.origin)
                  if config.robust_ground else
                  printed_ground(cloud, points, labels, convention.ground, config))
        if ground is not None and config.correspondence_preprocessing:
            cloud = cloud[~ground.mask]
    with clock('neighbours'):
        radius = max(config.vote_radius, config.normal_radius)
        neighbours = radius_neighbours(cloud.points, radius)
    with clock('votes'):
        regional = regional_labels(cloud, neighbours, config.vote_radius)
        keep = ~np.isin(regional, _unmatched_classes(convention, config))
        if config.correspondence_preprocessing and config.drop_ground_labels == 'point':
            keep &= ~np.isin(cloud.labels, list(convention.ground))    # S_n of Eq. 4
    with clock('normals'):
        directions = normals(scan.seen_from_sensor(cloud.points), neighbours,
                             config.normal_radius, keep)
    return cloud[keep], regional[keep], directions[keep], ground


def _fixed_surface(scan: SemanticScan, points: NDArray[np.float32], labels: NDArray[np.uint8],
                   convention: LabelConvention, config: SgorConfig) -> Surface | None:
    """Return the surface of all that stands still, on a grid that no other scan has."""
    cloud = voxel_grid(points, labels, config.voxel_size, shift_of(points))
    if len(cloud.points) > config.max_voxels:
        cloud = cloud[thin(len(cloud.points), config.max_voxels)]
    fixed = config.moving_vote | ~np.isin(cloud.labels, list(convention.movable))
    return surface(cloud.points[fixed], config.voxel_size, scan.origin)


def _unmatched_classes(convention: LabelConvention, config: SgorConfig) -> list[int]:
    """Return the regional labels that take no part in matching."""
    ground = (convention.ground if config.correspondence_preprocessing
              and config.drop_ground_labels == 'regional' else frozenset())
    return sorted(ground if config.moving_vote else ground | convention.movable)


def fpfh_descriptors(points: NDArray[np.float64], directions: NDArray[np.float64], radius: float
                     ) -> NDArray[np.float32]:
    """Return the FPFH of (V, 3) keypoints with unit normals, within a radius, metres: (V, 33)."""
    return fpfh(points, directions, radius_neighbours(points, radius))


def _over_ground(features: Features, ground: Ground, convention: LabelConvention,
                 config: SgorConfig) -> Features:
    """Add what needs a ground plane: heights over it and the semantic context."""
    heights = ground.heights(features.points)
    if config.context_weight == 0:
        return replace(features, heights=heights)
    return replace(features, heights=heights, surrounded=partial(
        semantic_context, features.points, features.regional, ground, context_classes(convention),
        config))


def _given(keypoints: ArrayLike | None, descriptors: ArrayLike | None, cloud: VoxelCloud,
           regional: NDArray[np.uint8], config: SgorConfig) -> Features:
    """Give the caller's keypoints the labels of the nearest voxel; drop those without one near.

    Those are on the ground, out of range or on something that moves.
    """
    if keypoints is None or descriptors is None:
        raise InputError('keypoints and descriptors: give both or none')
    points = finite_points(keypoints, 'keypoints')
    described = as_numbers(descriptors, 'descriptors').astype(np.float32)
    if described.ndim != 2 or len(described) != len(points):
        raise InputError(f'descriptors: expected one row a keypoint, ({len(points)}, D), '
                         f'got shape {described.shape}')
    if not np.isfinite(described).all():
        raise InputError('descriptors: not all are finite')
    distance, nearest = cKDTree(cloud.points).query(points, workers=config.threads)
    rows = np.flatnonzero(distance <= config.voxel_size)
    nearest = nearest[rows]
    return Features(points[rows], cloud.labels[nearest], regional[nearest],
                    unit_rows(described[rows]))
