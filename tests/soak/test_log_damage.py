"""Ten thousand damaged logs of every kind: frames and counters, or an error that names the file."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.service.ingest.log_damage import damaged, log_bytes, read_all
from tests.service.ingest.test_log_damage import KINDS


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
def test_ten_thousand_damaged_logs(tmp_path: Path, kind: str, seed: int) -> None:
    rng, path = random.Random(seed), tmp_path / f"a{kind}"
    for size in (1, 20, 200, 2000):
        content = log_bytes(path, rng, size)
        for _ in range(2500 if size < 2000 else 100):
            path.write_bytes(damaged(content, rng))
            read_all(path)
