"""The compact form of a prepared scan: for keyframes that are kept, sent and written to files.

It holds what registering to it needs and cannot be made again: keypoints with labels and normals,
ground, ranges and the cloud of the local refinement. Descriptors, context and indexes follow from
these. All of it is exact but the cloud of the local refinement, which is float32.
"""
from collections.abc import Mapping
from dataclasses import asdict
from dataclasses import dataclass
from functools import partial
import json
from typing import Any
from typing import Self

import numpy as np
from numpy.typing import NDArray

from .common.checks import as_laid_out
from .common.checks import Layout
from .common.settings import InputError
from .config import SgorConfig
from .execution.lazy import Lazy
from .features.features import Features
from .features.semantic_context import context_classes
from .features.semantic_context import semantic_context
from .index.columns import in_columns
from .index.scan_index import scan_index
from .index.surface import Surface
from .prepared_scan import PreparedScan
from .preprocessing import fpfh_descriptors
from .scan.directions import AZIMUTHS
from .scan.directions import ELEVATIONS
from .scan.ground import Ground
from .scan.labels import label_convention

VERSION = 1
"""Of the arrays; another one is refused."""
CELLS = AZIMUTHS * ELEVATIONS
ARRAYS: Layout = {
    'points': (np.float64, ('V', 3)), 'normals': (np.float64, ('V', 3)),
    'labels': (np.uint8, ('V',)), 'regional': (np.uint8, ('V',)),
    'descriptors': (np.float32, ('V', 'D')), 'context_classes': (np.uint8, ('C',)),
    'plane': (np.float64, ('G',)), 'origin': (np.float64, (3,)), 'seen': (np.uint8, (CELLS // 8,)),
    'ranges': (np.float32, ('R',)), 'surface_points': (np.float32, ('S', 3)),
    'surface_normals': (np.float32, ('S', 3)), 'surface_sizes': (np.float64, (2,))}


@dataclass(frozen=True, eq=False, repr=False)
class CompactScan:
    """A prepared scan without what it was made from and without what follows from the rest.

    It pickles; `as_arrays` is for files. `restored` is what `register` takes.

    Attributes
    ----------
    config : SgorConfig
        What it was prepared with, but for the scale.
    scale : float
        What the lengths of the configuration were multiplied by.
    ground_source : str
        Where the first guess of the ground came from, as in `Ground`; empty without ground.
    ground_certain : bool
        As in `Ground`.
    arrays : dict of str to array
        ``points``, ``normals`` : (V, 3) float64, keypoints, metres, and their unit normals;
        ``labels``, ``regional`` : (V,) uint8, classes inside of keypoints and neighbourhoods;
        ``descriptors`` : (V, D) float32 of the caller, D is 0 where they follow from the rest;
        ``context_classes`` : (C,) uint8, classes that the semantic context tells apart;
        ``plane`` : (4,) float64, normal and offset of the ground, metres; (0,) without;
        ``origin`` : (3,) float64, place of the sensor, metres;
        ``seen`` : (8100,) uint8, cells of the range image that have a range, as bits;
        ``ranges`` : (R,) float32, those ranges, metres;
        ``surface_points``, ``surface_normals`` : (S, 3) float32, cloud of the local refinement;
        ``surface_sizes`` : (2,) float64, edge of its columns and median range, metres.
    """

    config: SgorConfig
    scale: float
    ground_source: str
    ground_certain: bool
    arrays: dict[str, NDArray[Any]]

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in self.arrays.values())

    def __repr__(self) -> str:
        return (f'CompactScan({len(self.arrays["points"])} keypoints, scale {self.scale:g}, '
                f'{self.nbytes / 1e6:.2f} MB)')

    def as_arrays(self) -> dict[str, NDArray[Any]]:
        """Return all of it as arrays without objects, for `numpy.savez` and the like."""
        about = {'version': VERSION, 'config': asdict(self.config), 'scale': self.scale,
                 'ground_source': self.ground_source, 'ground_certain': self.ground_certain}
        return {'about': np.frombuffer(json.dumps(about).encode(), np.uint8), **self.arrays}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Build from what `as_arrays` returned.

        Raises
        ------
        InputError
            Another version, an array that is missing or of another shape, or a setting that
            this version refuses.
        """
        try:
            about = json.loads(arrays['about'].tobytes())
            version = about['version']
        except (LookupError, ValueError, TypeError, AttributeError) as error:
            raise InputError(f'about: not of a compact scan ({error!r})') from error
        if version != VERSION:
            raise InputError(f'version = {version!r}: this program reads version {VERSION}')
        found, lengths = as_laid_out(arrays, ARRAYS)
        try:
            made = cls(SgorConfig.from_values(about['config']), float(about['scale']),
                       str(about['ground_source']), bool(about['ground_certain']), found)
        except (LookupError, TypeError, ValueError) as error:
            raise InputError(f'about: not of a compact scan ({error})') from error
        made._check(lengths)
        return made

    def _check(self, lengths: dict[str, int]) -> None:
        """Refuse what no scan is like."""
        if not 0 < self.scale <= 10:
            raise InputError(f'scale = {self.scale}: not above 0 and at most 10')
        seen = int(np.unpackbits(self.arrays['seen']).sum())
        if seen != lengths['R']:
            raise InputError(f'ranges: {lengths["R"]} for {seen} cells')
        if lengths['G'] != (4 if self.ground_source in ('labels', 'geometry') else 0):
            raise InputError(f'plane: {lengths["G"]} numbers, and ground from '
                             f'{self.ground_source!r}')
        # a map of what lies farther would not fit the memory
        for name in ('points', 'surface_points'):
            farthest = float(np.abs(self.arrays[name]).max(initial=0.0))
            if farthest > 2 * self.config.max_range:
                raise InputError(f'{name}: {farthest:.3g} m from the sensor, max_range is '
                                 f'{self.config.max_range:g} m')
        for name in ('normals', 'surface_normals'):
            if np.abs(self.arrays[name]).max(initial=0.0) > 1.001:
                raise InputError(f'{name}: longer than one')
        if lengths['S'] and not 0.001 < self.arrays['surface_sizes'][0] < 1000:
            raise InputError('surface_sizes: no edge of a column')

    def restored(self) -> PreparedScan:
        """Return it prepared, for `register` and the `Tracker`; without the points of the scan."""
        config, have = self.config.scaled(self.scale), self.arrays
        points, normals, regional = have['points'], have['normals'], have['regional']
        ground = heights = context = None
        if self.ground_source:
            ground = Ground(have['plane'][:3], float(have['plane'][3]), np.zeros(0, np.bool_),
                            'labels' if self.ground_source == 'labels' else 'geometry',
                            self.ground_certain)
            heights = ground.heights(points)
            if config.context_weight > 0:
                context = partial(semantic_context, points, regional, ground,
                                  have['context_classes'].tolist(), config)
        described = have['descriptors'] if have['descriptors'].shape[1] else partial(
            fpfh_descriptors, points, normals, config.descriptor_radius)
        features = Features(points, have['labels'], regional, described, heights, context)
        ranges = np.full(CELLS, np.inf, np.float32)
        ranges[np.unpackbits(have['seen']).astype(np.bool_)] = have['ranges']
        index = scan_index(ranges.reshape(AZIMUTHS, ELEVATIONS), features, normals,
                           None if ground is None else ground.normal,
                           config.max_correspondence_distance, have['origin'])
        return PreparedScan(None, self.config, self.scale, features, ground, index,
                            Lazy(partial(_surface, have)), (), {})


def compact(prepared: PreparedScan) -> CompactScan:
    """Return the compact form of a prepared scan."""
    features, ground, index = prepared.features, prepared.ground, prepared.index
    surface, seen = prepared.surface, np.isfinite(index.ranges).ravel()
    classes = context_classes(label_convention(prepared.config.label_convention))
    none = np.zeros((0, 3))
    given = prepared.given is not None
    arrays: dict[str, Any] = {
        'points': features.points, 'normals': index.normals, 'labels': features.labels,
        'regional': features.regional,
        'descriptors': features.descriptors if given else np.zeros((len(features.points), 0)),
        'context_classes': classes,
        'plane': () if ground is None else (*ground.normal, ground.offset),
        'origin': index.origin, 'seen': np.packbits(seen), 'ranges': index.ranges.ravel()[seen],
        'surface_points': none if surface is None else surface.columns.points,
        'surface_normals': none if surface is None else surface.normals,
        'surface_sizes': (0.0, 0.0) if surface is None else (surface.columns.edge,
                                                            surface.middle_range)}
    return CompactScan(prepared.config, prepared.scale, '' if ground is None else ground.source,
                       ground is None or ground.certain,
                       {name: np.array(arrays[name], kind) for name, (kind, _) in ARRAYS.items()})


def _surface(arrays: dict[str, NDArray[Any]]) -> Surface | None:
    points = arrays['surface_points'].astype(np.float64)
    if not len(points):
        return None
    edge, middle_range = arrays['surface_sizes'].tolist()
    columns = in_columns(points, edge)
    return Surface(columns, arrays['surface_normals'].astype(np.float64)[columns.order],
                   middle_range)
