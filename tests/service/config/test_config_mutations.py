"""Whatever is done to a right configuration, it loads or says where it is wrong; never a traceback."""

import re
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.config import ConfigErrors, ConfigProblem, load

SHIPPED = Path(__file__).resolve().parents[3] / "config"
BASE = (Path(__file__).parent / "config_base.toml").read_text(encoding="utf-8")
EXAMPLE = re.sub(r"^#(?=[\w\[])", "", (SHIPPED / "reference.toml").read_text(encoding="utf-8"), flags=re.MULTILINE)
for file_that_fits in ('nominal_file = "nominal.toml"\n', 'thresholds_file = "thresholds.toml"\n'):
    EXAMPLE = EXAMPLE.replace(file_that_fits, "")
TEXTS = (BASE, EXAMPLE)

ENTRY = re.compile(r'(?P<key>[\w"/]+) = (?P<value>.+)')
VALUES = [
    *('"text"', '""', '"1/Ja"', "0", "-1", "3.5", "1e-300", "inf", "nan", "true", "1979-05-27", "07:32:00"),
    *("[]", "[[1]]", '["kT", 2]', "[0.0, 1.0]", "{}", "{ a = { b = 1 } }", "{ message = 3 }"),
    *("9" * 400, "0x" + "f" * 4000),
]


class Mutation(NamedTuple):
    rows: list[str]
    row: int

    def __repr__(self) -> str:
        return f"line {self.row + 1} of {len(self.rows)}: {self.rows[self.row]}"

    @property
    def entry(self) -> re.Match[str]:
        found = ENTRY.match(self.rows[self.row])
        assert found
        return found

    @property
    def header(self) -> int:
        """The line of the table that the row is in."""
        return max(i for i, row in enumerate(self.rows[: self.row], 1) if row.startswith("["))

    @property
    def is_option(self) -> bool:
        """In [bus.options] everything is allowed."""
        return self.rows[self.header - 1] == "[bus.options]"

    @property
    def is_limit(self) -> bool:
        """A limit is a number or a pair of numbers."""
        return self.rows[self.header - 1] == "[robot.axis.model.limits]"

    @property
    def is_description(self) -> bool:
        """What describes the messages: beside another description it may be left out."""
        return self.entry["key"] == "messages"

    def with_row(self, *new: str) -> str:
        return "\n".join([*self.rows[: self.row], *new, *self.rows[self.row + 1 :]])


def _mutation(text: str) -> st.SearchStrategy[Mutation]:
    rows = text.split("\n")
    entries = [i for i, row in enumerate(rows) if ENTRY.match(row)]
    return st.builds(Mutation, st.just(rows), st.sampled_from(entries))


mutations = st.sampled_from(TEXTS).flatmap(_mutation)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mutations")
    for name in ("robot.dbc", "drive.eds"):
        (folder / name).symlink_to(SHIPPED / name)
    return folder / "a.toml"


def found(file: Path, text: str) -> list[ConfigProblem]:
    """The problems of the text, none if it loads; all of them in lines that exist."""
    file.write_text(text, encoding="utf-8")
    problems: list[ConfigProblem] | None = None
    try:
        load(file, {})
    except ConfigErrors as errors:
        problems = errors.problems
    assert problems is None or problems
    for problem in problems or []:
        assert problem.line is not None
        assert 1 <= problem.line <= text.count("\n") + 1
        assert problem.message
        assert str(problem).startswith(f"{file}:{problem.line}:")
    return problems or []


@settings(deadline=None, max_examples=30)
@given(mutations)
def test_a_deleted_key_is_missed_where_its_table_is(file: Path, mutation: Mutation) -> None:
    problems = found(file, mutation.with_row())
    if mutation.is_description:  # of its messages, and not of the key, others say that they are missing
        return
    assert not problems or mutation.header in [problem.line for problem in problems]


@settings(deadline=None, max_examples=30)
@given(mutations, st.text("abcXYZ_-", min_size=1, max_size=3), st.booleans())
def test_a_misspelled_key_is_named(file: Path, mutation: Mutation, letters: str, before: bool) -> None:
    key = mutation.entry["key"].strip('"')
    wrong = letters + key if before else key + letters
    problems = found(file, mutation.with_row(f'"{wrong}" = {mutation.entry["value"]}'))
    if not mutation.is_option:
        assert (mutation.row + 1, wrong) in [(p.line, p.key.split(".")[-1].strip('"')) for p in problems]


@settings(deadline=None, max_examples=20)
@given(mutations, st.sampled_from(VALUES))
def test_a_value_of_another_type_is_named(file: Path, mutation: Mutation, value: str) -> None:
    problems = found(file, mutation.with_row(f"{mutation.entry['key']} = {value}"))
    either = mutation.is_limit and {_kind(value), _kind(mutation.entry["value"])} == {"number", "list"}
    if _kind(value) != _kind(mutation.entry["value"]) and not mutation.is_option and not either:
        assert mutation.row + 1 in [problem.line for problem in problems]


@settings(deadline=None, max_examples=30)
@given(st.sampled_from(TEXTS), st.data())
def test_any_mess_is_loaded_or_reported(file: Path, text: str, data: st.DataObject) -> None:
    rows = text.split("\n")
    for _ in range(data.draw(st.integers(1, 8))):
        i, k = (data.draw(st.integers(0, len(rows) - 1)) for _ in range(2))
        match data.draw(st.sampled_from(["delete", "swap", "repeat", "value", "letter"])):
            case "delete" if len(rows) > 1:
                del rows[i]
            case "swap":
                rows[i], rows[k] = rows[k], rows[i]
            case "repeat":
                rows.insert(k, rows[i])
            case "value" if entry := ENTRY.match(rows[i]):
                rows[i] = f"{entry['key']} = {data.draw(st.sampled_from(VALUES))}"
            case "letter" if rows[i]:
                at = data.draw(st.integers(0, len(rows[i]) - 1))
                rows[i] = rows[i][:at] + data.draw(st.sampled_from('a."[]{}=1#\\é')) + rows[i][at + 1 :]
    found(file, "\n".join(rows))


def _kind(value: str) -> str:
    kind = type(tomllib.loads(f"x = {value}")["x"]).__name__
    return "number" if kind in ("int", "float") else kind
