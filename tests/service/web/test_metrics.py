"""/metrics: the golden file, promtool's opinion, what is absent or infinite, and what a real Prometheus makes of it."""

import json
import math
import re
import subprocess
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from prometheus_client.openmetrics import parser as openmetrics
from prometheus_client.parser import text_string_to_metric_families

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmEvent, AlarmRules, AlarmState
from service.pipeline.persistence.alarm_recording import AlarmsSnapshot, as_recorded
from service.store.alarm_entries import AlarmEntry
from service.store.alarm_transitions import Note
from service.web.app_state import VERSION
from service.web.metrics import Metrics
from tests import golden
from tests.conftest import ROOT
from tests.end_to_end.processes import PATIENCE_S, wait_for
from tests.ports import own_port
from tests.service.web.conftest import Stage, serving, with_status

SHIPPED = ROOT / "config" / "prometheus"
GOLDEN = Path(__file__).with_name("metrics.golden")
OPENMETRICS = "application/openmetrics-text; version=1.0.0"


def scrape(client: TestClient, accept: str = "text/plain") -> str:
    answer = client.get("/metrics", headers={"Accept": accept})
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith(accept.split(";")[0])
    return answer.text


def own(stage: Stage) -> str:
    """The metrics without those of the process."""
    text, _ = Metrics(lambda: stage.snapshot, lambda: stage.now_us, lambda: stage.links).scrape("")
    return text.decode().split("# HELP process_")[0]


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


def test_alarms_are_counted_by_state_and_priority_and_hidden_ones_are_marked(stage: Stage, fm_alarm: Alarm) -> None:
    def entry(parameter: str, rules: AlarmRules) -> AlarmEntry:
        return AlarmEntry("demo.axis1", "1", 1.0, replace(fm_alarm, parameter=parameter, past=()), rules)

    stage.journal.record([entry("fm", AlarmRules("high")), entry("kT", AlarmRules("low", suppressed=True))])
    waiting = as_recorded(entry("1/Ja", AlarmRules("high")), recorded=False)
    journal = stage.journal
    alarms = AlarmsSnapshot(tuple(journal.standing()), (waiting,), 3, tuple(journal.state_counts()))
    stage.snapshot = replace(stage.snapshot, alarms=alarms)
    found = values(own(stage))
    assert found["axiswatch_alarms", "high", "unacknowledged"] == 2
    assert found["axiswatch_alarms", "low", "suppressed"] == 1
    assert sum(count for (name, *_), count in found.items() if name == "axiswatch_alarms") == 3
    hidden = {labels[-1] for labels, value in found.items() if labels[0] == "axiswatch_alarm_hidden" and value}
    assert hidden == {"kT"}
    assert found[("axiswatch_alarms_not_recorded",)] == 3
    assert found["axiswatch_alarm_active", "demo.axis1", "up", "kT"] == 0
    # A latched alarm is active, and one whose off-delay is not over, though the monitor has none.
    for state in (AlarmState.LATCHED, AlarmState.ACKNOWLEDGED):
        lasting = replace(alarms.standing[1], state=state, returns_to=None, ended_us=stage.snapshot.taken_us)
        stage.snapshot = replace(stage.snapshot, alarms=alarms._replace(standing=(lasting,)))
        assert values(own(stage))["axiswatch_alarm_active", "demo.axis1", "up", "kT"] == 1
    # A shelf that is over hides nothing, though its end cannot be recorded.
    noon_us = stage.snapshot.taken_us
    journal.act(1, AlarmEvent.SHELVE, Note(noon_us - 9, "anna"), noon_us)
    alarms = alarms._replace(standing=tuple(journal.standing()))
    for later_us, is_hidden in ((-1, 1.0), (0, 0.0)):
        stage.snapshot = replace(stage.snapshot, alarms=alarms, taken_us=noon_us + later_us)
        assert values(own(stage))["axiswatch_alarm_hidden", "demo.axis1", "up", "fm"] == is_hidden


@pytest.mark.prometheus
def test_promtool_has_nothing_to_say(client: TestClient, need: Callable[[str], str]) -> None:
    command = [need("promtool"), "check", "metrics"]

    def checked(text: str) -> tuple[int, str]:
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
        return done.returncode, done.stdout + done.stderr

    assert checked(scrape(client)) == (0, "")
    assert "help" in checked("x_ms 1\n")[1]  # it would say something


def test_a_scrape_has_the_metrics_of_the_process_in_the_format_that_is_asked_for(client: TestClient) -> None:
    assert values(scrape(client))[("process_resident_memory_bytes",)] > 1e6
    assert scrape(client, OPENMETRICS).endswith("# EOF\n")


def test_both_formats_say_the_same(client: TestClient) -> None:
    """Read by the parsers of prometheus_client, of which that of OpenMetrics is strict."""

    def without_process(found: dict[tuple[str, ...], float]) -> dict[tuple[str, ...], float]:
        return {key: value for key, value in found.items() if not key[0].startswith("process_")}

    text = scrape(client, OPENMETRICS)
    other = {
        (sample.name, *(value for _, value in sorted(sample.labels.items()))): sample.value
        for family in openmetrics.text_string_to_metric_families(text)  # type: ignore[no-untyped-call]
        for sample in family.samples
    }
    assert without_process(other) == without_process(values(scrape(client)))
    assert len(other) > 150
    assert "# TYPE axiswatch_samples counter\naxiswatch_samples_total{" in text


