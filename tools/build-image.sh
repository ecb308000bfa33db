#!/usr/bin/env bash
#
# build-image.sh [BUILD ARGUMENT...]
#
# Builds the container image with docker or buildah, whichever works here. Extra arguments go to the build,
# for example:  build-image.sh --build-arg BASE_IMAGE=python:3.13-slim
#
# Settings (environment):
#   IMAGE=axiswatch         name, with or without a tag
#   BUILDER=docker|buildah  which one; default: docker where its engine answers, else buildah
#   BUILDAH_ISOLATION=chroot STORAGE_DRIVER=vfs   buildah's own, for building inside a container

set -eu
cd "$(dirname "${BASH_SOURCE[0]}")/.."
IMAGE=${IMAGE:-axiswatch}

if [ -z "${BUILDER:-}" ]; then
  if docker info >/dev/null 2>&1; then BUILDER=docker
  elif command -v buildah >/dev/null; then BUILDER=buildah
  else
    echo "build-image: needs a running docker engine, or buildah (Debian: apt-get install buildah)" >&2
    exit 1
  fi
fi
case $BUILDER in
  docker) exec docker build -t "$IMAGE" "$@" . ;;
  buildah) exec buildah bud --format docker -t "$IMAGE" "$@" . ;; # OCI has no HEALTHCHECK
  *) echo "build-image: BUILDER is docker or buildah, not $BUILDER" >&2; exit 1 ;;
esac
