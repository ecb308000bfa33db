"""An axis that presses for a part of its cycle: what a signal tells of that, and what a gate leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Bools, Floats
from monitor_core.identification import Record, contact_force, rigid_fit
from monitor_core.identification.predictor.prepared_record import series
from monitor_core.identification.records.record_parts import open_pieces
from monitor_core.identification.records.uniform_grid import on_grid, resample

STEP_S, SECONDS = 0.004, 120.0
T: Floats = STEP_S * np.arange(round(SECONDS / STEP_S), dtype=np.float64)
INERTIA, VISCOUS, COULOMB, SCALE = 0.05, 0.1, 0.5, 0.05


class Motion:
    """An angle of some sines [rad], with its speed and acceleration (N,)."""

    def __init__(self, rng: np.random.Generator) -> None:
        f, phase = rng.uniform(0.3, 0.9, 5), rng.uniform(0, 2 * np.pi, 5)
        self.q = 2 * np.sin(2 * np.pi * f[:, np.newaxis] * T + phase[:, np.newaxis]).mean(axis=0)
        self.w = np.gradient(self.q, STEP_S)
        self.a = np.gradient(self.w, STEP_S)

    def record(self, rng: np.random.Generator, force: Floats, switch: Bools, mass: float | Floats = 0.0) -> Record:
        """The record with this further torque, and mass, of which the signal "closed" tells."""
        u = (INERTIA + mass) * self.a + VISCOUS * self.w + COULOMB * np.tanh(self.w / SCALE) + force
        u += 0.02 * rng.standard_normal(T.size)
        return Record(T, u, self.q, "angle", "a.csv", signals={"closed": switch.astype(float), "other": T})

    def pressing(self, rng: np.random.Generator, stiffness: float = 12.0) -> Record:
        """It presses against a spring at the end of its way."""
        depth = np.minimum(self.q + 0.3, 0.0)
        return self.record(rng, stiffness * depth, depth < 0)


@pytest.fixture
def rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_a_signal_tells_when_the_axis_presses(rng: np.random.Generator) -> None:
    record = Motion(rng).pressing(rng)
    found = contact_force([record], ["other", "closed"])
    assert found is not None
    assert (found.signal, found.free, found.pressing) == ("closed", 0.0, 1.0)
    assert found.explained > 0.9
    opened = replace(record, signals={"open": 1 - record.signals["closed"]})
    found = contact_force([opened], ["open"])
    assert found is not None
    assert (found.signal, found.free, found.pressing) == ("open", 1.0, 0.0)


def test_what_is_carried_is_no_force_of_that_kind(rng: np.random.Generator) -> None:
    """It adds to the torque and to the inertia, so both parts can be used."""
    motion, switch = Motion(rng), np.sin(2 * np.pi * 0.05 * T) > 0
    carried = motion.record(rng, np.where(switch, 3.0, 0.0), switch, np.where(switch, 2 * INERTIA, 0.0))
    assert contact_force([carried], ["closed"]) is None
    assert contact_force([motion.record(rng, np.where(switch, 2.0, 0.0), switch)], ["closed"]) is None
    assert contact_force([motion.record(rng, np.zeros(T.size), switch)], ["closed", "other"]) is None


def test_the_balance_leaves_out_what_a_closed_gate_does(rng: np.random.Generator) -> None:
    record = Motion(rng).pressing(rng)
    gate = record.signals["closed"] == 0
    every, free = rigid_fit(record, SCALE), rigid_fit(replace(record, gate=gate), SCALE)
    assert every is not None
    assert free is not None
    assert abs(every.inertia - INERTIA) > 0.3 * INERTIA
    assert free.inertia == pytest.approx(INERTIA, rel=0.05)
    assert free.torques["coulomb"] == pytest.approx(COULOMB, rel=0.1)


def test_errors_count_while_the_gate_is_open(rng: np.random.Generator) -> None:
    record = Motion(rng).pressing(rng).without(np.arange(5))
    gate = record.signals["closed"] == 0
    gated = replace(record, gate=gate)
    prepared = series(gated, ())
    assert prepared.measured.tolist() == record.measured.astype(int).tolist()  # they correct the state
    assert prepared.counts.tolist() == (record.measured & gate).astype(int).tolist()
    assert on_grid([gated])[0].known.tolist() == (record.measured & gate).tolist()
    assert gated.select(slice(10, 90)).judged.tolist() == gated.judged[10:90].tolist()
    with pytest.raises(ValueError, match=r"a\.csv: the gates of the axis are closed throughout"):
        series(replace(record, gate=np.zeros(T.size, np.bool_)), ())


def test_pieces_are_open_throughout() -> None:
    t = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 3.0, 3.1, 3.2])
    gate = np.array([1, 1, 1, 0, 1, 0, 1, 1, 1, 0], np.bool_)
    record = Record(t, np.zeros(10), np.arange(10.0), "angle", gate=gate)
    assert [piece.y.tolist() for piece in open_pieces(record)] == [[0, 1, 2], [7, 8]]
    fine = resample(replace(record, t=np.linspace(0.0, 0.9, 10)), 0.2)
    assert fine.judged[1:-1].tolist() == (gate[::2] & fine.measured)[1:-1].tolist()
