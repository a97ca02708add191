"""Configurations: every value is checked where it enters, and the message names it."""
import dataclasses
import math

import pytest

from sgor_ros import InputError
from sgor_ros import SgorConfig
from sgor_ros import TrackerConfig
from sgor_ros.core.ablation import Ablation
from sgor_ros.core.config import PAPER_STEPS
from sgor_ros.core.config import PREPARATION
from sgor_ros.core.config import prepares_alike
from sgor_ros.tracker.config import TrackerAblation

FIELDS = [(kind, item) for kind in (SgorConfig, TrackerConfig) for item in kind.settings()]
NUMBERS = [pytest.param(kind, item, id=item.name) for kind, item in FIELDS
           if item.kind in (int, float)]


def message(kind, **values):
    """Return what InputError says about values."""
    with pytest.raises(InputError) as caught:
        kind(**values)
    return str(caught.value)


@pytest.mark.parametrize(('kind', 'item'), NUMBERS)
def test_bounds_are_inclusive_and_nothing_beyond_is_taken(kind, item):
    """Each number has both bounds; at them it is taken, just beyond refused by name."""
    step = 1 if item.kind is int else max(1e-9, abs(item.maximum) * 1e-12)
    low, high = item.kind(item.minimum), item.kind(item.maximum)
    assert low <= item.default <= high
    assert item.check(low) == low
    assert item.check(high) == high
    for value, word in ((low - step, 'below the minimum'), (high + step, 'above the maximum')):
        assert message(kind, **{item.name: value}).startswith(f'{item.name} = {value!r}: {word}')


@pytest.mark.parametrize('value', [float('nan'), float('inf'), -float('inf')])
@pytest.mark.parametrize(('kind', 'item'), [
    pytest.param(kind, item, id=item.name) for kind, item in FIELDS if item.kind is float])
def test_numbers_are_finite(kind, item, value):
    """NaN passes every comparison with bounds, so it has a check of its own."""
    assert message(kind, **{item.name: value}) == f'{item.name} = {value!r}: not a finite number'


@pytest.mark.parametrize(('kind', 'item'), [
    pytest.param(kind, item, id=item.name) for kind, item in FIELDS])
def test_wrong_types_are_refused(kind, item):
    """No silent conversion: not text for a number, not a number for a truth value or text."""
    wrong = {bool: (1, 'true', None), int: (10.0, True, '10'), float: (True, '0.5', None),
             str: (1, None, True)}
    for value in wrong[item.kind]:
        said = message(kind, **{item.name: value})
        assert said.startswith(f'{item.name} = {value!r}: expected {item.kind.__name__}, got')


def test_whole_numbers_are_taken_for_floats():
    """And become floats, as ROS and YAML need them."""
    config = SgorConfig(sigma_d=1)
    assert type(config.sigma_d) is float
    assert config == SgorConfig(sigma_d=1.0)


@pytest.mark.parametrize(('kind', 'name'), [(SgorConfig, 'semantics'), (TrackerConfig, 'mode')])
def test_words_come_from_a_list(kind, name):
    """Each choice is taken; the refusal of any other lists them all."""
    choices = next(item.choices for item in kind.settings() if item.name == name)
    for word in choices:
        assert getattr(kind(**{name: word}), name) == word
    assert message(kind, **{name: 'Loose'}) == f"{name} = 'Loose': not one of {', '.join(choices)}"


def test_unknown_names_are_refused():
    """A typing error in YAML does not go by unseen; the message lists what there is."""
    with pytest.raises(InputError, match=r'^sigma_x: no such setting; there are .*sigma_d.*tau_1'):
        SgorConfig.from_values({'sigma_x': 0.5})
    with pytest.raises(InputError, match='keyframes: no such setting'):
        TrackerConfig().replace(keyframes=3)


