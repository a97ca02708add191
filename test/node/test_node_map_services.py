"""What the node can be asked of its map while it runs, over real DDS."""
from dataclasses import replace
import json
import shutil

from conftest import errors
from conftest import relative
from geometry_msgs.msg import PoseArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Path
import numpy as np
import pytest
from rcl_interfaces.msg import Parameter
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters
from return_drive import known_map
from return_drive import return_drive
from return_drive import THERE
from return_drive import TURN
from return_drive import twice
import ros_helpers as ros
from scipy.spatial.transform import Rotation
from std_srvs.srv import Trigger
from test_node_health import given_pose

from sgor_ros import Map
from sgor_ros.core.common import se3
from sgor_ros.io.frames import parse_transform
from sgor_ros.io.header_stamp import stamp_ns_of
from sgor_ros.io.messages import matrix_of
from sgor_ros.ros.playback.node_process import NodeProcess

pytest.importorskip('gtsam')

PERIOD_NS = 100_000_000
BACK = THERE + TURN
UPSTAIRS = parse_transform('0 0 40 0 0 0', 'upstairs')


def stamp_of(index):
    return ros.START_NS + index * PERIOD_NS


def truth(index):
    return relative(return_drive()[0][2], return_drive()[index][2])


class Asked(ros.Partner):
    """A partner that asks the node for its map, and sends scans of the drive."""

    def __init__(self, domain):
        super().__init__(domain)
        self.sent = []

    def ask(self, name):
        """Call a service; return success and message."""
        answer = self.call(Trigger, f'/{name}', Trigger.Request())
        return answer.success, answer.message

    def name(self, folder):
        """Set `map_folder`."""
        value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=str(folder))
        request = SetParameters.Request(parameters=[Parameter(name='map_folder', value=value)])
        result, = self.call(SetParameters, '/sgor_node/set_parameters', request).results
        assert result.successful

    def scan(self, index):
        """Send a scan of the drive; return what the node says of it."""
        self.sent.append(index)
        return self.outcome(ros.cloud(*return_drive()[index][:2], stamp_of(len(self.sent))))

    def assert_in_map(self, paths):
        """Assert that the last node of a path is where the scan was taken."""
        self.spin_until(lambda: paths, 10.0, 'path')
        self.spin_for(0.5)
        end = paths[-1].poses[-1]
        index = self.sent[(stamp_ns_of(end.header) - ros.START_NS) // PERIOD_NS - 1]
        metres, degrees = errors(matrix_of(end.pose), truth(index))
        assert metres < 0.15
        assert degrees < 1


@pytest.fixture
def started(domain, tmp_path):
    """Return a function that starts a node, and who asks it."""
    open_now = []

    def start(*parameters):
        arguments = [word for item in ('loop_closure:=true', *parameters) for word in ('-p', item)]
        node = NodeProcess(domain, tmp_path / 'log', *arguments)
        open_now.append(node)
        partner = Asked(domain)
        open_now.append(partner)
        partner.wait_for_node(node.alive)
        return node, partner

    yield start
    for one in reversed(open_now):
        one.__exit__(None, None, None)


def pose_of(row):
    return se3.compose(Rotation.from_quat(row[3:]).as_matrix(), np.array(row[:3]))


def test_a_map_is_named_loaded_located_in_followed_and_added_to(started, tmp_path):
    """One day of a robot; the node begins without a map."""
    folder, other = tmp_path / 'yard', tmp_path / 'new'
    known_map().save(folder)
    node, partner = started()
    assert partner.ask('locate') == (False, 'no scan has come yet')
    success, message = partner.ask('load_map')
    assert not success
    assert 'map_folder is needed' in message
    success, message = partner.ask('set_mode_localization')
    assert not success
    assert 'no map to follow' in message
    partner.name(folder)
    success, message = partner.ask('load_map')
    assert success
    assert str(folder) in message
    assert f'{len(known_map().keyframes)} keyframes' in message
    assert partner.ask('set_mode_localization')[0]
    paths = partner.hear(Path, '/path')
    for index in range(BACK, BACK + 4):
        level, _, values = partner.scan(index)
        assert values['state'] in ('tracking', 'new track'), level
        assert values['map mode'] == 'localization'
        assert values['keyframes'] == str(len(known_map().keyframes))
    last = stamp_of(len(partner.sent))
    success, message = partner.ask('locate')
    assert success
    found = json.loads(message)
    assert found['stamp'] == f'{last // 10**9}.{last % 10**9:09d}'
    assert (found['frame'], found['child_frame'], found['status']) == ('map', 'lidar',
                                                                       'registered')
    metres, degrees = errors(pose_of(found['pose']), truth(BACK + 3))
    assert metres < 0.1
    assert degrees < 0.5
    assert 0 < max(found['three_sigma'][:3]) < 0.5
    assert 0.5 < found['confidence'] <= 1
    assert found['alternatives'] == []
    partner.assert_in_map(paths)
    # nothing of it is in the map
    partner.name(other)
    assert partner.ask('save_map')[0]
    assert Map.load(other).nodes.keys() == known_map().nodes.keys()
    # and now it is
    assert partner.ask('set_mode_mapping')[0]
    assert partner.scan(BACK + 4)[2]['map mode'] == 'mapping'
    assert partner.ask('save_map')[0]
    assert Map.load(other).sessions == (0, 1)
    assert node.stop() == 0


def test_what_is_wrong_with_a_map_is_an_answer_and_the_node_goes_on(started, tmp_path):
    folder, damaged = tmp_path / 'yard', tmp_path / 'damaged'
    known_map().save(folder)
    shutil.copytree(folder, damaged)
    (damaged / 'graph.npz').write_bytes(b'nothing')
    node, partner = started(f'map_folder:={folder}', 'localization:=true')
    assert partner.scan(BACK)[2]['map mode'] == 'localization'
    for name, said in ((tmp_path / 'none', 'no such folder'), (damaged, 'graph.npz: damaged'),
                       (tmp_path, 'no map')):
        partner.name(name)
        success, message = partner.ask('load_map')
        assert not success
        assert said in message
    (tmp_path / 'file').write_text('dear')
    partner.name(tmp_path / 'file')
    assert not partner.ask('save_map')[0]
    # it is still in the first one, and follows it
    assert partner.scan(BACK + 1)[2]['state'] == 'tracking'
    assert json.loads(partner.ask('locate')[1])['status'] == 'registered'
    # loaded again it begins anew and finds itself; odom goes on
    partner.name(folder)
    assert partner.ask('load_map')[0]
    paths = partner.hear(Path, '/path')
    _, _, values = partner.scan(BACK + 2)
    assert values['state'] == 'new track'
    assert values['map mode'] == 'localization'
    partner.assert_in_map(paths)
    before, after = (matrix_of(one.pose.pose) for one in partner.odometry[-2:])
    assert np.linalg.norm((after - before)[:3, 3]) < 6
    assert node.stop() == 0


def test_elsewhere_locate_says_why_not(started, tmp_path, elsewhere):
    known_map().save(tmp_path / 'yard')
    node, partner = started(f'map_folder:={tmp_path / "yard"}')
    partner.outcome(ros.cloud(*elsewhere[0][:2], stamp_of(1)))
    success, message = partner.ask('locate')
    assert not success
    found = json.loads(message)
    assert found['status'] == 'refused'
    assert 'keyframes that look alike' in found['reason']
    assert found['pose'] is None
    assert node.stop() == 0


def test_the_map_frame_is_that_of_the_first_base_whatever_is_mounted_today(started, tmp_path):
    """Yesterday the sensor sat elsewhere on the vehicle; poses are those of the base."""
    yesterday = parse_transform('1.0 0.5 1.8 0.02 -0.1 1.2', 'mount')
    mount = '1.2 -0.3 1.8 0.05 0.1 1.5'
    folder = tmp_path / 'yard'
    replace(known_map(), T_base_sensor=yesterday).save(folder)
    node, partner = started(f'map_folder:={folder}', 'base_frame:=base_link',
                            f'T_base_sensor:={mount}')
    assert partner.scan(BACK)[2]['state'] == 'new track'
    success, message = partner.ask('locate')
    assert success
    found = json.loads(message)
    assert found['child_frame'] == 'base_link'
    T_base_sensor = parse_transform(mount, 'mount')
    metres, degrees = errors(pose_of(found['pose']),
                             yesterday @ truth(BACK) @ se3.inverse(T_base_sensor))
    assert metres < 0.1
    assert degrees < 0.5
    assert partner.ask('save_map')[0]
    np.testing.assert_array_equal(Map.load(folder).T_base_sensor, yesterday)
    assert node.stop() == 0


def in_map(T, frame='map'):
    return given_pose(T, np.diag([0.25, 0.25, 0, 0, 0, 0.07]), frame)


def test_two_floors_alike_are_hypotheses_until_what_is_driven_decides(started, tmp_path):
    """The first metres are the same upstairs; a hint of the wrong floor decides nothing."""
    known = known_map()
    twice(known, UPSTAIRS, list(known.nodes)[:2]).save(tmp_path / 'house')
    node, partner = started(f'map_folder:={tmp_path / "house"}')
    paths = partner.hear(Path, '/path')
    heard = partner.hear(PoseArray, '/hypotheses')
    hint = partner.node.create_publisher(PoseWithCovarianceStamped, '/initialpose', 1)
    partner.spin_until(hint.get_subscription_count)
    _, message, _ = partner.scan(0)
    assert '2 places of the map fit' in message
    partner.spin_until(lambda: heard, 10.0, 'hypotheses')
    assert heard[0].header.frame_id == 'map'
    assert stamp_ns_of(heard[0].header) == stamp_of(1)
    floors = sorted((matrix_of(pose) for pose in heard[0].poses), key=lambda T: T[2, 3])
    assert len(floors) == 2
    assert errors(floors[0], truth(0))[0] < 0.15
    assert errors(floors[1], UPSTAIRS @ truth(0))[0] < 0.15
    hint.publish(in_map(UPSTAIRS @ truth(0)))
    partner.spin_for(0.5)
    decided = None
    for index in range(1, THERE):
        partner.scan(index)
        partner.spin_for(0.2)
        if not heard[-1].poses:
            decided = index
            break
    assert decided is not None
    assert stamp_ns_of(heard[-1].header) == stamp_of(len(partner.sent))
    partner.scan(decided + 2)
    partner.assert_in_map(paths)
    assert node.stop() == 0


def lost_in_a_map(started, tmp_path):
    """Return a node and its partner, the paths it will tell, and a publisher of hints."""
    known_map().save(tmp_path / 'yard')
    node, partner = started(f'map_folder:={tmp_path / "yard"}')
    paths = partner.hear(Path, '/path')
    hint = partner.node.create_publisher(PoseWithCovarianceStamped, '/initialpose', 1)
    partner.spin_until(hint.get_subscription_count)
    return node, partner, paths, hint


@pytest.mark.parametrize('hinted', [BACK, 2])
def test_a_hint_may_be_right_or_wrong_and_nonsense_is_ignored(started, tmp_path, hinted):
    node, partner, paths, hint = lost_in_a_map(started, tmp_path)
    hint.publish(in_map(truth(BACK), 'odom'))
    partner.spin_for(0.5)
    broken = in_map(truth(BACK))
    broken.pose.pose.position.x = float('nan')
    hint.publish(broken)
    partner.spin_for(0.5)
    log = (tmp_path / 'log').read_text()
    assert 'initialpose: in the frame odom, not in map: ignored' in log
    assert 'initialpose: its position is not finite: ignored' in log
    hint.publish(in_map(truth(hinted)))
    partner.spin_for(0.5)
    assert 'it is looked for there first' in (tmp_path / 'log').read_text()
    partner.scan(BACK)
    partner.scan(BACK + 1)
    partner.assert_in_map(paths)
    assert node.stop() == 0


def test_a_hint_never_gives_a_pose_without_registration(started, tmp_path, elsewhere):
    node, partner, paths, hint = lost_in_a_map(started, tmp_path)
    _, message, _ = partner.outcome(ros.cloud(*elsewhere[0][:2], stamp_of(1)))
    assert 'not found in the map' in message
    hint.publish(in_map(truth(3)))
    partner.spin_for(0.5)
    # the same place again, no new keyframe: it is looked for all the same
    _, message, _ = partner.outcome(ros.cloud(*elsewhere[0][:2], stamp_of(2)))
    assert 'not found in the map' in message
    _, message, _ = partner.outcome(ros.cloud(*elsewhere[0][:2], stamp_of(3)))
    assert 'not found in the map' not in message
    partner.spin_for(0.5)
    assert paths == []
    assert node.stop() == 0
