"""Label conventions: what the ids of a scan mean, whoever wrote them."""
import json
import re
import sys

import numpy as np
import pytest
import yaml

from sgor_ros import InputError
from sgor_ros import preprocess
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.scan.labels import label_convention
from sgor_ros.core.scan.labels import TABLES

CAR, ROAD, BUILDING, VEGETATION, POLE = 1, 9, 13, 15, 18    # classes inside
CONVENTIONS = ('semantickitti', 'semantickitti_train', 'nuscenes', 'nuscenes16',
               'autoware_frnet', 'autoware_ptv3', 'carla', 'rellis')
# as they publish them, id after id from 0
PUBLISHED = {
    'nuscenes16': 'void barrier bicycle bus car construction_vehicle motorcycle pedestrian '
                  'traffic_cone trailer truck driveable_surface other_flat sidewalk terrain '
                  'manmade vegetation',
    'autoware_frnet': 'drivable_surface other_flat_surface sidewalk manmade vegetation car bus '
                      'emergency_vehicle train truck tractor_unit semi_trailer '
                      'construction_vehicle forklift kart motorcycle bicycle pedestrian '
                      'personal_mobility animal pushable_pullable traffic_cone debris stroller '
                      'other_stuff noise+ghost_point unknown',
    'autoware_ptv3': 'car truck bus bicycle pedestrian traffic_cone barrier debris '
                     'drivable_flat non_drivable_flat vegetation building vertical_thin '
                     'static_clutter noise',
    'carla': 'None Roads Sidewalks Buildings Walls Fences Poles TrafficLight TrafficSigns '
             'Vegetation Terrain Sky Pedestrians Rider Car Truck Bus Train Motorcycle Bicycle '
             'Static Dynamic Other Water RoadLines Ground Bridge RailTrack GuardRail',
}


def decode(name, ids):
    """Return classes and keep as lists, and the unknown ids."""
    classes, keep, unknown = label_convention(name).decode(np.array(ids, np.int64))
    assert classes.dtype == np.uint8
    return classes.tolist(), keep.tolist(), unknown


def test_raw_semantickitti_ids_and_instance_bits():
    """The class is in the low 16 bits; the instance above does not matter."""
    ids = [0, 10, 40, 50, 70, 80, 252]
    plain = decode('semantickitti', ids)
    assert plain[0] == [0, CAR, ROAD, BUILDING, VEGETATION, POLE, 22]
    assert plain == decode('semantickitti', [i | (311 << 16) for i in ids])
    assert plain[2] == []


def test_semantickitti_outliers_are_removed():
    """Id 1 is a wrong measurement, not a thing without a label."""
    assert decode('semantickitti', [0, 1, 40])[1] == [True, False, True]


def test_train_ids_count_from_zero():
    """0 is a car, 8 the road, 255 unlabelled."""
    classes, keep, unknown = decode('semantickitti_train', [*range(19), 255])
    assert classes == [*range(1, 20), 0]
    assert all(keep)
    assert unknown == []


def test_nuscenes_ego_vehicle_and_movers():
    """31 is the vehicle itself and goes; 32 to 39 move and belong to no place."""
    classes, keep, unknown = decode('nuscenes', [17, 24, 28, 30, 31, *range(32, 40)])
    assert classes[:4] == [CAR, ROAD, BUILDING, VEGETATION]
    assert keep == [True] * 4 + [False] + [True] * 8
    assert set(classes[5:]) <= label_convention('nuscenes').movable
    assert unknown == []


@pytest.mark.parametrize('ids', [
    (40, 8, 24, 11, 0, 8, 1, 10), (10, 0, 17, 4, 5, 0, 14, None), (50, 12, 28, 15, 3, 11, 3, 12),
    (70, 14, 30, 16, 4, 10, 9, 4), (30, 5, 2, 7, 17, 4, 12, 17), (11, 1, 14, 2, 16, 3, 19, None),
    (18, 3, 23, 10, 9, 1, 15, None), (48, 10, 26, 13, 2, None, 2, None),
    (72, 16, 27, 14, None, None, 10, 3), (51, 13, 9, 1, None, 6, 5, 18),
    (80, 17, None, None, None, 12, 6, 5)])
def test_the_same_thing_is_the_same_class_in_all_conventions(ids):
    """So that a scan of one convention meets one of another, with the same name."""
    found = {decode(name, [i])[0][0] for name, i in zip(CONVENTIONS, ids, strict=True)
             if i is not None}
    assert len(found) == 1
    names = {label_convention(name).names[next(iter(found))] for name in CONVENTIONS}
    assert len(names) == 1


