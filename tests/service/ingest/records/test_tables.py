"""Tables as records: columns become samples, and faults are named by file, line and column."""

import math
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from monitor_core.samples import SampleBlock, concatenate
from service.can.user_errors import RecordError
from service.ingest.records.axis_records import axis_record
from service.ingest.records.record_files import read_record
from service.ingest.tables.csv_tables import CsvTable
from service.ingest.tables.table_files import open_table
from tests.service.ingest.plant import axis1, axis2, make_config, write_table

N = 20_000  # more than one block of rows
SUFFIXES = (".csv", ".parquet", ".mat")


def columns(seed: int, count: int = N) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    return {
        "t": 100.0 + 0.005 * np.arange(count),
        "torque_one": rng.normal(size=count),
        "angle_one": rng.normal(size=count),
        "unused": np.arange(count),
    }


def timed(**other: Any) -> dict[str, Any]:
    return axis1(time={"column": "t"}, **other)


def samples_of(path: Path, folder: Path, axis: dict[str, Any]) -> tuple[SampleBlock, dict[str, int]]:
    record = read_record(path, make_config(folder, axis))
    steps = list(record.steps())
    blocks = [step.samples[f"r.{axis['name']}"] for step in steps if step.samples]
    assert [step.done for step in steps] == sorted(step.done for step in steps)
    assert steps[-1].done == 1.0
    dropped = record.quality.axis_dropped[f"r.{axis['name']}"]
    return concatenate(blocks), {reason: n for reason, n in dropped.items() if n}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_columns_become_samples(tmp_path: Path, suffix: str, seed: int) -> None:
    table = columns(seed)
    write_table(tmp_path / f"a{suffix}", table)
    axis = timed()
    axis["torque"] |= {"factor": -2.0, "offset": 0.5}
    block, dropped = samples_of(tmp_path / f"a{suffix}", tmp_path, axis)
    assert np.array_equal(block.t_us, 100_000_000 + 5000 * np.arange(N))
    assert np.array_equal(block.u, -2.0 * table["torque_one"] + 0.5)
    assert np.array_equal(block.y, table["angle_one"])
    assert dropped == {}


