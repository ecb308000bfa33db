"""Each mistake is reported with its line, its key, its value, and what would be right; what is doubtful is noted.

The files config_mistakes/*.golden and config_remarks/*.golden are the tables: a text of config_texts.py by the name of
the file, changes to it, one in a line, `old => new`, and below them all that is reported or noted.
"""

from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path

import pytest

from service.config import ConfigErrors, load
from service.config.remarks import remarks
from service.config.schema.base_table import RENAMED_KEYS
from service.config.schema.found_file import FoundFileError, read_found
from service.config.schema.nominal_file import NominalFile
from tests import golden
from tests.service.config.config_texts import CONFIG, TEXTS, furnish, loaded

MISTAKES, REMARKS = (Path(__file__).parent / f"config_{name}" for name in ("mistakes", "remarks"))
SUFFIXES = (".toml", ".dbc", ".mo")


def entries(path: Path) -> Iterator[list[str]]:
    """The changes of each entry of a file."""
    rows = path.read_text(encoding="utf-8").splitlines()
    for is_report, group in groupby(rows, lambda row: row.startswith("    ")):
        if not is_report:
            yield list(group)


def write(text: str, changes: list[str], folder: Path) -> Path:
    """The text with these changes; one that begins with the name of another file is made there."""
    (folder / "a.toml").write_text(text, encoding="utf-8")
    for change in (change for change in changes if change != "as it is"):
        place, _, rest = change.partition(": ")
        name, edit = (place, rest) if rest and place.endswith(SUFFIXES) else ("a.toml", change)
        old, _, new = edit.replace("\\n", "\n").partition(" =>")
        content = (folder / name).read_text(encoding="utf-8")
        assert content.count(old) == 1, change
        (folder / name).write_text(content.replace(old, new.removeprefix(" ")), encoding="utf-8")
    return folder / "a.toml"


def rows(changes: list[str], found: Iterable[str]) -> str:
    """An entry of a file."""
    return "".join(f"{row}\n" for row in (*changes, *(f"    {words}" for words in found)))


@pytest.mark.parametrize("path", sorted(MISTAKES.glob("*.golden")), ids=lambda path: path.stem)
def test_mistakes_are_reported(path: Path, tmp_path: Path) -> None:
    found = ""
    for changes in entries(path):
        with pytest.raises(ConfigErrors) as caught:
            load(write(TEXTS[path.stem], changes, furnish(tmp_path)), {})
        found += rows(changes, str(caught.value).replace(f"{tmp_path}/", "").splitlines())
    golden.check(found, path)


@pytest.mark.parametrize("path", sorted(REMARKS.glob("*.golden")), ids=lambda path: path.stem)
def test_remarks_are_made(path: Path, tmp_path: Path) -> None:
    found = ""
    for changes in entries(path):
        config = load(write(TEXTS[path.stem], changes, furnish(tmp_path)), {})
        found += rows(changes, [*remarks(config)] or ["-"])
    golden.check(found, path)


@pytest.mark.parametrize("name", TEXTS)
def test_without_a_mistake_the_texts_load(name: str, tmp_path: Path) -> None:
    assert loaded(furnish(tmp_path), TEXTS[name]).axes


# --- keys of earlier versions -------------------------------------------------------------------------------


EXAMPLE = (CONFIG / "reference.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("key", RENAMED_KEYS.values())
def test_the_new_keys_exist(key: str) -> None:
    assert f"{key} = " in EXAMPLE or f".{key}]]" in EXAMPLE


def test_a_parameter_may_have_the_name_of_an_old_key(tmp_path: Path) -> None:
    """What is wrong with this file is something else."""
    (tmp_path / "nominal.toml").write_text("format = 1\n[values]\naveraged = 1.0\n", encoding="utf-8")
    with pytest.raises(FoundFileError, match="required"):
        read_found(NominalFile, tmp_path / "nominal.toml")
