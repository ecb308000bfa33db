"""The documents are of this program: the generated part, and every command."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from docs import build
from service.commands.main import COMMANDS

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize(("target", "write"), [("SCHEMA", build.write_schema), ("METRICS", build.write_metrics)])
def test_what_docs_says_of_api_and_metrics_is_the_programs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, target: str, write: Callable[[], None]
) -> None:
    committed = getattr(build, target)
    monkeypatch.setattr(build, target, tmp_path / "written")
    write()
    assert (tmp_path / "written").read_text("utf-8") == committed.read_text("utf-8"), "run make docs"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_in_the_documents(command: str) -> None:
    documents = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    named = [p for p in documents if re.search(rf"axiswatch {command}\b", p.read_text(encoding="utf-8"))]
    assert named, f"neither README.md nor a file of docs names `axiswatch {command}`"


CHOSEN = sorted(
    {
        word
        for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
        for chosen in re.findall(r"""-k ['"]?([\w ]+?)['"]""", path.read_text(encoding="utf-8"))
        for word in chosen.split(" or ")
    }
)


@pytest.mark.parametrize("word", CHOSEN)
def test_a_test_that_the_documents_choose_is_there(word: str) -> None:
    """As `-k` of pytest does, by the name of the file or of the test."""
    assert any(
        word in f"{path.stem} {' '.join(re.findall(r'def (test_[a-z_0-9]+)', path.read_text('utf-8')))}"
        for path in (ROOT / "tests").rglob("test_*.py")
    )
