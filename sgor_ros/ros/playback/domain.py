"""A ROS domain for one player and one node, so that nothing else on the machine interferes."""
import os
import socket

# free of Linux's ephemeral ports and hardly ever chosen by hand
DOMAINS = range(215, 233)
CLAIM_PORT = 32100


class Domain:
    """A ROS domain that no other player on this machine uses; close it after use.

    Attributes
    ----------
    id : int
    """

    def __init__(self) -> None:
        # the bound port is the claim
        self._claim = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        for self.id in DOMAINS:
            try:
                self._claim.bind(('127.0.0.1', CLAIM_PORT + self.id))
            except OSError:
                continue
            # read when a context is made, by this process and its children
            os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
            return
        raise RuntimeError(f'all ROS domains from {DOMAINS[0]} to {DOMAINS[-1]} are taken')

    def environment(self) -> dict[str, str]:
        """Return the environment of a process in this domain."""
        return {**os.environ, 'ROS_DOMAIN_ID': str(self.id), 'PYTHONUNBUFFERED': '1'}

    def close(self) -> None:
        """Leave it to others."""
        self._claim.close()
