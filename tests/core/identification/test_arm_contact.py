"""An arm whose tool presses for a part of the time: which of several signals tells of that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.identification import ArmSignals, Record, arm_contact

STEP_S, SECONDS = 0.01, 240.0
LIMITS = {"spindle": -0.3, "contact": 0.3, "late": 0.4}
"""Each signal is 1 while a sine exceeds this"""


def grinding(rng: np.random.Generator) -> Record:
    """An axis that lifts its own link, and presses with a varying force while "contact" is 1.

    "spindle" is 1 for longer, "late" for a part of that time.
    """
    t = np.arange(0.0, SECONDS, STEP_S)
    f, phase = rng.uniform(0.1, 0.6, (5, 1)), rng.uniform(0, 2 * np.pi, (5, 1))
    q = 1.2 * np.sin(2 * np.pi * f * t + phase).mean(axis=0)
    w = np.gradient(q, STEP_S)
    cycle = np.sin(2 * np.pi * t / 13.7)
    signals = {name: (cycle > limit).astype(float) for name, limit in LIMITS.items()}
    force = np.interp(t, np.arange(SECONDS + 1), rng.uniform(2, 25, round(SECONDS) + 1))
    u = 4 * np.gradient(w, STEP_S) + 40 * np.cos(q) + 0.8 * w + np.tanh(w / 0.05)
    u += force * np.sin(q - 0.4) * signals["contact"] + rng.normal(0, 0.1, t.size)
    return Record(t, u, q, "angle", signals={"lift": q, "base": np.sin(t), **signals})


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("spindle", "late", "contact"), "contact"),
        (("spindle",), "spindle"),
        (("late",), "late"),
    ],
)
def test_the_signal_that_leaves_most_of_the_time_tells_if_it_leaves_little_torque(
    names: tuple[str, ...], expected: str, seed: int
) -> None:
    signals = ArmSignals("lift", ["lift", "base"], names)
    found = arm_contact([grinding(np.random.default_rng(seed))], signals, 0.0, 0.1)
    assert found is not None
    assert (found.force.signal, found.force.free, found.force.pressing) == (expected, 0.0, 1.0)
    assert found.load.weights.terms == ("cos(lift)",)
    assert found.force.explained == found.load.weights.explained


def test_no_signal_tells_where_loads_explain_the_torque_as_well(seed: int) -> None:
    record = grinding(np.random.default_rng(seed))
    signals = ArmSignals("lift", ["lift", "base"], ["contact"])
    found = arm_contact([record], signals, 0.0, 0.1)
    assert found is not None
    left = 1 - found.force.explained
    assert arm_contact([record], signals, 1 - 1.5 * left, 0.1) is not None
    assert arm_contact([record], signals, 1 - 1.3 * left, 0.1) is None


def test_what_is_left_of_the_force_when_the_signal_has_changed_is_left_out(seed: int) -> None:
    """The signal changes 0.3 s before the force comes and goes."""
    record = grinding(np.random.default_rng(seed))
    early = np.roll(record.signals["contact"], -round(0.3 / STEP_S))
    record = replace(record, signals={**record.signals, "contact": early})
    signals = ArmSignals("lift", ["lift", "base"], ["contact"])
    left = []
    for settle_s in (0.0, 0.4):
        found = arm_contact([record], signals, 0.0, settle_s)
        assert found is not None
        left.append((1 - found.force.explained) ** 2)
    assert left[1] < left[0] / 2
