"""The kernel compiled in a process of its own: only where it must be, never a hindrance."""

import sys
import threading
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from service.pipeline.kernel_cache import VARIABLE
from service.pipeline.warming import CacheFiller, compile_kernel
from tests.end_to_end.processes import wait_for

FAILED = "the kernel could not be compiled in a process of its own"


def test_a_filled_cache_needs_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    compile_kernel(1)
    monkeypatch.setattr(sys, "executable", "/no/such/program")
    with capture_logs() as logs:
        assert CacheFiller().fill([1])
    assert logs == []


@pytest.mark.parametrize(
    ("program", "reason"), [("/no/such/program", "/no/such/program"), ("false", "exit code 1")]
)
def test_a_process_that_fails_is_told_and_the_start_goes_on(
    program: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(sys, "executable", program)
    with capture_logs() as logs:
        assert CacheFiller().fill([1])
    assert [entry["event"] for entry in logs] == [FAILED]
    assert reason in logs[0]["reason"]


def test_a_stop_ends_the_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    endless = tmp_path / "endless"
    endless.write_text(f"#!/bin/sh\ntouch {tmp_path}/begun\nexec sleep 1000\n")
    endless.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(endless))
    filler, ended = CacheFiller(), list[bool]()
    thread = threading.Thread(target=lambda: ended.append(filler.fill([1])))
    thread.start()
    wait_for((tmp_path / "begun").exists)
    with capture_logs() as logs:
        filler.stop()
        thread.join(60)
    assert (ended, logs) == ([False], [])


def test_after_a_stop_none_is_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(sys, "executable", "/no/such/program")
    filler = CacheFiller()
    filler.stop()
    with capture_logs() as logs:
        assert not filler.fill([1])
    assert logs == []
