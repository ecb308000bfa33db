"""Numbers, tables, JSON, TOML and pages as all reports write them, and the origin of a result."""

from __future__ import annotations

import json
import math
import re
import shlex
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, is_dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table as RichTable
from rich.text import Text

if TYPE_CHECKING:
    from jinja2 import Environment

_FULL = 1e7
_DIGITS, _FEW = 10, 5


class Provenance(NamedTuple):
    """Origin of a result: ``date`` in ISO 8601, ``drawing`` name and sha256 of the drive's file, if it has one."""

    version: str
    date: str
    command: str
    drawing: tuple[str, str] | None = None

    @classmethod
    def now(cls, drawing: tuple[str, str] | None = None) -> Provenance:
        """Origin of a result of this program with its command line, at the present time."""
        date = datetime.now(UTC).isoformat(timespec="seconds")
        return cls(version("axiswatch"), date, shlex.join(["axiswatch", *sys.argv[1:]]), drawing)


def plain(value: float, digits: int) -> str:
    """A number with so many digits; large numbers in full: 281330, not 2.8133e+05."""
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:.0f}" if 10 ** (digits - 1) <= abs(rounded) < _FULL else f"{value:.{digits}g}"


def number(value: float | None, sd: float | None = None) -> str:
    """Five digits; two where the standard deviation is larger than the value."""
    if value is None:
        return ""
    return plain(value, 5 if sd is None or sd < abs(value) else 2)


class Fact(NamedTuple):
    """A value of a result in files: JSON contains the value, TOML also its meaning."""

    value: Any
    meaning: str = ""
    rough: bool = False
    """The value is known to five digits only"""


def labelled(label: str, words: str, style: str = "bold yellow") -> Text:
    """A sentence for the terminal after a label, such as "Note"."""
    return Text.assemble((f"{label}: ", style), words)


# --- Tables -----------------------------------------------------------------------------------------------------------


class TextTable(NamedTuple):
    """Text for the terminal and the page, a cell of each row below each title."""

    titles: Sequence[str]
    rows: Sequence[Sequence[str]]


def for_terminal(
    table: TextTable, title: str, right: Collection[str] = (), unbroken: int = 2, styles: Mapping[int, str] = {}
) -> RichTable:
    """The table for rich; markup in cells is shown unchanged.

    ``right``: titles of right-aligned columns; ``unbroken``: number of columns that are never broken; ``styles``:
    styles of rows, by row number.
    """
    drawn = RichTable(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for number, name in enumerate(table.titles):
        side: Literal["right", "left"] = "right" if name in right else "left"
        # Wide cells are folded, not cut: without its last digits a number would be another number.
        drawn.add_column(name, justify=side, no_wrap=number < unbroken, overflow="fold")
    for number, row in enumerate(table.rows):
        drawn.add_row(*map(escape, row), style=styles.get(number))
    return drawn


# --- JSON -------------------------------------------------------------------------------------------------------------


Json = dict[str, Any]
"""An object of a JSON document"""


def json_text(content: Any) -> str:
    """A document: arrays become lists, records of named fields objects, numbers that are not finite null."""
    return json.dumps(_simple(content), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def fields_of(record: Any) -> dict[str, Any]:
    """The fields of a dataclass or a NamedTuple by name."""
    named: tuple[str, ...] = getattr(record, "_fields", ()) or tuple(field.name for field in fields(record))
    return {name: getattr(record, name) for name in named}


def _simple(value: Any) -> Any:
    if isinstance(value, Fact):
        value = value.value
    if is_dataclass(value) or hasattr(value, "_fields"):
        value = fields_of(value)
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _simple(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_simple(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# --- TOML -------------------------------------------------------------------------------------------------------------


def toml_table(header: str, entries: Mapping[str, Any], about: str = "") -> str:
    """A table of values or facts, with a comment above it."""
    lines = [f"# {about}"] * bool(about) + [header] * bool(header)
    for key, entry in entries.items():
        fact = entry if isinstance(entry, Fact) else Fact(entry)
        text = toml_value(fact.value, _FEW if fact.rough else _DIGITS)
        meaning = f"  # {one_line(fact.meaning)}" if fact.meaning else ""
        lines.append(f"{toml_key(key)} = {text}{meaning}")
    return "\n".join([*lines, ""])


def toml_value(value: Any, digits: int = _DIGITS) -> str:
    """A value in TOML: text, a number with so many digits, an array, a matrix row by row, or an inline table."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        texts = [toml_value(entry, digits) for entry in value]
        is_matrix = bool(value) and isinstance(value[0], list)
        return "\n".join(["[", *(f"  {row}," for row in texts), "]"]) if is_matrix else f"[{', '.join(texts)}]"
    if isinstance(value, Mapping):
        pairs = ", ".join(f"{toml_key(key)} = {toml_value(entry)}" for key, entry in value.items())
        return f"{{ {pairs} }}" if pairs else "{}"
    if isinstance(value, str):
        # JSON's escapes are valid in TOML, which in addition requires one for the delete character.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int):
        return str(value)
    text = f"{value:.{digits}g}"
    return text if any(letter in text for letter in ".en") else f"{text}.0"


def toml_key(name: str) -> str:
    """A key, in quotes if TOML requires them."""
    bare = name.replace("_", "")
    return name if bare.isascii() and bare.isalnum() else toml_value(name)


def one_line(text: str) -> str:
    """The text without line breaks and control characters, for use in a comment."""
    return "".join(c if c.isprintable() else " " for c in text)


# --- HTML pages from the templates in this folder; values are escaped -------------------------------------------------


TEMPLATES = Path(__file__).parent / "templates"
_CODE = re.compile(r"`([^`]*)`")
_NOT_HTML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def render(template: str, **values: Any) -> str:
    """The page that a template makes of these values; pictures are ``safe`` HTML.

    The filter ``marked`` shows text between backticks as code.
    """
    return _environment().get_template(template).render(**values)


def safe(html: str) -> str:
    """HTML that the program itself has made, such as a picture, and that is not escaped."""
    from markupsafe import Markup

    return Markup(html)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup
    from markupsafe import escape as escape_html

    def clean(value: Any) -> Any:
        is_text = isinstance(value, str) and not isinstance(value, Markup)
        return _NOT_HTML.sub("", value) if is_text else value

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        finalize=clean,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["marked"] = lambda words: safe(_CODE.sub(r"<code>\1</code>", clean(str(escape_html(words)))))
    return environment
