"""Package for pip and for colcon (ament_python)."""
from glob import glob

from setuptools import find_packages
from setuptools import setup

SHARE = 'share/sgor_ros'
COMMANDS = {
    'sgor_node': 'sgor_ros.ros.node',
    'sgor_replay': 'sgor_ros.commands.replay',
    'sgor_register': 'sgor_ros.commands.register',
    'sgor_kitti_to_bag': 'sgor_ros.commands.kitti_to_bag',
    'sgor_benchmark': 'sgor_ros.commands.benchmark',
    'sgor_demo': 'sgor_ros.commands.demo',
}
# .pcd and .ply files, and the built-in world; the module of open3d without CUDA
OPEN3D = ['open3d-cpu>=0.18']

setup(
    name='sgor_ros',
    version='0.1.0',
    description='Global LiDAR registration by semantic-geometric outlier removal (SGOR)',
    author='sgor_ros maintainers',
    maintainer='sgor_ros maintainers',
    maintainer_email='sgor-ros@example.org',
    license='Apache-2.0',
    python_requires='>=3.12',
    packages=find_packages(include=['sgor_ros', 'sgor_ros.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/sgor_ros']),
        (SHARE, ['package.xml']),
        (f'{SHARE}/config', glob('config/*.yaml') + glob('config/*.rviz')
         + glob('config/*.json')),
        (f'{SHARE}/config/labels', glob('config/labels/*.yaml')),
        (f'{SHARE}/launch', glob('launch/*.py')),
    ],
    zip_safe=False,
    install_requires=[
        'setuptools',
        'matplotlib',
        'numba>=0.58',
        'numpy>=1.26',
        'pyyaml',
        'rosbags~=0.11.0',    # its 0.x releases remove names
        'scipy>=1.11',
        'small_gicp>=1.0',
        'threadpoolctl>=3.0',
        'tqdm',
    ],
    extras_require={
        # where no ROS 2 Jazzy is installed: the same rclpy with Fast DDS, as wheels
        'ros': ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces'],
        'open3d': OPEN3D,
        'benchmark': [*OPEN3D, 'kiss-icp', 'kiss_matcher'],
        # to run what docs/pose_graph.md shows
        'slam': ['gtsam>=4.3', 'g2opy'],
        # --visualize; needs numpy 2, which the messages of an installed Jazzy do not take
        'visualize': ['rerun-sdk>=0.41'],
        'test': ['pytest'],
        'dev': [
            'mypy',
            'ruff',
            'catkin-pkg',
            'colcon-common-extensions',
            'setuptools<80',    # colcon installs by commands that setuptools 80 dropped
        ],
    },
    entry_points={
        'console_scripts': [f'{name} = {module}:main' for name, module in COMMANDS.items()],
    },
)
