"""/metrics: the golden file, promtool's opinion, and what is absent or infinite."""

import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import pytest
from fastapi.testclient import TestClient
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.parser import text_string_to_metric_families

from service.pipeline.snapshot import Snapshot
from service.web.app_state import VERSION
from service.web.metrics import SnapshotCollector
from tests import golden

GOLDEN = Path(__file__).with_name("metrics.golden")
OPENMETRICS = "application/openmetrics-text; version=1.0.0"


class Stage(Protocol):
    snapshot: Snapshot
    now_us: int


def scrape(client: TestClient, accept: str = "text/plain") -> str:
    answer = client.get("/metrics", headers={"Accept": accept})
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith(accept.split(";")[0])
    return answer.text


def own(stage: Stage) -> str:
    """The metrics without those of the process."""
    registry = CollectorRegistry()
    registry.register(SnapshotCollector(lambda: stage.snapshot, lambda: stage.now_us))
    return generate_latest(registry).decode()


def values(text: str) -> dict[tuple[str, ...], float]:
    """By name and label values, in the order of the labels' names."""
    return {
        (sample.name, *(value for _, value in sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_metrics_are_as_in_the_golden_file(stage: Stage) -> None:
    text = own(stage).replace(f'{{version="{VERSION}"}}', '{version="VERSION"}')
    golden.check(text, GOLDEN)


def test_a_forecast_is_no_alarm_of_a_change(stage: Stage) -> None:
    """It has a metric of its own."""
    axis = stage.snapshot.axes[0]
    (limit,) = axis.trends[2].reaches
    (fm,) = axis.open_alarms
    for forecast in (False, True):
        e = replace(fm, kind="forecast", reaches=(limit,)) if forecast else fm
        axes = (replace(axis, open_alarms=(e,)), *stage.snapshot.axes[1:])
        stage.snapshot = replace(stage.snapshot, axes=axes)
        found = values(own(stage))
        assert found["axiswatch_alarm_active", "demo.axis1", "up", "fm"] == float(not forecast)
        assert found["axiswatch_limit_alarm_active", "demo.axis1", "upper", "fm"] == float(forecast)


@pytest.mark.prometheus
def test_promtool_has_nothing_to_say(client: TestClient, need: Callable[[str], str]) -> None:
    text = scrape(client)
    done = subprocess.run(
        [need("promtool"), "check", "metrics"], input=text, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


@pytest.mark.prometheus
def test_promtool_would_have_said_something(need: Callable[[str], str]) -> None:
    done = subprocess.run(
        [need("promtool"), "check", "metrics"], input="x_ms 1\n", capture_output=True, text=True, check=False
    )
    assert "help" in done.stdout + done.stderr


def test_openmetrics_where_it_is_asked_for(client: TestClient) -> None:
    assert scrape(client, OPENMETRICS).endswith("# EOF\n")


def test_process_metrics_are_there(client: TestClient) -> None:
    found = values(scrape(client))
    assert found[("process_resident_memory_bytes",)] > 1e6


def test_an_axis_without_samples_is_infinitely_old(stage: Stage) -> None:
    found = values(own(stage))
    assert found[("axiswatch_last_sample_age_seconds", "demo.axis2")] == float("inf")
    stage.now_us += 2_000_000
    assert values(own(stage))[("axiswatch_last_sample_age_seconds", "demo.axis1")] == 2.65


def test_a_checkpoint_that_never_was_has_no_age(stage: Stage) -> None:
    assert values(own(stage))[("axiswatch_checkpoint_age_seconds",)] == 30.25
    stage.snapshot = replace(stage.snapshot, checkpoint_us=None)
    assert ("axiswatch_checkpoint_age_seconds",) not in values(own(stage))


def test_alarms_are_active_by_direction(stage: Stage) -> None:
    found = values(own(stage))
    active = {key[1:] for key, value in found.items() if key[0] == "axiswatch_alarm_active" and value == 1}
    assert active == {("demo.axis1", "up", "fm")}
    assert found[("axiswatch_alarm_active", "demo.axis1", "down", "fm")] == 0


def test_reasons_count_from_zero(stage: Stage) -> None:
    found = values(own(stage))
    assert found[("axiswatch_frames_dropped_total", "can0", "queue_full")] == 12
    assert found[("axiswatch_frames_dropped_total", "can1", "socket")] == 0
    assert found[("axiswatch_values_dropped_total", "demo.axis2", "late")] == 0
    assert found[("axiswatch_clock_restarts_total", "demo.axis1", "clock_reanchored")] == 3


def test_names_that_need_escaping_come_back(stage: Stage) -> None:
    name = 'a"b\\c\nd'
    stage.snapshot = replace(stage.snapshot, axes=(replace(stage.snapshot.axes[0], id=name),))
    assert ("axiswatch_samples_total", name) in values(own(stage))


def test_the_histogram_counts_up(stage: Stage) -> None:
    found = values(own(stage))
    buckets = [found[("axiswatch_processing_seconds_bucket", le)] for le in ("0.001", "0.01", "0.1", "+Inf")]
    assert buckets == [100, 120, 123, 124]
    assert found[("axiswatch_processing_seconds_count",)] == 124
    assert found[("axiswatch_processing_seconds_sum",)] == 1.25
