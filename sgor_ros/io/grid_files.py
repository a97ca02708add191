"""An occupancy grid as the two files that nav2's map_server reads: a picture and its YAML."""
from pathlib import Path

import numpy as np

from ..mapping.maps.occupancy import FREE
from ..mapping.maps.occupancy import OccupancyGrid
from ..mapping.maps.occupancy import OCCUPIED
from .writing import new_file

UNKNOWN_GREY, FREE_GREY, OCCUPIED_GREY = 205, 254, 0
"""As map_saver writes them; with the thresholds below, 205 is just not free."""
YAML = """image: {image}
mode: trinary
resolution: {resolution:g}
origin: [{x:.6g}, {y:.6g}, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def write_grid(path: Path, grid: OccupancyGrid) -> None:
    """Write a grid to PATH, a .yaml, and to the .pgm of the same name beside it."""
    picture = path.with_suffix('.pgm')
    greys = np.full(grid.cells.shape, UNKNOWN_GREY, np.uint8)
    greys[grid.cells == FREE], greys[grid.cells == OCCUPIED] = FREE_GREY, OCCUPIED_GREY
    height, width = greys.shape
    with new_file(picture) as place:    # its first row is the greatest y
        place.write_bytes(f'P5\n{width} {height}\n255\n'.encode() + greys[::-1].tobytes())
    x, y = grid.origin
    with new_file(path) as place:
        place.write_text(YAML.format(image=picture.name, resolution=grid.resolution, x=x, y=y))
