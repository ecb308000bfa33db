"""The generated part of docs/ is that of this program."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from tests.conftest import ROOT


def test_the_schema_in_docs_is_the_programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = importlib.util.spec_from_file_location("docs_build", ROOT / "docs" / "build.py")
    assert spec is not None
    assert spec.loader is not None
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    committed = build.TARGET.read_text(encoding="utf-8")
    monkeypatch.setattr(build, "TARGET", tmp_path / "openapi.json")
    build.write_schema()
    assert build.TARGET.read_text(encoding="utf-8") == committed, "run make docs"
