"""A million random frames on two hundred random buses, whose messages a DBC describes."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

import pytest

from tests.service.ingest.random_bus import feed_random_frames, random_bus


@pytest.mark.soak
def test_a_million_random_frames(tmp_path: Path, seed: int) -> None:
    rng, found = random.Random(seed), Counter[str]()
    for _ in range(200):
        found += feed_random_frames(random_bus(tmp_path, rng), rng, 5000, 500)
    print(dict(found))
    assert found["frames"] == 1_000_000
    assert found["samples"] > 10_000
