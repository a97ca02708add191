"""A bag, the node and RViz: ros2 launch sgor_ros replay.launch.py bag:=FOLDER."""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.actions import ExecuteProcess
from launch.actions import IncludeLaunchDescription
from launch.actions import TimerAction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Start node and RViz, and the bag once they had time to come up."""
    share = FindPackageShare('sgor_ros')
    points = LaunchConfiguration('points')
    return LaunchDescription([
        DeclareLaunchArgument('bag', description='Folder of the bag'),
        DeclareLaunchArgument('points', default_value='points',
                              description='Topic of the labelled PointCloud2 in the bag'),
        DeclareLaunchArgument(
            'params_file', default_value=PathJoinSubstitution([share, 'config/sgor_node.yaml']),
            description='Parameters of sgor_node'),
        DeclareLaunchArgument('rate', default_value='1.0', description='Speed of the replay'),
        DeclareLaunchArgument('delay', default_value='5.0',
                              description='Seconds until the bag starts'),
        DeclareLaunchArgument(
            'publish_tf', default_value='true',
            description='RViz shows the scans by it; false where the bag brings its own'),
        DeclareLaunchArgument('rviz', default_value='true', description='Show it in RViz'),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(
                PathJoinSubstitution([share, 'launch/odometry.launch.py'])),
            launch_arguments={'points': points, 'use_sim_time': 'true',
                              'publish_tf': LaunchConfiguration('publish_tf'),
                              'params_file': LaunchConfiguration('params_file')}.items(),
        ),
        Node(
            package='rviz2',
            executable='rviz2',
            arguments=['-d', PathJoinSubstitution([share, 'config/sgor.rviz'])],
            parameters=[{'use_sim_time': True}],
            remappings=[('points', points)],
            condition=IfCondition(LaunchConfiguration('rviz')),
        ),
        TimerAction(period=LaunchConfiguration('delay'), actions=[
            ExecuteProcess(cmd=['ros2', 'bag', 'play', LaunchConfiguration('bag'), '--clock',
                                '--rate', LaunchConfiguration('rate')], output='screen'),
        ]),
    ])
