"""Tables with a row for each time and each signal or axis, as databases export them."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from service.can.user_errors import RecordError
from service.ingest.tables.long_tables import LongTable
from service.ingest.tables.table_files import open_table

ROWS_OF_TIMES = [f"{3 * k + n},{k},{name},{k * n % 7}" for k in range(5) for n, name in enumerate("ABC")]


@pytest.mark.parametrize(
    ("head", "rows", "names"),
    [
        ("nr,t,axis,u", ROWS_OF_TIMES, ("t", "nr_A", "nr_B", "nr_C", "u_A", "u_B", "u_C")),
        ("t,name,u", [row.partition(",")[2] for row in ROWS_OF_TIMES], ("t", "A", "B", "C")),
        ("t,name,unit,u", [row.partition(",")[2].replace("A", "A,s") for row in ROWS_OF_TIMES[::3]], ("t", "A")),
        ("t,unit,name,u", [row.partition(",")[2].replace("A", "s,A") for row in ROWS_OF_TIMES[::3]], ("t", "A")),
        ("x,axis,y,u", ROWS_OF_TIMES, None),
        ("t,u,y", ["0.000,1.5,2.5", "0.005,1.6,2.6", "0.010,1.7,2.7"], None),
    ],
)  # fmt: skip
@pytest.mark.parametrize("by_name", [False, True])
def test_rows_for_each_time_and_signal(
    tmp_path: Path, head: str, rows: list[str], names: tuple[str, ...] | None, by_name: bool
) -> None:
    """By the times; a single number of each row also by the names, as a melted table has it."""
    if by_name and head.count(",") == 2:
        rows = sorted(rows, key=lambda row: row.split(",")[1])
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    read = open_table(tmp_path / "a.csv")
    assert isinstance(read, LongTable) == (names is not None)
    assert tuple(read.names) == (names or tuple(head.split(",")))
    if names is not None and "C" in names[-1]:
        (columns,) = read.rows(names)
        assert columns.columns["t"].tolist() == [0, 1, 2, 3, 4]
        assert columns.columns[names[-1]].tolist() == [0, 2, 4, 6, 1]


def test_dates_beside_the_times_of_signals_are_no_signals(tmp_path: Path) -> None:
    """As WinCC writes them, by the second."""
    lines = [f"{name};2.3.2026 08:00:0{k // 3};{k};{100 * k}" for k in range(6) for name in ("M1", "q1")]
    (tmp_path / "a.csv").write_text("\n".join(["name;date;value;ms", *lines]) + "\n", encoding="utf-8")
    assert tuple(open_table(tmp_path / "a.csv").names) == ("ms", "M1", "q1")


def test_units_of_signals_in_a_column(tmp_path: Path) -> None:
    lines = [f"{k},{name},{unit},{k}" for k in range(5) for name, unit in (("M1", "Nm"), ("n1", "rpm"), ("s", ""))]
    (tmp_path / "a.csv").write_text("\n".join(["t,name,unit,value", *lines]) + "\n", encoding="utf-8")
    assert dict(open_table(tmp_path / "a.csv").units) == {"M1": "Nm", "n1": "rpm", "s": ""}


def test_dates_of_rows_are_in_seconds(tmp_path: Path) -> None:
    lines = [f"2026-03-02 08:00:0{k},{name},{k * n}" for k in range(9) for n, name in enumerate(("M1", "q1"))]
    (tmp_path / "a.csv").write_text("\n".join(["time,name,value", *lines]) + "\n", encoding="utf-8")
    assert open_table(tmp_path / "a.csv").units["time"] == "s"


def test_signals_with_times_of_their_own_are_refused(tmp_path: Path) -> None:
    lines = [f"{k + shift},{name},{k}" for k in range(9) for name, shift in (("M1", 0.0), ("n1", 0.5))]
    (tmp_path / "a.csv").write_text("\n".join(["t,name,value", *lines]) + "\n", encoding="utf-8")
    with pytest.raises(RecordError, match='each "name" has times of its own'):
        _ = open_table(tmp_path / "a.csv").names


def test_a_value_that_lacks_at_a_time(tmp_path: Path) -> None:
    """Times of day go on past midnight, in the order of the file."""
    lines = ["23:59:59,A,1", "23:59:59,B,2", "00:00:00,A,3", "00:00:01,A,5", "00:00:01,B,6"]
    (tmp_path / "a.csv").write_text("\n".join(["Time,name,value", *lines]) + "\n", encoding="utf-8")
    (rows,) = open_table(tmp_path / "a.csv").rows(["Time", "A", "B"])
    assert rows.columns["Time"].tolist() == [86399, 0, 1]
    assert rows.columns["A"].tolist() == [1, 3, 5]
    np.testing.assert_array_equal(rows.columns["B"], [2, np.nan, 6])


def written(path: Path, head: str, rows: Sequence[str]) -> LongTable:
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    read = open_table(path)
    assert isinstance(read, LongTable)
    return read


AXES, SIGNALS, TIMES = ("elbow", "wrist"), ("torque", "angle"), 400


def value(axis: int, signal: int, k: int) -> float:
    return round(float(np.sin(0.1 * k * (axis + 1) + signal)), 4)


@pytest.mark.parametrize("numbered", [False, True])
@pytest.mark.parametrize("by_time", [False, True])
@pytest.mark.parametrize("state", ["", ";Good"])
def test_axis_and_signal_in_columns_of_their_own(tmp_path: Path, numbered: bool, by_time: bool, state: str) -> None:
    """Sorted by time or by signal; a further column of texts, the same in all rows but one, names no signal."""
    places = list(product(range(2), range(2), range(TIMES)))
    names = [str(a + 1) if numbered else AXES[a] for a in range(2)]
    rows = [
        f"{k / 100};{names[a]};{SIGNALS[s]};{value(a, s, k)}{state if k != 50 or s else state[:2]}"
        for a, s, k in (sorted(places, key=lambda place: place[2]) if by_time else places)
    ]
    read = written(tmp_path / "a.csv", f"time;axis;signal;value{';state' if state else ''}", rows)
    signals = [f"{names[a]} {SIGNALS[s]}" for a, s in product(range(2), range(2))]
    assert list(read.names) == ["time", *signals]
    assert read.taken[-1] == 'a "time" has a row for each "axis" and "signal"'
    (columns,) = (rows.columns for rows in read.rows(read.names))
    for (a, s), name in zip(product(range(2), range(2)), signals, strict=True):
        assert columns[name].tolist() == [value(a, s, k) for k in range(TIMES)]


def test_repeated_rows_need_no_further_column(tmp_path: Path) -> None:
    """A database may send a value twice, here with another state."""
    rows = [f"{k / 100};{name};{value(0, s, k)};Good" for s, name in enumerate(SIGNALS) for k in range(TIMES)]
    again = [row.replace("Good", "Sent again") for row in rows[10:30]]
    read = written(tmp_path / "a.csv", "time;signal;value;state", [*rows, *again])
    assert list(read.names) == ["time", *SIGNALS]


def test_series_of_influxdb(tmp_path: Path) -> None:
    """Each series stands below remarks, the names again, and an empty line; a tag is the axis."""
    remarks = [
        "#group,false,false,true,true,false,false,true,true,true",
        "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,string,string",
        "#default,_result,,,,,,,,",
        ",result,table,_start,_stop,_time,_value,_field,_measurement,joint",
    ]
    rows, start = list[str](), "2026-03-02T08:00:00Z,2026-03-02T09:00:00Z"
    for number, (a, s) in enumerate(product(range(2), range(2))):
        rows += remarks if number else remarks[1:]
        rows += [
            f",,{number},{start},2026-03-02T08:00:{k / 100:012.9f}Z,{value(a, s, k)},{SIGNALS[s]},robot,{AXES[a]}"
            for k in range(TIMES)
        ]
        rows.append("")
    read = written(tmp_path / "a.csv", remarks[0], rows)
    names = [f"{signal} {axis}" for axis, signal in product(AXES, SIGNALS)]
    assert list(read.names) == ["_time", *names]
    (columns,) = (part.columns for part in read.rows(read.names))
    assert columns["_time"][:3] - columns["_time"][0] == pytest.approx([0.0, 0.01, 0.02], abs=1e-6)
    for (a, s), name in zip(product(range(2), range(2)), names, strict=True):
        assert columns[name].tolist() == [value(a, s, k) for k in range(TIMES)]
    assert read.left_out == []
