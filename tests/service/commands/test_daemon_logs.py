"""Where logs go, and what they look like there."""

import io
import json
import logging
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import pytest
import structlog

from service.commands.daemon.daemon_logs import LogFormat, configure_logs


@pytest.fixture(autouse=True)
def logs_as_before() -> Iterator[None]:
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    structlog.reset_defaults()
    root.handlers[:] = handlers
    root.setLevel(level)


@pytest.fixture
def stream(tmp_path: Path) -> Iterator[TextIO]:
    with (tmp_path / "log").open("w+", encoding="utf-8") as file:
        yield file


def journal_of(stream: TextIO) -> dict[str, str]:
    """The variable, as systemd sets it for a service whose stream its journal reads."""
    status = os.fstat(stream.fileno())
    return {"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino}"}


def lines(stream: TextIO, log_format: LogFormat, environ: dict[str, str]) -> list[str]:
    configure_logs(log_format, stream, environ=environ)
    log = structlog.get_logger("test")
    log.info("running", axes=2)
    logging.getLogger("library").warning("said by a library")
    secret = "axw_1234"
    try:
        raise ValueError(f"first\nsecond {len(secret)}")
    except ValueError:
        log.critical("failed", exc_info=True)
    stream.seek(0)
    text = stream.read()
    assert secret not in text, "a local variable, as the headers of a request are"
    return text.splitlines()


def test_a_file_gets_json(stream: TextIO) -> None:
    found = [json.loads(line) for line in lines(stream, "auto", {})]
    assert [(e["event"], e["level"]) for e in found] == [
        ("running", "info"),
        ("said by a library", "warning"),
        ("failed", "critical"),
    ]
    assert found[0]["axes"] == 2
    assert found[2]["exception"][0]["exc_value"] == "first\nsecond 8"


def test_the_addresses_of_webhooks_which_httpx_logs_are_not_there(stream: TextIO) -> None:
    configure_logs("json", stream, environ={})
    logging.getLogger("httpx").info("HTTP Request: POST https://orders.plant.example/a-secret")
    stream.seek(0)
    assert stream.read() == ""


def test_the_journal_gets_each_line_with_its_priority(stream: TextIO) -> None:
    found = lines(stream, "json", journal_of(stream))
    assert [line[:4] for line in found] == ["<6>{", "<4>{", "<2>{"]
    assert json.loads(found[0][3:])["axes"] == 2


def test_every_line_of_a_traceback_for_people_has_its_priority(stream: TextIO) -> None:
    found = lines(stream, "console", journal_of(stream))
    assert found[0].startswith("<6>")
    assert "running" in found[0]
    assert {line[:3] for line in found[2:]} == {"<2>"}
    assert "\x1b" not in "".join(found), "colours are for terminals"


def test_the_journal_of_another_stream_is_none(stream: TextIO, tmp_path: Path) -> None:
    with (tmp_path / "other").open("w", encoding="utf-8") as other:
        assert all(line.startswith("{") for line in lines(stream, "auto", journal_of(other)))
    assert lines(io.StringIO(), "auto", {"JOURNAL_STREAM": "1:1"})[0].startswith("{")
