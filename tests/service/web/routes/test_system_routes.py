"""What the daemon tells of itself: its files, its configuration without any secret, who has changed what."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin

import pytest
from fastapi.testclient import TestClient
from pydantic import BaseModel

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmEvent
from service.config import Config, load
from service.config.public_text import HIDDEN, public_text
from service.store.alarm_transitions import Note
from service.store.epochs import EpochPlan
from service.store.tokens import Scope, TokenFile
from service.web.access import Access
from tests.conftest import ROOT
from tests.demo_text import demo_text
from tests.service.pipeline.robots import with_axes
from tests.service.web.conftest import NOON_US, Stage, robot_setup

S = 1_000_000


@pytest.fixture
def set_up(stage: Stage) -> TestClient:
    stage.setup = robot_setup()
    return stage.client()


# --- The configuration: nothing that is secret ------------------------------------------------------------------------


SECRETS = {
    "web.key",
    "links.webhook.url",
    "links.webhook.secret_file",
    "links.webhook.secret_env",
    "links.mqtt.password_file",
    "links.mqtt.password_env",
    "links.smtp.password_file",
    "links.smtp.password_env",
    "links.opcua.key",
}
"""All keys of the schema that hold a secret, or where it is."""

LINKS = """
[web]
certificate = "cert.pem"
key = "hush-web.key"
[[links.webhook]]
name = "orders"
url = "https://orders.example/hush-path?hush-query"
secret_file = "hush-secret-file"
secret_env = "hush_secret_env"
[links.mqtt]
host = "broker.example"
user = "anna"
password_file = "hush-password-file"
password_env = "hush_password_env"
[links.smtp]
host = "mail.example"
sender = "a@plant.example"
to = ["b@plant.example"]
user = "anna"
password_file = "hush-mail-file"
password_env = "hush_mail_env"
[links.opcua]
certificate = "cert.pem"
key = "hush-opcua.key"
"""


def keys(table: type[BaseModel], path: str = "") -> Iterator[str]:
    """All keys of a table and of those within it."""
    for name, field in table.model_fields.items():
        yield f"{path}{name}"
        for inner in tables(field.annotation):
            if inner.__name__.endswith("Config"):
                yield from keys(inner, f"{path}{name}.")


def tables(kind: Any) -> Iterator[type[BaseModel]]:
    if get_origin(kind) in (Union, UnionType, tuple):
        for part in get_args(kind):
            yield from tables(part)
    elif isinstance(kind, type) and issubclass(kind, BaseModel):
        yield kind


def test_the_schema_has_no_other_secret() -> None:
    """A key that sounds like one must be in the list above, and so in the test below."""
    sounds = re.compile(r"(secret|password|passw|token|credential|url)|(^|[._])(key|auth)$", re.IGNORECASE)
    assert {key for key in keys(Config) if sounds.search(key.rpartition(".")[2])} == SECRETS


def test_no_secret_leaves(stage: Stage, tmp_path: Path) -> None:
    (tmp_path / "demo.dbc").write_bytes((ROOT / "config" / "demo.dbc").read_bytes())
    file = tmp_path / "robot.toml"
    options = 'options = { bitrate = 500000, password = "hush-option", host = "tcp://anna:hush-user@gate" }'
    text = demo_text(1).replace("[[bus]]\n", f"[[bus]]\n{options}\n") + LINKS
    file.write_text(text, encoding="utf-8")
    config = load(file, {})
    assert len(re.findall("hush", file.read_text(encoding="utf-8"))) == 12
    stage.setup = replace(robot_setup(), config=lambda: config, file=file)
    body = stage.client().get("/api/v1/system/configuration").json()
    assert "hush" not in str(body)
    shown = body["text"]
    for key in SECRETS - {"links.webhook.url"}:
        assert f'{key.rpartition(".")[2]} = "{HIDDEN}"' in shown
    for words in ('url = "https://orders.example/..."', 'to = ["b@plant.example"]', "bitrate = 500000"):
        assert words in shown
    assert 'messages = "demo.dbc"' in shown


def test_what_is_in_force_is_shown_and_defaults_are_not(set_up: TestClient, stage: Stage) -> None:
    assert stage.setup is not None
    text = set_up.get("/api/v1/system/configuration").json()["text"]
    assert 'nominal_file = "demo.axis1-nominal.toml"' in text
    assert "queue_frames" not in text
    assert "defaults" not in text
    config = stage.setup.config()
    other = with_axes(config, config.robot[0].axis[:1])
    assert public_text(other, stage.setup.file.parent).count("nominal_file") == 1


# --- Who has changed what ---------------------------------------------------------------------------------------------


@pytest.fixture
def changed(stage: Stage, set_up: TestClient, fm_alarm: Alarm) -> TestClient:
    """An alarm that two persons handle, what a third one does to the axis, and what the daemon does itself."""
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    stage.journal.act(number, AlarmEvent.ACKNOWLEDGE, Note(NOON_US + S, "anna", "<b>seen</b>", "WO-17"))
    stage.journal.act(number, AlarmEvent.SHELVE, Note(NOON_US + 2 * S, "otto"), NOON_US + 60 * S)
    stage.journal.epochs.begin_with([EpochPlan("demo.axis1", "configuration", "{}", "1")], NOON_US - S)
    plan = EpochPlan("demo.axis1", "window", "{}", "1", learn_s=60.0)
    stage.journal.epochs.learn(plan, Note(NOON_US + 2 * S, "eva", "gearbox changed"))
    stage.journal.services.change("demo.axis2", AlarmEvent.REMOVE, Note(NOON_US + 3 * S, "eva", "new brake"))
    stage.journal.epochs.cancel("demo.axis1", Note(NOON_US + 9 * S, "axiswatch"), "refused", "too little")
    return set_up


def test_the_audit_trail_has_persons_and_files_newest_first(changed: TestClient) -> None:
    found = changed.get("/api/v1/system/audit").json()
    assert found["next"] is None
    names = [(c["who"], c["subject"], c["event"], c["parameter"]) for c in found["changes"]]
    assert names == [
        ("eva", "service", "remove from service", None),
        ("eva", "epoch", "begun", None),
        ("otto", "alarm", "shelve", "fm"),
        ("anna", "alarm", "acknowledge", "fm"),
        ("configuration", "epoch", "taken over", None),
    ]
    seen = found["changes"][3]
    assert (seen["comment"], seen["work_order"], seen["at"]) == (
        "<b>seen</b>",
        "WO-17",
        "2026-03-01T12:00:01.000000Z",
    )


def test_its_pages_miss_nothing_where_two_changes_have_one_time(changed: TestClient) -> None:
    every = changed.get("/api/v1/system/audit").json()["changes"]
    found, cursor = list[Any](), None
    for _ in every:
        page = changed.get("/api/v1/system/audit", params={"limit": 1, **({"cursor": cursor} if cursor else {})}).json()
        found += page["changes"]
        cursor = page["next"]
    assert found == every
    assert cursor is None


def test_what_is_no_cursor_is_refused(changed: TestClient) -> None:
    for cursor in ("", "7", "1.alarm", "1.alarm.x", "1.person.2", "1.alarm.2.3", "-1.alarm.2"):
        answer = changed.get("/api/v1/system/audit", params={"cursor": cursor})
        assert answer.status_code == 400, cursor
        assert "`next` of a page" in answer.json()["detail"]


def test_who_may_only_operate_sees_neither_names_nor_addresses(stage: Stage, tmp_path: Path) -> None:
    tokens = TokenFile(tmp_path / "tokens.json")
    secrets = {scope: tokens.new(str(scope), scope) for scope in Scope}
    stage.access, stage.setup = Access(tokens), robot_setup()
    client = stage.client()

    def status(scope: Scope, path: str) -> int:
        headers = {"Authorization": f"Bearer {secrets[scope]}"}
        return client.get(f"/api/v1/system{path}", headers=headers).status_code

    for path in ("/configuration", "/audit"):
        assert [status(scope, path) for scope in Scope] == [403, 403, 200]
    assert status(Scope.READ, "") == 200


# --- The files --------------------------------------------------------------------------------------------------------


def test_the_databases_have_sizes_times_and_problems(stage: Stage, tmp_path: Path) -> None:
    setup = robot_setup()
    service = setup.config().service.model_copy(update={"state_dir": tmp_path})
    config = setup.config().model_copy(update={"service": service})
    gone = f"{tmp_path / 'history.sqlite'} is no longer there"
    problems = {"alarms.sqlite": "3 alarms are not recorded yet", "checkpoints.sqlite": None, "history.sqlite": gone}
    stage.setup = replace(setup, config=lambda: config, problems=lambda: problems)
    damaged = "history.sqlite.damaged-20260301T120000.000000Z"
    (tmp_path / damaged).touch()
    found = stage.client().get("/api/v1/system").json()
    alarms, checkpoints, history = found["databases"]
    on_disk = [tmp_path / "alarms.sqlite", tmp_path / "alarms.sqlite-wal"]
    assert alarms["size_bytes"] == sum(path.stat().st_size for path in on_disk) > 0
    assert alarms["problem"] == "3 alarms are not recorded yet"
    assert (checkpoints["size_bytes"], checkpoints["written"], checkpoints["problem"]) == (0, None, None)
    assert (history["name"], history["problem"]) == ("history.sqlite", "history.sqlite is no longer there")
    assert re.fullmatch(r"20\d\d-.*Z", history["written"])
    assert found["damaged"] == [damaged]
    assert found["free_bytes"] > 0
    assert found["cpu_s"] > 0
    assert found["memory_bytes"] > 10**7
    assert {"Python", "SQLite", "numba"} <= found["versions"].keys()
