#!/usr/bin/env bash
#
# audit.sh [PIP-AUDIT ARGUMENT...]
#
# Known vulnerabilities of the packages that an installation has, by the advisories of their registry.  Where it or these
# cannot be reached, it says so, and that is no failure.

set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 1
PROGRAM=.cache/pip-audit/bin/pip-audit

nothing() { echo "audit: $1 cannot be reached: nothing was looked at"; exit 0; }

[ -x "$PROGRAM" ] || { "${PYTHON:-python3}" -m venv .cache/pip-audit && .cache/pip-audit/bin/pip install --quiet pip-audit==2.10.1; } ||
  nothing "the registry"
found=$("$PROGRAM" --disable-pip --require-hashes -r requirements-runtime.lock --progress-spinner off "$@" 2>&1)
rc=$?
echo "$found"
[ $rc = 0 ] || grep -q "^Found .* known vulnerabilit" <<<"$found" || nothing "the advisories"
exit $rc
