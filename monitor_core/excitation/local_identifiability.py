"""Local identifiability: what a given torque tells of the parameters at their nominal values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.excitation.accuracy import Accuracy
from monitor_core.excitation.sensitivity import INTERVAL_S, sensitivities, usual_torque
from monitor_core.modeling.identifiability import structural
from monitor_core.modeling.numbers import drive_of, nominal_of
from monitor_core.modeling.statespace import StateSpace

NOISE_SHARE = 0.01
"""Standard deviation of the noise on the output, as a share of its rms value, where it is not known."""

_SEED = 1


@dataclass(frozen=True, slots=True)
class Experiment:
    """A torque (N,) [N m] held over each interval [s], and the noise on the output [rad or rad/s; None: a share].

    ``words`` says where it comes from.
    """

    torque: Floats
    interval_s: float
    words: str
    noise: float | None = None


def usual_experiment() -> Experiment:
    """The multisine of the reference experiment, 0 to 30 Hz, at 200 samples a second."""
    words = "10 s of a multisine from 0 to 30 Hz, 200 samples a second, 1 N m rms"
    return Experiment(usual_torque(_SEED, 1.0), INTERVAL_S, words)


@dataclass(frozen=True, slots=True)
class Local:
    """``accuracy`` of the parameters that are not ``held`` known nor zero at nominal (``left_out``)."""

    experiment: Experiment
    noise: float
    accuracy: Accuracy
    held: tuple[str, ...]
    left_out: tuple[str, ...]
    quantity: str


def local(
    ss: StateSpace, values: Mapping[str, float] | None, experiment: Experiment, speed_scale: float = 1.0
) -> Local:
    """What the experiment tells of the parameters, those held known without which nothing could be told.

    Raises:
        ModelError: the drive has more than one torque or sensor.
        KeyError, ValueError: a nominal value is missing or makes no sense; the drive cannot be simulated.
    """
    nominal = nominal_of(ss, values)
    held = structural(ss).suggestion
    names = [p.name for p in ss.parameters if p.name not in held]
    free = [name for name in names if nominal[name] != 0]
    drive = drive_of(ss)
    given = (experiment.torque, experiment.interval_s)
    with np.errstate(over="ignore", invalid="ignore"):  # looked for below
        S = sensitivities(drive, nominal, free, *given, speed_scale=speed_scale)
        rms = _output_rms(ss, nominal, experiment, speed_scale)
    _check_motion(drive.output, rms, S)
    noise = experiment.noise or NOISE_SHARE * rms
    left_out = tuple(name for name in names if name not in free)
    return Local(experiment, noise, Accuracy(tuple(free), S, noise), held, left_out, drive.output)


def _check_motion(quantity: str, rms: float, S: Floats) -> None:
    if not (np.isfinite(rms) and np.isfinite(S).all()):
        raise ValueError(
            f"simulated with these values, the {quantity} leaves the range of numbers "
            "(an unstable drive, or a value with a wrong power of ten?)"
        )
    if rms == 0:
        raise ValueError(f"with these values the torque does not change the {quantity}")


def _output_rms(
    ss: StateSpace, nominal: Mapping[str, float], experiment: Experiment, speed_scale: float
) -> float:
    from monitor_core.modeling.simulated_axis import SimulatedAxis

    drive = drive_of(ss)
    axis = SimulatedAxis(nominal, speed_scale, substeps=1, drive=drive)
    moved = [axis.step(value, experiment.interval_s) for value in experiment.torque.tolist()]
    y = np.array(moved)[:, 0 if drive.output == "angle" else 1]
    return float(np.sqrt(np.mean(y**2)))
