"""Readers never cost a sample: clients that ask for long histories without a pause, while six axes run at 200 Hz."""

import os
import threading
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import httpx
import pytest

from service.config import load
from service.store.history_query import MOST_POINTS
from service.store.history_store import Bounds, HistoryPoint, HistorySeries, HistoryStore, Resolution
from tests.end_to_end.played_robot import write_log
from tests.end_to_end.processes import daemon, demo_config, running, wait_for

pytestmark = pytest.mark.soak

CLIENTS, SECONDS, RATE_HZ, AXES = 20, 40, 200, 6
AGES: dict[Resolution, float] = {
    "raw": 30 * 86400.0,
    "minute": 60 * 86400.0,
    "hour": 730 * 86400.0,
    "day": 3650 * 86400.0,
}


def test_twenty_clients_that_ask_for_histories_cost_no_sample(tmp_path: Path, seed: int) -> None:
    """The samples are those of a record, and each frame has a number: what is lost is counted, by whomever."""
    config = demo_config(tmp_path, axes=AXES)
    record = tmp_path / "robot.log"
    write_log(record, load(config, {}), SECONDS, seed, ())
    fill(tmp_path / "state" / "history.sqlite")
    with daemon(config) as d:
        wait_for(lambda: not d.get("api/v1/service")["messages"])
        stop, answers = threading.Event(), Counter[int]()
        url = f"{d.page}api/v1/axes/demo.axis1/history?resolution=raw&points={MOST_POINTS}"
        threads = [threading.Thread(target=reads, args=(url, stop, answers)) for _ in range(CLIENTS)]
        for thread in threads:
            thread.start()
        with running("play", "--config", config, record, log=tmp_path / "play.txt") as player:
            with suppress(PermissionError):  # else what a busy machine does to the player is counted, too
                os.setpriority(os.PRIO_PROCESS, player.pid, -15)
            assert player.wait(SECONDS + 60) == 0
        stop.set()
        for thread in threads:
            thread.join(60)
        time.sleep(2)
        axes = d.get("api/v1/axes")["axes"]
        (bus,) = d.get("api/v1/service")["buses"]
        assert d.stop() == 0
    found = {axis["name"]: (axis["samples"], sum(axis["dropped"].values())) for axis in axes}
    print({axis["name"]: (axis["dropped"], axis["clock"], axis["counters"], axis["stamps"]) for axis in axes})
    print(f"answers by status: {dict(answers)}; samples and drops: {found}; frames: {bus['frames']}, {bus['dropped']}")
    assert answers[200] > CLIENTS
    assert sum(bus["dropped"].values()) == 0
    for samples, dropped in found.values():
        assert (dropped, samples) == (
            0,
            pytest.approx(SECONDS * RATE_HZ, abs=2),
        )  # the last has no partner yet


def fill(path: Path) -> None:
    """Two days of the first axis."""
    path.parent.mkdir(exist_ok=True)
    store, now_s = HistoryStore(path, Bounds(AGES, 1e9)), round(time.time()) // 10 * 10
    series = [HistorySeries("demo.axis1", name, "1") for name in ("kT", "1/Ja", "fm")]
    for begin in range(now_s - 2 * 86400, now_s, 6000):
        store.add([HistoryPoint(s, t, [t % 97] * 7) for t in range(begin, begin + 6000, 10) for s in series])
    store.close()


def reads(url: str, stop: threading.Event, answers: Counter[int]) -> None:
    """Asks again and again, and counts the answers by their status."""
    with httpx.Client(timeout=60) as client:
        while not stop.is_set():
            answers[client.get(url).status_code] += 1
