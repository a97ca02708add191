"""Draw docs/images/animation.gif: a tunnel and a facade that are refused, and a loop closed.

All of it is computed by the code that registers and maps, in the built-in world. Usage, from the
checkout: .venv/bin/python scripts/animation.py [FILE]
"""
from collections.abc import Iterator
from pathlib import Path
import sys
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from trust_picture import draw
from trust_picture import Example
from trust_picture import facade
from trust_picture import tunnel

from sgor_ros import Mapper
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import TrackerConfig
from sgor_ros import world
from sgor_ros.core.common import se3
from sgor_ros.io.colours import SOURCE
from sgor_ros.io.colours import TARGET

Array = NDArray[np.float64]

PICTURE = Path(__file__).parents[1] / 'docs/images/animation.gif'
SIZE_IN, DPI = (7.2, 4.0), 100
FRAME_MS, LAST_MS = 110, 2400
STEPS = 14
"""Frames of a placement that moves from the answer to another."""
STEP_M, BEYOND_M = 2.0, 20.0
"""Of the drive around the block, and how far it goes on where it has been."""
DRIVEN = 5
"""Scans a frame."""
COLOURS = 48
LOOP = '#009e73'


def main() -> None:
    """Draw the three scenes one after the other."""
    frames: list[tuple[Image.Image, int]] = []
    for scene in (placed(tunnel(), 40.0, 'A tunnel'),
                  placed(facade(), 48.0, 'A facade in bays'), around_the_block()):
        frames += scene
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE
    # one palette for all, made of the last frames of the scenes
    ends = [image for image, milliseconds in frames if milliseconds == LAST_MS]
    sheet = Image.new('RGB', (ends[0].width, sum(end.height for end in ends)))
    for index, end in enumerate(ends):
        sheet.paste(end, (0, index * end.height))
    palette = sheet.quantize(COLOURS)
    images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image, _ in frames]
    images[0].save(path, save_all=True, append_images=images[1:], loop=0, optimize=True,
                   duration=[milliseconds for _, milliseconds in frames])
    print(f'{path}: {len(images)} frames, {path.stat().st_size / 1e6:.2f} MB')


def blank() -> tuple[Figure, Any]:
    """Return an empty frame."""
    figure = Figure(figsize=SIZE_IN, dpi=DPI)
    FigureCanvasAgg(figure)
    return figure, figure.add_axes((0.02, 0.1, 0.96, 0.78))


def image_of(figure: Figure) -> Image.Image:
    """Return what a figure shows."""
    canvas: Any = figure.canvas
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def placed(example: Example, width: float, name: str) -> Iterator[tuple[Image.Image, int]]:
    """Move the source from the answer to another placement, and tell what the clouds say."""
    found = register(example.source, example.target)
    assert not found.success
    verdict = f'as good: {found.status}, so not registered'
    ways = [0.0] * 4 + list(np.linspace(0.0, 1.0, STEPS))
    for index, way in enumerate(ways):
        T = example.answer.copy()
        T[:3, 3] += way * (example.other - example.answer)[:3, 3]
        if way == 1.0:
            T = example.other
        figure, axes = blank()
        draw(axes, example, T, width)
        axes.set_ylim(*(example.middle[1] + 0.24 * width * np.array((-1, 1))))
        moved = np.linalg.norm((T - example.answer)[:3, 3])
        figure.text(0.02, 0.93, name, fontsize=14, weight='bold')
        figure.text(0.02, 0.02, 'target scan', color=TARGET, fontsize=12)
        figure.text(0.16, 0.02, 'source scan', color=SOURCE, fontsize=12)
        last = index == len(ways) - 1
        figure.text(0.98, 0.93, verdict if last else f'moved by {moved:.1f} m', ha='right',
                    fontsize=12, weight='bold' if last else 'normal',
                    color='#b00020' if last else 'black')
        yield image_of(figure), LAST_MS if last else FRAME_MS


def around_the_block() -> Iterator[tuple[Image.Image, int]]:
    """Drive around a block, scan to scan and without labels, until the loop is closed."""
    street = world.street_scene(0)
    count = int((street.layout.loop.length + BEYOND_M) / STEP_M)
    true = np.array(list(world.loop_trajectory(street, count, speed=STEP_M, period=1.0)))
    rng, lidar = np.random.default_rng(0), world.Lidar(beams=32, columns=900)
    mapper = Mapper(SgorConfig(), TrackerConfig(mode='consecutive'))
    clouds: list[Array] = []
    track: list[Array] = []
    for index, T in enumerate(true):
        scan = SemanticScan(lidar.scan(street, T, rng)[0])
        found = mapper.track(scan, index * 10**9)
        assert found.T_odom_sensor is not None
        track.append(found.T_odom_sensor)
        clouds.append(upright(scan.points[::40].astype(np.float64)))
        if index % DRIVEN == 0 and not mapper.graph.loops:
            yield drive_frame(true, clouds, np.array(track), 'a scan every 2 m, no labels'), (
                FRAME_MS)
    mapper.finish()
    before = np.array(track)
    after = mapper.trajectory().T_map_sensor
    at = {stamp: i for i, stamp in enumerate(mapper.trajectory().stamps_ns.tolist())}
    stamp_of = mapper.node_stamps_ns()
    loops = [(at[stamp_of[loop.target]], at[stamp_of[loop.source]]) for loop in mapper.graph.loops]
    off = [100 * np.linalg.norm(poses[-1][:3, 3] - (se3.inverse(true[0]) @ true[-1])[:3, 3])
           for poses in (before, after)]
    yield drive_frame(true, clouds, before, f'back where it began: {off[0]:.0f} cm off'), 1600
    yield (drive_frame(true, clouds, after, f'{len(loops)} loops closed: {off[1]:.0f} cm '
                       'off', loops), LAST_MS)


def upright(points: Array) -> Array:
    """Return points that stand over the road: neither road nor crowns."""
    return points[(points[:, 2] > -1.2) & (points[:, 2] < 1.0)]


def drive_frame(true: Array, clouds: list[Array], poses: Array, text: str,
                loops: list[tuple[int, int]] | None = None) -> Image.Image:
    """Draw the scans where a track lays them, and the track; both from its first pose."""
    way = se3.inverse(true[0]) @ true
    figure, axes = blank()
    seen = np.concatenate([se3.transform(T, cloud) for T, cloud in zip(poses, clouds,
                                                                      strict=False)])
    axes.plot(*seen[:, :2].T, '.', ms=1.5, mew=0, color='#777777')
    axes.plot(*poses[:, :2, 3].T, color=SOURCE, lw=2)
    for target, source in loops or ():
        axes.plot(*poses[[target, source], :2, 3].T, color=LOOP, lw=2)
    axes.plot(*poses[-1, :2, 3], 'o', ms=8, mfc='white', mec=SOURCE, mew=2.5)
    axes.set(xlim=(way[:, 0, 3].min() - 25, way[:, 0, 3].max() + 25),
             ylim=(way[:, 1, 3].min() - 20, way[:, 1, 3].max() + 20), xticks=[], yticks=[],
             aspect='equal')
    figure.text(0.02, 0.93, 'A loop around the block', fontsize=14, weight='bold')
    figure.text(0.98, 0.93, text, ha='right', fontsize=12, weight='bold' if loops else 'normal',
                color=LOOP if loops else 'black')
    return image_of(figure)


if __name__ == '__main__':
    main()
