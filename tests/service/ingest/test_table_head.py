"""What stands above the numbers of a CSV file: remarks, names, units; and how it is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from service.ingest.table_files import CsvTable, MatTable
from service.ingest.table_head import head_of, seconds_of

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


def test_damaged_lines_below_a_head_are_named_by_their_place(tmp_path: Path) -> None:
    read = table(
        tmp_path / "a.csv", "\n".join(["# a", "t,u,y", "s,A,deg", *ROWS * 50, "0.1,x,2", *ROWS]) + "\n"
    )
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
        ("03/02/2026 06:59:30", None),
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


@pytest.mark.parametrize(("names", "found"), [("ABC", (1, 2)), ("ABA", None)])
def test_rows_for_each_time_and_axis(names: str, found: tuple[int, int] | None) -> None:
    rows = [f"{3 * k + n},{k},{name},{k * n % 7}\n" for k in range(5) for n, name in enumerate(names)]
    assert head_of(["nr,t,axis,u\n", *rows]).keys() == found


def test_columns_of_a_matrix(tmp_path: Path) -> None:
    matrix = np.arange(12.0).reshape(4, 3)
    scipy.io.savemat(tmp_path / "a.mat", {"log": {"I": matrix}})
    (rows,) = MatTable(tmp_path / "a.mat").rows(["log.I(:,1)", "log.I(:,3)"])
    assert [v.tolist() for v in rows.columns.values()] == [matrix[:, 0].tolist(), matrix[:, 2].tolist()]


def test_rows_of_texts_and_numbers_are_no_head() -> None:
    """A data row is not taken for a line of units, since it holds a number."""
    head = head_of(["t,u,state\n", "0.0,1.0,idle\n", "0.1,1.0,run\n"])
    assert (head.lines, head.names, dict(head.units)) == (1, ("t", "u", "state"), {})


def test_many_lines_of_words_below_the_names_are_no_head() -> None:
    """They are damage, which is counted."""
    head = head_of(["t,u,y\n", *["x,x,x\n"] * 20, *(f"{row}\n" for row in ROWS)])
    assert head.lines == 1
