"""Maps of the poses of a robot in its records, and the share of other poses in the way of an axis."""

import math
from itertools import pairwise

import numpy as np
import pytest

from monitor_core.arrays import Bools, Floats
from monitor_core.drive import Conditions, NominalSchedule, Term
from monitor_core.monitoring import MOST_NEW_POSES, CalibratedRange, ConditionTracker, PoseMap, pose_maps
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

H = 0.005
SETTINGS = Settings(H, lam=0.95)
"""Memory of 20 samples; poses over 200"""
SIGNALS = ("shoulder", "temperature", "elbow")
DEGREE = math.pi / 180


def block(shoulder: Floats, elbow: Floats, speed: Floats | float = 1.0, start: int = 0) -> SampleBlock:
    N = len(shoulder)
    t_us = (start + np.arange(N)) * round(H * 1e6)
    signals = np.column_stack([shoulder, np.full(N, 20.0), elbow])
    return SampleBlock(t_us, np.zeros(N), np.full(N, speed), signals=signals)


def line(turned: float = 0.0, samples: int = 2000) -> tuple[Floats, Floats]:
    """Both angles from 0 to 1 rad and back, together; ``turned``: the elbow the other way by this share."""
    s = 0.5 - 0.5 * np.cos(np.linspace(0, 20 * math.pi, samples))
    return s, s * (1 - turned) + (1 - s) * turned


def found(records: list[SampleBlock], angles: tuple[str, ...] = ("shoulder", "elbow")) -> list[PoseMap]:
    return list(pose_maps(angles, SIGNALS, records))


def test_a_pose_is_known_within_a_cell_of_the_records_and_after_whole_turns() -> None:
    a, b = line()
    (known,) = found([block(a, b)])
    assert known.angles == ("shoulder", "elbow")
    assert known.holds(a, b).all()
    assert known.holds(a + 4.9 * DEGREE, b).all()
    assert known.holds(a + 2 * math.tau, b - math.tau).all()
    assert not known.holds(a + 10.1 * DEGREE, b - 10.1 * DEGREE).any()
    assert known.holds(np.array([math.nan, 3.0]), np.array([0.5, math.nan])).all()


def test_two_angles_in_their_ranges_may_be_a_pose_that_never_was() -> None:
    (known,) = found([block(*line())])
    a, b = line(turned=1.0)
    share = known.holds(a, b).mean()
    assert 0.1 < share < 0.5
    assert found([block(*line())], ()) == []
    (alone,) = found([block(*line())], ("elbow",))
    assert alone.angles == ("elbow", "elbow")
    assert alone.holds(b, b).all()
    assert not alone.holds(b + 2.0, b + 2.0).any()
    assert found([block(*line())._replace(signals=None)]) == []


def test_cells_are_fine_where_poses_come_again(seed: int) -> None:
    """A program repeats its poses; of motion at random, records do not have all of them."""
    rng = np.random.default_rng(seed)
    a, b = line()
    (program,) = found([block(a, b), block(a, 1 - b)])
    assert program.cells.shape == (72, 72)
    knots = np.linspace(0, 1, 40)
    a, b = (np.interp(np.linspace(0, 1, 2000), knots, rng.uniform(0, 2, 40)) for _ in range(2))
    (random,) = found([block(a, b)])
    assert random.cells.shape == (36, 36)


def test_three_angles_have_a_map_of_each_pair() -> None:
    maps = found([block(*line())], ("shoulder", "temperature", "elbow"))
    assert [m.angles for m in maps] == [
        ("shoulder", "temperature"),
        ("shoulder", "elbow"),
        ("temperature", "elbow"),
    ]


def test_digits_of_a_map_are_read_back() -> None:
    (known,) = found([block(*line())])
    again = PoseMap.from_hex(known.angles, known.to_hex())
    np.testing.assert_array_equal(again.cells, known.cells)
    with pytest.raises(ValueError, match="4 hexadecimal digits: need 324 or 1296"):
        PoseMap.from_hex(known.angles, "abc1")


def watch(records: list[SampleBlock]) -> CalibratedRange:
    return CalibratedRange((), ConditionTracker("speed", SETTINGS, SIGNALS, found(records)))


def poses(calibrated: CalibratedRange, samples: SampleBlock) -> Bools:
    inside = calibrated.take(samples)
    assert inside.poses is not None
    np.testing.assert_array_equal(inside.poses, inside.conditions)
    return inside.poses


def test_another_program_is_outside_and_the_old_one_inside_again() -> None:
    calibrated = watch([block(*line())])
    assert poses(calibrated, block(*line(), start=0)).all()
    inside = poses(calibrated, block(*line(turned=1.0), start=2000))
    assert inside[0]
    assert not inside[400:].any()
    assert "of the way of the axis is in poses of the robot that no record" in calibrated.new_poses
    assert calibrated.outside == (calibrated.new_poses,)
    assert poses(calibrated, block(*line(), start=4000))[-1]
    assert list(calibrated.outside) == []
    assert CalibratedRange((), ConditionTracker("speed", SETTINGS, SIGNALS)).take(block(*line())).poses is None


def test_the_share_is_that_of_the_way() -> None:
    """A tenth of the way in new poses is allowed, and a stop there is no way."""
    a, b = line()
    for share, speed, inside in ((0.06, 1.0, True), (0.3, 1.0, False), (0.3, 0.1, True)):
        new = (np.arange(2000) % 20) < 20 * share
        calibrated = watch([block(a, b)])
        taken = poses(calibrated, block(np.where(new, a + 2.0, a), b, np.where(new, speed, 1.0)))
        assert taken[300:].all() == inside
        assert taken[300:].any() == inside
    assert 0.06 < MOST_NEW_POSES < 0.3


def test_any_cut_of_the_samples_gives_the_same_bits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shoulder, elbow = rng.uniform(-4, 4, (2, 1000))
    samples = block(shoulder, elbow, rng.normal(size=1000))
    samples.y[rng.integers(0, 1000, 20)] = np.nan
    maps = found([block(*line())])
    at_once, piecewise = (ConditionTracker("speed", SETTINGS, SIGNALS, maps) for _ in range(2))
    cuts = [0, *sorted(rng.integers(0, 1000, 30).tolist()), 1000]
    parts = [piecewise.take(samples.select(slice(a, b))) for a, b in pairwise(cuts)]
    np.testing.assert_array_equal(at_once.take(samples), np.concatenate(parts))


def test_angles_of_the_pose_are_those_in_cosines_and_sines() -> None:
    terms = ("temperature", "cos(shoulder + elbow)", "payload * sin(elbow)", "square(speed) * cos(wrist)")
    follows = tuple(NominalSchedule("fm", Term.read(term), 1.0, 0.0) for term in terms)
    assert Conditions((), follows[:2], weight=follows[2:]).pose_angles == ("shoulder", "elbow", "wrist")
    assert Conditions((), follows[:1], angles=("wrist",)).pose_angles == ("wrist",)
    assert bool(Conditions(("wrist",), angles=("wrist",))), "poses alone are conditions, too"
    assert Conditions((), follows[:2], angles=("wrist", "elbow")).pose_angles == ("shoulder", "elbow", "wrist")
