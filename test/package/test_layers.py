"""Layers point one way: core <- tracker <- mapping <- shells; the world stands alone."""
import ast
from pathlib import Path
import subprocess
import sys

import pytest

import sgor_ros

PACKAGE = Path(sgor_ros.__file__).parent
SHELLS = {'io', 'pipeline', 'visualize', 'ros', 'commands', 'evaluation'}
ROS = {'rclpy', 'ament_index_python', 'launch', 'launch_ros', 'sensor_msgs', 'nav_msgs',
       'geometry_msgs', 'visualization_msgs', 'diagnostic_msgs', 'std_msgs', 'std_srvs',
       'builtin_interfaces', 'rcl_interfaces', 'tf2_msgs', 'tf2_ros'}
FILES = {'rosbags', 'rerun', 'matplotlib', 'rich', 'argparse'}

# module or folder -> what it may import of the package besides itself
MAY_IMPORT = {
    'core': set(),
    'tracker': {'core'},
    'mapping': {'core', 'tracker'},
    'api': {'core', 'tracker', 'mapping'},
    'io': {'core', 'tracker', 'mapping'},
    'evaluation': {'core', 'tracker', 'mapping', 'io'},
    'pipeline': {'core', 'tracker', 'mapping', 'io'},
    'ros': {'core', 'tracker', 'mapping', 'io', 'pipeline'},
    'visualize': {'core', 'tracker', 'mapping'},
    'commands': {'core', 'tracker', 'mapping', 'io', 'pipeline', 'evaluation', 'ros', 'visualize',
                 'world'},
    'world': set(),
}

# what a method loads when it is called: a map is asked to save and load itself
WHEN_CALLED = {('mapping/maps/map.py', 'sgor_ros.io.map_folder.read_map'),
               ('mapping/maps/map.py', 'sgor_ros.io.map_folder.write_map')}

# rooms and files of core, each above those that it may import
CORE = ('common', 'execution', 'ablation', 'config', 'scan', 'features', 'index', 'matching',
        'scoring', 'solver', 'icp', 'degeneracy', 'hypotheses', 'prepared_scan', 'preprocessing',
        'compact_scan', 'verdict', 'registration', 'prediction_check', 'warmup')

# likewise in evaluation
EVALUATION = ('dense_reference', 'output', 'metrics', 'calibration', 'methods', 'protocols',
              'front_end', 'job', 'memory', 'sequences', 'loops', 'solver', 'runner', 'report')


def imports_of(path):
    """Return the dotted names that a file imports, anywhere in it, relative ones resolved."""
    package = ('sgor_ros', *path.relative_to(PACKAGE).parent.parts)
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = '.'.join(package[:len(package) - node.level + 1]) if node.level else ''
            module = '.'.join(part for part in (base, node.module) if part)
            names |= {f'{module}.{alias.name}' for alias in node.names}
    return names


def layer_of(path):
    return path.relative_to(PACKAGE).parts[0].removesuffix('.py')


SOURCES = sorted(path for path in PACKAGE.rglob('*.py') if path != PACKAGE / '__init__.py')


