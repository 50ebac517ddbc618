# Sourced by the scripts beside it: paths and environment that do not depend on who calls.
# shellcheck shell=bash

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build_dir=$root/build/ros
# Not below build/: rosrun skips executables that are in a package's own build folder.
devel_dir=$root/devel

# ROS' Python modules belong to the system's Python; another python3 may be first in PATH.
export PATH=/usr/bin:/bin:/usr/sbin:/sbin:$PATH
export LC_ALL=${LC_ALL:-C.UTF-8}
export TERM=${TERM:-dumb}

# shellcheck disable=SC2034
jobs=$(nproc)

# Nothing is left in the user's home, and names of hosts need not resolve.
export ROS_HOME=${ROS_HOME:-$root/build/ros_home}
export ROS_LOG_DIR=${ROS_LOG_DIR:-$ROS_HOME/log}
export ROS_HOSTNAME=localhost
unset ROS_IP

die() {
  printf '%s: %s\n' "${0##*/}" "$1" >&2
  exit 1
}

# Sources a ROS setup file; those read unset variables.
source_setup() {
  set +u
  # shellcheck disable=SC1090
  source "$1"
  set -u
}

# A ROS that is not part of the distribution (Noetic, ROS One) and not yet in the environment.
use_installed_ros() {
  local setup
  [[ -z ${ROS_DISTRO:-} ]] || return 0
  for setup in /opt/ros/{noetic,one}/setup.bash; do
    if [[ -f $setup ]]; then
      source_setup "$setup"
      return 0
    fi
  done
}

# The package as built by scripts/build.
use_build() {
  getent hosts localhost > /dev/null ||
    die "'localhost' does not resolve, which ROS needs: put '127.0.0.1 localhost' into /etc/hosts"
  source_setup "$devel_dir/setup.bash"
}
