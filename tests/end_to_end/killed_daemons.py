"""Daemons that are killed while an operator and an engineer work with them."""

import random
import signal
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx

from service.config import load
from service.simulation.robot import SimulatedFault
from tests.end_to_end.played_robot import played_robot
from tests.end_to_end.processes import PATIENCE_S, Daemon, daemon, demo_config, running, wait_for
from tests.service.found_files import nominal_text

INTERVAL_S = 1.0
FAST_CHECKPOINTS = f"checkpoint_interval_s = {INTERVAL_S}\nhistory_interval_s = 0.5"


def alarms(daemon: Daemon) -> dict[int, dict[str, Any]]:
    return {alarm["id"]: alarm for alarm in daemon.get("api/v1/alarms?limit=1000")["alarms"]}


def killed(folder: Path, seed: int, *, kills: int, while_starting: bool) -> dict[int, dict[str, Any]]:
    """The alarms shown last.  All shown before are still there each time, and of the estimation what a checkpoint has.

    The first daemon waits for an alarm and a checkpoint; the others are killed at any moment, and with
    ``while_starting`` one more each time while it starts.  The robot is a record: a simulated one leaves out what it
    cannot send in time, and on a busy machine its gaps keep all from being estimated.  Meanwhile an operator
    acknowledges alarms and comments on them, and an engineer begins epochs of both axes.
    """
    config, chance = demo_config(folder, service=FAST_CHECKPOINTS), random.Random(seed)
    shown, kept, operator = dict[int, dict[str, Any]](), list[tuple[int, int]](), Operator()
    engineer = Engineer(config, chance)
    with ExitStack() as moving:
        for number in range(kills):
            if while_starting:
                with running("run", "--config", config, "--port", "0", log=folder / "start.log"):
                    time.sleep(chance.uniform(0, 1.5))
            with daemon(config) as d:
                if not number:
                    fault = SimulatedFault("demo.axis1", {"fm": 1.6}, 5.0)
                    moving.enter_context(played_robot(config, 8 * kills, seed, fault))
                now, first = alarms(d), d.axis()
                assert {k: still(shown[k]) for k in shown} == {k: still(now[k]) for k in shown}
                assert list(overlaps(now.values())) == []
                operator.check(d)
                engineer.check(d)
                assert all(first["samples"] >= n for epoch, n in kept if epoch == first["epoch"]["number"])
                if any(alarm["active"] and alarm["axis"] == first["id"] for alarm in now.values()):
                    assert "alarm" in {p["status"] for p in first["parameters"]}
                if not shown:
                    wait_for(lambda d=d: alarms(d) and d.get("api/v1/service")["checkpoint"])  # type: ignore[misc]
                with operator.working(d), engineer.working(d):
                    kept, shown = checkpointed(d, chance.uniform(0, 2.5)), alarms(d)
                    d.process.kill()
                assert d.process.wait() == -signal.SIGKILL
    assert operator.answered
    assert engineer.answered
    return shown


def checkpointed(d: Daemon, seconds: float) -> list[tuple[int, int]]:
    """Epochs and numbers of samples of the first axis, shown within that time, that the last checkpoint then covers.

    How much that is depends on the machine: after a start the first checkpoint waits for the kernels of all detectors.
    """
    shown, end = list[tuple[str, int, int]](), time.monotonic() + seconds
    while not shown or time.monotonic() < end:
        body = d.get("api/v1/axes")
        axis = body["axes"][0]
        shown.append((body["taken"], axis["epoch"]["number"], axis["samples"]))
        time.sleep(0.1)
    saved = d.get("api/v1/service")["checkpoint"]
    return [(epoch, samples) for taken, epoch, samples in shown if saved is not None and taken < saved]


class Person(ABC):
    """Does something at a daemon until it is killed."""

    path: str
    """What it works at"""

    def __init__(self) -> None:
        self.answered: list[tuple[Any, str]] = []
        """Alarm or axis, and comment, of each write that the daemon has answered"""

    @contextmanager
    def working(self, d: Daemon) -> Iterator[None]:
        """It works until the end of the block, in which the daemon is killed."""
        thread = threading.Thread(target=self._work, args=(d.page + self.path,))
        thread.start()
        try:
            yield
        finally:
            thread.join(PATIENCE_S)
            assert not thread.is_alive()

    @abstractmethod
    def _work(self, url: str) -> None: ...


