"""Features compared by `paper_steps()`: what is ours registers from noise, the paper does not."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest

from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig

PAIRS = ((1, 0), (2, 1), (2, 0))    # 6, 6 and 12 m apart
CONFIG = SgorConfig().paper_steps()


@pytest.fixture(scope='module')
def answers(elsewhere):
    """Return a function from configuration and kind of feature to the answers and their errors."""
    scans = [SemanticScan(points, labels) for points, labels, _ in elsewhere]
    ready = [preprocess(scan, SgorConfig(scale=1.0)).features for scan in scans]
    features = {'fpfh': [each.descriptors for each in ready],
                'noise': [np.random.default_rng(i).normal(size=(len(each.points), 32))
                          for i, each in enumerate(ready)]}

    def run(config, kind):
        prepared = [preprocess(scan, config, keypoints=each.points, descriptors=described)
                    for scan, each, described in zip(scans, ready, features[kind], strict=True)]
        found = []
        for source, target in PAIRS:
            result = register(prepared[source], prepared[target], config)
            truth = relative(elsewhere[target][2], elsewhere[source][2])
            found.append((result, *errors(result.T_target_source, truth)))
        return found
    return run


def test_good_features_register(answers):
    for result, metres, degrees in answers(CONFIG, 'fpfh'):
        assert result.success
        assert metres < 0.6
        assert degrees < 5


def test_noise_does_not(answers):
    """An answer there is, since nothing is refused; it is wrong, and hardly a match bears it."""
    for result, metres, _ in answers(CONFIG, 'noise'):
        assert metres > 1.2
        assert result.inliers.sum() < 10


def test_the_threshold_can_be_put_back(answers):
    """With `min_confidence` noise is refused and good features are not."""
    config = CONFIG.replace(min_confidence=SgorConfig().min_confidence)
    assert not any(result.success for result, *_ in answers(config, 'noise'))
    assert all(result.success for result, *_ in answers(config, 'fpfh'))


def test_the_default_finds_the_way_without_features(answers):
    """Which is why it can't compare them: labels, heights and context do."""
    for result, metres, _ in answers(SgorConfig(), 'noise'):
        assert result.success
        assert metres < 0.1
