#!/usr/bin/env bash
# Installs the protocol into a temporary prefix and builds and runs programs outside the tree with what is there: in C
# and C++ by the CMake package, in C by pkg-config.
#   install_test.sh CMAKE BUILD SOURCE CC CXX
set -euo pipefail
cmake=$1 build=$2 source=$3 cc=$4 cxx=$5
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
prefix=$work/prefix
"$cmake" --install "$build" --component shm_protocol --prefix "$prefix" >"$work/log"

library=$(find "$prefix" -name 'libshm_protocol_c.so.1')
[ -n "$library" ] || { cat "$work/log"; echo "no libshm_protocol_c.so.1 was installed"; exit 1; }
others=$(nm -D --defined-only "$library" | awk '$2 != "A" && $3 !~ /^ssp_/')
[ -z "$others" ] || { echo "exported, but not of the C interface: $others"; exit 1; }

# In place, as a stranger would have them.
cp "$source"/shm-protocol/examples/{surface.c,controller.c,controller.cpp} "$work"
run_pair() {  # FOLDER NAME [CONTROLLER]
  "$1/surface" "$2" &
  local peer=$!
  "$1/${3:-controller}" "$2" || { kill "$peer"; return 1; }
  wait "$peer"
}

cat >"$work/CMakeLists.txt" <<'END'
cmake_minimum_required(VERSION 3.25)
project(outside LANGUAGES C CXX)
set(CMAKE_C_STANDARD 11)
find_package(shm_protocol 1.0 REQUIRED)
foreach(program surface controller)
  add_executable(${program} ${program}.c)
  target_link_libraries(${program} PRIVATE shm_protocol::shm_protocol)
endforeach()
add_executable(controller_cpp controller.cpp)
target_link_libraries(controller_cpp PRIVATE shm_protocol::endpoints)
END
"$cmake" -G Ninja -S "$work" -B "$work/by-cmake" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_C_COMPILER="$cc" \
    -DCMAKE_CXX_COMPILER="$cxx" >"$work/log" 2>&1 &&
  "$cmake" --build "$work/by-cmake" >>"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
run_pair "$work/by-cmake" "install-cmake-$$"
run_pair "$work/by-cmake" "install-cpp-$$" controller_cpp

mkdir "$work/by-pkg-config"
PKG_CONFIG_PATH=$(dirname "$(find "$prefix" -name shm_protocol.pc)")
export PKG_CONFIG_PATH
[ "$(pkg-config --modversion shm_protocol)" = 1.0.0 ]
for program in surface controller; do
  # shellcheck disable=SC2046
  "$cc" -std=c11 -Wall -Wextra -Wpedantic -Werror "$work/$program.c" -o "$work/by-pkg-config/$program" \
    $(pkg-config --cflags --libs shm_protocol) -Wl,-rpath,"$(dirname "$library")"
done
run_pair "$work/by-pkg-config" "install-pc-$$"

"$prefix/bin/shm_dump" --list >/dev/null
python=$(dirname "$(find "$prefix" -path '*/shm_protocol/__init__.py')")
if /usr/bin/python3 -c 'import numpy' 2>/dev/null; then
  # Without being told where the library is.
  PYTHONPATH=$(dirname "$python") PYTHONDONTWRITEBYTECODE=1 /usr/bin/python3 -c '
import sys, shm_protocol
from shm_protocol import _library
assert shm_protocol.__file__.startswith(sys.argv[1]) and _library.lib._name.startswith(sys.argv[1])' "$prefix"
fi
echo "built and ran by both"
