"""Where the compiled kernel is kept."""

from pathlib import Path

import pytest

from service.pipeline import kernel_cache
from service.pipeline.kernel_cache import VARIABLE, choose, fingerprint


def test_it_lies_below_the_folder_that_is_set(tmp_path: Path) -> None:
    environ = {VARIABLE: str(tmp_path)}
    assert choose(environ) == tmp_path / f"kernel-{fingerprint()}"
    assert Path(environ[VARIABLE]).is_dir()


def test_a_child_process_uses_the_same_folder(tmp_path: Path) -> None:
    environ = {VARIABLE: str(tmp_path)}
    assert choose(environ) == choose(environ)


def test_else_below_the_users_cache(tmp_path: Path) -> None:
    assert choose({"XDG_CACHE_HOME": str(tmp_path)}).parent == tmp_path / "axiswatch"


def test_other_sources_have_another_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_cache, "KERNEL", tmp_path)
    (tmp_path / "a.py").write_text("x = 1\n")
    before = fingerprint()
    (tmp_path / "a.py").write_text("x = 2\n")
    assert fingerprint() != before


def test_without_a_place_there_is_one_for_this_run_and_it_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    environ = {VARIABLE: str(tmp_path / "file")}
    choose(environ)
    assert Path(environ[VARIABLE]).is_dir()
    assert "set NUMBA_CACHE_DIR" in capsys.readouterr().err