def test_numbers_are_read_as_they_are(stage: Stage) -> None:
    """With all digits; what is not finite as both formats want it."""
    axis, numbers = (
        stage.snapshot.axes[0],
        (0.0, -0.25, 1 / 3, 1e-7, 999_999.5, 1e6, 1.27530e8, 1.5e300, -3e7),
    )
    for value, text in (
        *zip(numbers, repeat(None)),
        (math.inf, "+Inf"),
        (-math.inf, "-Inf"),
        (math.nan, "NaN"),
    ):
        kT, *others = axis.status.parameters
        status = replace(axis.status, parameters=(replace(kT, estimate=value), *others))
        stage.snapshot = replace(stage.snapshot, axes=(replace(axis, status=status),))
        (line,) = re.findall(r'^axiswatch_parameter_estimate{.*parameter="kT"} (.*)$', own(stage), re.M)
        assert line == text if text else float(line) == value


def test_what_is_kept_of_a_snapshot_follows_axes_and_numbers(stage: Stage) -> None:
    metrics = Metrics(lambda: stage.snapshot, lambda: stage.now_us, lambda: stage.links)
    axis = stage.snapshot.axes[0]
    other = replace(axis, causes=(*axis.causes, "load"))  # of an epoch with another detector
    for axes in (
        (axis,),
        (other,),
        (replace(axis, id="100 %s"), axis),
        (replace(axis, id="a"),),
        (),
        (axis,),
    ):
        for variance in (1.0, 1.0, 2.0):
            status = replace(axis.status, innovation_variance=variance)
            stage.snapshot = replace(stage.snapshot, axes=tuple(replace(a, status=status) for a in axes))
            kept, _ = metrics.scrape("")
            assert kept.decode().split("# HELP process_")[0] == own(stage)


def test_the_ages_grow_while_the_worker_hangs(stage: Stage) -> None:
    """The rest is written once for each snapshot."""
    metrics = Metrics(lambda: stage.snapshot, lambda: stage.now_us)

    def found(name: str, *labels: str) -> float:
        return values(metrics.scrape("")[0].decode())[name, *labels]

    assert found("axiswatch_snapshot_age_seconds") == 0.25
    stage.now_us += 20_000_000
    assert found("axiswatch_snapshot_age_seconds") == 20.25
    assert found("axiswatch_last_sample_age_seconds", "demo.axis1") == 20.65
    with_status(stage, innovation_variance=7.0)
    assert found("axiswatch_innovation_variance", "demo.axis1") == 7.0


def test_no_checkpoint_has_no_age_and_names_are_escaped(stage: Stage) -> None:
    assert values(own(stage))[("axiswatch_checkpoint_age_seconds",)] == 30.25
    stage.snapshot = replace(stage.snapshot, checkpoint_us=None)
    assert ("axiswatch_checkpoint_age_seconds",) not in values(own(stage))
    name = 'a"b\\c\nd'
    stage.snapshot = replace(stage.snapshot, axes=(replace(stage.snapshot.axes[0], id=name),))
    assert ("axiswatch_samples_total", name) in values(own(stage))


# --- a real Prometheus ------------------------------------------------------------------------------------------------


@contextmanager
def prometheus(program: str, target: str, folder: Path) -> Iterator[str]:
    """Prometheus on the shipped configuration, scraping this target; its address."""
    config = (SHIPPED / "prometheus.yml").read_text(encoding="utf-8")
    assert "localhost:8080" in config
    assert "scrape_interval: 5s" in config
    config = config.replace("localhost:8080", target).replace("scrape_interval: 5s", "scrape_interval: 1s")
    config = config.replace("scrape_timeout: 4s", "scrape_timeout: 1s")
    (folder / "prometheus.yml").write_text(config, encoding="utf-8")
    (folder / "alerts.yml").write_bytes((SHIPPED / "alerts.yml").read_bytes())
    address = f"127.0.0.1:{own_port()}"
    with (folder / "prometheus.log").open("wb") as log:
        process = subprocess.Popen(
            [
                program,
                f"--config.file={folder / 'prometheus.yml'}",
                f"--storage.tsdb.path={folder / 'tsdb'}",
                f"--web.listen-address={address}",
            ],
            stdout=log,
            stderr=log,
        )
    try:
        yield f"http://{address}"
    finally:
        process.kill()
        process.wait()


def asked(address: str, expression: str) -> dict[tuple[str, ...], float]:
    """The answer of Prometheus, by axis and parameter; empty while there is none."""
    url = f"{address}/api/v1/query?{urllib.parse.urlencode({'query': expression})}"
    try:
        with urllib.request.urlopen(url, timeout=PATIENCE_S) as answer:
            found: list[dict[str, Any]] = json.loads(answer.read())["data"]["result"]
    except (urllib.error.URLError, ConnectionError):
        return {}
    return {
        (row["metric"].get("axis", ""), row["metric"].get("parameter", "")): float(row["value"][1]) for row in found
    }


@pytest.mark.prometheus
def test_prometheus_has_the_estimates_of_the_api(stage: Stage, tmp_path: Path, need: Callable[[str], str]) -> None:
    with (
        serving(stage) as url,
        prometheus(need("prometheus"), url.removeprefix("http://"), tmp_path) as address,
    ):
        scraped = wait_for(lambda: asked(address, "axiswatch_parameter_estimate"))
        alive = asked(address, "up")
    axes = stage.snapshot.axes
    assert scraped == {(axis.id, p.name): p.estimate for axis in axes for p in axis.status.parameters}
    assert list(alive.values()) == [1.0]
