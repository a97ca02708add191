"""What the tests of the node share."""
import pytest

from sgor_ros.ros.player import Domain


@pytest.fixture(scope='module')
def domain():
    """Yield a ROS domain that no other test on this machine uses."""
    domain = Domain()
    yield domain
    domain.close()
