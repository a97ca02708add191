"""The extra that evaluation needs; the rest of the package is installed without."""
from collections.abc import Iterable
from importlib.util import find_spec
from typing import Any

from ..core.common.settings import InputError

MODULES = ('evo', 'matplotlib', 'tqdm')
INSTALL = "pip install 'sgor_ros[evaluation]'"


def require_evaluation() -> None:
    """Refuse to go on where the extra is not installed.

    Raises
    ------
    InputError
        It names what is missing, and how to install it.
    """
    missing = [module for module in MODULES if not installed(module)]
    if missing:
        raise InputError(f'{", ".join(missing)}: not installed; {INSTALL}')


def installed(module: str) -> bool:
    """Return whether a module could be imported."""
    return find_spec(module) is not None


def progress[T](items: Iterable[T], label: str = '', total: int | None = None,
                unit: str = 'pair') -> Iterable[T]:
    """Return the items, with a progress bar on a terminal."""
    from tqdm import tqdm
    bar: Any = tqdm(items, label, total, unit=unit, disable=None)
    shown: Iterable[T] = bar
    return shown
