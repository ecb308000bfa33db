"""``axiswatch commission --minutes``: the buses are looked at, recorded, and what is wrong with them is named."""

from __future__ import annotations

import os
import pty
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monitor_core.arrays import Floats
from service.commands import commission
from service.commands.command_line.exit_codes import MISTAKE, NO_BUS
from service.commands.commissioning.axis import axis_processes
from service.commands.commissioning.axis.axis_job import AxisJob
from service.commands.commissioning.live import live_recording
from service.commands.commissioning.live.live_look import LiveLook, look_at
from service.commands.commissioning.live.live_recording import recorded
from service.commands.commissioning.signals import exchanged_torques, signal_proposals
from service.commands.commissioning.signals.signal_proposals import Review
from service.config import load
from service.ingest.records import axis_records
from service.reports.commissioning_report import Outcome
from tests.service.command_line import axiswatch, refused
from tests.service.commands import can_logs
from tests.service.commands.commissioning.two_mass_tables import table
from tests.service.commands.live_robots import configured, moving

LOOK_S = 1.0


@pytest.fixture(autouse=True)
def fast(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots here live faster than the clock."""
    monkeypatch.setattr(live_recording, "LEAST_S", 1.0)
    monkeypatch.setattr(live_recording, "LOOK_S", LOOK_S)


def words_of(result: str) -> str:
    return " ".join(result.replace("│", " ").split())


def test_what_is_wrong_is_named_before_and_after_the_recording(folder: Path, two_axes: Path) -> None:
    """The first torque has the wrong sign, its angle is in degrees; the second axis is right.

    A motion is planned for the first, longer than the recording.
    """
    (folder / "made" / "motion").mkdir(parents=True)
    plan = folder / "made" / "motion" / "cell.a1.csv"
    plan.write_text("t_s,torque_Nm\n0,0.1\n35.995,0\n", encoding="utf-8")
    config = configured(folder / "robot.toml", can_logs.dbc(folder / "robot.dbc", 2, "deg"), 2)
    second = 'signal = "Joint2_Pos_Act"'
    text = config.read_text("utf-8").replace(second, f"{second}, factor = {np.pi / 180}")
    config.write_text(text, "utf-8")

    def change(rows: Floats) -> None:
        turned(rows)
        rows[:, 2:5:2] *= 180 / np.pi
        rows[:, 4] *= np.pi / 180  # the encoder of the simulated robot divides by the factor

    words = ("commission", "--config", config, "--output", "made")
    with moving(two_axes, config, change):
        result = axiswatch(*words, "--minutes", 0.02)
    looked, _, after = result.output.partition("Recording 1.2 s into made/records/")
    assert "200 samples a second on can0; Joint1." in looked
    assert "-> torque.factor = -1; proposed after the recording" in looked
    assert "cell.a2: 200 samples" in looked
    assert "Planned: made/motion/cell.a1.csv (36 s). Let the controller run it while this records." in looked
    assert "That takes longer than the recording: see --minutes." in looked
    for part in (looked, after):
        assert "cell.a1: the description of the bus says that the angle is in degrees" in part
        assert "cell.a2: the description" not in part
    assert result.exit_code == MISTAKE
    changes = "cell.a1: angle.factor = 0.0174533; cell.a1: torque.factor = -1"
    right = f"2 proposed changes, to be confirmed in a terminal: {changes}"
    assert right in words_of(result.stderr)
    (record,) = recorded(folder / "made")

    again = axiswatch(*words)  # with what was recorded; no robot is there
    assert again.exit_code == MISTAKE
    assert right in words_of(again.stderr)
    assert recorded(folder / "made") == [record]


def to_degrees(rows: Floats) -> None:
    rows[:, 2] *= 180 / np.pi


# --- The look: what is wrong, and what to do --------------------------------------------------------------------------


def looked_at(
    folder: Path,
    config: Path,
    rows: Path | None,
    change: Callable[[Floats], object] = lambda _: None,
    seconds: float = LOOK_S,
    robot: Path | None = None,
) -> LiveLook:
    """``rows``: those that a robot sends by its configuration, the same if none is given; None: nothing is sent."""
    with nullcontext() if rows is None else moving(rows, robot or config, change):
        text = config.read_text("utf-8")
        return look_at(load(config, {}), text, folder, seconds, threading.Event(), lambda *_: None)


@pytest.fixture(scope="module")
def two_axes(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Path:
    return table(tmp_path_factory.mktemp("rows") / "rows.csv", seed, 25.0, axes=2)


@pytest.fixture
def config(folder: Path) -> Path:
    return configured(folder / "robot.toml", can_logs.dbc(folder / "robot.dbc", 2, "rad"), 2)


def test_swapped_axes(folder: Path, config: Path, two_axes: Path) -> None:
    # A second of motion is not evidence enough where a busy machine stalls in it.
    look = looked_at(folder, config, two_axes, lambda rows: swap(rows, 1, 3), 4 * LOOK_S)
    assert not look.buses
    for n, axis in enumerate(look.axes, 1):
        assert not axis.problems
        assert "the motion of this axis follows the torque of" in axis.proposals[0]
        assert f'torque.message = "Joint{3 - n}"' in axis.proposals[0]


def swap(rows: Floats, a: int, b: int) -> None:
    rows[:, [a, b]] = rows[:, [b, a]]


def stuck_torque(rows: Floats) -> None:
    rows[:, 3] = 0.5


def stuck_angle(rows: Floats) -> None:
    rows[:, 4] = 0.5


def standing(rows: Floats) -> None:
    rows[:, 3], rows[:, 4] = 0.0, 0.5


def stuck_for_a_while(rows: Floats) -> None:
    rows[200:900, 4] = rows[200, 4]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (
            stuck_torque,
            "the torque is 0.5 all the time, while the axis moves: Joint2.Joint2_Torque_Act is stuck",
        ),
        (
            stuck_angle,
            "the angle is 0.5 all the time, while the torque changes: Joint2.Joint2_Pos_Act is stuck",
        ),
        (standing, "it does not move: let the robot work"),
        (stuck_for_a_while, "signal Joint2_Pos_Act of Joint2 (the angle) is stuck, while the axis moves"),
    ],
    ids=["torque", "angle", "standing", "for a while"],
)
def test_an_axis_that_is_not_right(
    change: Callable[[Floats], object], problem: str, folder: Path, config: Path, two_axes: Path
) -> None:
    first, second = looked_at(folder, config, two_axes, change).axes
    assert (first.problems, first.proposals) == ((), ())
    assert second.loaded is not None
    assert problem in second.problems[0]


def test_frames_that_are_lost(folder: Path, config: Path, two_axes: Path) -> None:
    def every_tenth(rows: Floats) -> None:
        rows[5::10] = np.nan

    for axis in looked_at(folder, config, two_axes, every_tenth).axes:
        assert axis.loaded is not None
        share, _, words = axis.problems[0].partition(" % of its")
        assert words.startswith(" samples are missing")
        assert float(share) == pytest.approx(10, abs=1)


def first_axis(config: Path) -> Path:
    """The configuration of the first axis alone."""
    text = config.read_text(encoding="utf-8")
    single = config.with_name("single.toml")
    single.write_text(text[: text.rindex("[[robot.axis]]")], encoding="utf-8")
    return single


def test_a_silent_axis(folder: Path, config: Path, two_axes: Path) -> None:
    """The robot has one axis, the configuration two."""
    first, second = looked_at(folder, config, two_axes, robot=first_axis(config)).axes
    assert (first.loaded is None, second.loaded is None) == (False, True)
    assert "no torque and angle: message Joint2 (0x182) was not received on bus can0" in second.problems[0]


def test_a_silent_bus_and_the_dbc_of_another_robot(folder: Path, config: Path, two_axes: Path) -> None:
    (words,) = looked_at(folder, config, None, seconds=0.2).buses
    assert "is silent: no frame" in words
    other = (folder / "robot.dbc").read_text(encoding="utf-8").replace("BO_ 38", "BO_ 48")
    (folder / "other.dbc").write_text(other, encoding="utf-8")
    text = config.read_text(encoding="utf-8").replace("robot.dbc", "other.dbc")
    config.with_name("other.toml").write_text(text, encoding="utf-8")
    look = looked_at(folder, folder / "other.toml", two_axes, robot=config)
    assert "none of their messages is in other.dbc: 0x181, 0x182" in look.buses[0]
    assert not any(axis.loaded for axis in look.axes)


@pytest.mark.vcan
def test_on_a_real_device(folder: Path, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first torque has the wrong sign, its angle is in degrees; the second axis stands; frames come in bunches."""
    monkeypatch.setattr(live_recording, "LOOK_S", 5.0)

    def change(rows: Floats) -> None:
        turned(rows)
        to_degrees(rows)
        standing(rows)

    config = configured(folder / "robot.toml", can_logs.dbc(folder / "robot.dbc", 2), 2, "vcan0")
    words = ("commission", "--config", config, "--output", "made")
    with moving(table(folder / "rows.csv", seed, 60.0, axes=2), config, change):
        result = axiswatch(*words, "--minutes", 0.1)
    looked, _, after = result.stdout.partition("Recording 6 s into made/records/")
    for part in (looked, after):
        assert "frames are received in bunches" in part
        assert "the samples of the records are" not in part
        assert "the description of the bus says that the angle is in degrees" in part
        assert "-> torque.factor = -1" in part
    assert "cell.a2: it does not move: let the robot work" in looked
    assert result.exit_code == MISTAKE
    assert 'to be confirmed in a terminal: cell.a1: time.clock = "cyclic"; cell.a1: angle.factor' in words_of(
        result.stderr
    )


# --- The recording ----------------------------------------------------------------------------------------------------


def test_what_is_refused(folder: Path, config: Path) -> None:
    words = ("commission", "--config", config)
    assert "no records, and none of half a minute in commissioned/records" in refused(*words)
    assert "0 minutes: half a minute (0.5) is the least" in refused(*words, "--minutes", 0)
    assert "leave out --minutes" in refused(*words, "healthy.log", "--minutes", 1)
    (folder / "taken").mkdir()
    (folder / "taken" / "records").touch()
    taken = axiswatch(*words, "--minutes", 0.05, "--output", "taken")
    assert (taken.exit_code, "cannot write taken/records: File exists" in taken.stderr) == (MISTAKE, True)
    silent = axiswatch(*words, "--minutes", 0.05)
    assert silent.exit_code == MISTAKE
    assert "bus can0 (virtual live-" in silent.stdout
    assert "nothing is recorded: no axis has its signals" in silent.stderr
    assert not recorded(folder / "commissioned")
    config.write_text(config.read_text("utf-8").replace('"virtual"', '"socketcan"'), "utf-8")
    gone = axiswatch(*words, "--minutes", 0.05)
    assert gone.exit_code == NO_BUS
    assert "there is no network interface live-" in gone.stderr


def test_ctrl_c_ends_the_recording_and_goes_on(folder: Path, config: Path, two_axes: Path) -> None:
    """The torques of two axes are exchanged, so that it ends with a question."""

    def interrupt() -> None:
        while not list((folder / "made" / "records").glob("*.log")):
            timer.wait(0.05)
        timer.wait(1.5)
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Event()
    thread = threading.Thread(target=interrupt)
    with moving(two_axes, config, lambda rows: swap(rows, 1, 3)):
        thread.start()
        result = axiswatch("commission", "--config", config, "--output", "made", "--minutes", 10)
    thread.join()
    (record,) = recorded(folder / "made")
    assert f"made/records/{record.name}: " in result.stdout
    assert result.exit_code == MISTAKE
    again = "Accept all with: axiswatch commission --config"
    assert any(line.startswith(again) and line.endswith(" --yes") for line in result.stdout.splitlines())
    assert 'cell.a1: torque.message = "Joint2"' in words_of(result.stderr)


@pytest.mark.parametrize(("typed", "minutes"), [("y", [3.0, 1]), ("n", [3.0]), ("", [3.0])])
def test_a_planned_motion_may_be_recorded_at_once(
    typed: str, minutes: list[float], folder: Path, config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At a terminal, a real one here, it asks; yes records again, for as long as the motion takes."""
    found = Outcome("cell.a1", watched=("kT",), nominal_file="n.toml")
    moved = replace(found, lost=("fm",), excite=("--find", "fm"), motion="motion/cell.a1.csv", motion_s=36.0)
    recorded, results = list[float](), iter([moved, found])
    monkeypatch.setattr(
        live_recording,
        "record_live",
        lambda _config, _text, _folder, seconds, _yes: recorded.append(seconds / 60),
    )
    monkeypatch.setattr(live_recording, "recorded", lambda _folder: [folder / "record.log"])
    monkeypatch.setattr(axis_records, "silent_in", lambda *_: {})
    monkeypatch.setattr(exchanged_torques, "exchanged", lambda *_: {})
    monkeypatch.setattr(signal_proposals, "review", lambda *_: Review((), (), (), ""))

    def outcomes(jobs: Sequence[AxisJob], *_: object) -> list[Outcome]:
        return [next(results), *(replace(found, axis_id=job.axis_id) for job in jobs[1:])]

    monkeypatch.setattr(axis_processes, "outcomes", outcomes)
    ours, theirs = pty.openpty()
    with os.fdopen(ours, "wb", buffering=0) as keyboard, os.fdopen(theirs, encoding="utf-8") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        keyboard.write(f"{typed}\n".encode())
        commission.commission(config, output=folder / "made", minutes=3.0)
    assert recorded == minutes


def test_an_axis_that_no_record_has_does_not_hinder_the_others(folder: Path, config: Path, two_axes: Path) -> None:
    with moving(two_axes, first_axis(config), turned):
        result = axiswatch("commission", "--config", config, "--output", "made", "--minutes", 0.03)
    assert result.exit_code == MISTAKE  # a question, of the axis that is there
    assert "1 proposed change, to be confirmed in a terminal: cell.a1: torque.factor = -1" in words_of(result.stderr)


def turned(rows: Floats) -> None:
    rows[:, 1] *= -1
