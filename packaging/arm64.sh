#!/usr/bin/env bash
# arm64.sh [FOLDER]: builds libraries, program and unit tests for arm64 here, and runs the tests. As root, with PROGRAM=1 the
# program too. Takes the network, 3 GB in FOLDER (build/arm64), and Debian's packages
#   g++-aarch64-linux-gnu mmdebstrap qemu-user-static
# Debian's packages for arm64 are unpacked into FOLDER/root, without being set up; the cross compiler compiles and links against
# them, as packaging/arm64.cmake says; QEMU runs what comes out, ten to thirty times slower than a processor of that kind would.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(realpath -m "${1:-build/arm64}")
root=$folder/root

packages_of() {  # the packages of the named sections of packages.txt, without programs that run on this machine
  awk -v want=" $* " '/^\[/ { on = index(want, " " substr($0, 2, length($0) - 2) " ") } on && /^[a-z0-9]/ { print $1 }' packages.txt |
    grep -vxE 'cmake|g\+\+|git|ninja-build|pkg-config'
}

made=$folder/root-is-of-arm64.sh  # else what is there is another's, and stays
if [ ! -e "$root/usr/lib/aarch64-linux-gnu/liblapack.so.3" ]; then
  if [ -e "$root" ] && [ ! -e "$made" ]; then
    echo "arm64.sh: $root is there and was not made by this script; name another FOLDER" >&2
    exit 2
  fi
  mkdir -p "$folder"
  touch "$made"
  rm -rf "$root"
  mmdebstrap --quiet --mode=root --variant=extract --architectures=arm64 --hook-dir=/usr/share/mmdebstrap/hooks/merged-usr \
    --include="$(packages_of build | paste -sd,),libstdc++-12-dev,libgtest-dev,libgmock-dev,librapidcheck-dev,libtiff-dev" \
    bookworm "$root" http://deb.debian.org/debian
  # What setting the packages up would link.
  ln -s hdf5-serial.pc "$root/usr/lib/aarch64-linux-gnu/pkgconfig/hdf5.pc"
  ln -s blas/libblas.so.3 lapack/liblapack.so.3 "$root/usr/lib/aarch64-linux-gnu/"
fi

cmake -S . -B "$folder/build" -G Ninja --toolchain packaging/arm64.cmake -DARM64_ROOT="$root" -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_UNITY_BUILD=ON -DXRAYCAST_BUILD_PYTHON=OFF -DCMAKE_CXX_COMPILER_LAUNCHER="$(command -v ccache || true)" >"$folder/cmake.log"
tests=(host_unit segmentation_unit simulation_unit)
cmake --build "$folder/build" --target "${tests[@]}" ${PROGRAM:+xraycast}
for name in "${tests[@]}"; do
  qemu-aarch64-static -L "$root" "$folder/build/tests/$name" --gtest_brief=1 --gtest_filter="${SMOKE:-*}"
done
[ -z "${PROGRAM:-}" ] || qemu-aarch64-static -L "$root" "$folder/build/cli/xraycast" --version
