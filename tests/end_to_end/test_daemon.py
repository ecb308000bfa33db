"""The daemon from outside: frames on a real bus between processes in, answers and files out."""

import json
import re
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from service.config import load
from service.simulation.robot import SimulatedFault
from service.texts.instants import iso, now_us
from tests.end_to_end.documents import shown
from tests.end_to_end.killed_daemons import (
    alarms,
    killed,
)
from tests.end_to_end.played_robot import played_robot
from tests.end_to_end.processes import PATIENCE_S, Daemon, daemon, demo_config, running, wait_for
from tests.end_to_end.saved_monitors import saved
from tests.service.command_line import axiswatch
from tests.service.daemon_thread import daemon_thread

DETECTORS = ("cusum", "multimodel")
"""What raises the alarms of the first axis, and of the second."""
COMPILED = "kernel is being compiled"
"""In the messages of a daemon meanwhile: it is not ready, and takes longer than a robot may move."""


def with_both_detectors(folder: Path) -> Path:
    """The configuration of two axes, in a folder of its own; its messages lie elsewhere."""
    (folder / "robot").mkdir()
    config = demo_config(folder / "robot", service="history_interval_s = 1\ncheckpoint_interval_s = 0.5")
    (folder / "robot" / "demo.dbc").rename(folder / "demo.dbc")
    first, second = config.read_text(encoding="utf-8").rsplit("[robot.axis.detector]\n", 1)
    own = f'[robot.axis.detector]\nalarm_source = "{DETECTORS[1]}"\n'
    config.write_text(first.replace('"demo.dbc"', '"../demo.dbc"') + own + second, encoding="utf-8")
    return config


