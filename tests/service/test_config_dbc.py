"""DBC files as tools write them, and what is said about those that cannot be used."""

import os
from pathlib import Path

import pytest

from service.can.dbc import DbcError, find_counter, find_message, find_signal, read_dbc

HEAD = 'VERSION ""\nBU_: X\n'
GOOD = 'BO_ 257 Good: 8 X\n SG_ Value : 0|16@1- (0.1,0) [0|0] "°" X\n SG_ Other : 16|16@1- (1,0) [0|0] "" X\n'
OVERLAP = 'BO_ 258 Overlap: 8 X\n SG_ A : 0|16@1- (1,0) [0|0] "" X\n SG_ B : 8|16@1- (1,0) [0|0] "" X\n'
SHORT = 'BO_ 259 Short: 2 X\n SG_ A : 0|32@1- (1,0) [0|0] "" X\n'


def write(folder: Path, text: str, encoding: str = "utf-8") -> Path:
    file = folder / "a.dbc"
    file.write_text(HEAD + text, encoding=encoding)
    return file


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
def test_encodings(encoding: str, tmp_path: Path) -> None:
    message = find_message(read_dbc(write(tmp_path, GOOD, encoding)), "Good")
    assert find_signal(message, "Value").unit == "°"


def test_faults_matter_only_where_they_are_used(tmp_path: Path) -> None:
    database = read_dbc(write(tmp_path, GOOD + OVERLAP + SHORT))
    find_message(database, "Good")
    for name, words in (("Overlap", "are overlapping"), ("Short", "A does not fit")):
        with pytest.raises(DbcError, match=words):
            find_message(database, name)


def test_two_messages_with_one_identifier(tmp_path: Path) -> None:
    database = read_dbc(write(tmp_path, GOOD + GOOD.replace("Good", "Twin")))
    with pytest.raises(DbcError, match="gives its identifier 0x101 to Twin, too"):
        find_message(database, "Good")


def test_an_extended_identifier_is_another_one(tmp_path: Path) -> None:
    extended = GOOD.replace("Good", "Long").replace("257", str(257 | 1 << 31))
    database = read_dbc(write(tmp_path, GOOD + extended))
    assert find_message(database, "Good").frame_id == find_message(database, "Long").frame_id


@pytest.mark.parametrize(
    "text",
    ["!nonsense", "BO_ x", 'VAL_ 77 S 1 "a" ;', 'BA_ "foo" 5;', "BO_ 99999999999 A: 8 X\n", "\x00\xff\x17"],
)
def test_no_dbc(text: str, tmp_path: Path) -> None:
    file = write(tmp_path, text, "latin-1")
    with pytest.raises(DbcError) as caught:
        read_dbc(file)
    assert str(caught.value).startswith(f"{file} is no valid DBC: ")


def test_no_file_and_a_file_that_changes(tmp_path: Path) -> None:
    """A file is read again when it changes."""
    with pytest.raises(DbcError, match=r"none\.dbc: No such file"):
        read_dbc(tmp_path / "none.dbc")
    with pytest.raises(DbcError, match="Is a directory"):
        read_dbc(tmp_path)
    file = write(tmp_path, GOOD)
    first = read_dbc(file)
    assert read_dbc(file) is first
    write(tmp_path, GOOD.replace("Good", "Best"))
    os.utime(file, ns=(1, 1))
    assert [message.name for message in read_dbc(file).messages] == ["Best"]


def test_a_counter_is_a_whole_number(tmp_path: Path) -> None:
    real = GOOD + "SIG_VALTYPE_ 257 Other : 1;\n"
    message = find_message(read_dbc(write(tmp_path, GOOD)), "Good")
    assert find_counter(message, "Other").length == 16
    with pytest.raises(
        DbcError, match=r"must be an integer with factor 1; in the DBC Value is .* factor 0\.1"
    ):
        find_counter(message, "Value")
    message = find_message(read_dbc(write(tmp_path, real.replace("16|16", "16|32"))), "Good")
    with pytest.raises(DbcError, match="Other is a float"):
        find_counter(message, "Other")
