"""The stamp of a message."""
from typing import Any


def stamp_ns_of(header: Any) -> int:
    """Return the stamp of a header, nanoseconds."""
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)