@pytest.mark.parametrize('name', PUBLISHED)
def test_ids_are_those_of_the_published_list(name):
    """Each id stands beside its published name, all are listed, noise is dropped."""
    published = PUBLISHED[name].split()
    text = (TABLES / f'{name}.toml').read_text()
    written = {int(i): word for i, word in re.findall(r'^(\d+) = \d+ +# (\S+)$', text, re.M)}
    convention = label_convention(name)
    for i, word in enumerate(published):
        assert written.get(i, 'dropped') == word or i in convention.drop
        assert (i in convention.drop) == word.startswith('noise')
    assert set(convention.classes) - set(range(len(published))) <= {255}


@pytest.mark.parametrize('name', CONVENTIONS)
def test_every_convention_knows_ground_and_movers(name):
    """The sets that the method asks for are classes that the convention can give."""
    convention = label_convention(name)
    assert ROAD in convention.ground
    assert not convention.ground & convention.movable
    assert set(convention.classes.values()) <= set(convention.names)
    assert convention.ground <= set(convention.names)


def test_raw_ids_agree_with_the_table_of_semantickitti(data_folder):
    """Where the published learning map has a class, it is ours; the rest has classes above 19.

    Moving things have one class of their own: they take no part in registration.
    """
    table = yaml.safe_load((data_folder / 'kitti/semantic-kitti.yaml').read_text())
    convention = label_convention('semantickitti')
    for raw, expected in table['learning_map'].items():
        (inside,), (keep,), unknown = decode('semantickitti', [raw])
        assert unknown == []
        assert keep == (table['labels'][raw] != 'outlier')
        if 0 < inside <= 19:
            assert inside == expected
            assert convention.names[inside] == table['labels'][
                table['learning_map_inv'][expected]]
        elif table['labels'][raw].startswith('moving'):
            assert inside in convention.movable
        else:
            assert expected == 0
    for train, raw in table['learning_map_inv'].items():
        if train > 0:
            assert (decode('semantickitti_train', [train - 1])[0]
                    == decode('semantickitti', [raw])[0])


def test_real_labels_hold_nothing_unknown(data_folder):
    """Hand labels, a network's labels and nuScenes labels, each in its own convention."""
    for path, dtype, name in (
            ('kitti/00/labels/000000.label', np.uint32, 'semantickitti'),
            ('kitti/00/predicted_labels/000000.label', np.uint32, 'semantickitti_train'),
            ('nuscenes/labels/000000.label', np.uint8, 'nuscenes')):
        ids = np.fromfile(data_folder / path, dtype).astype(np.int64)
        classes, _, unknown = label_convention(name).decode(ids)
        assert unknown == []
        # road, walls and plants are most of what a street shows
        assert np.isin(classes, [9, 10, 11, 12, 13, 14, 15, 17]).mean() > 0.6


@pytest.mark.parametrize('name', CONVENTIONS)
@pytest.mark.parametrize('odd', [-1, -40, 199, 65000, 10**9, 2**62 + 199])
def test_odd_ids_are_unlabelled_and_reported(name, odd):
    """Negative and huge ids neither fail nor become some class; others are untouched."""
    known = next(iter(label_convention(name).classes))
    classes, keep, unknown = decode(name, [known, odd])
    assert classes[1] == 0
    assert keep[1]
    assert len(unknown) == 1
    assert classes[0] == label_convention(name).classes[known]


