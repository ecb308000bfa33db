#!/usr/bin/env bash
#
# lock.sh [UV PIP COMPILE ARGUMENT...]      for example: lock.sh --upgrade-package numpy
#
# Writes requirements.lock (everything), requirements-runtime.lock (the part the container image needs, at the same
# versions, with the extras mqtt and opcua, as nothing is installed in an image later), requirements-mf4.lock (the same with the
# extra mf4, for its tests) and requirements-schemathesis.lock (what the soak of the API needs): exact versions and hashes, with
# markers where Pythons or platforms differ.

set -eu
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ $# -gt 0 ] || set -- --upgrade
compile() {
  .venv/bin/uv pip compile pyproject.toml --quiet --universal --python-version 3.11 --generate-hashes \
    --no-emit-index-url --custom-compile-command "make lock" "$@"
}
compile --extra dev --extra mqtt --extra opcua --output-file requirements.lock "$@"
compile --constraints requirements.lock --extra mqtt --extra opcua --output-file requirements-runtime.lock --upgrade
compile --constraints requirements.lock --extra mf4 --output-file requirements-mf4.lock --upgrade
# A program of its own, for tests/soak/test_api_contract.py; no package of axiswatch needs it.
echo "schemathesis>=4" | .venv/bin/uv pip compile - --quiet --universal --python-version 3.11 --generate-hashes \
  --no-emit-index-url --custom-compile-command "make lock" --output-file requirements-schemathesis.lock --upgrade
