"""The history of an axis by REST: columns for plots, files, few readers, and errors that are described."""

import csv
import io
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from itertools import islice
from typing import Any

import httpx
import pyarrow.parquet as pq
import pytest
from fastapi.testclient import TestClient

from service.pipeline.persistence.history_recording import HistoryRecording
from service.store.history_rows import QUANTITIES
from service.texts.instants import iso
from service.web.routes.history_routes import MOST_READERS, MOST_WAITING
from tests.end_to_end.processes import PATIENCE_S
from tests.service.web.conftest import HISTORY_TIMES, Stage, point_values, serving

HISTORY = "/api/v1/axes/demo.axis1/history"


def test_points_come_in_columns_with_a_row_for_the_gap(client: TestClient) -> None:
    body = client.get(HISTORY).json()
    assert (body["axis"], body["resolution"], body["step_s"], body["next"]) == ("demo.axis1", "raw", 10, None)
    gap_at = HISTORY_TIMES[89] + 10
    expected = [*HISTORY_TIMES[:90], gap_at, *HISTORY_TIMES[90:]]
    assert body["time"] == [iso(t * 1_000_000) for t in expected]
    assert body["time"][-1] == "2026-03-01T12:00:00.000000Z"
    kT, Ja, fm = body["parameters"]
    assert (kT["name"], Ja["unit"], fm["nominal"]) == ("kT", "1/(kg m^2)", 0.06)
    assert fm["n"] == [1] * 90 + [0] + [1] * 10
    for q, name in enumerate(QUANTITIES):
        numbers: list[float | None] = [point_values(k)[q] for k in range(100)]
        numbers.insert(90, None)
        for column in ("mean", "min", "max"):
            assert fm[name][column] == [None if v is None else pytest.approx(v, rel=1e-6) for v in numbers]
    units = {fm[name]["unit"] for name in ("cusum_up", "cusum_down", "threshold")}
    assert units == {"N m s/rad samples"}
    assert {fm[name]["unit"] for name in ("estimate", "deviation", "standard_deviation")} == {"N m s/rad"}
    assert fm["observability"]["unit"] == "1"


