"""The documents are of this program: the generated part, and every command."""

import re
from pathlib import Path

import pytest

from docs import build
from service.commands.main import COMMANDS

ROOT = Path(__file__).resolve().parent.parent


def test_the_schema_in_docs_is_the_programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    committed = build.TARGET.read_text(encoding="utf-8")
    monkeypatch.setattr(build, "TARGET", tmp_path / "openapi.json")
    build.write_schema()
    assert build.TARGET.read_text(encoding="utf-8") == committed, "run make docs"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_in_the_documents(command: str) -> None:
    documents = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    assert any(re.search(rf"axiswatch {command}\b", path.read_text(encoding="utf-8")) for path in documents)
