"""The folder of a map: what comes back, what is said of damage, and what a kill leaves."""
from dataclasses import replace
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import zlib

import numpy as np
import pytest
from return_drive import known_map

from sgor_ros import InputError
from sgor_ros import Map
from sgor_ros.io import writing
from sgor_ros.io.map_folder import StoredFile

gtsam = pytest.importorskip('gtsam')

KEYFRAME = 'keyframes/000003.npz'


@pytest.fixture(scope='module')
def saved(tmp_path_factory):
    folder = tmp_path_factory.mktemp('maps') / 'street'
    known_map().save(folder)
    return folder


@pytest.fixture
def copied(saved, tmp_path):
    """Return a map to damage."""
    return shutil.copytree(saved, tmp_path / 'copied')


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob('*')
            if path.is_file()}


def same(one, other):
    """Assert that two maps are the same, bit by bit."""
    assert list(one.nodes) == list(other.nodes)
    for node, its in one.nodes.items():
        assert (its.stamp_ns, its.session) == (other.nodes[node].stamp_ns,
                                               other.nodes[node].session)
        np.testing.assert_array_equal(its.T_map_sensor, other.nodes[node].T_map_sensor)
    for edge, its in zip(one.edges, other.edges, strict=True):
        assert (edge.target, edge.source, edge.kind) == (its.target, its.source, its.kind)
        np.testing.assert_array_equal(edge.T_target_source, its.T_target_source)
        np.testing.assert_array_equal(edge.covariance, its.covariance)
    for keyframe, its in zip(one.keyframes, other.keyframes, strict=True):
        assert (keyframe.id, keyframe.stamp_ns, keyframe.track_id) == (
            its.id, its.stamp_ns, its.track_id)
        np.testing.assert_array_equal(keyframe.descriptor, its.descriptor)
        if keyframe.frame_covariance is None:
            assert its.frame_covariance is None
        else:
            np.testing.assert_array_equal(keyframe.frame_covariance, its.frame_covariance)
        have, found = keyframe.scan.as_arrays(), its.scan.as_arrays()
        assert have.keys() == found.keys()
        for name, array in have.items():
            np.testing.assert_array_equal(array, found[name])
    assert (one.config, one.tracker_config, one.mapper_config) == (
        other.config, other.tracker_config, other.mapper_config)


def test_what_is_saved_comes_back_bit_by_bit(saved, tmp_path):
    loaded = Map.load(saved)
    assert len(loaded.keyframes) == len(known_map().keyframes) >= 6
    assert loaded.warnings == ()
    same(loaded, known_map())
    loaded.save(tmp_path / 'again')
    assert contents(tmp_path / 'again') == contents(saved)


def test_what_is_not_known_of_a_deskewed_scan_is_kept(tmp_path):
    known, keyframes = known_map(), known_map().keyframes.copy()
    one = next(iter(keyframes))
    keyframes.put(replace(one, frame_covariance=np.diag(np.arange(1.0, 7.0)) * 1e-4))
    bent = replace(known, keyframes=keyframes)
    bent.save(tmp_path / 'bent')
    same(Map.load(tmp_path / 'bent'), bent)


def test_it_is_small_and_people_and_others_can_read_it(saved):
    sizes = [path.stat().st_size for path in (saved / 'keyframes').iterdir()]
    assert max(sizes) < 300_000
    assert 'Map.load' in (saved / 'README.txt').read_text()
    index = json.loads((saved / 'map.json').read_text())
    assert index['config']['voxel_size'] == known_map().config.voxel_size
    nodes = known_map().nodes
    tum = np.loadtxt(saved / 'poses.tum')
    np.testing.assert_allclose(tum[:, 1:4], known_map().poses(nodes)[:, :3, 3], atol=1e-6)
    factors, values = gtsam.readG2o(str(saved / 'graph.g2o'), True)
    assert factors.size() == len(known_map().edges)
    for node, its in nodes.items():
        np.testing.assert_allclose(values.atPose3(node).matrix(), its.T_map_sensor, atol=1e-6)


def test_scans_are_read_when_they_are_needed(copied):
    loaded = Map.load(copied)
    assert all(isinstance(one.held, StoredFile) for one in loaded.keyframes)
    shutil.rmtree(copied / 'keyframes')
    with pytest.raises(InputError, match=KEYFRAME):
        loaded.keyframes[3].scan  # noqa: B018


def test_a_map_replaces_the_one_before_it(copied):
    """Also where it is read from there."""
    (copied / 'map.png').write_bytes(b'a picture')
    loaded = Map.load(copied)
    before = contents(copied)
    del before['map.png']
    loaded.save(copied)
    assert contents(copied) == before
    assert list(copied.parent.iterdir()) == [copied]
    loaded.keyframes[3].scan.restored()


def flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 4
    path.write_bytes(content)


def cut(path):
    path.write_bytes(path.read_bytes()[:-20])


@pytest.mark.parametrize('damage', [flip, cut, os.unlink])
@pytest.mark.parametrize('name', ['map.json', 'graph.npz', 'keyframes.npz', KEYFRAME])
def test_what_is_damaged_is_named(copied, name, damage):
    damage(copied / name)
    with pytest.raises(InputError, match=name):    # noqa: PT012
        loaded = Map.load(copied)
        assert (name, damage) == (KEYFRAME, flip)    # no scan is read yet
        loaded.keyframes[3].scan  # noqa: B018


