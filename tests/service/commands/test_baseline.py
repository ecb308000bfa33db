"""`axiswatch baseline` and the REST interface against real monitors; the commands are those of docs/operation.md."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.testclient import TestClient
from structlog.testing import capture_logs

from service.config.epoch_values import from_files, with_epoch
from service.store.tokens import Scope, TokenFile
from service.web.access import Access
from tests import golden
from tests.conftest import ROOT
from tests.end_to_end.processes import PATIENCE_S
from tests.service.command_line import axiswatch, session, shown
from tests.service.found_files import nominal_text, thresholds_text
from tests.service.pipeline.running_core import AXIS, RunningCore, cell, changed_axis
from tests.service.web.api_schema import matches_schema
from tests.service.web.conftest import serving

SECTION = "### After the repair: a new baseline"


def console() -> list[list[str]]:
    """The commands of the section, as arguments."""
    text = (ROOT / "docs" / "operation.md").read_text(encoding="utf-8")
    section = text.split(SECTION)[1].split("\n## ")[0]
    blocks = re.findall(r"```console\n(.*?)```", section, re.S)
    return [shlex.split(line[2:]) for block in blocks for line in block.splitlines()]


@pytest.fixture
def core(tmp_path: Path, seed: int) -> Iterator[RunningCore]:
    """Twelve seconds after its start; alarm 1 is there."""
    core = RunningCore(tmp_path, cell(tmp_path, 2))
    core.feed(changed_axis(tmp_path, 12.0, seed))
    yield core
    core.close()


@pytest.fixture
def url(core: RunningCore, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    with capture_logs(), serving(core) as address:
        monkeypatch.setenv("AXISWATCH_URL", address)
        yield address


def write_files(core: RunningCore, folder: Path) -> None:
    """nominal.toml and thresholds.toml of another commissioning of the first axis."""
    axis = core.config.axes[0]
    nominal = nominal_text(axis.config, {"values": {**axis.config.model.nominal, "fm": 0.078}})
    (folder / "nominal.toml").write_text(nominal, encoding="utf-8")
    new = with_epoch(axis, from_files(axis, nominal, None), 2)
    (folder / "thresholds.toml").write_text(thresholds_text(new.config), encoding="utf-8")


def test_one_alarm_is_followed_through_all_that_the_document_shows(
    core: RunningCore, url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_files(core, tmp_path)
    monkeypatch.chdir(tmp_path)
    outputs = {}
    for command in console():
        if command[0] == "axiswatch":
            done = axiswatch(*command[1:])
            assert done.exit_code == 0, done.output
            outputs[" ".join(command[1:4])] = done.stdout
        elif "--json" in command:
            answer = httpx.post(
                command[3].replace("http://127.0.0.1:8080", url),
                json=json.loads(command[2]),
                timeout=PATIENCE_S,
            )
            assert answer.status_code == 200, answer.text
        else:
            schema = httpx.get(f"{url}/openapi.json", timeout=PATIENCE_S).json()
            answer = httpx.get(command[1].replace("http://127.0.0.1:8080", url), timeout=PATIENCE_S)
            matches_schema(answer, schema["paths"]["/api/v1/axes/{axis}/epochs"]["get"], schema)
            assert len(answer.json()["epochs"]) == 4
    assert (
        "epoch 2: learning, 0 of 4 h of operation, from a learning window; by local at"
        in outputs[f"baseline status {AXIS}"]
    )
    assert "fm = 0.078 N m s/rad (before: 0.06)" in outputs[f"baseline start {AXIS}"]
    assert "epoch 4: verifying, 0 of 8 h of operation, the values of epoch 1" in outputs[f"baseline restore {AXIS}"]
    assert "clear by local: normal (epoch 3 of demo.axis1 has begun) (WO-1718)" in outputs["alarms show 1"]
    states = [(e.number, e.state, e.source) for e in core.epochs()]
    assert states == [
        (5, "verifying", "restored"),
        (4, "rolled_back", "restored"),
        (3, "rolled_back", "files"),
        (2, "cancelled", "window"),
        (1, "closed", "configuration"),
    ]
    assert [e.state for e in core.journal.epochs.of_axis("demo.axis2")] == ["cancelled", "current"]


@pytest.mark.usefixtures("folder", "url")
def test_what_is_not_possible_is_refused_in_words(core: RunningCore, tmp_path: Path) -> None:
    write_files(core, tmp_path)
    (tmp_path / "nominal.toml").write_text("format = 2", encoding="utf-8")
    text = session(
        "baseline",
        "status demo.axis9",
        "start demo.axis1 --hours 0.001",
        "cancel demo.axis1",
        "restore demo.axis1 1",
        "restore demo.axis1 7",
        "start demo.axis1",
        "start demo.axis1 --nominal none.toml",
        "start demo.axis1 --nominal nominal.toml",
    )
    golden.check(text, Path(__file__).parent / "golden" / "baseline_mistakes.txt")
    assert "epoch 1: current, from the configuration; by configuration" in shown("baseline", "status", AXIS)


PLAN: dict[str, Any] = {"mode": "window", "hours": 2.0}


WRONG: list[tuple[str, dict[str, Any], int]] = [
    (f"{AXIS}/baseline", {**PLAN, "mode": "files"}, 422),
    (f"{AXIS}/baseline", {**PLAN, "hours": None}, 422),
    (f"{AXIS}/baseline", {**PLAN, "hours": -1}, 422),
    (f"{AXIS}/baseline", {**PLAN, "nominal": "x"}, 422),
    (f"{AXIS}/baseline", {**PLAN, "unknown": 1}, 422),
    (f"{AXIS}/baseline", {"mode": "files", "nominal": "\0 = 1"}, 422),
    (f"{AXIS}/baseline/cancel", {}, 409),
    (f"{AXIS}/epochs/1/restore", {}, 409),
    (f"{AXIS}/epochs/2/restore", {}, 404),
    (f"{AXIS}/epochs/0/restore", {}, 422),
    ("demo.axis9/baseline", PLAN, 404),
    ("demo.axis9/baseline/cancel", {}, 404),
]


def test_a_request_that_is_not_right_is_answered_with_what_is_documented(standing: RunningCore) -> None:
    with TestClient(standing.app(), base_url="http://localhost") as client:
        schema = client.get("/openapi.json").json()
        for path, body, status in WRONG:
            answer = client.post(f"/api/v1/axes/{path}", json=body)
            assert answer.status_code == status, (path, body, answer.text)
            template = re.sub(r"^[^/]+", "{axis}", re.sub(r"/\d/", "/{number}/", path))
            operation = schema["paths"][f"/api/v1/axes/{template}"]["post"]
            assert str(status) in operation["responses"]
            matches_schema(answer, operation, schema)
    assert len(standing.epochs()) == 1


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningCore]:
    """Without samples."""
    folder = tmp_path_factory.mktemp("standing")
    core = RunningCore(folder, cell(folder, 1))
    yield core
    core.close()


def test_to_operate_is_not_enough(standing: RunningCore, tmp_path: Path) -> None:
    tokens = TokenFile(tmp_path / "tokens.json")
    secrets = {scope: tokens.new(str(scope), scope) for scope in (Scope.OPERATE, Scope.ADMIN)}
    with TestClient(standing.app(Access(tokens)), base_url="http://localhost") as client:
        for scope, status in ((Scope.OPERATE, 403), (Scope.ADMIN, 409)):
            headers = {"authorization": f"Bearer {secrets[scope]}"}
            for path in ("baseline/cancel", "epochs/1/restore"):
                answer = client.post(f"/api/v1/axes/{AXIS}/{path}", json={}, headers=headers)
                assert answer.status_code == status
        operator = {"authorization": f"Bearer {secrets[Scope.OPERATE]}"}
        assert client.get(f"/api/v1/axes/{AXIS}/epochs", headers=operator).json()["current"] == 1
