"""Package for pip and for colcon (ament_python); version and people are those of package.xml."""
from glob import glob
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages
from setuptools import setup

HERE = Path(__file__).resolve().parent
PACKAGE = ElementTree.parse(HERE / 'package.xml').getroot()
MAINTAINER = PACKAGE.find('maintainer')
SHARE = 'share/sgor_ros'
COMMANDS = ('replay', 'register', 'map', 'kitti_to_bag', 'benchmark', 'demo', 'warm_up',
            'tables')
# the built-in world; the module of open3d without CUDA
OPEN3D = ['open3d-cpu>=0.18']
COMMANDS_NEED = [
    'matplotlib',
    'pyyaml',
    'rich',
    'rosbags~=0.11.0',    # its 0.x releases remove names
]
# and APE and RPE, the other methods, their matches from depth maps, and a cluster to run on
EVALUATION = [*COMMANDS_NEED, *OPEN3D, 'evo', 'kiss-icp', 'kiss_matcher', 'small_gicp>=1.0',
              'igraph', 'pillow', 'distributed', 'scikit-learn']

setup(
    name='sgor_ros',
    version=PACKAGE.findtext('version'),
    description=PACKAGE.findtext('description'),
    long_description=(HERE / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    url=PACKAGE.findtext('url'),
    project_urls={'Paper': 'https://arxiv.org/abs/2407.06297'},
    author=MAINTAINER.text,
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get('email'),
    license='Apache-2.0',
    keywords=['LiDAR', 'point cloud registration', 'semantic', 'odometry', 'SLAM', 'ROS 2'],
    classifiers=[
        'Development Status :: 4 - Beta',
        'Intended Audience :: Developers',
        'Intended Audience :: Science/Research',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3 :: Only',
        'Programming Language :: Python :: 3.12',
        'Topic :: Scientific/Engineering',
        'Typing :: Typed',
    ],
    python_requires='>=3.12',
    packages=find_packages(include=['sgor_ros', 'sgor_ros.*']),
    package_data={'sgor_ros': ['py.typed', 'core/scan/conventions/*.toml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/sgor_ros']),
        (SHARE, ['package.xml']),
        (f'{SHARE}/config', glob('config/*.yaml') + glob('config/*.rviz')
         + glob('config/*.json')),
        (f'{SHARE}/launch', glob('launch/*.py')),
    ],
    zip_safe=False,
    install_requires=[
        'numba>=0.58',
        'numpy>=1.26',
        'scipy>=1.11',
    ],
    extras_require={
        # files, bags and pictures: what the commands need beside the library
        'commands': COMMANDS_NEED,
        # where no ROS 2 Jazzy is installed: the same rclpy with Fast DDS, as wheels
        'ros': ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces'],
        'open3d': [*OPEN3D, 'evo'],    # evo: the errors that the demo shows
        'evaluation': EVALUATION,
        'benchmark': EVALUATION,    # its former name
        # loops of the `Mapper`; its wheel wants numpy 2
        'mapping': ['gtsam>=4.3'],
        # to run what docs/pose_graph.md shows
        'slam': ['gtsam>=4.3', 'g2opy'],
        # --visualize; needs numpy 2, which the messages of an installed Jazzy do not take
        'visualize': ['rerun-sdk>=0.41'],
        'test': ['pytest', 'pytest-xdist'],
        # the site: python -m sphinx -W docs out/site
        'docs': ['sphinx>=8', 'numpydoc>=1.8', 'myst-parser>=4', 'furo'],
        'dev': [
            'mypy',
            'mutmut>=3.8',
            'ruff',
            'build',
            'catkin-pkg',
            'colcon-common-extensions',
            'setuptools<80',    # colcon installs by commands that setuptools 80 dropped
        ],
    },
    entry_points={
        'console_scripts': [
            'sgor = sgor_ros.commands.entry:sgor',
            'sgor_node = sgor_ros.ros.main:main',
            *(f'sgor_{name} = sgor_ros.commands.entry:{name}' for name in COMMANDS)],
    },
)
