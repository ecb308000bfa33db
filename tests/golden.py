"""Golden files: a text is compared with the file beside the test; AXISWATCH_UPDATE_GOLDEN=1 rewrites the files."""

import os
from pathlib import Path


def check(text: str, path: Path) -> None:
    """Compare ``text`` with the golden file; look at the difference before you commit a rewritten one."""
    if os.environ.get("AXISWATCH_UPDATE_GOLDEN"):
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text(encoding="utf-8"), (
        f"differs from {path.name}: AXISWATCH_UPDATE_GOLDEN=1 rewrites it"
    )
