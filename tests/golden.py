"""Golden files: a text is compared with the file beside the test; AXISWATCH_UPDATE_GOLDEN=1 rewrites the files."""

import os
import re
from html import unescape
from pathlib import Path


def check(text: str, path: Path) -> None:
    """Compare ``text`` with the golden file; look at the difference before you commit a rewritten one."""
    if os.environ.get("AXISWATCH_UPDATE_GOLDEN"):
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text(encoding="utf-8"), f"differs from {path.name}: AXISWATCH_UPDATE_GOLDEN=1 rewrites it"


_UNREAD = re.compile(r"<(style|svg)\b.*?</\1>", re.DOTALL)
_BLOCK = re.compile(r"</(?:p|h\d|li|tr|figcaption|caption|summary|title|div|section|dd|dt)>")


def page_text(page: str) -> str:
    """What a person reads on an HTML page: a line for each paragraph, heading or row, without pictures."""
    blocks = _BLOCK.split(_UNREAD.sub("", page))
    rows = (" ".join(unescape(re.sub(r"<[^>]+>", " ", block)).split()) for block in blocks)
    return "".join(f"{row}\n" for row in rows if row)
