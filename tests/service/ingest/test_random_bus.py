"""Ten thousand random frames on random buses: nothing but samples comes out, and every frame is accounted for."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

from tests.service.ingest.random_bus import feed_random_frames, random_bus


def test_random_frames_on_random_buses(tmp_path: Path, seed: int) -> None:
    rng, found = random.Random(seed), Counter[str]()
    for _ in range(10):
        found += feed_random_frames(random_bus(tmp_path, rng), rng, 1000, 200)
    assert found["frames"] == 10_000
    for what in ("samples", "unwanted", "too_short", "signal_absent"):
        assert found[what] > 100
