"""Files become records for identification: ranges, torn rows, further signals, where they come from."""

import hashlib
import math
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor_core.identification import KnownAxis, check_record
from monitor_core.modeling.standard_drives import reference_model
from service.can.frame_recorder import FrameRecorder
from service.can.frames import Frame, FrameBlock
from service.can.user_errors import RecordError
from service.config.schema import Config
from service.ingest.records.loaded_records import Loaded, load, load_samples
from service.ingest.records.record_files import read_record, samples_of
from service.ingest.records.record_ranges import Wanted, in_order_of_time, wanted
from tests.service.ingest.plant import (
    START_US,
    angle1,
    axis1,
    axis2,
    both2,
    make_config,
    torque1,
    write_table,
)

N = 20_000  # more than one block of rows
SPEED = {"name": "speed", "message": "Both2", "signal": "Speed", "column": "w", "factor": 2.0, "offset": 1.0}


def table(seed: int, count: int = N) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    columns = {name: rng.normal(size=count) for name in ("torque_one", "angle_one", "w")}
    return {"t": 50.0 + 0.005 * np.arange(count, dtype=float), **columns}


def timed(folder: Path, **other: Any) -> Config:
    return make_config(folder, axis1(time={"column": "t"}, signal=[SPEED], **other))


def test_a_table_becomes_a_record(tmp_path: Path, seed: int) -> None:
    columns = table(seed)
    path = write_table(tmp_path / "a.csv", columns)
    found = load(str(path), timed(tmp_path), "r.one")
    record = found.record
    assert (record.quantity, record.name, len(record)) == ("angle", "a.csv", N)
    assert record.t == pytest.approx(columns["t"] - 50.0, abs=1e-9)
    assert np.array_equal(record.u, columns["torque_one"])
    assert np.array_equal(record.y, columns["angle_one"])
    assert record.measured.all()
    assert np.array_equal(record.signals["speed"], 2 * columns["w"] + 1)
    assert found.source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (found.source.samples, found.source.used, set(found.source.dropped.values())) == (N, N, {0})
    assert found.source.words == f"{path}: {N} samples; dropped: nothing"


@pytest.mark.parametrize(
    ("text", "path", "start", "end"),
    [
        ("a.csv", "a.csv", None, None),
        ("a.csv@10:60", "a.csv", 10, 60),
        ("a@b.csv@1.5:", "a@b.csv", 1.5, None),
        ("a.csv@:.5", "a.csv", None, 0.5),
        ("a.csv@:", "a.csv", None, None),
        ("me@home/a.csv", "me@home/a.csv", None, None),
    ],
)
def test_ranges(text: str, path: str, start: float | None, end: float | None) -> None:
    assert wanted(text) == Wanted(Path(path), start, end)


def test_a_file_that_is_called_like_a_range(tmp_path: Path) -> None:
    (tmp_path / "a@1:2").touch()
    assert wanted(str(tmp_path / "a@1:2")) == Wanted(tmp_path / "a@1:2")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a.csv@5:2", "ends before its start"),
        ("a.csv@1.2.3:", "a range is @START"),
        ("a.csv@1,5:6", "a range is @START"),
        ("a.csv@8:00:9:00", "a range is @START"),
    ],
)
def test_ranges_that_are_none(text: str, problem: str) -> None:
    with pytest.raises(RecordError, match=f"^{re.escape(text)}: .*{problem}"):
        wanted(text)


def test_a_range_counts_from_the_first_sample(tmp_path: Path, seed: int) -> None:
    columns = table(seed)
    path = write_table(tmp_path / "a.csv", columns)
    found = load(f"{path}@10:60", timed(tmp_path), "r.one")
    assert np.array_equal(found.record.u, columns["torque_one"][2000:12001])
    assert (found.source.used, found.source.start_s, found.source.end_s) == (10001, 10.0, 60.0)
    assert found.source.words == f"{path}: {N} samples, 10001 of them from 10 to 60 s; dropped: nothing"


