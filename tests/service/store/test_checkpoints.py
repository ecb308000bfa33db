"""Checkpoints: bit-equal when they come back, quarantined when they cannot be used."""

import random
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from monitor_core.arrays import Arrays
from service.store.checkpoints import (
    Checkpoint,
    Checkpoints,
    MonitorState,
    QuarantinedCheckpoint,
    UnreadableError,
    pack,
    unpack,
)
from tests.service.store.quarantine import quarantined

FILE = "checkpoints.sqlite"


def arrays(seed: int) -> Arrays:
    rng = np.random.default_rng(seed)
    floats = np.concatenate([rng.normal(size=50), [np.nan, np.inf, -0.0, 5e-324]])
    return {"floats": floats, "ints": rng.integers(-(2**63), 2**63 - 1, 20), "none": np.empty((0, 6))}


def assert_equal(a: Arrays, b: Arrays) -> None:
    assert a.keys() == b.keys()
    for name in a:
        assert (a[name].dtype, a[name].shape) == (b[name].dtype, b[name].shape)
        assert a[name].tobytes() == b[name].tobytes()


def test_arrays_come_back_bit_by_bit_the_last_of_each_axis(checkpoints: Checkpoints, seed: int) -> None:
    checkpoints.save([MonitorState("demo.axis1", "key", arrays(seed))], 5)
    found = checkpoints.load("demo.axis1", "key", now_us=6)
    assert isinstance(found, Checkpoint)
    assert found.at_us == 5
    assert_equal(found.arrays, arrays(seed))
    for at_us in (1, 2):
        states = [MonitorState(f"demo.axis{k}", "key", arrays(seed + k + at_us)) for k in range(3)]
        checkpoints.save(states, at_us)
    for k in range(3):
        found = checkpoints.load(f"demo.axis{k}", "key", now_us=3)
        assert isinstance(found, Checkpoint)
        assert_equal(found.arrays, arrays(seed + k + 2))
    assert checkpoints.load("demo.axis9", "key", now_us=3) is None


def test_another_key_is_quarantined_once(checkpoints: Checkpoints, tmp_path: Path, seed: int) -> None:
    checkpoints.save([MonitorState("demo.axis1", "key", arrays(seed))], 5)
    found = checkpoints.load("demo.axis1", "other key", now_us=6)
    assert isinstance(found, QuarantinedCheckpoint)
    assert "another model" in found.reason
    assert checkpoints.load("demo.axis1", "key", now_us=7) is None
    assert quarantined(tmp_path) == [("demo.axis1", found.reason)]


def test_what_the_monitor_refuses_can_be_quarantined(checkpoints: Checkpoints, tmp_path: Path, seed: int) -> None:
    checkpoints.save([MonitorState("demo.axis1", "key", arrays(seed))], 5)
    checkpoints.quarantine("demo.axis1", "no array 'ints'", now_us=6)
    assert checkpoints.load("demo.axis1", "key", now_us=7) is None
    assert quarantined(tmp_path) == [("demo.axis1", "no array 'ints'")]


@pytest.mark.parametrize("column", ["arrays", "key", "checksum", "at_us"])
def test_a_flipped_bit_is_noticed(column: str, tmp_path: Path, seed: int) -> None:
    checkpoints = Checkpoints(tmp_path / FILE)
    checkpoints.save([MonitorState("demo.axis1", "key", arrays(seed))], 5)
    checkpoints.close()
    flip_a_bit(tmp_path / FILE, column, random.Random(seed))
    checkpoints = Checkpoints(tmp_path / FILE)
    found = checkpoints.load("demo.axis1", "key", now_us=6)
    assert isinstance(found, QuarantinedCheckpoint)
    assert "damaged" in found.reason
    assert len(quarantined(tmp_path)) == 1
    checkpoints.close()


def flip_a_bit(path: Path, column: str, random_: random.Random) -> None:
    connection = sqlite3.connect(path)
    (value,) = connection.execute(f"SELECT CAST({column} AS BLOB) FROM checkpoint").fetchone()
    flipped = bytearray(value)
    flipped[random_.randrange(len(flipped))] ^= 1 << random_.randrange(8 if column != "at_us" else 3)
    kind = {"key": "TEXT", "at_us": "INTEGER"}.get(column, "BLOB")
    connection.execute(f"UPDATE checkpoint SET {column} = CAST(? AS {kind})", (bytes(flipped),))
    connection.commit()
    connection.close()


class Pickled:
    ran = False

    def __reduce__(self) -> tuple[type, tuple[()]]:
        return type(self), ()

    def __init__(self) -> None:
        Pickled.ran = True


def test_objects_and_what_was_not_packed_are_refused_and_pickles_never_run(tmp_path: Path, seed: int) -> None:
    objects = np.array([Pickled()], dtype=object)
    with pytest.raises(ValueError, match=r"[Oo]bject"):
        pack({"evil": objects})
    np.savez(tmp_path / "evil.npz", evil=objects)
    Pickled.ran = False
    with pytest.raises(UnreadableError, match="allow_pickle"):
        unpack((tmp_path / "evil.npz").read_bytes())
    assert not Pickled.ran
    random_ = random.Random(seed)
    good = pack(arrays(seed))
    for data in (b"", random_.randbytes(100), good[: random_.randrange(len(good) - 1)]):
        with pytest.raises(UnreadableError):
            unpack(data)