def test_unknown_ids_are_told_by_preprocess():
    """The warning names the ids and the convention; the points stay."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-20, 20, (500, 3))
    prepared = preprocess(SemanticScan(points, np.full(500, 77)))
    assert any('[77]' in w and 'semantickitti' in w for w in prepared.warnings)
    assert len(prepared.features.points) > 0
    assert (prepared.features.labels == 0).all()


def test_thousands_of_unknown_ids_are_told_in_a_line():
    """As with a field that holds no class ids; and that they are most of the points."""
    points = np.random.default_rng(0).uniform(-20, 20, (5000, 3))
    warning, = (w for w in preprocess(SemanticScan(points, 1000 + np.arange(5000))).warnings
                if 'label ids' in w)
    assert '[1000, 1001, 1002, 1003, 1004, ... 5000 in all]' in warning
    assert '100% of the points: is label_convention right?' in warning
    assert len(warning) < 300
    few = np.where(np.arange(5000) < 2000, 77, 50)
    assert not any('right?' in w for w in preprocess(SemanticScan(points, few)).warnings)


def test_dropped_ids_leave_no_keypoints():
    """The ego vehicle of nuScenes is out before anything is computed."""
    rng = np.random.default_rng(0)
    car = rng.uniform(-2, 2, (400, 3)) + [2, 0, 0]
    trees = rng.uniform(-3, 3, (400, 3)) + [12, 0, 0]
    prepared = preprocess(SemanticScan(np.vstack((car, trees)), np.repeat([31, 30], 400)),
                          SgorConfig(label_convention='nuscenes'))
    assert prepared.features.points[:, 0].min() > 8.5
    # nothing was measured nearer than the trees
    assert prepared.index.ranges.min() > 8.5


def test_a_table_of_the_user(tmp_path):
    """A YAML file by path: its ids, ground, movers and drops are obeyed."""
    path = tmp_path / 'mine.yaml'
    path.write_text('mask: 0xFF\nclasses: {3: 9, 4: 13, 5: 6}\nground: [9]\nmovable: [6]\n'
                    'drop: [7]\nnames: {9: floor, 13: wall, 6: guest}\n')
    convention = label_convention(str(path))
    assert decode(str(path), [3, 4, 5, 7, 3 | 0x500]) == (
        [9, 13, 6, 0, 9], [True, True, True, False, True], [])
    assert (convention.ground, convention.movable) == ({9}, {6})
    assert convention.names[13] == 'wall'
    assert decode(str(path), [8])[2] == [8]


def test_a_table_is_the_same_in_each_format(tmp_path, monkeypatch):
    """TOML and JSON without any package; YAML needs one, and says which."""
    table = {'mask': 0xFF, 'classes': {'3': 9, '4': 13}, 'ground': [9], 'names': {'9': 'floor'}}
    lines = 'mask = 0xFF\nground = [9]\n[classes]\n3 = 9\n4 = 13\n[names]\n9 = "floor"\n'
    found = []
    for suffix, text in (('toml', lines), ('json', json.dumps(table)),
                         ('yaml', yaml.safe_dump(table))):
        path = tmp_path / f'table.{suffix}'
        path.write_text(text)
        one = label_convention(str(path))
        found.append((one.mask, one.classes, one.names, one.ground, one.movable, one.drop))
    assert found == [(0xFF, {3: 9, 4: 13}, {9: 'floor'}, {9}, frozenset(), frozenset())] * 3
    monkeypatch.setitem(sys.modules, 'yaml', None)
    label_convention.cache_clear()
    assert label_convention(str(tmp_path / 'table.toml')).mask == 0xFF
    with pytest.raises(InputError, match='pip install pyyaml'):
        label_convention(str(tmp_path / 'table.yaml'))


@pytest.mark.parametrize(('suffix', 'text'), [
    ('toml', '[classes'), ('toml', 'classes = 3'), ('json', '{"classes": '), ('json', '[1]'),
    ('json', '{"classes": {"1": 300}, "ground": [], "names": {}}')])
def test_broken_tables_of_other_formats_are_named(tmp_path, suffix, text):
    path = tmp_path / f'broken.{suffix}'
    path.write_text(text)
    with pytest.raises(InputError, match=rf'label_convention = .*broken\.{suffix}'):
        label_convention(str(path))


@pytest.mark.parametrize('text', [
    '', 'classes: [1, 2', 'classes: {1: 2}', '- 1\n- 2', 'just words',
    'classes: {1: 300}\nground: []\nnames: {}', 'classes: {-1: 3}\nground: []\nnames: {}',
    'classes: {a: 3}\nground: []\nnames: {}', 'classes: {1: 3}\nground: 5\nnames: {}',
    'classes: [3]\nground: []\nnames: {}', 'classes: {1: 3}\nground: []\nnames: [a]',
    'mask: -1\nclasses: {1: 3}\nground: []\nnames: {}',
    'classes: {1: 3}\nground: []\nnames: {}\ndrop: [-4]',
    'classes: {1: 3}\nground: []\nnames: {}\ndrop: [1000000000]',
    'classes: {}\nground: []\nnames: {}'])
def test_broken_tables_are_named(tmp_path, text):
    """Whatever is wrong inside, the error says which file."""
    path = tmp_path / 'broken.yaml'
    path.write_text(text)
    with pytest.raises(InputError, match=r'label_convention = .*broken\.yaml'):
        label_convention(str(path))


def test_a_file_that_is_no_text(tmp_path):
    path = tmp_path / 'binary.yaml'
    path.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r'binary\.yaml'):
        label_convention(str(path))


@pytest.mark.parametrize('name', ['kitti', '', 'nowhere.yaml', 'label'])
def test_names_that_are_none(name):
    """The message repeats the name and lists the conventions that there are."""
    with pytest.raises(InputError) as caught:
        label_convention(name)
    assert repr(name) in str(caught.value)
    assert all(known in str(caught.value) for known in CONVENTIONS)


def test_a_mask_has_32_bits(tmp_path):
    text = (TABLES / 'nuscenes.toml').read_text()
    (tmp_path / 'a.toml').write_text(text.replace('mask = 0xFFFFFFFF', f'mask = {2**62}'))
    with pytest.raises(InputError, match='mask must be in 0 to 0xFFFFFFFF'):
        label_convention(str(tmp_path / 'a.toml'))