@pytest.mark.parametrize(('values', 'words'), [
    ({'normal_radius': 4.0}, ('normal_radius = 4.0', 'descriptor_radius = 3.5')),
    ({'vote_radius': 4.0}, ('vote_radius = 4.0', 'descriptor_radius = 3.5')),
    ({'descriptor_radius': 1.2}, ('normal_radius = 1.5', 'descriptor_radius = 1.2')),
    ({'group_size': 20, 'group_keep': 20}, ('group_keep = 20', 'group_size = 20')),
])
def test_fields_that_do_not_fit_each_other(values, words):
    """The message names both fields and both values."""
    said = message(SgorConfig, **values)
    assert all(word in said for word in words)


def test_replace_checks_again_and_leaves_the_original():
    """Frozen: a copy with everything checked, single values and combinations."""
    config = SgorConfig()
    changed = config.replace(sigma_d=0.9, groups=7)
    assert (changed.sigma_d, changed.groups) == (0.9, 7)
    assert config == SgorConfig()
    assert changed.replace(sigma_d=config.sigma_d, groups=config.groups) == config
    with pytest.raises(InputError, match=r'sigma_d = -1\.0'):
        config.replace(sigma_d=-1.0)
    with pytest.raises(InputError, match='normal_radius'):
        config.replace(descriptor_radius=1.2)
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.sigma_d = 0.1


def test_every_setting_tells_what_it_means():
    """Shells print name, unit and meaning: none may be empty, angles are radians."""
    for _, item in FIELDS:
        assert item.meaning[0].isupper()
        assert item.description.startswith(item.meaning)
        assert item.unit in ('', 'm', 'rad', 's', 'm/s', 'rad/s', 'm/s^2', 'rad/s^2')
        assert all(choice in item.description for choice in item.choices)
        if item.name.endswith(('_angle', '_theta')):
            assert item.unit == 'rad'
            assert item.maximum <= math.pi


def test_outdoor_is_the_default():
    assert SgorConfig.outdoor() == SgorConfig()


def test_indoor_is_a_smaller_world():
    """Every length shrinks or is switched off; ground there is no sign of upright."""
    indoor, outdoor = SgorConfig.indoor(), SgorConfig()
    lengths = {item.name for item in SgorConfig.settings() if item.unit == 'm'}
    for name in lengths - {'ground_radius'}:    # as far as a room goes
        assert getattr(indoor, name) < getattr(outdoor, name) / 2
    assert not indoor.ground_check


BEYOND = [item for item in SgorConfig.settings() if 'beyond the paper' in item.meaning]


@pytest.mark.parametrize('name', [item.name for item in BEYOND] + [
    'local_refinement', 'min_confidence'])
def test_paper_turns_off_what_goes_beyond_it(name):
    """Each mechanism of ours is on by default and off in the preset of the paper."""
    assert getattr(SgorConfig.paper(), name) in (False, 0)
    assert getattr(SgorConfig(), name) not in (False, 0)


def test_paper_is_the_default_where_nothing_is_printed():
    """One rule: what is neither printed nor ours has the value of the default."""
    paper, default = SgorConfig.paper(), SgorConfig()
    differ = {item.name for item in SgorConfig.settings()
              if getattr(paper, item.name) != getattr(default, item.name)}
    assert differ == {*PAPER_STEPS, 'scale'}
    assert paper.scale == 1


def test_paper_steps_keep_sizes_and_ablations():
    """The same is off in any configuration; lengths, thresholds and ablations are its own."""
    own = SgorConfig.indoor().replace(semantics='hard', group_keep=20, scale=0.5)
    steps = own.paper_steps()
    for item in SgorConfig.settings():
        expected = PAPER_STEPS.get(item.name, getattr(own, item.name))
        assert getattr(steps, item.name) == expected
    assert SgorConfig().paper_steps() == SgorConfig.paper()


def test_kitti_protocol_is_the_paper_with_another_front_end():
    protocol, paper = SgorConfig.kitti_protocol(), SgorConfig.paper()
    assert (protocol.voxel_size, protocol.normal_radius, protocol.descriptor_radius) == (
        0.3, 0.6, 1.5)
    assert protocol.sampled_keypoints
    assert protocol.max_correspondences == 8000
    assert protocol == paper.replace(voxel_size=0.3, normal_radius=0.6, descriptor_radius=1.5)