@pytest.mark.parametrize('path', SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_file_imports_only_what_is_below_it(path):
    layer = layer_of(path)
    allowed = MAY_IMPORT[layer] | {layer}
    for name in imports_of(path):
        if (str(path.relative_to(PACKAGE)), name) in WHEN_CALLED:
            continue
        top, *rest = name.split('.')
        if top == 'sgor_ros':
            # `from sgor_ros import register` is the core and the tracker
            below = rest[0] if rest[0] in MAY_IMPORT else 'core'
            assert below in allowed, f'{layer} imports {name}'
        if layer != 'ros':
            assert top not in ROS, f'{layer} imports {name}'
        if layer in {'core', 'tracker', 'mapping', 'world'}:
            assert top not in FILES, f'{layer} imports {name}'
        if layer in {'core', 'tracker', 'mapping'}:
            assert top != 'open3d', f'{layer} imports {name}'


@pytest.mark.parametrize('path', [path for path in SOURCES
                                  if layer_of(path) in {'core', 'evaluation'}],
                         ids=lambda path: str(path.relative_to(PACKAGE)))
def test_rooms_lie_on_each_other(path):
    """No two of core or of evaluation import each other, by whatever way round."""
    layer = layer_of(path)
    rooms = CORE if layer == 'core' else EVALUATION
    room = path.relative_to(PACKAGE / layer).parts[0].removesuffix('.py')
    if room == '__init__':
        return
    below = rooms[:rooms.index(room)]
    for name in imports_of(path):
        if name.startswith(f'sgor_ros.{layer}.'):
            other = name.split('.')[2]
            assert other == room or other in below, f'{room} imports {name}'


PIPELINE_ONLY = {'sgor_ros.io.frames.OdomFrame', 'sgor_ros.io.pointcloud2.decode',
                 'sgor_ros.io.messages.relative_pose', 'sgor_ros.io.messages.odometry',
                 'sgor_ros.io.messages.pose_stamped',
                 'sgor_ros.io.messages.correspondence_markers'}


@pytest.mark.parametrize('path', [path for path in SOURCES if layer_of(path) in {
    'ros', 'commands'}], ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_the_pipeline_decodes_places_and_makes_messages(path):
    """Node and replay have one implementation of the way of a scan."""
    assert not imports_of(path) & PIPELINE_ONLY
    used = {f'sgor_ros.io.messages.{node.attr}' for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
            and node.value.id == 'messages'}
    assert not used & PIPELINE_ONLY


def test_the_rooms_of_the_node_do_not_know_the_node():
    """The process, the node and its services lie on input, output and diagnostics."""
    above = tuple(f'sgor_ros.ros.{name}.' for name in ('main', 'node', 'services',
                                                         'map_services'))
    rooms = [path for path in SOURCES if path.is_relative_to(PACKAGE / 'ros')
             and path.parent != PACKAGE / 'ros']
    assert len(rooms) > 10
    for path in rooms:
        assert not [name for name in imports_of(path) if name.startswith(above)], path


MAPPING = ('config', 'edge', 'result', 'retrieval', 'pose_graph', 'scan_poses', 'odometry',
           'keyframe', 'map_cloud', 'loops', 'trimming', 'maps', 'session', 'mapper')

# files in a room, or in a folder that is one, each above those that it may import
WITHIN = {
    'mapping/loops': ('paths', 'loop_consistency', 'candidates', 'verification', 'loop_closing'),
    'pipeline': ('outcome', 'query', 'sinks', 'loop_process', 'extrinsic', 'published_frames',
                 'scan_messages', 'pipeline'),
    'tracker': ('config', 'covariance', 'stamps', 'result', 'motion', 'keyframes',
                'keyframe_selection', 'choice', 'deskewing', 'scan_at_work', 'track',
                'scan_registration', 'tracker'),
}


def test_the_files_of_mapping_lie_on_each_other():
    folder = PACKAGE / 'mapping'
    for path in folder.rglob('*.py'):
        room = path.relative_to(folder).parts[0].removesuffix('.py')
        if room == '__init__':
            continue
        below = MAPPING[:MAPPING.index(room)]
        others = {name.split('.')[2] for name in imports_of(path)
                  if name.startswith('sgor_ros.mapping.')}
        assert others - {room} <= set(below), path


@pytest.mark.parametrize('room', WITHIN)
def test_the_files_of_a_room_lie_on_each_other(room):
    """The way of a scan, or of a loop, is on top."""
    folder, files = PACKAGE / room, WITHIN[room]
    assert {path.stem for path in folder.glob('*.py')} == {'__init__', *files}
    for path in folder.glob('*.py'):
        if path.stem == '__init__':
            continue
        prefix = f'sgor_ros.{room.replace("/", ".")}.'
        others = {name.removeprefix(prefix).split('.')[0] for name in imports_of(path)
                  if name.startswith(prefix)}
        assert others <= set(files[:files.index(path.stem)]), path


def test_no_file_on_the_way_of_a_scan_is_long():
    """One idea a file."""
    for path in SOURCES:
        if layer_of(path) in {'tracker', 'mapping', 'pipeline'}:
            assert len(path.read_text().splitlines()) < 300, path


def test_the_public_interface_is_core_tracker_and_mapping():
    layers = {name.split('.')[1] for name in imports_of(PACKAGE / 'api.py')}
    assert layers == {'core', 'tracker', 'mapping'}


def test_the_package_loads_its_interface_only_when_asked():
    code = ('import sys, sgor_ros; light = "numpy" not in sys.modules\n'
            'from sgor_ros import *\n'
            'print(light, all(name in globals() for name in sgor_ros.__all__))')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          cwd=PACKAGE.parent, check=True)
    assert done.stdout.split() == ['True', 'True']


def test_core_and_tracker_load_neither_ros_nor_files():
    shells = [f'sgor_ros.{name}' for name in (*SHELLS, 'world')]
    unwanted = [*ROS, *FILES - {'argparse'}, 'open3d', 'gtsam', *shells]
    code = ('import importlib, pkgutil, sys, sgor_ros.api, sgor_ros.core\n'
            'for module in pkgutil.walk_packages(sgor_ros.core.__path__, "sgor_ros.core."):\n'
            '    importlib.import_module(module.name)\n'
            f'print(*(name for name in {unwanted} if name in sys.modules))')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          cwd=PACKAGE.parent, check=True)
    assert done.stdout.split() == []
