#!/usr/bin/env bash
#
# audit.sh [PIP-AUDIT ARGUMENT...]
#
# Known vulnerabilities of the packages that an installation has, by PyPI's advisories.  Where these cannot be reached,
# it says so, and that is no failure.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
PROGRAM=.cache/pip-audit/bin/pip-audit
PYTHON=${PYTHON:-python3}

"$PYTHON" -c 'import urllib.request as r; r.urlopen("https://pypi.org/pypi/numba/json", timeout=10)' 2>/dev/null ||
  { echo "audit: PyPI's advisories cannot be reached: nothing was looked at"; exit 0; }
[ -x "$PROGRAM" ] || { "$PYTHON" -m venv .cache/pip-audit && .cache/pip-audit/bin/pip install --quiet pip-audit==2.10.1; }
exec "$PROGRAM" --disable-pip --require-hashes -r requirements-runtime.lock "$@"
