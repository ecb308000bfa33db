"""``axiswatch warm`` leaves nothing for identify and excite to compile."""

import subprocess
import sys
from pathlib import Path

from service.config import load
from tests.service.identification.conftest import write_record, write_robot

_PROGRAM = """
import gc, sys
from service.commands.warm import compile_offline
from service.commands.main import app

def compiled():
    from numba.core.dispatcher import Dispatcher
    all_ = [x for x in gc.get_objects() if isinstance(x, Dispatcher)]
    return {f"{x.py_func.__module__}.{x.py_func.__name__}{s}" for x in all_ for s in x.signatures}

compile_offline()
before = {x for x in compiled() if x.startswith("monitor_core")}
config, record, out = sys.argv[1:]
for command in (
    ["excite", "--config", config, "--torque-limit", "3", "--seconds", "4", "-o", out + ".csv"],
    ["excite", "--config", config, "--as", "angle", "--torque-limit", "3", "--seconds", "4", "-o", out + "2.csv"],
    ["identify", record, "--config", config, "--start", "search", "--output-dir", out],
):
    app(command, standalone_mode=False)
after = {x for x in compiled() if x.startswith("monitor_core")}
print("BEFORE", len(before))
for one in sorted(after - before):
    print("NEW", one)
"""


def test_nothing_is_left_to_compile(tmp_path: Path, seed: int) -> None:
    """Other kinds of arguments are compiled anew: none of identify's and excite's are."""
    config = write_robot(tmp_path)
    record = write_record(tmp_path / "a.csv", load(config), 10.0, seed)
    (tmp_path / "out").mkdir()
    command = [sys.executable, "-c", _PROGRAM, str(config), str(record), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr[-2000:]
    said = [line.split(" ", 1) for line in done.stdout.splitlines() if line.startswith(("BEFORE", "NEW"))]
    assert [name for what, name in said if what == "NEW"] == []
    assert int(said[0][1]) >= 5