def test_paper_keeps_what_is_printed():
    """All steps of the paper are on, with its way of weighing and its single refinement."""
    paper = SgorConfig.paper()
    assert paper.correspondence_preprocessing
    assert paper.secondary_ground
    assert paper.ground_check
    assert paper.semantics == 'loose'
    assert paper.refinement_rounds == 1
    assert paper.moving_vote
    assert paper.drop_ground_labels == 'point'    # s_i of Eq. 4
    assert paper.min_inliers == 0
    # exp(-d^2 / (2 sigma^2)) is cut where nothing is left of it
    assert math.exp(-paper.weight_cutoff**2 / 2) < 1e-7


def test_an_error_is_one_line_that_a_terminal_shows():
    """Names come out of files; an escape of a terminal among them is shown, not obeyed."""
    error = InputError('field \x1b[2J\x00: broken\n    in line 2\n')
    assert str(error) == r'field \x1b[2J\x00: broken in line 2'
    assert str(InputError('Grüße, 5 °')) == 'Grüße, 5 °'


def test_users_see_a_dozen_settings_and_the_rest_is_for_studies():
    """Each in a group; what is not shown is a field all the same, taken by name."""
    shown = SgorConfig.shown()
    assert [item.name for item in shown] == [
        'scale', 'label_convention', 'min_range', 'max_range', 'voxel_size', 'sigma_g', 'sigma_d',
        'sigma_theta', 'tau_1', 'min_confidence', 'hypothesis_radius', 'max_correspondences',
        'max_voxels', 'threads']
    assert list(dict.fromkeys(item.group for item in shown)) == [
        'space', 'sensor', 'thresholds', 'trust', 'speed']
    assert {*SgorConfig.settings()} == {*shown, *Ablation.settings()}
    assert {*TrackerConfig.settings()} == {*TrackerConfig.shown(), *TrackerAblation.settings()}
    assert SgorConfig(ground_check=False).ground_check is False
    assert TrackerConfig(predict_first=False).predict_first is False


RENAMED = {'rival_radius': 'hypothesis_radius', 'evidence_reach': 'max_correspondence_distance',
           'local_reach': 'gicp_max_correspondence_distance'}


@pytest.mark.parametrize(('old', 'new'), RENAMED.items())
def test_names_of_before_are_taken_with_a_warning(old, new):
    value = 0.7 if old != 'rival_radius' else 12.0
    for build in (SgorConfig, lambda **values: SgorConfig.from_values(values),
                  lambda **values: SgorConfig().replace(**values)):
        with pytest.warns(DeprecationWarning, match=f'{old} is {new} now'):
            config = build(**{old: value})
        assert config == SgorConfig(**{new: value})
        with pytest.warns(DeprecationWarning, match=f'{old} is {new} now'):
            assert getattr(config, old) == value


# another value of each setting that is not the default, and goes with the others
CHANGES = {name: not value if isinstance(value, bool) else value * 0.9
           for name in PREPARATION
           if isinstance(value := getattr(SgorConfig(), name), bool | float)}
CHANGES |= {'max_voxels': 30000, 'min_ground_points': 40, 'drop_ground_labels': 'point',
            'label_convention': 'nuscenes', 'scale': 0.5}


def test_what_a_scan_was_prepared_with_is_asked():
    assert {*CHANGES} == {*PREPARATION, 'scale'}
    for name, value in CHANGES.items():
        assert not prepares_alike(SgorConfig(), SgorConfig(**{name: value})), name
    for name in ({item.name for item in SgorConfig.settings()} - {*PREPARATION, 'scale'}):
        value = getattr(SgorConfig(), name)
        other = {bool: lambda v: not v, int: lambda v: v + 1, str: lambda v: 'hard',
                 float: lambda v: v * 1.1 if v >= 1 else v * 0.9}[type(value)](value)
        assert prepares_alike(SgorConfig(), SgorConfig(**{name: other})), name
