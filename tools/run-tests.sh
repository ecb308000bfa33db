#!/usr/bin/env bash
#
# run-tests.sh [PYTEST ARGUMENT...]
#
# Ruff, the tests that run anywhere, then those marked `vcan`, inside with-vcan.sh, where real SocketCAN devices exist, and
# mypy beside them (`make lint` has it at once). Where the devices cannot be had: a failure with CI=true, else those tests
# are skipped.
#
set -u
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 1
PYTEST=(.venv/bin/python -m pytest)
NOTHING_RAN=5 # pytest's exit status

# Tests start the program some two hundred times: not each of these processes should compile all sources again.
unset PYTHONDONTWRITEBYTECODE

# The virtual kernel shows modification times in whole seconds, by which numba knows its compiled kernels: with whole
# seconds on both sides the second run need not compile again what the first has.
.venv/bin/python -c "import os, pathlib
for file in (f for folder in ('monitor_core', 'service') for f in pathlib.Path(folder).rglob('*.py')):
    os.utime(file, (int(file.stat().st_mtime),) * 2)"

# The kernel is compiled ahead, else each of the test processes would compile all of it: in two parts.
ahead() {
  .venv/bin/python -c "import os
import tests.conftest # without garbage collection, which would take a tenth of the time
from service.commands.warm import compile_offline
from service.pipeline.warming import Shape, compile_kernel
$1
os._exit(0) # it is written; to take the compiler's memory apart would take a second"
}
if [ $# = 0 ]; then
  ahead "compile_kernel(Shape.MANY_AXES); compile_kernel(Shape.MULTIMODEL); compile_kernel(Shape.CYCLIC_CLOCK)" &
  ahead "compile_kernel(Shape.FEW_AXES); compile_offline()" &
fi
{ .venv/bin/ruff check . && .venv/bin/ruff format --check .; } || { kill $(jobs -p) 2>/dev/null; exit 1; }
wait

# Side by side, one process more than there are processors: tests of the daemon mostly wait.  More than four would only
# crowd each other's daemons.
mkdir -p .cache
# Each process collects all files: without a selection, not those of which nothing is run here.
unused=()
[ $# != 0 ] || unused=(--ignore tests/bench --ignore tests/soak)
processes=$(($(getconf _NPROCESSORS_ONLN) + 1))
"${PYTEST[@]}" --numprocesses "$processes" --maxprocesses 4 --dist worksteal --durations 25 "${unused[@]}" "$@"
main=$?

# These tests are one process in a kernel with one processor: mypy has the other one.
nice -n 10 .venv/bin/mypy >.cache/mypy.log 2>&1 &
types=$!

# Logs of loggers (.mf4) need asammdf, which python-can would load at every start, in ten times the memory: it has an
# environment of its own, over this one.
mf4_tests() {
  local over=.cache/mf4
  if ! [ -e "$over/.ready" ]; then
    .venv/bin/python -m venv --clear --without-pip "$over" && printf '%s\n' "$PWD"/.venv/lib/python*/site-packages \
      >"$(echo "$over"/lib/python*/site-packages)/axiswatch.pth" && .venv/bin/python -m pip --python "$over/bin/python" \
      install --quiet --no-compile --require-hashes -r requirements-mf4.lock && touch "$over/.ready" || return 1
  fi
  PYTHONPATH=$PWD "$over/bin/python" -m pytest -q -m mf4 tests/service/can/test_mf4.py
}
logs=''
if [ $# = 0 ]; then
  nice -n 10 bash -c "$(declare -f mf4_tests); mf4_tests" >.cache/mf4.log 2>&1 &
  logs=$!
fi

echo
echo "SocketCAN tests, on vcan0 and vcan1:"
# Everything is slow in there, imports above all: without a selection, collect only the files concerned.  Always in one
# order, as a process that has grown is slower: what records in real time is before what simulates a robot of its own.
if [ $# = 0 ]; then mapfile -t files < <(grep -rlE --include='test_*.py' 'mark\.vcan' tests --exclude-dir soak | sort); else files=(); fi
tools/with-vcan.sh "${PYTEST[@]}" "$@" -m "vcan and not soak" "${files[@]}"
sock=$?

if [ "$sock" = 125 ] && ! tools/with-vcan.sh true; then
  if [ "${CI:-}" = true ]; then
    echo "no SocketCAN devices, and CI=true: failed" >&2
    exit 1
  fi
  echo "No SocketCAN devices here. With root on a kernel that has them: modprobe vcan." >&2
  echo "Without: on Debian (amd64), apt-get update && apt-get install iproute2 util-linux; the rest is fetched." >&2
  "${PYTEST[@]}" "$@" -m "vcan and not soak" "${files[@]}" # skips them, and says so
  sock=$?
fi

wait "$types"
types=$?
cat .cache/mypy.log
if [ -n "$logs" ]; then
  wait "$logs"
  logs=$?
  echo "tests of .mf4 logs:"
  cat .cache/mf4.log
  if [ "$logs" != 0 ]; then
    if [ -e .cache/mf4/.ready ] || [ "${CI:-}" = true ]; then exit "$logs"; fi
    echo "asammdf cannot be installed here: these tests are skipped" >&2
  fi
fi

# A selection (make test ARGS="-k ...") may leave one of the two runs without tests. Without one, none may be.
if [ $# -gt 0 ] && [ "$main" != "$sock" ]; then
  [ "$main" != $NOTHING_RAN ] || main=0
  [ "$sock" != $NOTHING_RAN ] || sock=0
fi
[ "$main" = 0 ] || exit "$main"
[ "$sock" = 0 ] || exit "$sock"
exit "$types"