def test_fewer_points_are_means_of_longer_rows(client: TestClient) -> None:
    body = client.get(f"{HISTORY}?parameter=fm&points=10&since=2026-03-01T11:00:00Z").json()
    assert body["step_s"] == 180
    (fm,) = body["parameters"]
    assert sum(fm["n"]) == 100
    assert len(body["time"]) <= 10
    first = [k for k, t in enumerate(HISTORY_TIMES) if t // 180 == HISTORY_TIMES[0] // 180]
    assert fm["n"][0] == len(first)
    ups = fm["cusum_up"]
    assert (ups["min"][0], ups["max"][0]) == (first[0], first[-1])
    assert ups["mean"][0] == pytest.approx(sum(first) / len(first))


def test_rows_as_they_are_stored_go_on_at_next(client: TestClient) -> None:
    path, found = f"{HISTORY}?resolution=raw&points=30&until=2026-03-01T12:00:00Z", list[str]()
    body = client.get(path).json()
    while True:
        found += body["time"]
        if body["next"] is None:
            break
        body = client.get(f"{path}&since={body['next']}").json()
    known = [iso(t * 1_000_000) for t in HISTORY_TIMES[:-1]]
    assert sorted(set(found)) == sorted({*known, iso((HISTORY_TIMES[89] + 10) * 1_000_000)})
    hours = client.get(f"{HISTORY}?resolution=hour").json()
    assert hours["step_s"] == 3600
    assert sum(hours["parameters"][0]["n"]) == 100


def test_an_axis_without_points_has_its_parameters_and_no_rows(client: TestClient) -> None:
    body = client.get("/api/v1/axes/demo.axis2/history").json()
    assert body["time"] == []
    assert [(p["name"], p["n"]) for p in body["parameters"]] == [("kT", []), ("1/Ja", []), ("fm", [])]


@pytest.mark.parametrize("ending", ["", ".csv", ".parquet"])
def test_what_is_asked_wrongly_is_refused_with_the_reason(client: TestClient, ending: str) -> None:
    path = f"{HISTORY}{ending}"
    answer = client.get(f"{path}?since=2026-03-01T12:00:00Z&until=2026-03-01T11:00:00Z")
    assert (answer.status_code, answer.json()["detail"]) == (400, "since must be before until")
    assert client.get(f"{path}?parameter=kg").status_code == 404
    assert client.get(f"{path}?since=0.5").status_code == 422
    assert client.get(f"{path}?resolution=week").status_code == 422
    assert client.get(f"{path.replace('axis1', 'axis9')}").status_code == 404


def test_the_file_may_not_be_open_yet(stage: Stage) -> None:
    stage.history = None
    with stage.client() as client:
        for ending in ("", ".csv", ".parquet"):
            answer = client.get(f"{HISTORY}{ending}")
            assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")


def test_files_hold_the_same_numbers(client: TestClient) -> None:
    answer = client.get(f"{HISTORY}.csv?parameter=fm")
    assert answer.headers["content-type"].startswith("text/csv")
    assert "demo.axis1-history.csv" in answer.headers["content-disposition"]
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert [row["time"] for row in rows] == [iso(t * 1_000_000) for t in HISTORY_TIMES]
    assert {(row["parameter"], row["unit"], row["n"]) for row in rows} == {("fm", "N m s/rad", "1")}
    assert [float(row["estimate_mean"]) for row in rows] == pytest.approx(
        [point_values(k)[0] for k in range(100)], rel=1e-7
    )
    answer = client.get(f"{HISTORY}.parquet?resolution=minute")
    assert answer.headers["content-type"] == "application/vnd.apache.parquet"
    table = pq.read_table(io.BytesIO(answer.content))
    columns: dict[str, list[Any]] = table.to_pydict()
    assert sum(columns["n"]) == 300
    assert max(columns["cusum_up_max"]) == 99
    assert list(columns)[:4] == ["time", "parameter", "unit", "n"]


# --- readers are few ----------------------------------------------------------------------------------------


@contextmanager
def held(history: HistoryRecording) -> Iterator[tuple[threading.Event, list[int]]]:
    """Until the event is set nobody has read; how many have read at the same time."""
    go, lock, now, most = threading.Event(), threading.Lock(), [0], [0]
    store = history.store
    assert store is not None
    read = store.read

    @contextmanager
    def slow() -> Iterator[object]:
        with lock:
            now[0] += 1
            most[0] = max(most[0], now[0])
        assert go.wait(PATIENCE_S)
        with read() as view:
            yield view
        with lock:
            now[0] -= 1

    store.read = slow  # type: ignore[method-assign,assignment]
    try:
        yield go, most
    finally:
        go.set()


def test_readers_are_few_and_leave_the_others_alone(stage: Stage, history: HistoryRecording) -> None:
    """Others than these, and those that may wait, are asked to come again; the daemon answers all the rest."""
    room, more = MOST_READERS + MOST_WAITING, 4

    def ask(address: str) -> httpx.Response:
        return httpx.get(f"{address}{HISTORY}?points=5000", timeout=PATIENCE_S)

    with serving(stage) as address, held(history) as (go, most), ThreadPoolExecutor(room + more) as pool:
        asked = [pool.submit(ask, address) for _ in range(room + more)]
        refused = [future.result() for future in islice(as_completed(asked, PATIENCE_S), more)]
        assert [answer.status_code for answer in refused] == [503] * more
        assert {answer.headers["retry-after"] for answer in refused} == {"1"}
        assert httpx.get(f"{address}/healthz", timeout=PATIENCE_S).status_code == 200
        assert httpx.get(f"{address}/api/v1/axes", timeout=PATIENCE_S).status_code == 200
        go.set()
        statuses = sorted(future.result(PATIENCE_S).status_code for future in asked)
        assert statuses == [200] * room + [503] * more
        assert most == [MOST_READERS]
        assert ask(address).status_code == 200
