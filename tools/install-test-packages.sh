#!/usr/bin/env bash
#
# Debian packages that the tests use: only what is missing, only where it is possible. With CI=true what
# cannot be had is an error; elsewhere it is a message, and the tests concerned are skipped.
#
#   chromium               installed with apt-get (needs root)
#   iproute2, util-linux   likewise: with-vcan.sh's ip, unshare, setpriv, taskset
#   gcc                    likewise, where the processor has tile registers: see with-vcan-ptrace.c
#   promtool, prometheus   unpacked into .cache/test-packages, not installed: Debian's package would start
#                          a service, make a user and listen on a port
#   mosquitto              likewise, with those of its libraries that a machine mostly lacks

set -u
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 1
TREE=$PWD/.cache/test-packages

have() { PATH="$PATH:/usr/sbin:/sbin" command -v "$1" >/dev/null; }
fail() {
  echo "install-test-packages: $*" >&2
  [ "${CI:-}" != true ] || exit 1
}
apt() { DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=300 "$@"; }
quietly() { # show a command's output only when it fails
  local log rc
  log=$(mktemp); "$@" >"$log" 2>&1; rc=$?
  [ $rc = 0 ] || tail -n 20 "$log" >&2
  rm -f "$log"; return $rc
}
updated=''
listed() { compgen -G '/var/lib/apt/lists/*Packages*' >/dev/null; } # a fresh machine has no package lists
refresh() {                                                        # an old one may have stale ones
  if [ -z "$updated" ] && [ "$(id -u)" = 0 ]; then updated=1; quietly apt update; fi
}

missing=()
have chromium || missing+=(chromium)
have ip || missing+=(iproute2)
{ have unshare && have setpriv && have taskset && have flock; } || missing+=(util-linux)
if grep -qw amx_tile /proc/cpuinfo && ! have cc; then missing+=(gcc libc6-dev); fi
if [ ${#missing[@]} -gt 0 ]; then
  if ! have apt-get; then fail "missing: ${missing[*]}; no apt-get here to install them"
  elif [ "$(id -u)" != 0 ]; then fail "missing; as root: apt-get install ${missing[*]}"
  else
    echo "installing for the tests: ${missing[*]}"
    listed || refresh
    apt install -y --no-install-recommends "${missing[@]}" >/dev/null 2>&1 ||
      { refresh; quietly apt install -y --no-install-recommends "${missing[@]}"; } ||
      fail "could not install ${missing[*]}"
  fi
fi

unpack_prometheus() {
  local tmp rc
  tmp=$(mktemp -d) || return 1
  (
    # Not set -e: bash ignores it in what stands before || or &&.
    cd "$tmp" && apt -o APT::Sandbox::User=root download prometheus &&
      dpkg-deb --fsys-tarfile ./prometheus_*.deb | tar -x -f - ./usr/bin/promtool ./usr/bin/prometheus &&
      usr/bin/promtool --version && mkdir -p "$TREE/bin" &&
      mv usr/bin/prometheus usr/bin/promtool "$TREE/bin/" # promtool last: the sign that all is there
  )
  rc=$?
  rm -rf "$tmp"; return $rc
}
if ! have promtool && [ ! -x "$TREE/bin/promtool" ]; then
  if ! have apt-get || ! have dpkg-deb; then fail "promtool is missing; it comes with Prometheus"
  else
    echo "unpacking for the tests: prometheus (promtool)"
    listed || refresh
    unpack_prometheus >/dev/null 2>&1 || { refresh; quietly unpack_prometheus; } ||
      fail "promtool is missing, and Debian's package prometheus could not be fetched"
  fi
fi

unpack_mosquitto() {
  local tmp rc
  tmp=$(mktemp -d) || return 1
  (
    cd "$tmp" && libraries=$(apt-cache depends mosquitto | awk '$2 ~ /^lib(wrap|dlt|cjson|mosquitto|websockets)/ {print $2}') &&
      apt -o APT::Sandbox::User=root download mosquitto $libraries &&
      for package in ./*.deb; do dpkg-deb -x "$package" tree || exit; done &&
      mkdir -p "$TREE/bin" "$TREE/mosquitto" &&
      cp -a tree/usr/sbin/mosquitto tree/usr/lib/*/*.so.* "$TREE/mosquitto" &&
      { [ ! -d tree/lib ] || find tree/lib -name '*.so.*' -exec cp -a {} "$TREE/mosquitto" ';'; } &&
      cat >mosquitto <<'WRAPPER' && chmod +x mosquitto &&
#!/bin/sh
here=$(dirname "$(readlink -f "$0")")/../mosquitto
LD_LIBRARY_PATH=$here exec "$here/mosquitto" "$@"
WRAPPER
      { LD_LIBRARY_PATH=$TREE/mosquitto "$TREE/mosquitto/mosquitto" -h | grep -q '^mosquitto version'; } &&
      mv mosquitto "$TREE/bin/"
  )
  rc=$?
  rm -rf "$tmp"; return $rc
}
if ! have mosquitto && [ ! -x "$TREE/bin/mosquitto" ]; then
  if ! have apt-get || ! have dpkg-deb; then fail "mosquitto is missing, the MQTT broker"
  else
    echo "unpacking for the tests: mosquitto"
    listed || refresh
    unpack_mosquitto >/dev/null 2>&1 || { refresh; quietly unpack_mosquitto; } ||
      fail "mosquitto is missing, and Debian's package could not be fetched"
  fi
fi
exit 0
