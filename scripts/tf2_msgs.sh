#!/usr/bin/env bash
# Build tf2_msgs for the tests of /tf, where ROS 2 comes from wheels, which have no such package.
# Only for tests: whoever has ROS 2 installed has the real one. Needs cmake and a C++ compiler.
# Usage: scripts/tf2_msgs.sh PYTHON FOLDER
set -euo pipefail
python=$1
mkdir -p "$2"
folder=$(cd "$2" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$python" -m venv "$work/venv"
bin=$work/venv/bin
wheels=(rosidl-default-generators rosidl-core-generators python-cmake-module ament-package
    ament-cmake ament-cmake-ros ament-cmake-include-directories ament-cmake-gmock
    ament-cmake-gtest ament-cmake-pytest domain-coordinator common-interfaces)
"$bin/python" -m pip install -qq --disable-pip-version-check 'ros-jazzy-rclpy[fastrtps]' \
    catkin-pkg 'setuptools<80' "${wheels[@]/#/ros-jazzy-}"

# the files of the wheels name the include folders of the machine that built them
include=$("$bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
numpy=$("$bin/python" -c 'import numpy; print(numpy.get_include())')
built=/opt/python/cp312-cp312
grep -rl --include='*.cmake' "$built" "$work/venv/share" | xargs sed -i \
    -e "s#$built/lib/python3.12/site-packages/numpy/_core/include#$numpy#g" \
    -e "s#$built/include/python3.12#$include#g"

mkdir -p "$work/source/msg"
echo 'geometry_msgs/TransformStamped[] transforms' > "$work/source/msg/TFMessage.msg"
cat > "$work/source/package.xml" <<'XML'
<package format="3">
  <name>tf2_msgs</name>
  <version>0.0.0</version>
  <description>TFMessage, for tests</description>
  <maintainer email="sgor-ros@example.org">sgor_ros maintainers</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>geometry_msgs</depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
</package>
XML
cat > "$work/source/CMakeLists.txt" <<'CMAKE'
cmake_minimum_required(VERSION 3.8)
project(tf2_msgs)
find_package(ament_cmake REQUIRED)
find_package(geometry_msgs REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(tf2_msgs msg/TFMessage.msg DEPENDENCIES geometry_msgs)
ament_package()
CMAKE
export PATH=$bin:$PATH AMENT_PREFIX_PATH=$work/venv CMAKE_PREFIX_PATH=$work/venv
cmake -S "$work/source" -B "$work/build" -DCMAKE_INSTALL_PREFIX="$folder" \
    -DPython3_EXECUTABLE="$bin/python" -DBUILD_TESTING=OFF >/dev/null
cmake --build "$work/build" --target install --parallel 2 >/dev/null
echo "tf2_msgs for tests: $folder"
