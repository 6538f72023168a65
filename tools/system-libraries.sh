#!/bin/sh
# Installs the few system libraries that Open3D loads (and, with --with-browser, Chromium for the page's tests),
# or names them when it may not.
set -u
packages=""
need() { # need SONAME PACKAGE
    ldconfig -p 2>/dev/null | grep -q "$1" || /sbin/ldconfig -p 2>/dev/null | grep -q "$1" || packages="$packages $2"
}
need libGL.so.1 libgl1
need libEGL.so.1 libegl1
need libX11.so.6 libx11-6
need libgomp.so.1 libgomp1
need libudev.so.1 libudev1
if [ "${1:-}" = "--with-browser" ]; then
    command -v chromium >/dev/null 2>&1 || packages="$packages chromium"
    command -v chromedriver >/dev/null 2>&1 || packages="$packages chromium-driver"
fi
[ -z "$packages" ] && exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    echo "installing system libraries:$packages"
    export DEBIAN_FRONTEND=noninteractive
    { apt-get -qq update && apt-get -qq install --no-install-recommends -y $packages; } >/dev/null 2>&1 && exit 0
fi
echo "missing system libraries:$packages"
echo "install them with: sudo apt-get install$packages"
exit 0
