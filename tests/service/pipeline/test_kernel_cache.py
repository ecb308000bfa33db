"""Where the compiled kernel is kept, and that it is compiled in a separate process, never a hindrance."""

import errno
import importlib.metadata
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from service.pipeline import kernel_cache
from service.pipeline.kernel_cache import VARIABLE, CacheFiller, KernelShape, choose, compile_kernel, fingerprint
from tests.end_to_end.processes import PATIENCE_S, wait_for


def test_it_lies_below_the_folder_that_is_set_or_the_users_cache(tmp_path: Path) -> None:
    environ = {VARIABLE: str(tmp_path)}
    assert choose(environ) == tmp_path / f"kernel-{fingerprint()}"
    assert Path(environ[VARIABLE]).is_dir()
    environ = {VARIABLE: str(tmp_path)}
    assert choose(environ) == choose(environ)
    assert choose({"XDG_CACHE_HOME": str(tmp_path)}).parent == tmp_path / "axiswatch"


def test_other_sources_another_place_and_another_numba_have_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In another place Numba compiles them again, so that marks of what is compiled must not count for both."""
    found = set[str]()
    for name, text in (("first", "x = 1\n"), ("first", "x = 2\n"), ("second", "x = 2\n")):
        (tmp_path / name).mkdir(exist_ok=True)
        (tmp_path / name / "a.py").write_text(text)
        monkeypatch.setattr(kernel_cache, "COMPILED", (tmp_path / name,))
        found.add(fingerprint())
    monkeypatch.setattr(importlib.metadata, "version", lambda _: "0.1")
    found.add(fingerprint())
    assert len(found) == 4


def test_without_a_place_there_is_one_for_this_run_and_it_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    environ = {VARIABLE: str(tmp_path / "file")}
    choose(environ)
    assert Path(environ[VARIABLE]).is_dir()
    assert "set NUMBA_CACHE_DIR" in capsys.readouterr().err


def test_a_shipped_kernel_that_cannot_be_written_to_is_used_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As on the read-only root of a container."""
    shipped = tmp_path / f"kernel-{fingerprint()}"
    (shipped / "block_0a").mkdir(parents=True)
    (shipped / "block_0a" / "run.nbi").write_bytes(b"compiled")

    def refuse(**_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    environ = {VARIABLE: str(tmp_path)}
    folder = choose(environ)
    assert tmp_path not in folder.parents
    assert (folder / "block_0a" / "run.nbi").read_bytes() == b"compiled"
    (folder / "block_0a" / "other.nbi").write_bytes(b"compiled, too")
    assert [file.name for file in shipped.rglob("*.nbi")] == ["run.nbi"]
    assert capsys.readouterr().err == ""
    monkeypatch.undo()
    assert choose(environ) == folder, "as a process that this one starts finds it"


FAILED = "the kernel could not be compiled in a separate process"


def test_a_filled_cache_needs_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    compile_kernel(KernelShape.FEW_AXES)
    monkeypatch.setattr(sys, "executable", "/no/such/program")
    with capture_logs() as logs:
        assert CacheFiller().fill([KernelShape.FEW_AXES])
    assert logs == []


@pytest.mark.parametrize(("program", "reason"), [("/no/such/program", "/no/such/program"), ("false", "exit code 1")])
def test_a_process_that_fails_is_told_and_the_start_goes_on(
    program: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(sys, "executable", program)
    with capture_logs() as logs:
        assert CacheFiller().fill([KernelShape.FEW_AXES])
    assert [entry["event"] for entry in logs] == [FAILED]
    assert reason in logs[0]["reason"]


def test_a_stop_ends_the_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    endless = tmp_path / "endless"
    endless.write_text(f"#!/bin/sh\ntouch {tmp_path}/begun\nexec sleep 1000\n")
    endless.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(endless))
    filler, ended = CacheFiller(), list[bool]()
    thread = threading.Thread(target=lambda: ended.append(filler.fill([KernelShape.FEW_AXES])))
    thread.start()
    wait_for((tmp_path / "begun").exists)
    with capture_logs() as logs:
        filler.stop()
        thread.join(PATIENCE_S)
    assert (ended, logs) == ([False], [])


_KILLED = """
import time
from service.pipeline.kernel_cache import CacheFiller, KernelShape
filler = CacheFiller()
filler.begin(KernelShape.FEW_AXES)
print("begun", flush=True)
time.sleep(1000)
"""


def test_a_daemon_that_is_killed_leaves_nothing_behind_that_compiles(tmp_path: Path) -> None:
    environ = {**os.environ, VARIABLE: str(tmp_path)}
    command = [sys.executable, "-c", _KILLED]
    with subprocess.Popen(command, env=environ, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        assert parent.stdout.readline() == "begun\n"
        (group,) = _children(parent.pid)
        wait_for(lambda: len(_running(group)) == min(os.cpu_count() or 1, 2))
        parent.kill()
    wait_for(lambda: not _running(group))
    assert list(tmp_path.glob("*.compiled")) == [], "they have not ended, but finished"


def _running(group: str) -> list[str]:
    """Processes of a group that have not ended."""
    return [pid for pid, fields in _processes() if fields[0] != "Z" and fields[2] == group]


def _children(parent: int) -> list[str]:
    return [pid for pid, fields in _processes() if fields[1] == str(parent)]


def _processes() -> Iterator[tuple[str, list[str]]]:
    """Id of each process, and what the kernel says of it: state, parent, group, and more."""
    for pid in filter(str.isdigit, os.listdir("/proc")):
        with suppress(OSError):
            text = Path("/proc", pid, "stat").read_text(encoding="ascii", errors="replace")
            yield pid, text.rpartition(")")[2].split()


def test_after_a_stop_none_is_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(sys, "executable", "/no/such/program")
    filler = CacheFiller()
    filler.stop()
    with capture_logs() as logs:
        assert not filler.fill([KernelShape.FEW_AXES])
    assert logs == []


_FIRST_CALL = """
from numba import njit
from numba.core.typing.typeof import typeof_impl
import monitor_core.kernel.compile
before = set(typeof_impl.registry)
assert njit(lambda x: x + 1)(1) == 2
print(*sorted(kind.__name__ for kind in set(typeof_impl.registry) - before))
"""


def test_a_first_call_changes_nothing_that_a_call_in_another_thread_looks_through(tmp_path: Path) -> None:
    """A daemon with a checkpoint calls the kernel while a thread loads it."""
    environ = os.environ | {VARIABLE: str(tmp_path)}
    command = [sys.executable, "-c", _FIRST_CALL]
    answer = subprocess.run(command, env=environ, capture_output=True, text=True, timeout=300, check=False)
    assert (answer.returncode, answer.stdout.strip()) == (0, ""), answer.stderr
