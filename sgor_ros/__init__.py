"""SGOR: global registration of labelled LiDAR scans, and the odometry built on it."""
from .core.config import SgorConfig
from .core.preprocessing import preprocess
from .core.registration import register
from .core.registration import register_correspondences
from .core.scan import PreparedScan
from .core.scan import Registration
from .core.scan import SemanticScan
from .core.settings import InputError
from .tracker import TrackedScan
from .tracker import Tracker
from .tracker import TrackerConfig

__all__ = ['InputError', 'PreparedScan', 'Registration', 'SemanticScan', 'SgorConfig',
           'TrackedScan', 'Tracker', 'TrackerConfig', 'preprocess', 'register',
           'register_correspondences']
