#!/usr/bin/env bash
# packages.sh, as root: installs the packages of `./dev package` in a bare Debian 12, where `xraycast demo` must work
# without a compiler, the Python package too, and each example of libxraycast-dev must be built and run. Takes the network and about 4 GB.
set -euo pipefail
cd "$(dirname "$0")/../.."

source tests/systems/bare_root.sh
make_bare_root bookworm
cp out/packages/*.deb "$root/root/"

echo "== xraycast"
install_within '/root/libxraycast0.2_*.deb /root/xraycast_*.deb'
if within bash -c 'command -v g++ cc make'; then
  echo "the program's package brings a compiler" >&2
  exit 1
fi
within bash -c 'time xraycast demo -o /root/demo && ls -l /root/demo/contact-sheet.png'
within grep -c 'href="run-dsa.gif"' /root/demo/index.html
within bash -c 'test -s /usr/share/man/man1/xraycast.1 || test -s /usr/share/man/man1/xraycast.1.gz'

echo "== without ld"
mv "$root/usr/bin/ld" "$root/usr/bin/ld.away"
said=$(within bash -c 'xraycast devices 2>&1' && exit 1 || true)
mv "$root/usr/bin/ld.away" "$root/usr/bin/ld"
echo "$said"
[[ $(wc -l <<<"$said") = 1 && $said == *binutils* ]]

echo "== python3-xraycast"
install_within '/root/python3-xraycast_*.deb'
within python3 -c '
import importlib.metadata
import xraycast as xc
assert importlib.metadata.version("xraycast") == xc.__version__
scan = xc.phantom("thorax", spacing_mm=2)
body = scan.cast(layers=4)
print(scan, scan.project(lao=30, cone_mm=(1000, 1500)).tau.max(), body.render(lao=30).shape, len(scan.segment().tree), "branches")
'

echo "== libxraycast-dev"
install_within cmake g++ make '/root/libxraycast-c0.2_*.deb /root/libxraycast-dev_*.deb'
for example in c host segmentation simulation viewer; do
  within bash -c "cp -r /usr/share/doc/libxraycast-dev/examples/$example /root/ && cd /root/$example &&
    cmake -S . -B build -DCMAKE_BUILD_TYPE=Release >/dev/null && cmake --build build >/dev/null && ./build/example"
done
echo "the packages serve a bare Debian 12"
