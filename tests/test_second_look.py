"""Only a test that draws from the run's seed may be run again with others, and only if no other failed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
BY_CHANCE = "def test_statistic(seed: int) -> None:\n    assert seed == 0\n"
BY_FAULT = "def test_fault() -> None:\n    raise AssertionError\n"
NO_SETUP = "import pytest\n\n@pytest.fixture\ndef broken(seed):\n    1 / 0\n\ndef test_x(broken):\n    pass\n"


IN_TWO = ["--numprocesses", "2"]
CONFIRMED = ["tests/test_0.py::test_statistic"]


@pytest.mark.parametrize(
    ("tests", "to_confirm", "processes"),
    [
        ([BY_CHANCE], CONFIRMED, []),
        ([BY_CHANCE], CONFIRMED, IN_TWO),
        ([BY_FAULT], [], []),
        ([BY_CHANCE, BY_FAULT], [], []),
        ([BY_CHANCE, BY_FAULT], [], IN_TWO),
        ([BY_CHANCE, NO_SETUP], [], []),
        ([BY_CHANCE, NO_SETUP], [], IN_TWO),
    ],
)
def test_which_failures_may_be_chance(
    tests: list[str], to_confirm: list[str], processes: list[str], tmp_path: Path
) -> None:
    folder, listed = tmp_path / "tests", tmp_path / "to-confirm"
    folder.mkdir()
    shutil.copy(ROOT / "tests" / "conftest.py", folder)
    for k, text in enumerate(tests):
        (folder / f"test_{k}.py").write_text(text)
    surroundings = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "AXISWATCH_SEED": "1",
        "AXISWATCH_TO_CONFIRM": str(listed),
    }
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *processes, "tests"]
    ended = subprocess.run(command, cwd=tmp_path, env=surroundings, capture_output=True, text=True)
    assert ended.returncode == pytest.ExitCode.TESTS_FAILED, ended.stdout + ended.stderr
    assert (listed.read_text().split() if listed.exists() else []) == to_confirm
