"""A real Prometheus scrapes the daemon with the configuration that is shipped."""

import json
import socket
import subprocess
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.end_to_end.processes import ROOT, daemon, demo_config, robot, wait_for

SHIPPED = ROOT / "config" / "prometheus"


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


@contextmanager
def prometheus(program: str, target: str, folder: Path) -> Iterator[str]:
    """Prometheus on the shipped configuration, scraping this target; its address."""
    config = (SHIPPED / "prometheus.yml").read_text(encoding="utf-8")
    assert "localhost:8080" in config
    (folder / "prometheus.yml").write_text(config.replace("localhost:8080", target), encoding="utf-8")
    (folder / "alerts.yml").write_bytes((SHIPPED / "alerts.yml").read_bytes())
    address = f"127.0.0.1:{free_port()}"
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
        with urllib.request.urlopen(url, timeout=20) as answer:
            found: list[dict[str, Any]] = json.loads(answer.read())["data"]["result"]
    except (urllib.error.URLError, ConnectionError):
        return {}
    return {
        (row["metric"].get("axis", ""), row["metric"].get("parameter", "")): float(row["value"][1])
        for row in found
    }


@pytest.mark.prometheus
def test_prometheus_has_the_estimates_of_the_api(tmp_path: Path, need: Callable[[str], str]) -> None:
    program = need("prometheus")
    config = demo_config(tmp_path, axes=1)
    with daemon(config) as d:
        with robot(config):
            wait_for(lambda: d.axis()["counters"]["used"] > 100)
        target = d.page.removeprefix("http://").rstrip("/")
        with prometheus(program, target, tmp_path) as address:
            scraped = wait_for(lambda: asked(address, "axiswatch_parameter_estimate"))
            alive = asked(address, "up")
        shown = {p["name"]: p["estimate"] for p in d.axis()["parameters"]}
    assert scraped == {("demo.axis1", name): estimate for name, estimate in shown.items()}
    assert list(alive.values()) == [1.0]
