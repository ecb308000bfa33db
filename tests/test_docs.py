"""The generated part of docs/ is that of this program."""

from pathlib import Path

import pytest

from docs import build


def test_the_schema_in_docs_is_the_programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    committed = build.TARGET.read_text(encoding="utf-8")
    monkeypatch.setattr(build, "TARGET", tmp_path / "openapi.json")
    build.write_schema()
    assert build.TARGET.read_text(encoding="utf-8") == committed, "run make docs"
