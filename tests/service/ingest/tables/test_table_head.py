"""What stands above the numbers of a CSV file: remarks, names, units; and how it is written."""

from __future__ import annotations

from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from service.ingest.tables.csv_tables import CsvTable
from service.ingest.tables.table_cells import seconds_of
from service.ingest.tables.table_files import MatTable
from service.ingest.tables.table_head import head_of

ROWS = ["0.000,1.5,2.5", "0.005,1.6,2.6", "0.010,1.7,2.7"]
NAMES = ("t", "u", "y")


def table(path: Path, text: str, encoding: str = "utf-8") -> CsvTable:
    path.write_bytes(text.encode(encoding))
    return CsvTable(path)


@pytest.mark.parametrize(
    ("head", "names", "units"),
    [
        (["t,u,y"], NAMES, {}),
        (["# export 4.2", "# axis 1, cell 4", "t,u,y", "[s],[A],[deg]"], NAMES, {"t": "s", "u": "A", "y": "deg"}),
        (["Project;Cell 4", "", "Export of Monday", "t,u,y"], NAMES, {}),
        (["", "t,u,y"], NAMES, {}),
        (["Export of Monday,,", "t,u,y", "s,Nm,1"], NAMES, {"t": "s", "u": "Nm", "y": "1"}),
        (["# t, u, y"], NAMES, {}),
        (["# one, two, three", "t,u,y"], NAMES, {}),
        (["t,u,y", "s,A,deg", "time,current,angle"], NAMES, {"t": "s", "u": "A", "y": "deg"}),
        (["Date,2026/03/02,2026/03/02", "Samples,3,3", "t,u,y"], NAMES, {}),
        (["Start,1.5,08:00:00", "t,u,y", "s,A,deg", "Port,1,1"], NAMES, {"t": "s", "u": "A", "y": "deg"}),
        (["t,u,y,Comment"], NAMES, {}),
        ([",u,u"], ("0", "u", "u_2"), {}),
        (["# only a remark"], ("0", "1", "2"), {}),
        ([], ("0", "1", "2"), {}),
    ],
)  # fmt: skip
def test_remarks_names_and_units(
    tmp_path: Path, head: list[str], names: tuple[str, ...], units: dict[str, str]
) -> None:
    read = table(tmp_path / "a.csv", "\n".join([*head, *ROWS]) + "\n")
    assert tuple(read.names) == names
    assert dict(read.units) == units
    (rows,) = read.rows(names)
    assert [rows.columns[name].tolist() for name in names] == [
        [0.0, 0.005, 0.01],
        [1.5, 1.6, 1.7],
        [2.5, 2.6, 2.7],
    ]
    assert read.left_out == []


@pytest.mark.parametrize(("head", "names"), [("t u y\n", NAMES), ("#\n# t u y\n", NAMES), ("", ("0", "1", "2"))])
@pytest.mark.parametrize("between", ["{} {} {}", "{:>8}{:>8}{:>8}", " {}   {} {}  "])
@pytest.mark.parametrize("torn", [False, True])
def test_cells_that_spaces_separate(
    tmp_path: Path, head: str, names: tuple[str, ...], between: str, torn: bool
) -> None:
    """As the recorder of Universal Robots writes them, numpy, MATLAB and Fanuc; arrow reads 1 MB at once."""
    lines = [between.format(*row.split(",")) for row in ROWS] * 20_000
    read = table(tmp_path / "a.csv", head + "\r\n".join([*lines, *["0.015 x"] * torn]))
    assert tuple(read.names) == names
    blocks = [rows.columns[names[2]] for rows in read.rows(names)]
    assert np.array_equal(np.concatenate(blocks), np.tile([2.5, 2.6, 2.7], 20_000))
    assert len(read.left_out) == torn


def test_remarks_of_several_words_do_not_make_spaces_separators(tmp_path: Path) -> None:
    remarks = [f"# remark {k} of an export" for k in range(9)]
    assert tuple(table(tmp_path / "a.csv", "\n".join([*remarks, "t,u,y", *ROWS]) + "\n").names) == NAMES


