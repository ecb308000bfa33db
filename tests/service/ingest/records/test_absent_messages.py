"""Why a log has no samples of an axis is said by its frames."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.can.frame_recorder import FrameRecorder
from service.can.frames import Frame, FrameBlock
from service.ingest.records.axis_records import absence_words, no_samples_words
from tests.service.ingest.plant import axis1, make_config, write_table

TORQUE, ANGLE = (0x100, False), (0x18FF0100, True)


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        ([(*TORQUE, 4), (*ANGLE, 8)], ""),
        ([(*TORQUE, 8), (0x300, True, 8)], "Angle1 (0x18FF0100) was not received"),
        ([(0x100, True, 4), (*ANGLE, 8)],
         "Torque1 has an identifier of 11 bits by plant.dbc, and 3 frames have 0x100 with 29"),
        ([(*TORQUE, 2), (*TORQUE, 3), (*ANGLE, 0)],
         "Torque1 has 4 bytes by plant.dbc, and its 6 frames 3; Angle1 has 8 bytes by plant.dbc, and its 3 frames 0"),
    ],
)  # fmt: skip
def test_messages_in_place_of_those_of_the_axis(
    tmp_path: Path, frames: list[tuple[int, bool, int]], words: str
) -> None:
    config, log = make_config(tmp_path, axis1()), tmp_path / "a.log"
    with FrameRecorder(log) as recorder:
        for k in range(3):
            block = [Frame(10**15 + k, can_id, extended, bytes(length)) for can_id, extended, length in frames]
            recorder.write("bus0", FrameBlock.from_frames(block))
    assert absence_words(log, config, config.axes[0]) == words


def test_numbers_that_no_machine_has(tmp_path: Path) -> None:
    """As where counts are taken for radians."""
    config = make_config(tmp_path, axis1())
    table = write_table(tmp_path / "a.csv", {"t": [0.0, 0.005], "torque_one": [0.0, 1.0], "angle_one": [2e9, 2e9]})
    words = no_samples_words(table, config, config.axes[0], {"absurd": 2, "unpaired": 1})
    assert words.startswith("2 values are beyond 1e+06 N m or 1e+08 rad, more than any machine has; is the factor")
    assert no_samples_words(table, config, config.axes[0], {"untimed": 2, "late": 0}) == "dropped: 2 untimed"
