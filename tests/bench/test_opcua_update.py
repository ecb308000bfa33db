"""What the OPC UA server costs for 300 axes: its start, and an update with and without a client that listens."""

import asyncio
import gc
import resource
import threading
import time
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import pytest
from asyncua import Client, Server

from service.links.opcua_access import GuardedServer, Users
from service.links.opcua_tree import NAMESPACE, Tree
from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.store.tokens import TokenFile
from tests.bench.measure import Say
from tests.ports import own_port
from tests.service.web.conftest import NOON_US, monitored_axis, whole_snapshot

pytestmark = pytest.mark.bench

AXES, PARAMETERS, ROUNDS = 300, 5, 5


def axis(number: int, k: int) -> AxisSnapshot:
    """An axis with other estimates and deviations in each round k."""
    shown = monitored_axis(f"axis{number}")
    kT = shown.status.parameters[0]
    parameters = tuple(
        replace(kT, name=f"p{i}", estimate=1.0 + k + i, standard_deviation=0.1 + k) for i in range(PARAMETERS)
    )
    return replace(shown, status=replace(shown.status, parameters=parameters, time_us=NOON_US + k))


def snapshot(k: int) -> Snapshot:
    return replace(whole_snapshot(), axes=tuple(axis(number, k) for number in range(AXES)))


def memory_mb() -> float:
    """Largest so far, of this process."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


async def updates(tree: Tree, first: int) -> tuple[float, int]:
    """Median time of the processor [s], and the number of values written in each."""
    seconds, count = [], 0
    for k in range(first, first + ROUNDS):
        now = snapshot(k)
        start = time.thread_time()
        count = await tree.update(now, NOON_US)
        seconds.append(time.thread_time() - start)
        await asyncio.sleep(0.5)  # what was written is sent
    return median(seconds), count


def listen(url: str, ready: threading.Event, done: threading.Event, seen: list[int]) -> None:
    class Counter:
        def datachange_notification(self, *_: Any) -> None:
            seen[0] += 1

    async def run() -> None:
        async with Client(url, timeout=60) as client:
            index = await client.get_namespace_index(NAMESPACE)
            names = [f"demo.axis{n}/p{i}" for n in range(AXES) for i in range(PARAMETERS)]
            subscription = await client.create_subscription(200, Counter())
            for at in range(0, len(names), 100):
                nodes = [client.get_node(f"ns={index};s={name}") for name in names[at : at + 100]]
                await subscription.subscribe_data_change(nodes)
            ready.set()
            while not done.is_set():
                await asyncio.sleep(0.1)

    asyncio.run(run())


def test_three_hundred_axes(tmp_path: Path, say: Say) -> None:
    async def nothing(_who: str, _method: object) -> None:
        return None

    async def measure() -> list[tuple[str, float, object]]:
        before_mb, start = memory_mb(), time.thread_time()
        server = Server(GuardedServer(Users(TokenFile(tmp_path / "tokens.json"), True), nothing))
        await server.init()
        rows: list[tuple[str, float, object]] = [("start [s]", time.thread_time() - start, "")]
        index = await server.register_namespace(NAMESPACE)
        start = time.thread_time()
        tree = Tree(server.iserver, index)
        count = await tree.update(snapshot(0), NOON_US)
        rows.append(("nodes and first values [s]", time.thread_time() - start, count))
        rows.append(("memory [MB]", memory_mb() - before_mb, ""))
        start = time.perf_counter()
        gc.collect()
        rows.append(("a full collection of garbage [s]", time.perf_counter() - start, ""))
        gc.freeze()
        start = time.perf_counter()
        gc.collect()
        rows.append(("the same, nodes frozen [s]", time.perf_counter() - start, ""))
        rows.append(("update, all estimates [s]", *await updates(tree, 1)))
        same = snapshot(ROUNDS)
        await tree.update(same, NOON_US)
        start = time.thread_time()
        count = await tree.update(same, NOON_US)
        rows.append(("update, nothing has changed [s]", time.thread_time() - start, count))
        url = f"opc.tcp://127.0.0.1:{own_port()}/"
        server.set_endpoint(url)
        await server.start()
        ready, done, seen = threading.Event(), threading.Event(), [0]
        client = threading.Thread(target=listen, args=(url, ready, done, seen))
        client.start()
        while not ready.is_set():
            await asyncio.sleep(0.1)
        start = time.thread_time()
        found, count = await updates(tree, 100)
        rows.append(("update, all estimates, a client listens to them [s]", found, count))
        rows.append(("the same with what is sent [s]", (time.thread_time() - start) / ROUNDS, seen[0]))
        done.set()
        while client.is_alive():
            await asyncio.sleep(0.1)
        await server.stop()
        return rows

    rows = asyncio.run(measure())
    gc.unfreeze()
    say(f"OPC UA, {AXES} axes with {PARAMETERS} parameters", ("", "found", "values"), rows)
