"""The studies of the paper: what they change, one value after the other."""
from collections.abc import Callable
from dataclasses import dataclass

from ...core.common.settings import InputError

COUNTS = (250, 500, 1000, 2000, 4000, 8000)
CATEGORIES = (1, 2, 3, 5, 8)
NOISE = (0.0, 0.1, 0.3, 0.5, 0.7)

STUDIES = {
    'matches': ('number of matches', COUNTS),
    'categories': ('categories that keep their labels', CATEGORIES),
    'noise': ('share of random labels', NOISE)}
"""Name to what is on the axis and its values."""


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


def variants(study: str, values: list[float] | None, seed: int) -> list[Variant]:
    """Return the variants of a study, of the paper's kind or with values of one's own."""
    if not study:
        return [Variant(seed=seed)]
    if study not in STUDIES:
        raise InputError(f'--study {study}: not one of {", ".join(STUDIES)}')
    chosen = STUDIES[study][1] if values is None else values
    make: dict[str, Callable[[float], Variant]] = {
        'matches': lambda value: Variant(f'{value:g}', matches=int(value), seed=seed),
        'categories': lambda value: Variant(f'{value:g}', categories=int(value), seed=seed),
        'noise': lambda value: Variant(f'{value:g}', random_labels=value, seed=seed)}
    return [make[study](value) for value in chosen]
