"""On what results were obtained: versions and machine."""
from importlib import metadata
import os
from pathlib import Path
import platform

PACKAGES = ('sgor_ros', 'numpy', 'scipy', 'numba', 'rosbags')


def describe_environment(packages: tuple[str, ...] = PACKAGES) -> dict[str, str | int]:
    """Return versions of Python and of packages, the processor and its cores."""
    return {'python': platform.python_version(),
            **{name: _version(name) for name in packages},
            'system': platform.platform(), 'processor': _processor(),
            'cores': len(os.sched_getaffinity(0))}


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return 'not installed'


def _processor() -> str:
    """Return the name that Linux knows; platform.processor() is empty there."""
    try:
        lines = Path('/proc/cpuinfo').read_text().splitlines()
    except OSError:
        lines = []
    names = (line.partition(':')[2].strip() for line in lines if line.startswith('model name'))
    return next(names, platform.machine())