def test_rows_that_are_no_samples_are_dropped_by_reason(tmp_path: Path, seed: int) -> None:
    columns = table(seed, 100)
    columns["torque_one"][3] = np.nan
    columns["angle_one"][[4, 5]] = 1e293, 1e9
    columns["torque_one"][6] = -1e7
    columns["w"][7] = 1e200
    columns["t"][9] = columns["t"][8]
    columns["t"][11] = columns["t"][2]
    path = write_table(tmp_path / "a.parquet", columns)
    found = load(str(path), timed(tmp_path), "r.one")
    dropped = {reason: count for reason, count in found.source.dropped.items() if count}
    assert dropped == {"not_finite": 1, "absurd": 4, "repeated": 1, "out_of_order": 1, "missing": 7}
    kept = np.delete(np.arange(100), [3, 4, 5, 6, 7, 9, 11])
    assert np.array_equal(found.record.u, columns["torque_one"][kept])
    assert np.array_equal(found.record.signals["speed"], 2 * columns["w"][kept] + 1)
    assert "1 not finite, 4 absurd, 1 repeated, 1 out of order, 7 missing" in found.source.words


def nameless(folder: Path) -> Config:
    axis = axis1(time={"column": "0"})
    axis["torque"]["column"], axis["angle"]["column"] = "2", "1"
    return make_config(folder, axis)


def test_a_torn_row_of_a_file_without_names_is_refused_as_a_whole(tmp_path: Path, seed: int) -> None:
    """Its own torque and angle look harmless; another cell gives it away."""
    rng = np.random.default_rng(seed)
    cells = np.column_stack((0.005 * np.arange(50, dtype=float), rng.normal(size=(50, 4))))
    cells[[7, 8], [3, 4]] = 5.9e293, -1e66
    path = tmp_path / "a.csv"
    np.savetxt(path, cells, delimiter=",")
    found = load(str(path), nameless(tmp_path), "r.one")
    assert found.record.u == pytest.approx(np.delete(cells[:, 2], [7, 8]))
    assert found.source.dropped["absurd"] == 2


def test_a_time_that_runs_ahead_costs_its_own_row_only(tmp_path: Path, seed: int) -> None:
    columns = table(seed, 100)
    columns["t"][[20, 21]] *= 1000
    columns["t"][40] = 50.41
    found = load(str(write_table(tmp_path / "a.csv", columns)), timed(tmp_path), "r.one")
    assert np.array_equal(found.record.u, np.delete(columns["torque_one"], [20, 21, 40]))
    assert "3 missing, 3 ahead" in found.source.words
    config = timed(tmp_path)
    (block,), _ = load_samples([str(tmp_path / "a.csv")], config, config.axes[0], reference_model("angle"))
    assert np.array_equal(block.u, found.record.u), "calibration has the same samples"


def test_files_that_continue_one_another_are_one_record(tmp_path: Path, seed: int) -> None:
    """As a recorder begins another file each minute; up to ten intervals may lie between them."""
    columns, config = table(seed, 4000), timed(tmp_path)
    ends = [0, 1000, 1500, 2600, 3000, 4000]
    for k, (begin, end) in enumerate(pairwise(ends)):
        first = begin + {2: 9, 3: 10}.get(k, 0)  # ten intervals from the sample before, and eleven
        write_table(tmp_path / f"{k}.csv", {name: values[first:end] for name, values in columns.items()})
    texts = [str(tmp_path / f"{k}.csv") for k in range(5)]
    blocks, sources = load_samples(texts, config, config.axes[0], reference_model("angle"))
    assert [block.name for block in blocks] == ["0.csv", "3.csv"]
    assert [source.text for source in sources] == texts
    left = [*range(1500), *range(1509, 2600)], [*range(2610, 4000)]
    for block, rows in zip(blocks, left, strict=True):
        assert np.array_equal(block.u, columns["torque_one"][rows])
    again, _ = load_samples([texts[1], texts[0]], config, config.axes[0], reference_model("angle"))
    assert len(again) == 2


