"""What config/ ships for Prometheus, Grafana, systemd and OpenModelica is accepted by those programs."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer
from pymoca import ast

from monitor_core.modeling.modelica.library import library
from monitor_core.modeling.modelica.parsing import Source, is_parameter, parse
from service.can.bus_reader import LONGEST_RETRY_S
from service.commands.command_line.exit_codes import MISTAKE
from service.commands.main import app
from service.web.server import GRACE_S
from tests.conftest import ROOT

CONFIG = ROOT / "config"
Need = Callable[[str], str]


def shown_metrics() -> dict[str, set[str]]:
    """The metrics and their labels, as /metrics has them."""
    golden = (ROOT / "tests" / "service" / "web" / "metrics.golden").read_text(encoding="utf-8")
    series = re.findall(r"^(axiswatch_\w+)(?:\{(.*)\})? ", golden, re.MULTILINE)
    return {name: set(re.findall(r'(\w+)="', labels)) for name, labels in series}


METRICS = shown_metrics()


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


PANELS: list[dict[str, Any]] = json.loads((CONFIG / "grafana" / "axiswatch.json").read_text(encoding="utf-8"))["panels"]
EXPRESSIONS = [target["expr"] for panel in PANELS for target in panel.get("targets", [])]
ALERTS = (CONFIG / "prometheus" / "alerts.yml").read_text(encoding="utf-8")


@pytest.mark.parametrize("text", [*EXPRESSIONS, ALERTS])
def test_dashboard_and_alerts_ask_for_metrics_that_exist(text: str) -> None:
    used = re.findall(r"(axiswatch_\w+)(?:\{([^}]*)\})?", text)
    assert used
    for metric, selector in used:
        assert set(re.findall(r"(\w+)=", selector)) <= METRICS[metric]
    if text is ALERTS:
        assert {"axiswatch_alarm_active", "axiswatch_limit_alarm_active"} <= dict(used).keys()


@pytest.mark.prometheus
def test_dashboard_expressions_are_promql(need: Need, tmp_path: Path) -> None:
    filled = [re.sub(r"\$\w+", "x", e.replace("$__rate_interval", "1m")) for e in EXPRESSIONS]
    rules = [{"record": f"panel:{number}", "expr": expression} for number, expression in enumerate(filled)]
    file = tmp_path / "rules.yml"
    groups = {"groups": [{"name": "dashboard", "rules": rules}]}
    file.write_text(json.dumps(groups), encoding="utf-8")  # JSON is YAML
    run(need("promtool"), "check", "rules", file)


def test_dashboard_panels_are_laid_out() -> None:
    assert len({panel["id"] for panel in PANELS}) == len(PANELS)
    taken: set[tuple[int, int]] = set()
    for panel in PANELS:
        place = panel["gridPos"]
        cells = {
            (x, y)
            for x in range(place["x"], place["x"] + place["w"])
            for y in range(place["y"], place["y"] + place["h"])
        }
        assert not cells & taken, panel["title"]
        assert place["x"] + place["w"] <= 24
        taken |= cells


UNIT = CONFIG / "systemd" / "axiswatch.service"


def unit_settings() -> dict[str, list[str]]:
    """The values of each setting of the unit, in their order."""
    found: dict[str, list[str]] = {}
    for name, value in re.findall(r"^(\w+)=(.*)$", UNIT.read_text(encoding="utf-8"), re.MULTILINE):
        found.setdefault(name, []).append(value)
    return found


def test_unit_lets_the_program_compile_and_see_the_bus() -> None:
    unit = unit_settings()
    assert unit.get("MemoryDenyWriteExecute", ["no"]) == ["no"]
    assert any(value.startswith("NUMBA_CACHE_DIR=%S/axiswatch/") for value in unit["Environment"])
    assert unit["StateDirectory"] == ["axiswatch"]
    assert "AF_CAN" in unit["RestrictAddressFamilies"][0].split()


def test_unit_and_program_agree() -> None:
    group: Any = typer.main.get_command(app)
    unit = unit_settings()
    (program, command, *words), *others = (line.split() for line in unit["ExecStart"])
    assert (Path(program).name, command, others) == ("axiswatch", "run", [])
    given = group.get_command(None, "run").make_context("run", words).params
    assert given["config"] == Path("/etc/axiswatch/axiswatch.toml")
    assert (unit["Type"], unit["Restart"]) == (["notify"], ["on-failure"])
    # This holds for the main process alone: after a mistake that another command finds, systemd starts again.
    assert unit["RestartPreventExitStatus"] == [str(MISTAKE)]
    assert "ExecStartPre" not in unit
    # An adapter may come up, or a disk get space, after any number of tries.
    assert unit["StartLimitIntervalSec"] == ["0"]
    assert unit["ExecReload"] == ["/bin/kill -HUP $MAINPID"]
    assert float(unit["TimeoutStopSec"][0]) > 4 * GRACE_S
    assert float(unit["WatchdogSec"][0]) > 2 * LONGEST_RETRY_S


def test_systemd_takes_the_unit_and_finds_it_hardened(need: Need, tmp_path: Path) -> None:
    analyze = need("systemd-analyze")
    unit = tmp_path / UNIT.name
    # The program must be there for systemd to take the unit.
    unit.write_text(re.sub(r"/opt/axiswatch/bin/axiswatch", "/bin/true", UNIT.read_text(encoding="utf-8")))
    checked = subprocess.run([analyze, "verify", unit], capture_output=True, text=True, check=False)
    assert (checked.returncode, unit.name in checked.stderr) == (0, False), checked.stderr
    run(analyze, "security", "--offline=true", "--threshold=20", unit)  # an exposure of 2.0


def test_image_keeps_its_compiled_kernel_where_no_volume_hides_it() -> None:
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    cache = next(word.split("=")[1] for word in " ".join(lines).split() if "NUMBA_CACHE_DIR=" in word)
    volumes = [line.split()[1] for line in lines if line.startswith("VOLUME")]
    assert volumes == ["/var/lib/axiswatch"]
    assert not Path(cache).is_relative_to(volumes[0])
    (made,) = (i for i, line in enumerate(lines) if f"-o axiswatch -g axiswatch {volumes[0]} {cache}" in line)
    assert made < lines.index("USER axiswatch") < lines.index("RUN axiswatch warm")


def components(package: ast.Class) -> dict[str, dict[str, tuple[list[str], str]]]:
    """Parameters and connectors of every class of a package, with their types."""
    return {
        name: {c.name: (c.prefixes, str(c.type)) for c in model.symbols.values()}
        for name, model in package.classes.items()
    }


def test_openmodelica_gets_the_components_that_the_program_knows() -> None:
    file = CONFIG / "modelica" / "AxisWatch.mo"
    text = file.read_text(encoding="utf-8")
    (package,) = parse(Source(file.name, text)).classes.values()
    shipped, known = components(package), components(library().classes["AxisWatch"])
    del shipped["CoulombFriction"]["w"]  # a variable of its own
    assert shipped == known
    # As tests/core/modeling/test_components.py has them of the program's components.
    assert re.findall(r"^    ([a-z.]+ = .+;)$", text, re.MULTILINE) == [
        "w = der(flange.phi);",
        "flange.tau = fc * tanh(w / speed_scale);",
        "flange.tau = gc * cos(flange.phi) + gs * sin(flange.phi);",
        "flange.tau = -tau0;",
    ]


PLACEMENT = re.compile(
    r"transformation\((?:origin = \{(?P<ox>-?\d+), (?P<oy>-?\d+)\}, )?"
    r"extent = \{\{(?P<x1>-?\d+), (?P<y1>-?\d+)\}, \{(?P<x2>-?\d+), (?P<y2>-?\d+)\}\}"
)
Box = tuple[int, int, int, int]


def boxes(text: str) -> list[Box]:
    """Left, bottom, right and top of each component of a drawing; the rotated ones are square."""
    found = [{k: int(v or 0) for k, v in m.groupdict().items()} for m in PLACEMENT.finditer(text)]
    return [(b["ox"] + b["x1"], b["oy"] + b["y1"], b["ox"] + b["x2"], b["oy"] + b["y2"]) for b in found]


@pytest.mark.parametrize("file", sorted((CONFIG / "drives").glob("*.mo")), ids=lambda file: file.stem)
def test_drawings_open_well_in_openmodelica(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    (model,) = parse(Source(file.name, text)).classes.values()
    placed = boxes(text)
    assert len(placed) == len([s for s in model.symbols.values() if not is_parameter(s)])
    assert not [(a, b) for i, a in enumerate(placed) for b in placed[:i] if overlap(a, b)]
    extent = re.search(r"Diagram\(coordinateSystem\(extent = \{\{(.*?), (.*?)\}, \{(.*?), (.*?)\}\}", text)
    assert extent
    left, bottom, right, top = map(int, extent.groups())
    assert all(b[0] >= left and b[1] >= bottom and b[2] <= right and b[3] <= top for b in placed)
    lines = re.findall(r"connect\(.*\)\n    annotation\(Line\(points = \{(.*)\}[,)]", text)
    assert len(lines) == text.count("connect(")
    for points in lines:
        ends = [tuple(map(int, p.split(", "))) for p in re.findall(r"\{(-?\d+, -?\d+)\}", points)]
        assert touches(ends[0], placed), points
        assert touches(ends[-1], placed), points


def overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def touches(point: tuple[int, ...], placed: list[Box]) -> bool:
    """Within two units of a component, as connectors stand out a little."""
    x, y = point
    return any(b[0] - 2 <= x <= b[2] + 2 and b[1] - 2 <= y <= b[3] + 2 for b in placed)
