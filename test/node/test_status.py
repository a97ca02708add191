"""The level on /diagnostics of what a drive brings about, scan by scan."""
import pytest

from sgor_ros import SemanticScan
from sgor_ros import Tracker
from sgor_ros.io.sequence import StampedScan
from sgor_ros.io.stream_config import StreamConfig
from sgor_ros.pipeline.pipeline import Pipeline
from sgor_ros.ros.diagnostics.status import level_of
from sgor_ros.ros.diagnostics.status import OK


@pytest.mark.parametrize('labels', ['labelled', 'none', 'zero'])
def test_a_drive_is_well_with_and_without_labels(street, labels):
    pipeline = Pipeline(Tracker(), StreamConfig())
    for i, (points, ids, _) in enumerate(street):
        given = {'labelled': ids, 'none': None, 'zero': 0 * ids}[labels]
        outcome = pipeline.process(StampedScan(
            (i + 1) * 100_000_000, 'lidar', lambda p=points, g=given: SemanticScan(p, g), 0))
        assert level_of(outcome)[0] == OK, level_of(outcome)
