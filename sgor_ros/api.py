"""The public interface, which is that of the package: `from sgor_ros import register`."""
from .core.common.settings import InputError
from .core.config import SgorConfig
from .core.registration import register
from .core.registration import register_correspondences
from .core.result import Placement
from .core.result import Registration
from .core.scan.preprocessing import preprocess
from .core.scan.scan import PreparedScan
from .core.scan.scan import SemanticScan
from .core.warmup import warm_up
from .tracker import State
from .tracker import TrackedScan
from .tracker import Tracker
from .tracker import TrackerConfig

__all__ = ['InputError', 'Placement', 'PreparedScan', 'Registration', 'SemanticScan', 'SgorConfig',
           'State', 'TrackedScan', 'Tracker', 'TrackerConfig', 'preprocess', 'register',
           'register_correspondences', 'warm_up']
