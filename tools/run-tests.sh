#!/usr/bin/env bash
#
# run-tests.sh [PYTEST ARGUMENT...]
#
# Ruff, then at once: the tests that run anywhere, those marked `vcan`, inside with-vcan.sh, where real SocketCAN devices
# exist, and mypy (`make lint` has it sooner). Where the devices cannot be had: a failure with CI=true, else those tests are
# skipped.
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
from service.pipeline.kernel_cache import KernelShape, compile_kernel
$1
os._exit(0) # it is written; to take the compiler's memory apart would take a second"
}
if [ $# = 0 ]; then
  shapes="KernelShape.MANY_AXES, KernelShape.MULTIMODEL, KernelShape.CYCLIC_CLOCK"
  ahead "[compile_kernel(shape) for shape in ($shapes)]" &
  ahead "compile_kernel(KernelShape.FEW_AXES); compile_offline()" &
fi
compiling=$(jobs -p)
{ .venv/bin/ruff check . && .venv/bin/ruff format --check .; } || { kill $(jobs -p) 2>/dev/null; exit 1; }
for job in $compiling; do
  wait "$job" || { echo "the kernel was not compiled ahead: see the error above" >&2; exit 1; }
done

# The SocketCAN tests, in one order: what records in real time is before what simulates a robot of its own.  Everything
# is slow in there, imports above all: without a selection, collect only the files concerned.
files=()
[ $# != 0 ] || mapfile -t files < <(grep -rlE --include='test_*.py' 'mark\.vcan' tests --exclude-dir soak | sort)
on_devices=("${PYTEST[@]}" "$@" -m "vcan and not soak" "${files[@]}")

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

# All at once: tests of the daemon and of devices mostly wait.  Those of devices are one process in a kernel with one
# processor, and record in real time: all others are nice to them.
mkdir -p .cache
trap 'exit 130' INT TERM
trap 'kill $(jobs -p) 2>/dev/null' EXIT
nice -n 10 .venv/bin/mypy >.cache/mypy.log 2>&1 &
types=$!
sock='' logs='' low=()
unused=()
if [ $# = 0 ]; then
  tools/with-vcan.sh "${on_devices[@]}" >.cache/vcan.log 2>&1 &
  sock=$!
  nice -n 10 bash -c "$(declare -f mf4_tests); mf4_tests" >.cache/mf4.log 2>&1 &
  logs=$!
  low=(nice -n 5)
  # Each process collects all files: not those of which nothing is run here.
  unused=(--ignore tests/bench --ignore tests/soak)
fi
# One process more than there are processors.  More than four would only crowd each other's daemons.
processes=$(($(getconf _NPROCESSORS_ONLN) + 1))
"${low[@]}" "${PYTEST[@]}" --numprocesses "$processes" --maxprocesses 4 --dist worksteal --durations 25 "${unused[@]}" "$@"
main=$?

echo
echo "SocketCAN tests, on vcan0 and vcan1:"
if [ -n "$sock" ]; then
  wait "$sock"
  sock=$?
  cat .cache/vcan.log
else
  tools/with-vcan.sh "${on_devices[@]}"
  sock=$?
fi

if [ "$sock" = 125 ] && ! tools/with-vcan.sh true; then
  if [ "${CI:-}" = true ]; then
    echo "no SocketCAN devices, and CI=true: failed" >&2
    exit 1
  fi
  echo "No SocketCAN devices here. With root on a kernel that has them: modprobe vcan." >&2
  echo "Without: on Debian (amd64), apt-get update && apt-get install iproute2 util-linux; the rest is fetched." >&2
  "${on_devices[@]}" # skips them, and says so
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
