"""The demo's first axis with columns for tables, and a replay of it."""

import re
from pathlib import Path

from tests.end_to_end.processes import edit
from tests.service.command_line import shown
from tests.service.robot_tables import configured

WATCHED = 'monitor = ["kT", "1/Ja", "fm", "delay"]'


def written(folder: Path, *changes: tuple[str, str], monitor: str = WATCHED) -> Path:
    """The demo's first axis, with columns; ``changes`` of the text."""
    file = configured(folder, "skew", ('monitor = ["kT", "1/Ja", "fm"]', monitor))
    text = re.sub(r"^initial_p.*\n", "", file.read_text(encoding="utf-8"), flags=re.MULTILINE)
    file.write_text(text, encoding="utf-8")
    return edit(file, *changes)


def replayed(file: Path, *arguments: object) -> str:
    return shown("replay", "--config", file, *arguments)
