"""The public interface, which is that of the package: `from sgor_ros import register`."""
from .core.common.settings import InputError
from .core.compact_scan import compact
from .core.compact_scan import CompactScan
from .core.config import SgorConfig
from .core.prepared_scan import PreparedScan
from .core.preprocessing import preprocess
from .core.registration import register
from .core.registration import register_correspondences
from .core.scan.scan import SemanticScan
from .core.verdict.result import Placement
from .core.verdict.result import Registration
from .core.verdict.result import Status
from .core.warmup import warm_up
from .mapping import Located
from .mapping import Loop
from .mapping import Map
from .mapping import MappedScan
from .mapping import Mapper
from .mapping import MapperConfig
from .mapping import Merged
from .mapping import Place
from .mapping import Trajectory
from .tracker import State
from .tracker import TrackedScan
from .tracker import Tracker
from .tracker import TrackerConfig

__all__ = ['CompactScan', 'InputError', 'Located', 'Loop', 'Map', 'MappedScan', 'Mapper',
           'MapperConfig', 'Merged', 'Place', 'Placement', 'PreparedScan', 'Registration',
           'SemanticScan', 'SgorConfig', 'State', 'Status', 'TrackedScan', 'Tracker',
           'TrackerConfig', 'Trajectory', 'compact', 'preprocess', 'register',
           'register_correspondences', 'warm_up']
