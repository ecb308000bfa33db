"""Every real record, from the file to the verdict: ``init`` and ``commission --yes``, nothing edited.

``-s`` prints the table of docs/validation.md.
"""

import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from service.commands.command_line.exit_codes import MISTAKE, NOT_TESTED, OK
from tests.end_to_end.processes import run_program

pytestmark = [pytest.mark.soak, pytest.mark.records]

ALL = tuple(f"robot1.axis{n}" for n in range(1, 7))
ONE = ("robot1.axis",)


@pytest.mark.parametrize(
    ("record", "axes", "codes", "watched"),
    [
        ("emps/DATA_EMPS.mat", ONE, [OK], 1),
        ("ur10e/ur-20_01_22-joint_1.csv", ONE, [OK], 1),
        ("ur10e/ur-20_01_22-joint_2.csv", ONE, [OK], 1),
        ("ur10e/ur-20_02_19_14harm50sec.csv", ALL, [OK, NOT_TESTED], 5),
        # Too short for most: ten and twelve seconds.
        ("irb/robot_arm.mat", ONE, [NOT_TESTED], 0),
        ("ur10e/ur-19_09_27-11_32_02.csv", ALL, [MISTAKE, NOT_TESTED], 2),
    ],
)
def test_from_a_file_to_a_verdict(
    record: str, axes: Sequence[str], codes: Sequence[int], watched: int, records_dir: Path, tmp_path: Path
) -> None:
    config, made = tmp_path / "axis.toml", tmp_path / "commissioned"
    begun = time.monotonic()
    init = run_program("init", records_dir / record, "-o", config)
    assert init.returncode == OK, init.stderr
    words = ("--config", config, "-o", made, "--budget", "10min", "--yes")
    done = run_program("commission", records_dir / record, *words, patience_s=1800)
    print(f"\n{record}: exit code {done.returncode} after {time.monotonic() - begun:.0f} s")
    verdicts = [line.partition("] ")[2] for line in done.stdout.splitlines() if line.startswith("[")]
    for verdict in sorted(verdicts):
        print(f"   {verdict}")
    assert done.returncode in codes, done.stderr
    assert sorted(verdict.partition(": ")[0] for verdict in verdicts) == sorted(axes)
    assert sum(" Can be watched: " in verdict or ": Found within " in verdict for verdict in verdicts) >= watched
    assert (made / "report.html").exists()