@pytest.mark.parametrize('damage', [flip, cut, os.unlink])
@pytest.mark.parametrize('name', ['README.txt', 'poses.tum', 'graph.g2o'])
def test_damage_of_what_is_not_read_is_a_warning(copied, name, damage):
    damage(copied / name)
    loaded = Map.load(copied)
    warning, = loaded.warnings
    assert name in warning
    same(loaded, known_map())


def test_a_map_of_another_version_is_said(copied):
    index = json.loads((copied / 'map.json').read_text())
    (copied / 'map.json').write_text(json.dumps({**index, 'version': 7}))
    with pytest.raises(InputError, match='version 7; this program reads version 1 to 2'):
        Map.load(copied)


def test_a_map_of_version_1_is_read(copied):
    """It says nothing of a mount, nor of a setting that came later."""
    index = json.loads((copied / 'map.json').read_text())
    del index['crc32'], index['T_base_sensor'], index['tracker_config']['retries']
    index['version'] = 1
    index['crc32'] = zlib.crc32(json.dumps(index, sort_keys=True).encode())
    (copied / 'map.json').write_text(json.dumps(index))
    loaded = Map.load(copied)
    same(loaded, known_map())
    assert loaded.T_base_sensor is None


def test_the_mount_is_kept(tmp_path):
    mount = np.eye(4)
    mount[:3, 3] = 1 / 3, 0, 1.8
    mounted = replace(known_map(), T_base_sensor=mount)
    mounted.save(tmp_path / 'mounted')
    np.testing.assert_array_equal(Map.load(tmp_path / 'mounted').T_base_sensor, mount)
    for (T, _), (T_base, _) in zip(mounted.scans(), mounted.scans(of_base=True), strict=True):
        np.testing.assert_array_equal(T_base, mount @ T)


@pytest.mark.parametrize(('text', 'fault'), [
    ('{"format": "another"}', 'not the index of a map'), ('[1]', 'not the index'),
    ('{', 'cannot be read')])
def test_what_is_no_map_is_said(copied, text, fault):
    (copied / 'map.json').write_text(text)
    with pytest.raises(InputError, match=f'map.json: .*{fault}'):
        Map.load(copied)


def test_no_folder_and_an_empty_one_are_said(tmp_path):
    with pytest.raises(InputError, match='no such folder'):
        Map.load(tmp_path / 'none')
    with pytest.raises(InputError, match=r'no map: there is no map\.json'):
        Map.load(tmp_path)


def test_what_is_no_map_is_not_replaced(tmp_path):
    (tmp_path / 'letters').mkdir()
    (tmp_path / 'letters/a.txt').write_text('dear')
    for place in (tmp_path / 'letters', tmp_path / 'letters/a.txt'):
        with pytest.raises(InputError, match='no map, so it is not replaced'):
            known_map().save(place)
    assert contents(tmp_path) == {'letters/a.txt': b'dear'}


def test_an_empty_map_is_not_saved(tmp_path):
    with pytest.raises(InputError, match='no keyframes'):
        Map().save(tmp_path / 'empty')


def test_where_folders_cannot_be_exchanged_the_old_one_is_put_back(copied, monkeypatch):
    """As on a network file system, and as after a crash between its two steps."""
    monkeypatch.setattr(writing, '_exchange', lambda *_: False)
    loaded, before = Map.load(copied), contents(copied)
    loaded.save(copied)
    assert contents(copied) == before
    assert list(copied.parent.iterdir()) == [copied]
    beside = copied.with_name('copied.unfinished')
    beside.mkdir()
    copied.rename(beside / 'copied.old')
    with pytest.raises(InputError, match='no such folder'):
        Map.load(copied)
    with pytest.raises(InputError), writing.replaced_folder(copied):
        raise InputError('the next writer breaks off')
    assert contents(copied) == before


WRITER = """
import os, sys
from sgor_ros import Map
maps = [Map.load(folder) for folder in sys.argv[2:]]
maps = [maps[0], maps[1]]
for line in sys.stdin:
    child = os.fork()
    if not child:
        while True:
            for known in maps:
                known.save(sys.argv[1])
    print(child, flush=True)
    sys.stdin.readline()
    os.waitpid(child, 0)
    print('gone', flush=True)
"""


def test_a_writer_that_is_killed_leaves_the_old_map_or_the_new_one(saved, tmp_path):
    """Twenty times, at any moment."""
    loaded, few = Map.load(saved), tmp_path / 'few'
    Map(loaded.nodes, loaded.edges, loaded.keyframes.copy(list(loaded.nodes)[:3]),
        loaded.config).save(few)
    whole = [contents(saved), contents(few)]
    place, rng, seen = tmp_path / 'maps/place', random.Random(0), set()
    began = time.perf_counter()
    loaded.save(tmp_path / 'timed')
    both = 2 * (time.perf_counter() - began)    # so long at most it takes to save the two
    with subprocess.Popen([sys.executable, '-c', WRITER, place, saved, few], text=True,
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE) as writer:
        for _ in range(20):
            writer.stdin.write('go\n')
            writer.stdin.flush()
            child = int(writer.stdout.readline())
            while not place.exists():    # of the first one
                time.sleep(0.001)
            time.sleep(rng.uniform(0, 2 * both))
            os.kill(child, signal.SIGKILL)
            writer.stdin.write('killed\n')
            writer.stdin.flush()
            assert writer.stdout.readline() == 'gone\n'
            found = contents(place)
            assert found in whole
            seen.add(whole.index(found))
            for keyframe in Map.load(place).keyframes:
                keyframe.scan.restored()
        writer.stdin.close()
    assert seen == {0, 1}
    known_map().save(place)    # what was left beside is cleared
    assert list(place.parent.iterdir()) == [place]
