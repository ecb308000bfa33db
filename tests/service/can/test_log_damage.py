"""A damaged log is read as far as it can be, or refused by name; nothing else happens."""

from __future__ import annotations

import random
import re
from itertools import islice
from pathlib import Path

import can
import pytest

from service.can.log_bytes import LogLines
from service.can.log_files import LOG_SUFFIXES, CanLog
from service.can.user_errors import RecordError
from tests.service.can.log_damage import damaged, log_bytes, read_all

KINDS = [*(suffix for suffix in LOG_SUFFIXES if suffix != ".mf4"), ".log.gz", ".blf.gz"]


SOAKED = pytest.param([(1, 600), (20, 600), (200, 400), (2000, 70)], marks=pytest.mark.soak, id="many")


@pytest.mark.parametrize("sizes", [pytest.param([(120, 100)], id="some"), SOAKED])
@pytest.mark.parametrize("kind", KINDS)
def test_any_damage_gives_frames_and_counters_or_an_error(
    tmp_path: Path, kind: str, sizes: list[tuple[int, int]], seed: int
) -> None:
    """``sizes``: frames in a log, and how often it is damaged."""
    rng, path = random.Random(seed), tmp_path / f"a{kind}"
    for frames, logs in sizes:
        content = log_bytes(path, rng, frames)
        for _ in range(logs):
            path.write_bytes(damaged(content, rng))
            read_all(path)


@pytest.mark.parametrize("kind", [".log", ".asc", ".trc", ".log.gz"])
def test_every_truncation_gives_the_frames_before_it(tmp_path: Path, kind: str, seed: int) -> None:
    rng, path = random.Random(seed), tmp_path / f"a{kind}"
    content = log_bytes(path, rng, 60)
    path.write_bytes(content)
    expected, _, problem = read_all(path)
    assert (len(expected), problem) == (60, "")
    for _ in range(100):
        path.write_bytes(content[: rng.randrange(len(content))])
        found, _, problem = read_all(path)
        # A last line without its end may be a frame with fewer bytes, where the format does not say how many.
        sure = found[:-1]
        assert sure == expected[: len(sure)]
        assert problem == "" or problem.endswith(("no CAN frames in it", "(0 frames were read)"))


@pytest.mark.parametrize("kind", [".asc", ".trc"])
def test_a_head_that_is_cut_anywhere_is_no_endless_one(
    tmp_path: Path, kind: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a .trc file of 20 bytes, which ends in the comment behind its version."""
    path, again, repeats = tmp_path / f"a{kind}", LogLines.repeat_head, list[int]()

    def counted(lines: LogLines) -> None:
        repeats.append(lines.number)
        assert len(repeats) < 10, "the same head is read again and again"
        again(lines)

    monkeypatch.setattr(LogLines, "repeat_head", counted)
    content = log_bytes(path, random.Random(seed), 1)
    for end in range(1, len(content)):
        repeats.clear()
        path.write_bytes(content[:end])
        found, _, problem = read_all(path)
        assert found or problem.endswith(("no CAN frames in it", "(0 frames were read)"))


def test_an_object_without_a_length_is_read_once(tmp_path: Path) -> None:
    """In a .blf file, where the next object would begin at the same place."""
    path = tmp_path / "a.blf"
    with can.BLFWriter(path, compression_level=0) as writer:
        for k in range(3):
            writer.on_message_received(can.Message(timestamp=1.76e9 + k, arbitration_id=k, channel=0))
    content = bytearray(path.read_bytes())
    _, first, second, _ = (part.start() for part in re.finditer(b"LOBJ", content))
    assert content[second + 8 : second + 12] == (second - first).to_bytes(4, "little")
    content[second + 8 : second + 12] = bytes(4)
    path.write_bytes(content)
    log = CanLog(path)
    with pytest.raises(RecordError, match=r"an object without a length.*\(2 frames were read\)"):
        list(islice(log.blocks(), 5))
