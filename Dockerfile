# The node on ROS 2 Jazzy. Written from the instructions in docs/start.md and not run by us.
#   docker build -t sgor_ros . && docker run --rm --net=host sgor_ros
FROM ros:jazzy

RUN apt-get update && apt-get install -y --no-install-recommends python3-pip python3-numba \
    && rm -rf /var/lib/apt/lists/* \
    && pip install --no-cache-dir --break-system-packages 'rosbags~=0.11.0'

WORKDIR /ws
COPY . src/sgor_ros
RUN . /opt/ros/jazzy/setup.sh && apt-get update \
    && rosdep install --from-paths src -iy --rosdistro jazzy && rm -rf /var/lib/apt/lists/* \
    && colcon build --packages-select sgor_ros

# bash, for the setup files; exec, for signals
ENTRYPOINT ["bash", "-c", ". /ws/install/setup.bash && exec \"$@\"", "--"]
CMD ["ros2", "run", "sgor_ros", "sgor_node"]