def test_damaged_lines_below_a_head_are_named_by_their_place(tmp_path: Path) -> None:
    read = table(tmp_path / "a.csv", "\n".join(["# a", "t,u,y", "s,A,deg", *ROWS * 50, "0.1,x,2", *ROWS]) + "\n")
    assert sum(len(rows.columns["u"]) for rows in read.rows(["u"])) == 153
    assert [line.partition(":")[0] for line in read.left_out] == ["line 154"]


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16", "utf-16-le", "utf-8-sig"])
def test_encodings_of_spreadsheets(tmp_path: Path, encoding: str) -> None:
    text = "Export\r\nZeit;Strom;Winkel°\r\ns;A;°\r\n0,000;1,5;2,5\r\n0,005;1,6;2,6\r\n0,0"
    read = table(tmp_path / "a.csv", text, encoding)
    assert read.names == ("Zeit", "Strom", "Winkel°")
    assert read.units["Winkel°"] == "°"
    columns = [rows.columns for rows in read.rows(read.names)]
    assert [v for block in columns for v in block["Winkel°"].tolist()] == [2.5, 2.6]
    assert len(read.left_out) == 1


def test_decimal_commas_in_quotes(tmp_path: Path) -> None:
    read = table(tmp_path / "a.csv", 't,u\n"0,000","1,5"\n"0,005","-1,6"\n')
    (rows,) = read.rows(["t", "u"])
    assert [v.tolist() for v in rows.columns.values()] == [[0.0, 0.005], [1.5, -1.6]]


@pytest.mark.parametrize(
    ("cell", "seconds"),
    [
        ("2026-03-02 07:59:30.5+01:00", 1772434770.5),
        ("2026-03-02 07:59:30.500 +0100", 1772434770.5),
        ("02.03.2026 06:59:30,5", 1772434770.5),
        ("2.3.2026, 06:59:30.5", 1772434770.5),
        ("00:00:30,25", 30.25),
        ("2026/03/02 6:59:30.5", 1772434770.5),
        ("3/2/2026 6:59:30.5 AM", 1772434770.5),
        ("03/02/2026 06:59:30.5 p.m.", 1772477970.5),
        ("12:00:01 AM", 1.0),
        ("13:00:01 PM", None),
        ("01:23,456", 83.456),
        ("0.004 sec", 0.004),
        ("4e-05 s", 4e-5),
        ("2 days 00:00:01.500000", 172801.5),
        ("2 days ago", None),
        ("1.5", None),
    ],
)
def test_dates_and_times_of_day(cell: str, seconds: float | None) -> None:
    assert seconds_of(cell) == seconds


@pytest.mark.parametrize("day", ["", "02.03.2026 ", "2026-03-02 "])
def test_dates_beside_decimal_commas(tmp_path: Path, day: str) -> None:
    read = table(tmp_path / "a.csv", f"Zeit;u\n{day}06:59:30,500;1,5\n{day}06:59:30,505;1,6\n;1,7\n")
    (rows,) = read.rows(["Zeit", "u"])
    first = seconds_of(f"{day}06:59:30.5")
    assert first is not None
    np.testing.assert_allclose(rows.columns["Zeit"] - first, [0, 0.005, np.nan], atol=1e-6)
    assert rows.columns["u"].tolist() == [1.5, 1.6, 1.7]


@pytest.mark.parametrize(
    ("dates", "words", "second"),
    [
        (("01/02/2026 10:00:00 AM", "01/02/2026 10:00:01 AM"), "taken as month/day/year", (2026, 1, 2)),
        (("01/02/2026 10:00:00", "01/02/2026 10:00:01"), "taken as day/month/year", (2026, 2, 1)),
        (("01/13/2026 10:00:00", "01/13/2026 10:00:01"), "", (2026, 1, 13)),
        (("12/02/2026 11:59:59 PM", "13/02/2026 12:00:00 AM"), "", (2026, 2, 12)),
    ],
)
def test_which_number_of_a_date_is_the_month(
    tmp_path: Path, dates: tuple[str, str], words: str, second: tuple[int, int, int]
) -> None:
    """By its size, else by the clock; where the size leaves it open it is said."""
    read = table(tmp_path / "a.csv", "t,u\n" + "".join(f"{date},1.5\n" for date in dates))
    (rows,) = read.rows(["t"])
    assert np.diff(rows.columns["t"]).tolist() == [1.0]
    assert datetime.fromtimestamp(rows.columns["t"][0], UTC).date() == date(*second)
    assert [words in taken for taken in read.taken] == ([True] if words else [])


