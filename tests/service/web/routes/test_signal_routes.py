"""The last seconds of an axis over the API: what the worker has kept, in columns."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from monitor_core.samples import SampleBlock
from service.pipeline.axes.live_signals import LENGTH_S, PATIENCE_S, LiveSignals
from service.texts.instants import iso
from tests.service.web.conftest import NOON_US, Stage, with_axis
from tests.service.web.watched_drives import reference, traced

SIGNALS = "/api/v1/axes/demo.axis1/signals"
INTERVAL_US = 5000


class Worker:
    """Adds blocks as the worker does, by a clock that the test moves."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.live = LiveSignals(lambda: self.now_s)

    def add(self, axis: str, first: int, count: int, begin_us: int = NOON_US) -> bool:
        """Samples from this number on; whether anything was to be written down."""
        observer = self.live.observer()
        if observer is not None:
            k = np.arange(first, first + count, dtype=np.int64)
            x = k.astype(np.float64)
            block = SampleBlock(begin_us + INTERVAL_US * k, 0.5 * x, x)
            yhat, eps = x - 0.25, np.where(k % 2 == 0, 0.25, np.nan)
            observer(axis, block, traced(eps, yhat))
        return observer is not None


@pytest.fixture
def worker(stage: Stage) -> Worker:
    worker = Worker()
    stage.live = worker.live
    return worker


def columns(answer: Any) -> Sequence[Sequence[float]]:
    return [answer[name] for name in ("torque", "measured", "predicted", "error")]


def test_nothing_is_kept_until_somebody_looks_nor_after_that(worker: Worker) -> None:
    assert not worker.add("demo.axis1", 0, 10)
    assert worker.live.look("demo.axis1") == ()
    assert worker.add("demo.axis1", 10, 10)
    assert worker.add("demo.axis2", 10, 10)
    assert [len(block.t_us) for block in worker.live.look("demo.axis1")] == [10]
    assert worker.live.look("demo.axis2") == ()  # nobody has looked at it before
    worker.now_s = PATIENCE_S + 0.1
    assert not worker.add("demo.axis1", 20, 10)
    assert worker.live.look("demo.axis1") == ()


def test_samples_are_columns_and_those_that_follow_are_asked_for_alone(worker: Worker, client: TestClient) -> None:
    nothing = client.get(SIGNALS).json()
    assert (nothing["begin"], nothing["end"], nothing["time_s"], nothing["torque"]) == (None, None, [], [])
    worker.add("demo.axis1", 0, 2)
    worker.add("demo.axis1", 2, 2)
    answer = client.get(SIGNALS).json()
    assert (answer["axis"], answer["unit"], answer["outlier_limit"]) == ("demo.axis1", "rad", None)
    assert (answer["begin"], answer["end"]) == (iso(NOON_US), iso(NOON_US + 3 * INTERVAL_US))
    assert answer["time_s"] == pytest.approx([0, 0.005, 0.01, 0.015])
    torque, measured, predicted, error = columns(answer)
    assert (torque, measured) == ([0, 0.5, 1, 1.5], [0, 1, 2, 3])
    assert (predicted, error) == ([-0.25, 0.75, 1.75, 2.75], [0.25] * 4)
    assert answer["learned"] == [True, False, True, False]
    worker.add("demo.axis1", 4, 1)
    more = client.get(SIGNALS, params={"since": answer["end"]}).json()
    assert (more["begin"], more["time_s"], more["measured"]) == (iso(NOON_US + 4 * INTERVAL_US), [0], [4])
    assert client.get(SIGNALS, params={"since": more["end"]}).json()["time_s"] == []


def test_only_the_last_seconds_are_kept_and_none_after_the_clock_was_set_back(
    worker: Worker, client: TestClient
) -> None:
    client.get(SIGNALS)
    for first in range(0, 4000, 20):
        worker.add("demo.axis1", first, 20)
        worker.live.look("demo.axis1")
    kept = client.get(SIGNALS).json()
    assert LENGTH_S <= kept["time_s"][-1] <= LENGTH_S + 0.1
    assert kept["measured"][-1] == 3999
    worker.add("demo.axis1", 0, 3, begin_us=NOON_US - 60_000_000)
    answer = client.get(SIGNALS, params={"since": kept["end"]}).json()
    assert answer["begin"] == iso(NOON_US - 60_000_000)
    assert answer["measured"] == [0, 1, 2]


def test_what_is_no_number_is_null_and_an_angle_keeps_its_digits(worker: Worker, client: TestClient) -> None:
    worker.live.look("demo.axis1")
    observer = worker.live.observer()
    assert observer is not None
    t_us, y, yhat = (
        np.array([NOON_US, NOON_US + INTERVAL_US]),
        np.array([1234.56789, 1.0]),
        np.array([1234.56788, np.nan]),
    )
    observer("demo.axis1", SampleBlock(t_us, y, y), traced(y - yhat, yhat))
    answer = client.get(SIGNALS).json()
    assert (answer["measured"], answer["predicted"]) == ([1234.56789, 1.0], [1234.56788, None])
    assert answer["error"] == [pytest.approx(1e-5, rel=1e-3), None]
    assert answer["learned"] == [True, False]


@pytest.mark.parametrize("lam0", [1e-12, 1.0])
def test_the_limit_of_outliers_is_that_of_the_settings(client: TestClient, stage: Stage, lam0: float) -> None:
    """At least that of the variance of the healthy axis."""
    with_axis(stage, watched=reference(lam=0.995, lam0=lam0, outlier_limit=6.0))
    limit = client.get(SIGNALS).json()["outlier_limit"]
    variance = stage.snapshot.axes[0].status.innovation_variance
    assert limit == pytest.approx(6 * max(variance, lam0) ** 0.5)


def test_an_unknown_axis_is_refused_and_not_looked_at(worker: Worker, client: TestClient) -> None:
    answer = client.get("/api/v1/axes/demo.axis9/signals")
    assert (answer.status_code, answer.json()["known"]) == (404, ["demo.axis1", "demo.axis2"])
    assert worker.live.observer() is None
