"""Ten thousand damaged logs of all kinds: frames and counters, or an error that names the file."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.service.can.log_damage import damaged, log_bytes, read_all
from tests.service.can.test_log_damage import KINDS


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
def test_damaged_logs_of_all_sizes(tmp_path: Path, kind: str, seed: int) -> None:
    rng, path = random.Random(seed), tmp_path / f"a{kind}"
    for size, logs in ((1, 600), (20, 600), (200, 400), (2000, 70)):
        content = log_bytes(path, rng, size)
        for _ in range(logs):
            path.write_bytes(damaged(content, rng))
            read_all(path)
