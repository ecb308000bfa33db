"""A damaged log is read as far as it can be, or refused by name; nothing else happens."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from service.can.log_files import LOG_SUFFIXES
from service.can.log_lines import LogLines
from tests.service.ingest.log_damage import damaged, log_bytes, read_all

KINDS = [*(suffix for suffix in LOG_SUFFIXES if suffix != ".mf4"), ".log.gz", ".blf.gz"]


@pytest.mark.parametrize("kind", KINDS)
def test_any_damage_gives_frames_and_counters_or_an_error(tmp_path: Path, kind: str, seed: int) -> None:
    rng, path = random.Random(seed), tmp_path / f"a{kind}"
    content = log_bytes(path, rng, 120)
    for _ in range(100):
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
    """A .trc file of 20 bytes, which ends in the comment behind its version, was read for ever."""
    path, again, repeats = tmp_path / f"a{kind}", LogLines.again, list[int]()

    def counted(lines: LogLines) -> None:
        repeats.append(lines.number)
        assert len(repeats) < 10, "the same head is read again and again"
        again(lines)

    monkeypatch.setattr(LogLines, "again", counted)
    content = log_bytes(path, random.Random(seed), 1)
    for end in range(1, len(content)):
        repeats.clear()
        path.write_bytes(content[:end])
        found, _, problem = read_all(path)
        assert found or problem.endswith(("no CAN frames in it", "(0 frames were read)"))