@pytest.mark.parametrize(("begin_s", "ordered"), [(1.7e9, True), (50.0, False)])
def test_records_with_dates_are_taken_in_the_order_of_their_times(
    tmp_path: Path, seed: int, begin_s: float, ordered: bool
) -> None:
    """A shell lists log_10 before log_2.  Without dates each may begin at the same time, whatever it says."""
    columns, config = table(seed, 3000), timed(tmp_path)
    columns["t"] = begin_s + 0.005 * np.arange(3000)
    for number, rows in {1: slice(0, 1000), 2: slice(1000, 2000), 10: slice(2000, 3000)}.items():
        write_table(tmp_path / f"log_{number}.csv", {name: values[rows] for name, values in columns.items()})
    first, second, tenth = (str(tmp_path / f"log_{number}.csv") for number in (1, 2, 10))
    assert in_order_of_time([first, tenth, second], config) == (
        [first, second, tenth] if ordered else [first, tenth, second]
    )
    assert in_order_of_time([f"{first}@3:", tenth, f"{first}@:2"], config) == (
        [f"{first}@:2", f"{first}@3:", tenth] if ordered else [f"{first}@3:", tenth, f"{first}@:2"]
    )
    assert in_order_of_time([second, f"{first}@1:", first], config) == [second, f"{first}@1:", first], "two overlap"
    missing = str(tmp_path / "log_3.csv")
    assert in_order_of_time([tenth, missing, first], config) == [tenth, missing, first]


def test_a_record_of_one_sample(tmp_path: Path) -> None:
    (tmp_path / "short.csv").write_text("t,torque_one,angle_one,w\n0,1,1,1\n1,nan,1,1\n")
    with pytest.raises(RecordError, match=r"1 samples of axis r\.one in it; dropped: 1 not_finite"):
        load(str(tmp_path / "short.csv"), timed(tmp_path), "r.one")


def log_of(path: Path, count: int = 200) -> Path:
    """Torque and angle of axis one each cycle, the speed every tenth: 2 ms after the sample, and first in cycle 5."""
    frames = list[Frame]()
    for k in range(count):
        t_us = START_US + 5000 * k
        frames += [torque1(t_us, k % 50 / 512), angle1(t_us + 100, k / 64)]
        frames += [both2(t_us + 2000, 0.0, k)] if k % 10 == 5 else []
    with FrameRecorder(path) as recorder:
        recorder.write("bus0", FrameBlock.from_frames(frames))
    return path


