#!/usr/bin/env bash
# wheel.sh WHEEL, as root: installs a wheel of `./dev wheel` in a bare Debian that has only python3-venv and binutils, and
# makes a scan, projections, maps, vessels and frames there, by the Python package and by the program; and what is said where a
# driver, the linker or what a wheel leaves out is missing.
# Debian 12 for its Python 3.11, Debian 13 for a wheel of the stable interface. Takes the network and about 2 GB.
set -euo pipefail
wheel=$(realpath "$1")
cd "$(dirname "$0")/../.."
source tests/systems/bare_root.sh

case $wheel in
*-cp311-cp311-*) suite=bookworm python=3.11 ;;
*-abi3-*) suite=trixie python=3.13 ;;
*) echo "$wheel: is for no Python of Debian" >&2 && exit 2 ;;
esac

make_bare_root "$suite"
install_within python3-venv binutils
mkdir "$root/root/wheels"
cp "$wheel" "$root/root/wheels/"
"${WHEEL_PIP:-build/wheel-venv/bin/pip}" download --quiet --no-deps --only-binary :all: --python-version "$python" \
  --platform manylinux_2_28_x86_64 --platform manylinux_2_27_x86_64 -d "$root/root/wheels" numpy
within bash -c 'cd /root && python3 -m venv venv && venv/bin/pip install --quiet --no-index --find-links wheels xraycast'

# Debian's Python brings expat, but not every Python does.
packages=/root/venv/lib/python3*/site-packages
within bash -c "test -s $packages/xraycast.libs/libexpat-*.so.1* && test -s $packages/xraycast.libs/libX11-*.so.6*"
if within bash -c "readelf -d $packages/xraycast/*.so $packages/xraycast/bin/xraycast $packages/xraycast.libs/*.so* |
  grep -E 'NEEDED.*lib(expat|X11|Xext|Xrender)\\.so'"; then
  echo "the libraries above need one of the system's" >&2
  exit 1
fi
within bash -c "cd $packages && test -s xraycast.libs/LICENSES.txt && test -s xraycast.libs/licenses/common-licenses/Apache-2.0 &&
  test -s xraycast.libs/licenses/nanobind && test -s xraycast-*.dist-info/licenses/LICENSE && grep -q expat xraycast-*.dist-info/sboms/*.json"

try() {  # code: runs it, and prints an xraycast error as one line
  within /root/venv/bin/python -c "
import xraycast as xc
try:
    $1
except xc.Error as error:
    print(type(error).__name__ + ':', error)" 2>&1
}
program() { within bash -c "cd /root && PATH=/root/venv/bin:\$PATH && $*" 2>&1; }  # xraycast and xraycast-cohort
expect() {  # what, pattern, text: the text is one line that matches
  echo "$1: $3"
  [[ $(wc -l <<<"$3") = 1 && $3 =~ $2 ]] || { echo "expected one line with: $2" >&2; exit 1; }
}

expect "version" '^[0-9.]+$' "$(try 'print(xc.__version__)')"
expect "program" '^[0-9.]+$' "$(program 'xraycast --version')"
expect "cohort" '^usage: xraycast-cohort' "$(program 'xraycast-cohort --help | head -1')"
expect "program without OpenCL" 'no OpenCL device: install .*pocl-opencl-icd.* 4$' "$(program 'echo $(xraycast phantom box -o box.nrrd 2>&1; echo $?)')"
expect "program without the window" '^xraycast: view: .*install Debian.s package xraycast 1$' "$(program 'echo $(xraycast view map.exr --vessels vessels --simulate 2>&1; echo $?)')"
expect "program without the server" '^xraycast: serve: .*install Debian.s package xraycast 1$' "$(program 'echo $(xraycast serve map.exr --web 2>&1; echo $?)')"
expect "without OpenCL" '^DeviceError: no OpenCL device: install .*pocl-opencl-icd' "$(try 'xc.phantom("box")')"
install_within pocl-opencl-icd
mv "$root/usr/bin/ld" "$root/usr/bin/ld.away"
expect "without ld" '^DeviceError: .*ld, which is not in PATH: install .*binutils' "$(try 'xc.phantom("box")')"
mv "$root/usr/bin/ld.away" "$root/usr/bin/ld"
expect "projection" '^5\.[0-9]+$' "$(try 'print(xc.phantom("thorax", spacing_mm=4, noise_hu=0).project(lao=30, cone_mm=(1000, 1500)).tau.max())')"
expect "vessels" '^[1-9][0-9]* branches$' "$(try 'print(len(xc.phantom("thorax", spacing_mm=2).segment().tree), "branches")')"
expect "without EGL" '^Error: .*libegl1' "$(try 'xc.phantom("thorax", spacing_mm=8).cast(layers=4).render()')"
install_within libegl1 libgl1-mesa-dri libopengl0
expect "frame" '^\([0-9]+, [0-9]+\)$' "$(try 'print(xc.phantom("thorax", spacing_mm=8).cast(layers=4).render().shape)')"
expect "a format that takes OpenImageIO" 'x.jpg: .*name a .png .*install Debian.s package xraycast' "$(try 'xc.phantom("box", size=(16, 16, 16)).project().write("x.jpg")')"
within apt-get install -y -qq --no-install-recommends fonts-dejavu-core >/dev/null 2>&1
expect "the same by the program" 'x.jpg: .*name a .png .*install Debian.s package xraycast' \
  "$(program 'xraycast phantom box --size 16x16x16 -o box.nrrd -q && xraycast project box.nrrd -o x.jpg')"
program 'time xraycast demo -o demo -q && ls -l demo/contact-sheet.png demo/run-dsa.gif demo/run.html'
echo "$(basename "$wheel") serves a bare Debian"