class Operator(Person):
    """Acknowledges the alarms and comments on them."""

    path = "api/v1/alarms"

    def check(self, d: Daemon) -> None:
        """All that was answered is in the journal."""
        found = {(k, t["comment"]) for k in alarms(d) for t in d.get(f"api/v1/alarms/{k}")["transitions"]}
        assert set(self.answered) <= found

    def _work(self, url: str) -> None:
        with suppress(httpx.TransportError), httpx.Client(timeout=PATIENCE_S) as client:
            while True:
                for alarm in client.get(url).json()["alarms"]:
                    comment = f"number {len(self.answered)}"
                    todo = "acknowledge" if alarm["state"] in ("unacknowledged", "returned") else "comment"
                    done = client.post(f"{url}/{alarm['id']}/{todo}", json={"comment": comment})
                    if done.status_code == 200:
                        self.answered.append((alarm["id"], comment))
                    else:  # it was raised again, or has ended, in the meantime
                        assert done.status_code == 409, done.text
                time.sleep(0.02)


class Engineer(Person):
    """Begins a window, cancels it, and begins an epoch: with files, then with the values of the first one again.

    Mostly at the second axis: after each epoch the first one needs some seconds until its tests find the fault again.
    """

    path = "api/v1/axes"
    first_share = 0.03

    def __init__(self, config: Path, chance: random.Random) -> None:
        super().__init__()
        self._files = {axis.id: nominal_text(axis.config) for axis in load(config, {}).axes}
        self._chance = chance

    def check(self, d: Daemon) -> None:
        """All that was answered is in the journal, and the epoch in force is the last that began to be."""
        found = set[tuple[str, str]]()
        for axis in self._files:
            body = d.get(f"{self.path}/{axis}/epochs")
            epochs = body["epochs"]
            found |= {(axis, event["comment"]) for epoch in epochs for event in epoch["events"]}
            (now,) = [e for e in epochs if e["state"] in ("verifying", "current")]
            assert body["current"] == now["number"] == max(e["number"] for e in epochs if e["in_force"])
        assert set(self.answered) <= found

    def _work(self, url: str) -> None:
        first, second = self._files
        with suppress(httpx.TransportError), httpx.Client(timeout=PATIENCE_S) as client:
            while True:
                axis = first if self._chance.random() < self.first_share else second
                newest = client.get(f"{url}/{axis}/epochs").json()["epochs"][0]
                files = {"mode": "files", "nominal": self._files[axis]}
                for path, body in (
                    ("baseline", {"mode": "window", "hours": 10}),
                    ("baseline/cancel", {}),
                    ("epochs/1/restore", {}) if newest["source"] == "files" else ("baseline", files),
                ):
                    comment = f"number {len(self.answered)}"
                    done = client.post(f"{url}/{axis}/{path}", json={**body, "comment": comment})
                    if done.status_code == 200:
                        self.answered.append((axis, comment))
                    else:  # alarms are not recorded yet, the window of the daemon before still runs, or it starts
                        assert done.status_code in (409, 503), done.text
                    time.sleep(0.05)


def overlaps(found: Iterable[dict[str, Any]]) -> Iterator[tuple[int, int]]:
    """The ids of alarms of one axis, parameter and direction of which one begins before the other has ended."""
    last: dict[tuple[str, str, str, bool], dict[str, Any]] = {}
    for alarm in sorted(found, key=lambda a: (a["raised"], a["id"])):
        name = alarm["axis"], alarm["parameter"], alarm["direction"], alarm["kind"] == "forecast"
        if (before := last.get(name)) and (before["ended"] is None or before["ended"] > alarm["raised"]):
            yield before["id"], alarm["id"]
        last[name] = alarm


def still(alarm: dict[str, Any]) -> tuple[Any, ...]:
    """What never changes of an alarm; it may get another name, and with it another onset."""
    first = [*alarm["past"], alarm][0]
    return alarm["axis"], alarm["raised"], first["parameter"], first["direction"]
