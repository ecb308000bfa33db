"""Copies of a record: they are what the axis would have done, without what a gate leaves out."""

import numpy as np
import pytest

from monitor_core.calibration.copy_excursions import simulate_excursions
from monitor_core.calibration.healthy_records import deviations
from monitor_core.calibration.record_doubts import CalibrationError, check_longest
from monitor_core.calibration.surrogate_records import copy_source
from monitor_core.samples import SampleBlock
from tests.core.calibration.healthy_axes import plant_with, record
from tests.shares import soaked

MINUTES_5 = 60_000
FM = 2


@pytest.mark.parametrize(("colour", "bias"), soaked([(0.0, 0.04), (0.9, -0.325)], (0.9, -0.325)))
def test_the_bias_that_colour_makes(colour: float, bias: float, seed: int) -> None:
    """The bias of fm, over sigma, as 400 h of such axes have it; the copies state how far they are off themselves."""
    plant = plant_with(colour)
    healthy = record(plant, seed, MINUTES_5)
    found = simulate_excursions(plant.axis, [healthy], 1.0, np.random.default_rng(seed), 1_000_000)
    off = found.mean[FM] / found.sigma[FM] - bias
    own = float(np.hypot(np.sqrt(found.error[FM, FM]), 0.02))  # so many copies have some chance left
    print(f"colour {colour}: off by {off:+.3f}, stated {own:.3f}")
    assert abs(off) < 5 * own
    assert own < 0.12


def test_records_too_short_for_copies_are_refused() -> None:
    plant = plant_with(0.0)
    with pytest.raises(ValueError, match=r"innovations|learned|memories"):
        simulate_excursions(plant.axis, [record(plant, 1, 1500)], 1.0, np.random.default_rng(1), 1000)


@pytest.mark.parametrize("gated", [False, True])
def test_the_shortest_record_that_is_taken_can_be_copied(gated: bool, seed: int) -> None:
    """Several shorter ones do not help: each begins with an unknown P(0)."""
    plant = plant_with(0.0, memory=100)
    full = record(plant, seed, 6000)
    gate = np.arange(full.size) % 10 < 7 if gated else None

    def parts(samples: int) -> list[SampleBlock]:
        return [full._replace(gate=gate).select(slice(k * samples, (k + 1) * samples)) for k in range(2)]

    def taken(samples: int) -> bool:
        try:
            check_longest(plant.axis, parts(samples))
        except CalibrationError:
            return False
        return True

    shortest = next(samples for samples in range(500, 3000, 10) if taken(samples))
    with pytest.raises(CalibrationError, match=r"the longest record holds .* join the files of one recording"):
        check_longest(plant.axis, parts(shortest - 10))
    copied = full._replace(gate=gate).select(slice(shortest))
    simulate_excursions(plant.axis, [copied], 1.0, np.random.default_rng(seed), 1000)


def test_what_a_gate_leaves_out_is_counted_and_not_copied(seed: int) -> None:
    plant = plant_with(0.0, memory=100)
    ungated = record(plant, seed, 6000)
    is_open = np.arange(6000) % 1000 < 600
    gated = ungated._replace(gate=is_open)
    (found,) = deviations(plant.axis, [gated])
    late = np.arange(6000) >= found.seeding
    assert 0 < found.seeding < 5000
    assert found.gated == np.count_nonzero(late & ~is_open)
    assert not found.tested[~is_open].any()
    source = copy_source(plant.axis, gated)
    assert source is not None
    (first,) = np.flatnonzero(ungated.u == source.u[0])
    np.testing.assert_array_equal(source.u, ungated.u[first:][is_open[first:]])
