"""A street that no corner repeats: a loop road with houses, gardens, cars and trees."""

from .scene import street_scene
from .scene import StreetScene
from .trajectory import loop_trajectory

__all__ = ['StreetScene', 'loop_trajectory', 'street_scene']