@pytest.mark.parametrize("lost", [0, 2 * N // 3])
def test_a_time_of_day_goes_on_after_midnight(tmp_path: Path, lost: int, seed: int) -> None:
    """For the monitor and for identification; also where rows are missing there, and where one has no right time."""
    table = columns(seed, 3 * N)
    t = 86_400.0 - 0.005 * N + 0.005 * np.arange(3 * N)
    table["t"] = t % 86_400.0
    table["t"][100] = 0.0
    left = np.delete(np.arange(3 * N), slice(N, N + lost))
    write_table(tmp_path / "a.csv", {name: values[left] for name, values in table.items()})
    config = make_config(tmp_path, timed())
    usual = np.rint(1e6 * np.delete(t[left], 100))
    block, _ = samples_of(tmp_path / "a.csv", tmp_path, timed())
    assert np.array_equal(block.t_us, usual)
    assert np.array_equal(axis_record(tmp_path / "a.csv", config, config.axes[0], ()).block.t_us, usual)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_without_a_time_rows_are_an_interval_apart(tmp_path: Path, suffix: str, seed: int) -> None:
    write_table(tmp_path / f"a{suffix}", columns(seed))
    axis = axis1(sample_interval_s=1 / 3000, pairing_tolerance_s=1e-4)
    block, _ = samples_of(tmp_path / f"a{suffix}", tmp_path, axis)
    assert block.t_us.tolist() == [round(k * 1e6 / 3000) for k in range(N)]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_rows_that_are_no_samples_are_counted(tmp_path: Path, suffix: str, seed: int) -> None:
    table = columns(seed, 12)
    table["torque_one"][3] = math.nan
    table["angle_one"][4] = -math.inf
    table["torque_one"][1] = 1e30
    table["t"][5] = math.nan
    table["t"][6] = 1e293
    table["t"][8] = table["t"][7]
    table["t"][9] = table["t"][2]
    write_table(tmp_path / f"a{suffix}", table)
    block, dropped = samples_of(tmp_path / f"a{suffix}", tmp_path, timed())
    assert ((block.t_us - 100_000_000) // 5000).tolist() == [0, 2, 7, 10, 11]
    assert dropped == {"not_finite": 4, "absurd": 1, "repeated": 1, "out_of_order": 1, "missing": 1 + 4 + 2}


def test_the_order_of_times_counts_across_blocks(tmp_path: Path, seed: int) -> None:
    table = columns(seed)
    table["t"][8192] = table["t"][10]  # the first row of the second block
    write_table(tmp_path / "a.parquet", table)
    block, dropped = samples_of(tmp_path / "a.parquet", tmp_path, timed())
    assert len(block.t_us) == N - 1
    assert dropped == {"out_of_order": 1, "missing": 1}


def test_axes_in_a_table_and_axes_without_columns(tmp_path: Path, seed: int) -> None:
    table = columns(seed, 5)
    write_table(tmp_path / "a.csv", {**table, "torque_two": np.ones(5), "speed_two": np.ones(5)})
    (step,) = read_record(tmp_path / "a.csv", make_config(tmp_path, timed(), axis2())).steps()
    assert step.samples["r.one"].t_us[0] == 100_000_000
    assert step.samples["r.two"].y.tolist() == [1.0] * 5
    write_table(tmp_path / "a.csv", columns(seed, 5))
    other = axis2()
    del other["torque"]["column"], other["speed"]["column"]
    (step,) = read_record(tmp_path / "a.csv", make_config(tmp_path, timed(), other)).steps()
    assert list(step.samples) == ["r.one"]


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_csv_without_names(tmp_path: Path, delimiter: str) -> None:
    rows = [["0.0", "1.5", "2.5"], ["0.005", "", "3.5"], ["0.01", "4.5", "1e3"]]
    (tmp_path / "a.csv").write_text("".join(delimiter.join(row) + "\n" for row in rows), encoding="utf-8")
    axis = axis1(time={"column": "0"})
    axis["torque"]["column"], axis["angle"]["column"] = "1", "2"
    block, dropped = samples_of(tmp_path / "a.csv", tmp_path, axis)
    assert block.t_us.tolist() == [0, 10_000]
    assert block.y.tolist() == [2.5, 1000.0]
    assert dropped == {"not_finite": 1, "missing": 1}


@pytest.mark.parametrize("suffix", [".txt", ".TSV", ".dat", ".lvm"])
def test_texts_of_other_names(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_text("t\ttorque_one\tangle_one\n0\t1\t2\n0.005\t3\t4\n", encoding="utf-8")
    block, _ = samples_of(path, tmp_path, timed())
    assert block.u.tolist() == [1.0, 3.0]


def test_csv_of_a_spreadsheet(tmp_path: Path) -> None:
    text = '\ufeff"t" ; "torque_one";angle_one\r\n0;1;2\r\n\r\n0.005;3;4\r\n'
    (tmp_path / "a.csv").write_text(text, encoding="utf-8", newline="")
    block, _ = samples_of(tmp_path / "a.csv", tmp_path, timed())
    assert block.u.tolist() == [1.0, 3.0]


def test_structures_and_row_vectors_in_mat(tmp_path: Path) -> None:
    values = {"log": {"t": np.arange(4.0), "x": {"torque": np.ones((1, 4))}}, "angle": np.ones((4, 1))}
    scipy.io.savemat(tmp_path / "a.mat", values)
    axis = axis1(time={"column": "log.t"})
    axis["torque"]["column"], axis["angle"]["column"] = "log.x.torque", "angle"
    block, _ = samples_of(tmp_path / "a.mat", tmp_path, axis)
    assert block.t_us.tolist() == [0, 1_000_000, 2_000_000, 3_000_000]


def fault(path: Path, axis: dict[str, Any]) -> str:
    with pytest.raises(RecordError) as caught:
        list(read_record(path, make_config(path.parent, axis)).steps())
    assert str(path) in str(caught.value)
    return str(caught.value).removeprefix(str(path))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2,3\n" * 3 + "1,2,3,4\n", ", line 5: 4 cells in a table of 3 columns"),
        ("1,2,3\n1,2\n", ", line 3: 2 cells in a table of 3 columns"),
        ("1,2,3\n\n1,1;5,3\n", ", line 4: column \"torque_one\" holds '1;5', which is no number"),
        (
            "1,2,3\n" * 900 + "1,2,off\n" * 10,
            ", line 902: column \"angle_one\" holds 'off', which is no number",
        ),
        (
            '1,2,"[3, 4]"\n1,2,3\n',
            ", line 2: column \"angle_one\" holds '[3, 4]', which is no number: give each of its values a column",
        ),
        (
            '1,2,"(3, 4)"\n1,2,3\n',
            ", line 2: column \"angle_one\" holds '(3, 4)', which is no number: give each of its values a column",
        ),
        (
            "1,2,\"array('d', [3, 4])\"\n1,2,3\n",
            ', line 2: column "angle_one" holds "array(\'d\', [3, 4])", which is no number: give each of its values a'
            " column",
        ),
    ],
)
def test_a_wrong_line_of_a_csv(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.csv").write_text("t,torque_one,angle_one\n" + text, encoding="utf-8")
    assert fault(tmp_path / "a.csv", timed()) == message


@pytest.mark.parametrize(
    ("wrong", "places"),
    [
        ({20: "0.1,2"}, ["line 22: 2 cells in a table of 3 columns"]),
        ({9000: "x,y,z", 18000: "1,2,3,4"}, ['line 9002: column "t" holds', "line 18002: 4 cells"]),
        ({19999: "199.99,0.5"}, ["line 20001: 2 cells in a table of 3 columns"]),
        ({19999: "199.99,0.5,-"}, ["line 20001: column \"angle_one\" holds '-', which is no number"]),
    ],
)
def test_lines_that_cannot_be_read_are_left_out(wrong: dict[int, str], places: list[str], tmp_path: Path) -> None:
    """Others are as they were; arrow reads 1 MB at once, here 40 000 lines."""
    lines = [f"{0.01 * k:.2f},{k},{-k}" for k in range(20_000)]
    rows = [wrong.get(k, line) for k, line in enumerate(lines)]
    path = tmp_path / "a.csv"
    path.write_text("t,torque_one,angle_one\n" + "\n".join(rows), encoding="utf-8")
    table = open_table(path)
    torque = np.concatenate([block.columns["torque_one"] for block in table.rows(["t", "torque_one", "angle_one"])])
    assert torque.tolist() == [k for k in range(20_000) if k not in wrong]
    assert isinstance(table, CsvTable)
    assert [left.startswith(place) for left, place in zip(table.left_out, places, strict=True)] == [True] * len(wrong)
    record = read_record(path, make_config(tmp_path, timed()))
    assert sum(step.samples["r.one"].size for step in record.steps() if "r.one" in step.samples) == torque.size
    assert record.quality.axis_dropped["r.one"]["unreadable"] == len(wrong)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", b"", ": the first line must hold names of columns, or numbers; it is empty"),
        ("a.csv", b"\xff\xfe\x00", " is no CSV file: its first line is no text"),
        ("a.parquet", b"t,u\n1,2\n", " is no Parquet file"),
        ("a.mat", b"t,u\n1,2\n", " is damaged or no MATLAB file"),
        ("a.mat", b"", " is damaged or no MATLAB file"),
    ],
)
def test_a_file_that_is_no_record(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    assert fault(tmp_path / name, timed()).startswith(message)


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".log", ".blf"])
def test_a_file_that_is_not_there(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(RecordError, match=f"cannot read .*a{suffix}: .*No such file"):
        read_record(tmp_path / f"a{suffix}", make_config(tmp_path, timed()))


@pytest.mark.parametrize("suffix", [".parquet", ".mat"])
@pytest.mark.parametrize("cut", [0.02, 0.5, 0.98])
def test_a_file_that_is_cut_off(tmp_path: Path, suffix: str, cut: float, seed: int) -> None:
    path = tmp_path / f"a{suffix}"
    write_table(path, columns(seed))
    data = path.read_bytes()
    path.write_bytes(data[: int(cut * len(data))])
    assert fault(path, timed())


@pytest.mark.parametrize("suffix", [".parquet", ".mat"])
def test_a_column_of_words(tmp_path: Path, suffix: str, seed: int) -> None:
    table = columns(seed, 3)
    table["angle_one"] = ["a", "b", "c"]
    write_table(tmp_path / f"a{suffix}", table)
    assert '"angle_one" holds' in fault(tmp_path / f"a{suffix}", timed())


def test_variables_that_are_no_columns(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "a.mat"
    write_table(path, {**columns(seed, 4), "angle_one": np.ones((2, 2))})
    assert fault(path, timed()) == ': variable "angle_one" is no vector, its size is (2, 2)'
    write_table(path, {**columns(seed, 4), "angle_one": np.ones(3)})
    assert fault(path, timed()).startswith(": the variables differ in length: {'torque_one': 4")


def test_a_configuration_without_columns(tmp_path: Path, seed: int) -> None:
    write_table(tmp_path / "a.csv", columns(seed, 5))
    axis = timed()
    del axis["angle"]["column"]
    with pytest.raises(RecordError, match=r"axis r\.one: angle\.column is missing"):
        read_record(tmp_path / "a.csv", make_config(tmp_path, axis))
    del axis["torque"]["column"]
    assert "no axis has columns in the configuration" in fault(tmp_path / "a.csv", axis)


def written(path: Path, table: dict[str, Any], row: Callable[..., str], header: str) -> Path:
    rows = zip(*table.values(), strict=True)
    path.write_text(header + "\n" + "".join(f"{row(*cells)}\n" for cells in rows), encoding="utf-8")
    return path


def test_a_decimal_comma_and_semicolons(tmp_path: Path, seed: int) -> None:
    """As spreadsheets write them in half of Europe; the last line is torn, and the one before holds no number."""
    table = columns(seed)

    def row(*cells: float) -> str:
        return ";".join(f"{cell:.17g}".replace(".", ",") for cell in cells)

    path = written(tmp_path / "a.csv", table, row, ";".join(table))
    with path.open("a", encoding="utf-8") as file:
        file.write("200,0;1,0;x;3\n200,005;1")
    read = CsvTable(path)
    blocks = list(read.rows(["t", "angle_one"]))
    assert np.array_equal(np.concatenate([b.columns["angle_one"] for b in blocks]), table["angle_one"])
    assert np.array_equal(np.concatenate([b.columns["t"] for b in blocks]), table["t"])
    assert [line.partition(":")[0] for line in read.left_out] == [f"line {N + 2}", f"line {N + 3}"]


def test_a_decimal_comma_without_names(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("0,5;1,25\n0,75;-1e-3\n", encoding="utf-8")
    table = CsvTable(tmp_path / "a.csv")
    (block,) = table.rows(["0", "1"])
    assert [block.columns[name].tolist() for name in table.names] == [[0.5, 0.75], [1.25, -1e-3]]


@pytest.fixture
def berlin(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The clock of the computer is that of Berlin."""
    with monkeypatch.context() as patch:
        patch.setenv("TZ", "Europe/Berlin")
        time.tzset()
        yield
    time.tzset()


@pytest.mark.usefixtures("berlin")
@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
@pytest.mark.parametrize("between", ["T", " "])
@pytest.mark.parametrize("torn", [False, True])
def test_dates_are_seconds(tmp_path: Path, zone: str, between: str, torn: bool) -> None:
    """Without a zone in UTC, wherever the computer is; also in the hour that summer time leaves out."""
    begin = datetime(2026, 3, 29, 0, 59, 59, 990_000)
    dates = [(begin + timedelta(milliseconds=5 * k)).isoformat(between, "microseconds") + zone for k in range(9)]
    table = {"Time": dates, "torque_one": range(9), "angle_one": range(9)}
    path = written(tmp_path / "a.csv", table, lambda *cells: ",".join(map(str, cells)), ",".join(table))
    if torn:
        with path.open("a", encoding="utf-8") as file:
            file.write("2026-03-")
    block, dropped = samples_of(path, tmp_path, axis1(time={"column": "Time"}))
    first_us = round(datetime.fromisoformat(dates[0] + ("" if zone else "Z")).timestamp() * 1e6)
    assert block.t_us.tolist() == [first_us + 5000 * k for k in range(9)]
    assert dropped == ({"unreadable": 1} if torn else {})


@pytest.mark.parametrize("kind", [pa.list_(pa.float64()), pa.large_list(pa.float32()), pa.list_(pa.float64(), 2)])
def test_elements_of_lists_in_a_parquet_file(tmp_path: Path, kind: pa.DataType) -> None:
    """As of joint states: names, and for each quantity a list of all axes; a missing list is no sample."""
    lists = [None if k == 5 else [float(k), k / 4] for k in range(9)]
    table = {"time": np.arange(9.0), "name": [["one", "two"]] * 9, "effort": pa.array(lists, kind)}
    pq.write_table(pa.table(table), tmp_path / "a.parquet")
    read = open_table(tmp_path / "a.parquet")
    assert read.names == ("time", "name[0]", "name[1]", "effort[0]", "effort[1]")
    (columns,) = read.rows(["effort[1]", "effort[0]"])
    expected = [np.nan if k == 5 else float(k) for k in range(9)]
    assert list(columns.columns) == ["effort[1]", "effort[0]"]
    assert columns.columns["effort[0]"] == pytest.approx(expected, nan_ok=True)
    assert columns.columns["effort[1]"] == pytest.approx(np.array(expected) / 4, nan_ok=True)
    with pytest.raises(RecordError, match='column "name" holds lists of other lengths, or no numbers'):
        next(read.rows(["name[0]"]))


def test_lists_of_other_lengths_in_a_parquet_file(tmp_path: Path) -> None:
    lists = {"u": [[1.0, 2.0], [3.0]], "empty": [[], []], "none": pa.array([None, None], pa.list_(pa.float64()))}
    pq.write_table(pa.table(lists), tmp_path / "a.parquet")
    read = open_table(tmp_path / "a.parquet")
    assert read.names == ("empty", "none", "u[0]", "u[1]")
    with pytest.raises(RecordError, match='column "u" holds lists of other lengths, or no numbers'):
        next(read.rows(["u[1]"]))
    with pytest.raises(RecordError, match='column "empty" holds list'):
        next(read.rows(["empty"]))
    pq.write_table(pa.table(lists).slice(0, 0), tmp_path / "b.parquet")
    assert open_table(tmp_path / "b.parquet").names == ("u", "empty", "none")


def test_dates_of_a_parquet_file_are_seconds(tmp_path: Path) -> None:
    dates = [datetime(2026, 1, 1, 0, 0, 0, 5000 * k, UTC) for k in range(9)]
    table = {"Time": pa.array(dates), "torque_one": np.arange(9.0), "angle_one": np.arange(9.0)}
    pq.write_table(pa.table(table), tmp_path / "a.parquet")
    block, _ = samples_of(tmp_path / "a.parquet", tmp_path, axis1(time={"column": "Time"}))
    assert block.t_us.tolist() == [round(date.timestamp() * 1e6) for date in dates]
    assert open_table(tmp_path / "a.parquet").units == {"Time": "s"}