@pytest.mark.parametrize(
    ("cells", "numbers", "taken"),
    [
        (["0.5;1,234.5", "1;-1,234,567"], [1234.5, -1234567.0], []),
        (["0,5;1.234,5", "1;1.234"], [1234.5, 1234.0], []),
        (["0.5;1 234.5", "1;1'234"], [1234.5, 1234.0], []),
        (["0.5;1,234", "1;12"], [1234.0, 12.0], []),
        (["2;1,234", "3;12"], [1.234, 12.0], ["1,234 is taken as 1.234"]),
        (["0,5;1,234", "1;12,5"], [1.234, 12.5], []),
    ],
)
def test_separators_of_thousands(tmp_path: Path, cells: list[str], numbers: list[float], taken: list[str]) -> None:
    read = table(tmp_path / "a.csv", "t;u\n" + "\n".join(cells) + "\n")
    assert [v for rows in read.rows(["u"]) for v in rows.columns["u"].tolist()] == numbers
    assert read.left_out == []
    assert [words.partition(";")[0] for words in read.taken] == taken


def test_columns_of_a_matrix(tmp_path: Path) -> None:
    matrix = np.arange(12.0).reshape(4, 3)
    scipy.io.savemat(tmp_path / "a.mat", {"log": {"I": matrix}})
    (rows,) = MatTable(tmp_path / "a.mat").rows(["log.I(:,1)", "log.I(:,3)"])
    assert [v.tolist() for v in rows.columns.values()] == [matrix[:, 0].tolist(), matrix[:, 2].tolist()]


def test_names_of_groups_above_the_names() -> None:
    """As merged cells of a spreadsheet are saved."""
    head = head_of(["t,A1,,A2,\n", "[s],u,y,u,y\n", "s,A,deg,A,deg\n", "0.0,1.0,2.0,3.0,4.0\n"])
    assert head.names == ("t [s]", "A1 u", "A1 y", "A2 u", "A2 y")
    assert head.units == dict(zip(head.names, ["s", "A", "deg", "A", "deg"], strict=True))


def test_rows_that_end_with_a_separator() -> None:
    assert head_of(["t;u\n", "0,0;1,0;\n", "0,1;2,0;\n"]).names == ("t", "u", "2")


def test_bars_and_flags(tmp_path: Path) -> None:
    """As a controller writes its inputs."""
    read = table(tmp_path / "a.txt", "t|grip|on\n0.0|TRUE|False\n0.1|FALSE|False\n0.2||False\n")
    (rows,) = read.rows(["grip", "on"])
    np.testing.assert_equal(rows.columns["grip"], [1, 0, np.nan])
    assert rows.columns["on"].tolist() == [0, 0, 0]
    assert read.left_out == []


@pytest.mark.parametrize("time", ["08:00:00.500", "1.5"])
def test_spaces_between_times_states_and_numbers(tmp_path: Path, time: str) -> None:
    read = table(tmp_path / "a.txt", "time state torque angle\n" + f"{time} run  0.5 1.5\n" * 3)
    (rows,) = read.rows(["time", "angle"])
    assert rows.columns["angle"].tolist() == [1.5, 1.5, 1.5]
    assert rows.columns["time"][0] == (28_800.5 if ":" in time else 1.5)


def test_names_without_cells_are_said() -> None:
    assert head_of(["t,u,Comment\n", "0.0,1.0\n"]).taken == (
        "the rows end before the names: no cells are taken as those of Comment",
    )


def test_rows_of_texts_and_numbers_are_no_head() -> None:
    """A data row is not taken for a line of units, since it holds a number."""
    head = head_of(["t,u,state\n", "0.0,1.0,idle\n", "0.1,1.0,run\n"])
    assert (head.lines, head.names, dict(head.units)) == (1, ("t", "u", "state"), {})


def test_many_lines_of_words_below_the_names_are_no_head() -> None:
    """They are damage, which is counted."""
    head = head_of(["t,u,y\n", *["x,x,x\n"] * 20, *(f"{row}\n" for row in ROWS)])
    assert head.lines == 1