def test_a_robot_from_check_to_play_with_the_same_bits_and_what_is_left_of_it_after_a_crash_or_damage(
    tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the commands of the documents."""
    config = with_both_detectors(tmp_path)
    monkeypatch.chdir(config.parent)
    (check, *_), (listen, *_) = shown("axiswatch check"), shown("axiswatch listen")
    (run,) = (command for command in shown("axiswatch run") if "--record" in command)
    record = config.with_name(run[-1])
    (simulate,) = shown("axiswatch simulate")
    assert axiswatch(*check[1:]).exit_code == 0
    assert axiswatch(*simulate[1:], "--seconds", "0.2").exit_code == 0
    with daemon(config, "--record", record) as d:
        assert d.status("readyz") == 503
        wait_for(lambda: not any(COMPILED in message for message in d.get("api/v1/service")["messages"]))
        with played_robot(config, 14, seed, SimulatedFault("demo.axis2", {"fm": 1.6}, 5.0)) as process:
            heard = axiswatch(*listen[1:])
            assert (heard.exit_code, "axis1" in heard.stdout) == (0, True)
            wait_for(lambda: d.status("readyz") == 200)
            alarm = wait_for(lambda: next((a for a in alarms(d).values() if a["stage"] == "named"), None))
            assert (alarm["axis"], alarm["parameter"], alarm["direction"]) == ("demo.axis2", "fm", "up")
            answers_to_curl(d)
            before = is_backed_up(d, alarm)
            assert process.wait(PATIENCE_S) == 0
        last = wait_until_silent(d)
        assert {p["name"]: p["status"] for p in last[1]["parameters"]}["fm"] == "alarm"
        assert alarm_sources(last) == DETECTORS
        metrics = d.text("metrics")
        assert wait_for(lambda: d.get("api/v1/axes/demo.axis1/history")["time"])
        assert d.stop() == 0
    for value in (
        'alarm_active{axis="demo.axis2",direction="up",parameter="fm"} 1.0',
        'alarm_active{axis="demo.axis2",direction="up",parameter="torque sign"} 0.0',
        'detector_alarms{axis="demo.axis1",detector="cusum"} 1.0',
        'detector_alarms{axis="demo.axis2",detector="multimodel"} 1.0',
    ):
        assert f"axiswatch_{value}" in metrics
    assert alarm["onset_low"] <= alarm["onset"] <= alarm["onset_high"]
    assert 0.01 < alarm["size"] < 0.06
    gives_the_same_bits(config, last, alarm)
    is_played_and_listened_to(config, record)
    goes_on_in_another_folder(before)


def gives_the_same_bits(config: Path, last: list[dict[str, Any]], alarm: dict[str, Any]) -> None:
    """A replay of the record: as REST has shown them, and as the daemon has saved them."""
    (replay,) = shown("axiswatch replay")
    result = axiswatch(*replay[1:])
    assert result.exit_code == 0, result.output
    page = Path("replay.html").read_text(encoding="utf-8")
    assert "fm" in page
    assert "<svg" in page
    replayed = json.loads(Path("result.json").read_text(encoding="utf-8"))["axes"]
    assert alarm_sources(replayed) == DETECTORS
    for found, rest_axis, monitor in zip(replayed, last, saved(config).values(), strict=True):
        status = monitor.status()
        assert found["samples"] == rest_axis["samples"] == status.samples
        assert found["last_sample"] == rest_axis["last_sample"]
        for p, rest, kept in zip(found["parameters"], rest_axis["parameters"], status.parameters, strict=True):
            for name in ("estimate", "standard_deviation", "p_diagonal"):
                assert p[name] == rest[name] == getattr(kept, name)
    assert [a["parameter"] for a in replayed[1]["alarms"]][:1] == ["fm"]
    assert replayed[1]["alarms"][0]["raised"] == alarm["raised"]


def answers_to_curl(d: Daemon) -> None:
    """Each address shown answers, on the port of this daemon."""
    for command in shown("curl"):
        if "--json" not in command:
            assert d.status(command[1].removeprefix("http://127.0.0.1:8080/")) == 200


def is_played_and_listened_to(config: Path, record: Path) -> None:
    """The last 300 frames of the record, by another process; the last but one is of the first axis."""
    (play,) = shown("axiswatch play")
    frames = record.read_text(encoding="utf-8").splitlines()[-300:]
    record.write_text("\n".join((*frames, "")), encoding="utf-8")
    lines = config.with_name("lines.txt")
    with running("listen", "--config", config, log=lines) as listener:
        wait_for(lambda: "can0: up" in lines.read_text(encoding="utf-8"))
        assert "demo.axis1\ttorque\tnot received" in lines.read_text(encoding="utf-8")
        played = axiswatch(*play[1:])
        assert (played.exit_code, played.stdout[:15]) == (0, "300 frames sent")
        sent = frames[-2].split("#")[1].split()[0]
        counter = int.from_bytes(bytes.fromhex(sent)[6:8], "little")
        for words in (f"counter\t{counter}\t", "can0: up, 300 frames"):
            wait_for(lambda words=words: words in lines.read_text(encoding="utf-8"))  # type: ignore[misc]
        listener.send_signal(signal.SIGTERM)
        assert listener.wait(PATIENCE_S) == 0
    shown_last = lines.read_text(encoding="utf-8").splitlines()
    last = [line.split("\t") for line in shown_last if line.startswith("demo.axis1\t")][-4:]
    assert last[2][:5] == ["demo.axis1", "counter", str(counter), "Axis1State.Counter", str(counter)]
    torque = int.from_bytes(bytes.fromhex(sent)[:2], "little", signed=True) / 1000
    assert last[0][2] == f"{torque:.6g} N m"
    axis, what, scatter, clock = last[3][:4]
    assert (axis, what, clock) == ("demo.axis1", "stamps", "counter")
    assert re.fullmatch(r"scatter [0-9.e+]+ ms", scatter)


def is_backed_up(d: Daemon, alarm: dict[str, Any]) -> int:
    """While it runs, after its first alarm was acknowledged; samples of the first axis at that time."""
    # An earlier checkpoint may be of before the first sample.
    wait_for(lambda: (d.get("api/v1/service")["checkpoint"] or "") > alarm["raised"])
    done = axiswatch("alarms", "ack", "1", "--comment", "seen", "--url", d.page)
    assert done.exit_code == 0, done.output
    (backup,) = shown("axiswatch backup")
    kept = axiswatch(*backup[1:])
    assert (kept.exit_code, kept.stderr) == (0, "")
    # What is shown may be older than the checkpoint in the backup.
    since = iso(now_us())
    return int(wait_for(lambda: (s := d.get("api/v1/axes"))["taken"] > since and s["axes"][0]["samples"]))


def goes_on_in_another_folder(before: int) -> None:
    """What was acknowledged is so there, and the estimates go on; then its files are damaged."""
    (restore,) = shown("axiswatch restore")
    done = axiswatch(*restore[1:])
    assert done.exit_code == 0, done.output
    assert "../demo.dbc is now restored/outside/1-demo.dbc" in done.stderr
    restored = Path("restored", "robot.toml").absolute()
    assert axiswatch("check", "--config", restored).exit_code == 0
    with inside(restored) as d:
        assert alarms(d)[1]["state"] in ("acknowledged", "normal")
        assert 0 < d.axis()["samples"] <= before
        assert daemon_messages(d) == []
        standing = sorted(a["raised"] for a in alarms(d).values() if a["active"])
        assert standing
    they_outlive_damaged_files(restored, standing)


def they_outlive_damaged_files(config: Path, standing: list[str]) -> None:
    """Alarms, by the times at which they were raised: checkpoints and journal both know them."""
    state = config.parent / "state"
    (state / "alarms.sqlite").write_bytes(b"no database" * 1000)
    with inside(config) as d:
        (message,) = daemon_messages(d)
        assert "alarms.sqlite is damaged" in message
        assert sorted(a["raised"] for a in alarms(d).values()) == standing
        assert d.axis(2)["parameters"][2]["status"] == "alarm"
    assert len(list(state.glob("alarms.sqlite.damaged-*"))) >= 1

    (state / "checkpoints.sqlite").write_bytes(b"no database" * 1000)
    with inside(config) as d:
        (message,) = daemon_messages(d)
        assert "checkpoints.sqlite is damaged" in message
        axis = d.axis(2)
        assert (axis["samples"], axis["parameters"][2]["status"]) == (0, "alarm")


class Inside(Daemon):
    """A daemon in a thread of this process."""

    def __init__(self, page: str) -> None:
        self.page = page


@contextmanager
def inside(file: Path) -> Iterator[Daemon]:
    """Where what a daemon has found in its files is looked at."""
    with daemon_thread(load(file, {}), file=file) as page:
        yield Inside(page)


def daemon_messages(d: Daemon) -> list[str]:
    """The messages of the daemon, except that the kernel is not ready yet."""
    messages: list[str] = d.get("api/v1/service")["messages"]
    return [message for message in messages if COMPILED not in message]


def alarm_sources(axes: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    return tuple(x["name"] for axis in axes for x in axis["detectors"] if x["alarms"])


def wait_until_silent(d: Daemon) -> list[dict[str, Any]]:
    """The axes when all that was sent has been processed: the worker has published three times without a new sample."""
    counts = dict[str, int]()

    def settled() -> list[dict[str, Any]] | None:
        body = d.get("api/v1/axes")
        axes: list[dict[str, Any]] = body["axes"]
        counts[body["taken"]] = sum(a["samples"] for a in axes)
        last = list(counts.values())[-3:]
        return axes if len(last) == 3 and len(set(last)) == 1 else None

    return wait_for(settled)


def test_kill_9_at_any_moment_loses_no_shown_alarm_and_nothing_of_a_checkpoint(tmp_path: Path, seed: int) -> None:
    assert killed(tmp_path, seed, kills=4, while_starting=False)
