#!/usr/bin/env bash
#
# test-image.sh [BUILD ARGUMENT...]
#
# Builds the container image and tries it: its size, and its demo on a read-only root, as a user whom the image does
# not know, without compiling anything.  Prints the size and the time to the first estimate.  Needs root, buildah, and
# a base image: BASE_IMAGE, else that of the Dockerfile where its registry can be reached, else Debian by mmdebstrap.
#
# Settings (environment):
#   BASE_IMAGE=IMAGE   any with python3 (3.11 or newer) and venv
#   MOST_MB=600        the image may have, unpacked

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
IMAGE=${IMAGE:-axiswatch-test}
BASE=axiswatch-test-base
MOST_MB=${MOST_MB:-600}
export BUILDER=buildah BUILDAH_ISOLATION=chroot STORAGE_DRIVER=${STORAGE_DRIVER:-vfs} IMAGE

need() { command -v "$1" >/dev/null || { echo "test-image: needs $1 (Debian: apt-get install $1)" >&2; exit 1; }; }

[ "$(id -u)" = 0 ] || { echo "test-image: needs root" >&2; exit 1; }
need buildah
work=$(mktemp -d)
container=
tidy() {
  [ -z "$container" ] || buildah rm "$container" >/dev/null
  buildah rmi --force "$IMAGE" >/dev/null 2>&1 || true # an image that was not built is not there
  buildah rmi --force "$BASE" >/dev/null 2>&1 || true
  buildah rmi --prune >/dev/null 2>&1 || true
  rm -rf "$work"
}
trap tidy EXIT

# Debian as small as it gets, as a base image; the names of its suite and mirror are those of this machine.
debian_base() {
  need mmdebstrap
  local suite root
  suite=$(. /etc/os-release && echo "${VERSION_CODENAME:-bookworm}")
  mmdebstrap --quiet --variant=minbase --include=usr-is-merged,python3,python3-venv,ca-certificates \
    --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' \
    --dpkgopt='path-exclude=/usr/share/locale/*' \
    "$suite" "$work/base.tar"
  root=$(buildah from scratch)
  buildah add --quiet "$root" "$work/base.tar" / >/dev/null
  buildah commit --quiet --rm "$root" "$BASE" >/dev/null
  rm "$work/base.tar"
  BASE_IMAGE=localhost/$BASE
}

if [ -z "${BASE_IMAGE:-}" ]; then
  BASE_IMAGE=$(sed -n 's/^ARG BASE_IMAGE=//p' Dockerfile)
  if ! timeout 60 buildah pull --quiet "$BASE_IMAGE" >/dev/null 2>&1; then
    echo "no registry has $BASE_IMAGE within reach: Debian is made by mmdebstrap"
    debian_base
  fi
fi

# The certificates of this machine, as its own pip uses them.
tools/build-image.sh --layers=false --volume /etc/ssl/certs:/etc/ssl/certs:ro --build-arg BASE_IMAGE="$BASE_IMAGE" "$@" \
  >"$work/build.log" 2>&1 || { tail -n 40 "$work/build.log" >&2; exit 1; }

container=$(buildah from "$IMAGE")
root=$(buildah mount "$container")
unpacked_mb=$(($(du -s --block-size=1 "$root" | cut -f 1) / 1000000))
packed_mb=$(($(tar -C "$root" -c . | gzip | wc -c) / 1000000))
echo "size: $packed_mb MB packed, as it is pulled; $unpacked_mb MB unpacked, of these:"
du -m --max-depth=6 "$root" | sort -rn | awk -v root="$root" '$1 >= 12 { sub(root, ""); print "  " $1, $2 }'
[ "$unpacked_mb" -lt "$MOST_MB" ] || { echo "test-image: more than $MOST_MB MB unpacked" >&2; exit 1; }

# As `docker run --read-only --user 4711:4711 --tmpfs /tmp --network host`, in mounts of its own.
buildah inspect --type image --format '{{range .OCIv1.Config.Env}}{{println .}}{{end}}' "$IMAGE" | sed '/^$/d' >"$work/env"
unshare --mount --propagation private tools/try-image.py "$root" "$work/env"
