#!/bin/sh
# An environment for the tests of ROS 2: .venv-ros, with cyclonedds, eclipse-zenoh and rosbags beside the packages of .venv.
# usage: tests/ros/make_environment.sh [python3.11]
set -eu
cd "$(dirname "$0")/../.."
venv=.venv-ros
"${1:-python3}" -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check \
    'cyclonedds>=11,<12' 'eclipse-zenoh>=1.10,<2' 'rosbags>=0.11,<0.12'
# ROS 1, with a real master, is Debian's; without it its tests are skipped.
if [ "$(id -u)" = 0 ] && command -v apt-get > /dev/null; then
    apt-get install --yes --quiet python3-rospy python3-rosmaster python3-nav-msgs python3-geometry-msgs || echo "ROS 1 is not tested"
fi
site() { "$1/bin/python" -c 'import site; print(site.getsitepackages()[0])'; }
# Its own packages first: a path file adds those of .venv behind them, and addsitedir reads their path files, too.
echo "import site; site.addsitedir('$(site "$PWD/.venv")')" > "$(site "$venv")/project.pth"
echo "ready: $venv/bin/python"
