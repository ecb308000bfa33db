"""Where the compiled kernel is kept when the program may write nowhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.commands.kernel_cache import VARIABLE, find_place, usual_places


def test_usual_places_are_left_to_numba(tmp_path: Path) -> None:
    environ: dict[str, str] = {}
    find_place(environ, [tmp_path / "none", tmp_path])
    assert environ == {}
    assert usual_places()[0].is_dir()


def test_what_is_set_stays(tmp_path: Path) -> None:
    environ = {VARIABLE: "given"}
    find_place(environ, [tmp_path / "none"])
    assert environ == {VARIABLE: "given"}


def test_without_a_place_there_is_one_for_this_run_and_it_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    environ: dict[str, str] = {}
    find_place(environ, [tmp_path / "none"])
    assert Path(environ[VARIABLE]).is_dir()
    assert "set NUMBA_CACHE_DIR" in capsys.readouterr().err
