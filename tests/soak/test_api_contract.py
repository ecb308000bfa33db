"""Schemathesis against a running daemon: whatever it is asked, the answer is as the description of the API says."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from service.simulation.robot import SimulatedFault
from tests.conftest import ROOT
from tests.end_to_end.played_robot import played_robot
from tests.end_to_end.processes import Daemon, daemon, demo_config, robot, wait_for
from tests.service.command_line import axiswatch

pytestmark = pytest.mark.soak

EXAMPLES = int(os.environ.get("AXISWATCH_EXAMPLES", "400"))
"""Of each operation"""
ENVIRONMENT = ROOT / ".cache" / "schemathesis"
CONFIGURATION = Path(__file__).with_name("schemathesis.toml")
CHECKS = "status_code_conformance,content_type_conformance,response_schema_conformance,response_headers_conformance"
"""A fault of the server is a status that is described nowhere; 503 is, where a bus or the disk is not there."""


@pytest.fixture(scope="module")
def schemathesis() -> Path:
    """The program, in an environment of its own: nothing else here needs it."""
    program = ENVIRONMENT / "bin" / "schemathesis"
    if not program.exists():
        subprocess.run([sys.executable, "-m", "venv", "--clear", str(ENVIRONMENT)], check=True)
        lock = ROOT / "requirements-schemathesis.lock"
        pip = [ENVIRONMENT / "bin" / "pip", "install", "--quiet", "--require-hashes", "-r", lock]
        subprocess.run(list(map(str, pip)), check=True)
    return program


def asks(program: Path, d: Daemon, seed: int, words: Sequence[str] = ()) -> None:
    """Schemathesis finds nothing, and the daemon has taken every sample meanwhile."""
    arguments = ["--checks", CHECKS, "--max-examples", str(EXAMPLES), "--seed", str(seed), "--no-color"]
    command = [str(program), "--config-file", str(CONFIGURATION), "run", f"{d.page}openapi.json"]
    command += [*arguments, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ENVIRONMENT)
    assert done.returncode == 0, done.stdout[-20_000:] + done.stderr[-2_000:]
    print(done.stdout[-1500:])


def dropped(d: Daemon) -> dict[str, int]:
    """Frames that the daemon did not get, by reason; over this bus only its queue can be full."""
    (bus,) = d.get("api/v1/service")["buses"]
    return {reason: count for reason, count in bus["dropped"].items() if reason == "queue_full"}


def test_without_tokens(tmp_path: Path, schemathesis: Path, seed: int) -> None:
    config = demo_config(tmp_path)
    with daemon(config) as d, played_robot(config, 30, seed, SimulatedFault("demo.axis1", {"fm": 1.6}, 5.0)):
        wait_for(lambda: d.get("api/v1/alarms")["alarms"])
        asks(schemathesis, d, seed)
        assert dropped(d) == {"queue_full": 0}
        assert d.stop() == 0


@pytest.mark.parametrize("scope", ["read", "operate"])
def test_with_a_token(tmp_path: Path, schemathesis: Path, seed: int, scope: str) -> None:
    config = demo_config(tmp_path)
    made = axiswatch("token", "new", "anna", "--scope", scope, "--config", config)
    words = ["--header", f"Authorization: Bearer {made.stdout.strip()}"]
    with daemon(config) as d, robot(config):
        asks(schemathesis, d, seed, words)
        assert d.stop() == 0
