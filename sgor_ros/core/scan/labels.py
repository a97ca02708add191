"""Label conventions: from the ids in a scan to the classes inside (Sec. III-B, S and S_g).

The only files that the core reads are label tables: its own, in `conventions`, and the user's.
"""
from dataclasses import dataclass
from functools import cached_property
from functools import lru_cache
import json
from pathlib import Path
import tomllib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.settings import InputError

UNLABELLED = 0
"""The class inside of everything without a label; it votes for nothing."""

TABLES = Path(__file__).with_name('conventions')
SUFFIXES = ('.toml', '.json', '.yaml', '.yml')
"""Of tables; for the last two the package pyyaml is needed."""


def labels_agree(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return where classes (N,) are the same, as far as both are known."""
    agree: NDArray[np.bool_] = (a == b) | (a == UNLABELLED) | (b == UNLABELLED)
    return agree


@dataclass(frozen=True)
class LabelConvention:
    """What the ids of a labelled scan mean.

    Attributes
    ----------
    name : str
        Name or path it was asked for by.
    mask : int
        Bits of an id that hold the class (SemanticKITTI keeps the instance in the others).
    classes : dict of int to int
        Id in the scan to class inside, 1 to 255; ids not listed are unlabelled (0).
    names : dict of int to str
        Class inside to its name.
    ground : frozenset of int
        Classes inside that are ground or road: S_g of the paper.
    movable : frozenset of int
        Classes inside that can move between two scans.
    drop : frozenset of int
        Ids whose points are removed, such as the ego vehicle.
    """

    name: str
    mask: int
    classes: dict[int, int]
    names: dict[int, str]
    ground: frozenset[int]
    movable: frozenset[int]
    drop: frozenset[int]

    def decode(self, labels: NDArray[np.int64]
               ) -> tuple[NDArray[np.uint8], NDArray[np.bool_], list[int]]:
        """Translate the ids of a scan.

        Returns
        -------
        classes : (N,) uint8
            Class inside of each point.
        keep : (N,) bool
            False where the id is one to drop.
        unknown : list of int
            Ids that the convention does not list, sorted.
        """
        ids = labels & self.mask
        table, dropped, known = self._tables
        rows = np.minimum(ids, table.size - 1)    # the last row stands for all larger ids
        unknown = ids[~known[rows]]
        return table[rows], ~dropped[rows], np.unique(unknown).tolist() if unknown.size else []

    @cached_property
    def _tables(self) -> tuple[NDArray[np.uint8], NDArray[np.bool_], NDArray[np.bool_]]:
        size = max([*self.classes, *self.drop]) + 2
        table = np.full(size, UNLABELLED, np.uint8)
        table[list(self.classes)] = list(self.classes.values())
        dropped = np.zeros(size, np.bool_)
        dropped[list(self.drop)] = True
        known = dropped.copy()
        known[list(self.classes)] = True
        return table, dropped, known


@lru_cache(maxsize=16)
def label_convention(name: str) -> LabelConvention:
    """Return the convention of a name in `conventions`, or of a path to a TOML, JSON or YAML file.

    Raises
    ------
    InputError
        No such convention, a file that is none, or YAML without pyyaml.
    """
    known = {path.stem: path for path in sorted(TABLES.glob('*.toml'))}
    path = known.get(name, Path(name))
    if path.suffix not in SUFFIXES or not path.is_file():
        raise InputError(f'label_convention = {name!r}: neither a convention '
                         f'({", ".join(known)}) nor a file ({", ".join(SUFFIXES)})')
    try:
        return _parse(name, _read(path))
    except ImportError as error:
        raise InputError(f'label_convention = {name!r}: YAML needs pyyaml ({error}): pip install '
                         'pyyaml, or write the table as TOML') from error
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError,
            RecursionError) as error:
        raise InputError(f'label_convention = {name!r}: {path} is not a label convention: '
                         f'{error!r}') from error


def _read(path: Path) -> Any:
    """Return what a file holds; ValueError where it is none of its format."""
    text = path.read_text()
    if path.suffix == '.toml':
        return tomllib.loads(text)
    if path.suffix == '.json':
        return json.loads(text)
    import yaml  # not needed for arrays
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error


def _parse(name: str, table: dict[str, Any]) -> LabelConvention:
    classes = {int(k): int(v) for k, v in table['classes'].items()}
    drop = frozenset(int(i) for i in table.get('drop', ()))
    if not classes:
        raise ValueError('no classes')
    if not (all(0 <= c <= 255 for c in classes.values())
            and all(0 <= i < 2**16 for i in (*classes, *drop))):
        raise ValueError('ids must be in 0 to 65535 and classes in 0 to 255')
    mask = int(table.get('mask', 0xFFFFFFFF))
    if not 0 <= mask <= 0xFFFFFFFF:    # not negative, so that a masked id never is
        raise ValueError('mask must be in 0 to 0xFFFFFFFF: it must not be negative')
    return LabelConvention(
        name=name, mask=mask, classes=classes,
        names={int(k): str(v) for k, v in table['names'].items()},
        ground=frozenset(int(c) for c in table['ground']),
        movable=frozenset(int(c) for c in table.get('movable', ())),
        drop=drop)
