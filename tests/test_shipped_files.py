"""What config/ ships for Prometheus, Grafana and systemd is accepted by those programs."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent.parent
CONFIG = ROOT / "config"
DASHBOARD = CONFIG / "grafana" / "axiswatch.json"
Need = Callable[[str], str]

# The metrics and their labels, as /metrics has them.
METRICS = {
    "axiswatch_parameter_estimate": {"axis", "parameter"},
    "axiswatch_parameter_nominal": {"axis", "parameter"},
    "axiswatch_parameter_standard_deviation": {"axis", "parameter"},
    "axiswatch_parameter_p_diagonal": {"axis", "parameter"},
    "axiswatch_innovation_variance": {"axis"},
    "axiswatch_cusum": {"axis", "parameter", "direction"},
    "axiswatch_cusum_threshold": {"axis", "parameter"},
    "axiswatch_alarm_active": {"axis", "parameter", "direction"},
    "axiswatch_samples_total": {"axis"},
    "axiswatch_frames_total": {"bus"},
    "axiswatch_frames_dropped_total": {"bus", "reason"},
    "axiswatch_last_sample_age_seconds": {"axis"},
}


def run(*command: str | Path) -> None:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.prometheus
@pytest.mark.parametrize(
    "check",
    [
        ("check", "config", CONFIG / "prometheus" / "prometheus.yml"),
        ("check", "rules", CONFIG / "prometheus" / "alerts.yml"),
        ("test", "rules", ROOT / "tests" / "prometheus" / "alerts_test.yml"),
    ],
    ids=["config", "rules", "alerts fire when they should"],
)
def test_promtool_accepts(check: tuple[str | Path, ...], need: Need) -> None:
    run(need("promtool"), *check)


def expressions() -> list[tuple[str, str]]:
    panels = json.loads(DASHBOARD.read_text(encoding="utf-8"))["panels"]
    return [(panel["title"], target["expr"]) for panel in panels for target in panel.get("targets", [])]


@pytest.mark.parametrize(("title", "expression"), expressions())
def test_dashboard_asks_for_metrics_that_exist(title: str, expression: str) -> None:
    used = re.findall(r"(axiswatch_\w+)(?:\{([^}]*)\})?", expression)
    assert used, title
    for metric, selector in used:
        assert set(re.findall(r"(\w+)=", selector)) <= METRICS[metric]


@pytest.mark.prometheus
def test_dashboard_expressions_are_promql(need: Need, tmp_path: Path) -> None:
    filled = [
        re.sub(r"\$\w+", "x", expression.replace("$__rate_interval", "1m")) for _, expression in expressions()
    ]
    rules = [{"record": f"panel:{number}", "expr": expression} for number, expression in enumerate(filled)]
    file = tmp_path / "rules.yml"
    file.write_text(
        json.dumps({"groups": [{"name": "dashboard", "rules": rules}]}), encoding="utf-8"
    )  # JSON is YAML
    run(need("promtool"), "check", "rules", file)


def test_dashboard_panels_are_laid_out() -> None:
    panels: list[dict[str, Any]] = json.loads(DASHBOARD.read_text(encoding="utf-8"))["panels"]
    assert len({panel["id"] for panel in panels}) == len(panels)
    taken: set[tuple[int, int]] = set()
    for panel in panels:
        place = panel["gridPos"]
        cells = {
            (x, y)
            for x in range(place["x"], place["x"] + place["w"])
            for y in range(place["y"], place["y"] + place["h"])
        }
        assert not cells & taken, panel["title"]
        assert place["x"] + place["w"] <= 24
        taken |= cells


def test_unit_lets_the_program_compile_and_see_the_bus() -> None:
    unit = (CONFIG / "systemd" / "axiswatch.service").read_text(encoding="utf-8")
    assert not re.search(r"^MemoryDenyWriteExecute=(yes|true|on|1)", unit, re.MULTILINE)
    assert re.search(r"^Environment=NUMBA_CACHE_DIR=%S/axiswatch/", unit, re.MULTILINE)
    assert re.search(r"^StateDirectory=axiswatch$", unit, re.MULTILINE)
    assert re.search(r"^RestrictAddressFamilies=.*\bAF_CAN\b", unit, re.MULTILINE)


def test_image_keeps_its_compiled_kernel_where_no_volume_hides_it() -> None:
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    cache = next(
        word.split("=", 1)[1] for line in lines for word in line.split() if "NUMBA_CACHE_DIR=" in word
    )
    volumes = [line.split()[1] for line in lines if line.startswith("VOLUME")]
    assert volumes == ["/var/lib/axiswatch"]
    assert not Path(cache).is_relative_to(volumes[0])
    made = next(
        i for i, line in enumerate(lines) if f"-o axiswatch -g axiswatch {volumes[0]} {cache}" in line
    )
    assert made < lines.index("USER axiswatch") < lines.index("RUN axiswatch warm")
