"""Odometry from labelled clouds: ros2 launch sgor_ros odometry.launch.py points:=/my/cloud."""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Start the node alone."""
    default_file = PathJoinSubstitution([FindPackageShare('sgor_ros'), 'config/sgor_node.yaml'])
    return LaunchDescription([
        DeclareLaunchArgument('points', default_value='points',
                              description='Topic of the labelled PointCloud2'),
        DeclareLaunchArgument('params_file', default_value=default_file,
                              description='Parameters of sgor_node'),
        DeclareLaunchArgument('namespace', default_value='', description='Namespace of the node'),
        DeclareLaunchArgument('use_sim_time', default_value='false',
                              description='Take the time from /clock'),
        DeclareLaunchArgument('publish_tf', default_value='false',
                              description='Publish odom_frame to the sensor frame on /tf'),
        Node(
            package='sgor_ros',
            executable='sgor_node',
            namespace=LaunchConfiguration('namespace'),
            parameters=[
                LaunchConfiguration('params_file'),
                {name: ParameterValue(LaunchConfiguration(name), value_type=bool)
                 for name in ('use_sim_time', 'publish_tf')},
            ],
            remappings=[('points', LaunchConfiguration('points'))],
            output='screen',
        ),
    ])
