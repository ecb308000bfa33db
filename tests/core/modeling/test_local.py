"""What an experiment tells of a drive's parameters, at nominal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.excitation.sensitivity import (
    NOISE_SHARE,
    LocalIdentifiability,
    TorqueExperiment,
    local_identifiability,
    usual_experiment,
)
from monitor_core.modeling.drawing import Drawing, part
from monitor_core.modeling.drive_drawings import three_mass
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.standard_drives import REFERENCE_VALUES


def reference(experiment: TorqueExperiment) -> LocalIdentifiability:
    return local_identifiability(eliminate(three_mass().flat()), REFERENCE_VALUES, experiment)


def test_what_cannot_be_seen_is_held_and_what_is_zero_left_out() -> None:
    told = reference(usual_experiment())
    assert told.held == ("kT", "r")
    assert told.left_out == ("fc", "tau0")
    assert told.accuracy.names == ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm")


def test_noise_given_goes_before_the_share_and_deviations_grow_with_it() -> None:
    usual = reference(usual_experiment())
    louder = reference(replace(usual_experiment(), noise=3 * usual.noise))
    assert louder.noise == 3 * usual.noise
    assert np.allclose(louder.accuracy.standard_deviations, 3 * usual.accuracy.standard_deviations)


def test_the_share_is_that_of_the_output() -> None:
    """A mass alone, moved by a square wave: its speed is a triangle of known rms value."""
    drawing = Drawing(
        "one",
        [
            part("torque", "torque", "m", kT=1),
            part("inertia", "motor", "m", J="J"),
            part("speed-sensor", "s", "m"),
        ],
    )
    N, h, J = 1000, 0.01, 2.0
    torque = np.tile(np.repeat([1.0, -1.0], 50), N // 100)
    told = local_identifiability(
        eliminate(drawing.flat()), {"J": J, "torque.kT": 1.0}, TorqueExperiment(torque, h, "square")
    )
    peak = 50 * h / J
    assert told.noise == pytest.approx(NOISE_SHARE * peak / np.sqrt(3), rel=0.02)


def test_a_slow_torque_cannot_tell_springs() -> None:
    slow = 0.5 * np.sin(2 * np.pi * 0.2 * np.arange(2000) * 0.005)
    told = reference(TorqueExperiment(slow, 0.005, "slow", 0.05))
    words = " ".join(told.accuracy.words())
    assert "cannot" in words
    assert told.accuracy.condition > 100 * reference(usual_experiment()).accuracy.condition


def test_friction_and_inertia_from_a_constant_torque_that_only_heats() -> None:
    """After the start nothing changes any more: one number, the final speed, tells the friction."""
    parts = [
        part("torque", "torque", "m", kT=1),
        part("inertia", "motor", "m", J="J"),
        part("viscous-friction", "b", "m", d="d"),
        part("speed-sensor", "s", "m"),
    ]
    ss = eliminate(Drawing("one", parts).flat())
    values = {"J": 1e-3, "d": 1.0, "torque.kT": 1.0}
    told = local_identifiability(ss, values, TorqueExperiment(np.ones(2000), 0.01, "constant", 0.01))
    deviations = dict(zip(told.accuracy.names, told.accuracy.standard_deviations.tolist(), strict=True))
    assert deviations["d"] < 0.001
    assert deviations["J"] > 0.02