SPEEDS = [2.0 * ((k - 6) // 10 * 10 + 5) + 1 for k in range(6, 200)]
"""As the daemon has them: from the first sample after the one during which the speed was received."""


def test_a_can_log_becomes_the_samples_of_replay(tmp_path: Path) -> None:
    config, path = make_config(tmp_path, axis1(signal=[SPEED]), axis2()), log_of(tmp_path / "a.log")
    record = load(str(path), config, "r.one").record
    block = samples_of(read_record(path, config), "r.one")
    assert record.t == pytest.approx((block.t_us - block.t_us[0]) / 1e6, abs=1e-12)
    assert (len(record), record.u.tolist(), record.y.tolist()) == (200, block.u.tolist(), block.y.tolist())
    assert np.isnan(record.signals["speed"][:6]).all()
    assert record.signals["speed"][6:].tolist() == SPEEDS


def test_a_signal_is_held_as_long_as_the_daemon_holds_it(tmp_path: Path, seed: int) -> None:
    """In a log from its receipt, in a table from its row; of a row that was refused it is not taken."""
    signal = {**SPEED, "max_age_s": 0.02}
    config = make_config(tmp_path, axis1(time={"column": "t"}, signal=[signal]))
    found = load(str(log_of(tmp_path / "a.log")), config, "r.one").record.signals["speed"]
    assert found[5:16].tolist() == pytest.approx([math.nan, *[11.0] * 4, *[math.nan] * 6], nan_ok=True)
    columns = table(seed, 40)
    columns["w"][1:] = np.nan
    columns["w"][[20, 30]], columns["torque_one"][30] = 5.0, 1e9
    path = write_table(tmp_path / "a.parquet", columns)
    found = load(str(path), config, "r.one").record.signals["speed"]
    known = np.flatnonzero(np.isfinite(found))
    assert known.tolist() == [*range(5), *range(20, 25)]
    assert set(found[20:25]) == {11.0}


def test_a_signal_that_never_comes_or_is_in_no_table(tmp_path: Path, seed: int) -> None:
    config = make_config(tmp_path, axis1(signal=[{"name": "x", "message": "Other", "signal": "Something"}]))
    found = load(str(log_of(tmp_path / "a.log")), config, "r.one")
    assert np.isnan(found.record.signals["x"]).all()
    path = write_table(tmp_path / "a.csv", table(seed, 100))
    only_on_the_bus = make_config(tmp_path, axis1(signal=[{**SPEED, "column": None}]))
    assert load(str(path), only_on_the_bus, "r.one").record.signals == {}


def real(
    folder: Path, torque: str, motion: str, output: str, time: str | None, interval_s: float
) -> tuple[Config, str]:
    make = axis1 if output == "angle" else axis2
    axis = make(
        sample_interval_s=interval_s,
        pairing_tolerance_s=interval_s / 3,
        time={"column": time} if time else {},
    )
    axis["torque"]["column"], axis[output]["column"] = torque, motion
    return make_config(folder, axis), f"r.{axis['name']}"


def kinds(found: Loaded) -> list[tuple[str, str]]:
    return [(f.kind, f.severity) for f in check_record(found.record, KnownAxis(parameters=10))]


@pytest.mark.records
def test_the_records_of_real_axes_are_healthy(tmp_path: Path, records_dir: Path) -> None:
    irb = load(str(records_dir / "irb/robot_arm.mat"), *real(tmp_path, "torque", "speed", "speed", None, 0.0005))
    assert len(irb.record) == 19838
    assert irb.record.interval_s == pytest.approx(0.0005)
    assert kinds(irb) == []
    emps = load(str(records_dir / "emps/DATA_EMPS.mat"), *real(tmp_path, "vir", "qm", "angle", "t", 0.001))
    assert len(emps.record) == 24841
    assert emps.record.duration_s == pytest.approx(24.84)
    assert kinds(emps) == []


@pytest.mark.records
@pytest.mark.parametrize(("joint", "samples"), [(1, 5889), (2, 6030)])
def test_the_jittered_record_of_a_real_axis(tmp_path: Path, records_dir: Path, joint: int, samples: int) -> None:
    config = real(tmp_path, str(12 + joint), str(joint), "angle", "0", 0.0105)
    found = load(str(records_dir / f"ur10e/ur-20_01_22-joint_{joint}.csv"), *config)
    assert (found.source.samples, sum(found.source.dropped.values())) == (samples, 0)
    assert found.record.jitter_s == pytest.approx(0.95e-3, rel=0.02)
    assert kinds(found) == [("jitter", "warn")]  # its stamps are multiples of 2 ms


@pytest.mark.records
def test_the_corrupt_record_of_a_real_axis(tmp_path: Path, records_dir: Path) -> None:
    path, config = (
        records_dir / "ur10e/ur-19_09_27-11_32_02.csv",
        real(tmp_path, "13", "1", "angle", "0", 0.0105),
    )
    found = load(str(path), *config)
    dropped = {reason: count for reason, count in found.source.dropped.items() if count}
    assert (found.source.samples, dropped) == (1119, {"absurd": 10, "torn": 10})
    assert abs(found.record.y).max() < 3
    assert kinds(found) == []
