"""The fault table of docs/node.md, each row over real DDS: what it says, and no wrong pose."""
import numpy as np
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
import ros_helpers as ros
from ros_helpers import status
from ros_helpers import street
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from sgor_ros.io.header_stamp import stamp_ns_of
from sgor_ros.io.messages import matrix_of
from sgor_ros.ros.playback.node_process import NodeProcess
from sgor_ros.world import Lidar
from sgor_ros.world import simulate

OK, WARN, ERROR = b'\x00', b'\x01', b'\x02'
PERIOD_NS = 100_000_000
WRONG_M, WRONG_RAD = 1.0, 0.1


@pytest.fixture(scope='module')
def drive():
    return street(20)


@pytest.fixture(scope='module')
def elsewhere():
    return street(8, seed=1)


@pytest.fixture(scope='module')
def shared(domain, tmp_path_factory):
    log = tmp_path_factory.mktemp('node') / 'log'
    with NodeProcess(domain, log) as node, ros.Partner(domain) as partner:
        partner.wait_for_node(node.alive)
        yield node, partner
        assert node.stop() == 0


@pytest.fixture
def partner(shared):
    node, partner = shared
    assert node.alive(), node.log.read_text()
    assert partner.call(Trigger, '/reset', Trigger.Request()).success
    partner.spin_for(0.1)
    partner.forget()
    yield partner
    assert node.alive(), node.log.read_text()


class Journey:
    """Scans sent one after the other, with new stamps, and what became of them."""

    def __init__(self, partner, begin_ns=ros.START_NS):
        self.partner = partner
        self.next_ns = begin_ns
        self.truth = {}
        self.told = {}

    def send(self, scan, points=None, labels=None, step_ns=PERIOD_NS):
        """Send a scan, or other points from its place; return level, message and values."""
        stamp_ns, self.next_ns = self.next_ns, self.next_ns + step_ns
        cloud = ros.cloud(scan[1] if points is None else points,
                          scan[2] if points is None else labels, stamp_ns)
        self.truth[stamp_ns] = scan[3]
        self.told[stamp_ns] = self.partner.outcome(cloud, 60.0)
        return self.told[stamp_ns]

    def poses(self):
        """Return the stamps that have a pose, all of which must be right for their track."""
        stamps = [stamp for stamp, (*_, values) in self.told.items()
                  if values.get('state') in ('new track', 'tracking', 'degenerate')]
        self.partner.spin_until(lambda: {stamp_ns_of(m.header) for m in self.partner.odometry}
                                >= set(stamps))
        found = {stamp_ns_of(m.header): matrix_of(m.pose.pose) for m in self.partner.odometry}
        origins = {}
        for stamp in stamps:
            track = self.told[stamp][2]['track']
            origin = origins.setdefault(track, self.truth[stamp])
            metres, radians = ros.difference(found[stamp],
                                             np.linalg.inv(origin) @ self.truth[stamp])
            assert metres < WRONG_M, (stamp, self.told[stamp])
            assert radians < WRONG_RAD, (stamp, self.told[stamp])
        return stamps


def test_a_third_of_the_scans_lost(partner, drive):
    journey = Journey(partner)
    lost = np.random.default_rng(0).uniform(size=len(drive)) < 0.3
    lost[:7] = False    # the rate must be known first
    for scan, gone in zip(drive, lost, strict=True):
        if gone:
            journey.next_ns += PERIOD_NS
        else:
            assert journey.send(scan)[0] == OK
    missed = int(journey.send(drive[-1])[2]['missed'])
    assert missed >= lost.sum()
    assert len(journey.poses()) == len(drive) - lost.sum() + 1


@pytest.mark.parametrize('count', [10, 1_000_000])
def test_a_cloud_of_few_or_very_many_points(partner, drive, count):
    """Ten say too little; a million are the place ten times over, with noise."""
    journey = Journey(partner)
    rng = np.random.default_rng(0)
    for index, scan in enumerate(drive[:6]):
        if index not in (2, 3):
            journey.send(scan)
            continue
        rows = rng.integers(0, len(scan[1]), count)
        points = scan[1][rows] + rng.normal(0, 0.02, (count, 3)).astype(np.float32)
        level, message, values = journey.send(scan, points, scan[2][rows])
        if count == 10:
            assert level == ERROR
            assert values['reason'] in message
    assert len(journey.poses()) == (4 if count == 10 else 6)


