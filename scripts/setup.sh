#!/usr/bin/env bash
# Make the environment: system libraries, Python 3.12, the package with its extras.
# Usage: scripts/setup.sh FOLDER      (PYTHON=/path/to/python3.12 chooses the interpreter)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
venv=${1:-.venv}
PATH=$PATH:/usr/sbin:/sbin    # dpkg needs them, a bare shell may not have them

say() { printf '== %s\n' "$*"; }
die() { printf 'error: %s\n' "$*" >&2; exit 1; }

is_python() { "$1" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 12))' 2>/dev/null; }

find_python() {
    local candidate
    for candidate in ${PYTHON:+"$PYTHON"} ${ROS_DISTRO:+/usr/bin/python3} python3.12 \
            "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.12*/bin/python3 python3; do
        if is_python "$candidate"; then
            echo "$candidate"
            return
        fi
    done
    die 'no Python 3.12, which is that of ROS 2 Jazzy. Install it (Ubuntu 24.04: apt install' \
        'python3-venv; elsewhere: pyenv install 3.12) or name it: make setup PYTHON=/path'
}

# Debian packages that are missing: what Open3D and OpenMP load, and venv itself
missing_packages() {
    "$1" - <<'PYTHON'
import ctypes
import importlib.util

LIBRARIES = {'libusb-1.0.so.0': 'libusb-1.0-0', 'libGL.so.1': 'libgl1', 'libEGL.so.1': 'libegl1',
             'libX11.so.6': 'libx11-6', 'libgomp.so.1': 'libgomp1'}
for library, package in LIBRARIES.items():
    try:
        ctypes.CDLL(library)
    except OSError:
        print(package)
if importlib.util.find_spec('ensurepip') is None:
    print('python3.12-venv')
PYTHON
}

install_packages() {
    local sudo=()
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || die "these system packages are missing: $*
As root: apt-get install $*"
        sudo=(sudo)
    fi
    command -v apt-get >/dev/null || die "these libraries are missing (Debian's names): $*"
    say "installing system packages: $*"
    "${sudo[@]}" apt-get update -qq
    "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq \
        --no-install-recommends "$@" >/dev/null
}

# uv takes a fifth of the time of pip; where it cannot be had or finds no index, pip does it.
# Compiled here, as pip does: where PYTHONDONTWRITEBYTECODE is set nothing else ever would
install() {
    VIRTUAL_ENV=$venv "$venv/bin/uv" pip install -q --compile-bytecode "$@" 2>/dev/null ||
        "$venv/bin/python" -m pip install -qq --disable-pip-version-check "$@"
}

python=$(find_python)
say "Python: $python"
mapfile -t packages < <(missing_packages "$python")
[ ${#packages[@]} -eq 0 ] || install_packages "${packages[@]}"

extras=commands,open3d,evaluation,test,docs,dev
options=() pins=()
if [ "${ROS_DISTRO:-}" = jazzy ] && "$python" -c 'import rclpy' 2>/dev/null; then
    say 'ROS 2 Jazzy is here: using its rclpy'
    options=(--system-site-packages)
    pins=('numpy<2')    # what the messages of Jazzy are compiled against
else
    say 'no ROS 2 Jazzy sourced: using its Python wheels'
    extras=ros,$extras
fi

say "making $venv (one to three minutes)"
"$python" -m venv --clear "${options[@]}" "$venv"
"$venv/bin/python" -m pip install -qq --disable-pip-version-check uv ||
    say 'no uv: pip takes some minutes more'
# of the kind that type checkers and IDEs find: a path, and no import hook
editable=(--config-settings editable_mode=compat --editable)
install "${editable[@]}" ".[$extras]" "${pins[@]}"
install 'gtsam>=4.3' g2opy "${pins[@]}" ||
    say 'no GTSAM or g2o for this machine: loops are not closed, and their tests are skipped'
if [ "${#pins[@]}" -eq 0 ]; then
    install "${editable[@]}" '.[visualize]' ||
        say 'no rerun for this machine: the tests of --visualize are skipped'
    say 'building tf2_msgs for the tests of /tf (a minute)'
    bash scripts/tf2_msgs.sh "$venv/bin/python" "$venv/tf2_msgs" ||
        say 'it could not be built (cmake and a C++ compiler?): the tests of /tf are skipped'
fi
"$venv/bin/python" -c 'import open3d, rclpy, sgor_ros'
"$venv/bin/python" -m sgor_ros.commands.warm_up
say "ready: $venv/bin/python"
