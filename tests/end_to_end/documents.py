"""README and docs: their blocks of code, and the commands that they show."""

import re
import shlex

from tests.end_to_end.processes import ROOT

DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXTS = {path.name: path.read_text(encoding="utf-8") for path in DOCUMENTS}


def code(language: str) -> list[str]:
    """The code blocks of all documents, each once."""
    blocks = (re.findall(rf"```{language}\n(.*?)```", text, re.S) for text in TEXTS.values())
    return list(dict.fromkeys(block for found in blocks for block in found))


CONSOLE = list(dict.fromkeys(re.findall(r"^\$ (.+)$", "\n".join(code("console")), re.M)))
TOML = code("toml")


def shown(start: str) -> list[list[str]]:
    """The commands that begin with these words, as arguments."""
    found = [shlex.split(line) for line in CONSOLE if f"{line} ".startswith(start + " ")]
    assert found, f"the documents show no {start!r} any more"
    return found