def test_clouds_without_a_usable_point(partner, drive):
    journey = Journey(partner)
    for index, scan in enumerate(drive[:8]):
        if index % 2:
            points = np.full_like(scan[1], np.nan)
            if index % 4 == 3:
                points[:40] = scan[1][:40]
            assert journey.send(scan, points, scan[2])[0] == ERROR
        else:
            assert journey.send(scan)[0] == OK
    assert len(journey.poses()) == 4


def test_labels_that_come_and_go(partner, drive):
    """None, all zero, half of them, all of another convention: never a wrong pose."""
    journey = Journey(partner)
    rng = np.random.default_rng(0)
    for index, scan in enumerate(drive):
        labels = scan[2]
        spoilt = (labels, None, np.zeros_like(labels),
                  np.where(rng.uniform(size=len(labels)) < 0.5, 0, labels),
                  rng.permutation(labels), labels + 20000)[index % 6]
        journey.send(scan, scan[1], spoilt)
    assert len(journey.poses()) > len(drive) // 2
    assert journey.send(drive[-1])[0] == OK


def test_stamps_that_jump_both_ways(partner, drive):
    journey = Journey(partner)
    for jump_ns, scan in zip([0, 0, 0, -PERIOD_NS * 3, PERIOD_NS * 3, 0, 3600 * 10**9, 0, 0,
                              -7200 * 10**9, 0, 0, 0], drive, strict=False):
        journey.next_ns += jump_ns
        journey.send(scan)
    assert len(journey.poses()) >= 9
    assert journey.told[list(journey.told)[-1]][0] == OK


def test_kidnapped_there_and_back(partner, drive, elsewhere):
    """Somewhere else it says failed, lost, new track; back again the old track goes on."""
    journey = Journey(partner)
    for scan in drive[:3]:
        assert journey.send(scan)[0] == OK
    first = journey.told[ros.START_NS][2]['track']
    for scan in elsewhere:
        journey.send(scan, step_ns=10**9)
    states = [values['state'] for *_, values in list(journey.told.values())[3:]]
    assert states[0] == 'failed'
    assert states[4] == 'lost'
    assert 'new track' in states
    for _ in range(6):
        level, _, values = journey.send(drive[3])
    assert values['track'] == first
    assert level == OK
    journey.poses()


def test_a_stand_of_200_scans(partner, drive):
    """Noise of its own in each; the pose stays and so does the velocity."""
    journey = Journey(partner)
    rng = np.random.default_rng(0)
    *_, scan = drive[:5]
    for _ in range(200):
        points = scan[1] + rng.normal(0, 0.02, scan[1].shape).astype(np.float32)
        assert journey.send(scan, points, scan[2])[0] == OK
    assert len(journey.poses()) == 200
    for message in partner.odometry:
        metres, radians = ros.difference(matrix_of(message.pose.pose), np.eye(4))
        assert metres < 0.1
        assert radians < 0.01
        assert abs(message.twist.twist.linear.x) < 1.0


def test_parameters_at_the_rate_of_the_scans(partner, drive):
    journey = Journey(partner)
    for index, scan in enumerate(drive):
        value = (2000, 8000)[index % 2]
        message: ParameterMessage = Parameter('max_correspondences', value=value
                                              ).to_parameter_msg()
        answer = partner.call(SetParameters, '/sgor_node/set_parameters',
                              SetParameters.Request(parameters=[message]))
        assert answer.results[0].successful
        assert journey.send(scan)[0] == OK
    assert len(journey.poses()) == len(drive)


def test_a_subscriber_that_never_reads(partner, domain, drive):
    idle = ros.Partner(domain)
    try:
        idle.spin_until(lambda: idle.node.count_publishers('/odometry') > 0)
        journey = Journey(partner)
        for scan in drive:
            assert journey.send(scan)[0] == OK
        assert len(journey.poses()) == len(drive)
    finally:
        idle.close()


def test_both_sides_killed_and_started_again(domain, drive, tmp_path):
    """A node begins a track at the origin; a new sender finds the node that is there."""
    with NodeProcess(domain, tmp_path / 'one', '-r', '__ns:=/again') as node:
        for half in (drive[:4], drive[4:8]):
            with ros.Partner(domain, '/again/') as partner:
                partner.wait_for_node(node.alive)
                journey = Journey(partner, half[0][0])
                for scan in half:
                    assert journey.send(scan)[0] == OK
                if half[0] is drive[0]:
                    assert len(journey.poses()) == 4
                else:    # the track of before goes on
                    partner.spin_until(lambda heard=partner.odometry: len(heard) == 4)
                    for message, scan in zip(partner.odometry, half, strict=True):
                        metres, _ = ros.difference(matrix_of(message.pose.pose),
                                                   np.linalg.inv(drive[0][3]) @ scan[3])
                        assert metres < WRONG_M
        node.process.kill()
        node.process.wait()
    with NodeProcess(domain, tmp_path / 'two', '-r', '__ns:=/again') as node, \
            ros.Partner(domain, '/again/') as partner:
        partner.wait_for_node(node.alive)
        journey = Journey(partner)
        for scan in drive[8:12]:
            assert journey.send(scan)[0] == OK
        assert len(journey.poses()) == 4
        assert node.stop() == 0


def test_a_clock_that_is_reset(domain, drive, tmp_path):
    """use_sim_time, and a bag that starts over: a new track, and /diagnostics goes on."""
    with NodeProcess(domain, tmp_path / 'log', '-r', '__ns:=/sim', '-p', 'use_sim_time:=true'
                     ) as node, ros.Partner(domain, '/sim/') as partner:
        partner.wait_for_node(node.alive)
        publisher = partner.node.create_publisher(Clock, '/clock', 10)
        partner.spin_until(lambda: publisher.get_subscription_count() > 0)
        journey = Journey(partner)
        for _ in range(2):
            journey.next_ns = ros.START_NS if not journey.told else ros.START_NS + 50
            for scan in drive[:5]:
                clock = Clock()
                clock.clock.sec, clock.clock.nanosec = divmod(journey.next_ns, 10**9)
                publisher.publish(clock)
                journey.send(scan, step_ns=10**9)
        states = [values['state'] for *_, values in journey.told.values()]
        assert states.count('new track') == 2
        assert len(journey.poses()) >= 9
        partner.diagnostics.clear()
        partner.spin_until(lambda: len(partner.diagnostics) >= 2)
        assert 'no clouds for' in status(partner.diagnostics[-1])[1]
        assert node.stop() == 0


def test_a_large_street_at_once(partner, domain):
    """A burst of large clouds: the newest wins, and it is right."""
    lidar = Lidar(beams=64, columns=1800)
    scans = [(0, points, labels, pose) for _, points, labels, pose
             in simulate(3, seed=0, lidar=lidar)]
    journey = Journey(partner)
    journey.send(scans[0])
    for index in range(30):
        stamp_ns = journey.next_ns + index * PERIOD_NS // 10
        scan = scans[1 + index % 2]
        journey.truth[stamp_ns] = scan[3]
        partner.send(stamp_ns, ros.cloud(scan[1], scan[2], stamp_ns))
    partner.spin_until(lambda: any(stamp_ns_of(m.header) == stamp_ns
                                   for m in partner.diagnostics), 60.0)
    for message in partner.diagnostics:
        if stamp_ns_of(message.header) in journey.truth:
            journey.told[stamp_ns_of(message.header)] = status(message)
    assert len(journey.poses()) >= 2
    values = journey.told[stamp_ns][2]
    assert int(values['received']) == sum(
        int(values[name]) for name in ('processed', 'failed', 'late', 'replaced'))
