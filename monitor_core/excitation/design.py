"""Design of an experiment: signal, motion within the limits, predicted accuracy, and warnings."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.parameter_names import split_name
from monitor_core.excitation.accuracy import FAIR, Accuracy
from monitor_core.excitation.motions import (
    ExcitationError,
    ExperimentPhases,
    FittedMotion,
    MotionLimits,
    PlannedMotion,
    fitted,
)
from monitor_core.excitation.multisine_signals import Complex, Multisine, crest_factor, flattened, lines_in
from monitor_core.excitation.planned_drive import DriveMotion, Plant
from monitor_core.excitation.prediction import (
    Estimation,
    Optimum,
    distinguishable,
    information,
    linear_part,
    optimal_powers,
)
from monitor_core.wording import percent

Command = Literal["torque", "speed", "angle"]

_PEAK = {"torque": 1.5, "speed": 2.5, "angle": 2.5}
"""Approximate ratio of peak to rms value: low for the torque, whose phases are optimised for it."""
_FADE_S = 1.0
"""Least time of a fade, if the period is long enough, as the motion must come to rest in it."""
_EVEN_SHARE = 0.2
"""Share of an optimal spectrum's power that is spread evenly, as the drive may differ from its nominal values."""


@dataclass(frozen=True)
class ExcitationTask:
    """Requirements of an experiment.

    Args:
        plant: the drive that is moved.
        estimation: how its parameters will be estimated.
        limits: limits of torque, speed and angle.
        period: number of samples in a period.
        periods: number of evaluated periods, after one for warming up.
        band_hz: band of the lines [Hz]; these are odd, so that the effect of friction has no mean.
        command: commanded quantity: torque, or a reference for the controller of the axis.
        free: estimated parameters; default: all that can be distinguished.
        find: parameters for which the spectrum is optimised; default: a flat spectrum.
    """

    plant: Plant
    estimation: Estimation
    limits: MotionLimits
    period: int
    periods: int = 2
    band_hz: tuple[float, float] = (0.0, 30.0)
    command: Command = "torque"
    free: tuple[str, ...] = ()
    find: tuple[str, ...] = ()

    @cached_property
    def grid(self) -> NDArray[np.intp]:
        """Lines (L,).

        Raises:
            ExcitationError: there are none.
        """
        try:
            return lines_in(self.period, self.plant.interval_s, self.band_hz, "odd")
        except ValueError as error:
            raise ExcitationError(f"{error}: widen the band or lengthen the period") from None

    @cached_property
    def schedule(self) -> ExperimentPhases:
        """Phases of the record."""
        fade = max(self.period // 4, round(_FADE_S / self.plant.interval_s), 4)
        return ExperimentPhases(self.period, self.periods, min(self.period, fade))

    @property
    def frequency_hz(self) -> Floats:
        """Frequencies of the lines (L,), Hz."""
        return np.asarray(self.grid / (self.period * self.plant.interval_s))

    def over_limits(self, frequency_hz: Floats) -> dict[str, Complex]:
        """Frequency responses (L,) from the torque to all limited quantities, over their limits."""
        angle, speed = self.plant.response(frequency_hz)
        each = {"torque": np.ones(len(angle), dtype=complex), "speed": speed, "angle": angle}
        limits = self.limits.by_name()
        return {name: each[name] / limits[name] for name in each if np.isfinite(limits[name])}

    def costs(self, frequency_hz: Floats) -> Floats:
        """Share of each of J limits that a power of 1 (N m)^2 in each line uses (J, L)."""
        return np.array([np.abs(G * _PEAK[name]) ** 2 for name, G in self.over_limits(frequency_hz).items()])


class Trial(NamedTuple):
    """A signal in N m, its largest motion, and the reference (2, samples) of angle and speed."""

    signal: Multisine
    fitted: FittedMotion
    reference: Floats


@dataclass(frozen=True)
class PlannedExperiment:
    """The planned experiment.

    Args:
        task: the requirements.
        trial: signal and motion.
        accuracy: predicted accuracy of the estimates.
        flat: accuracy with a flat spectrum under the same limits; equal to ``accuracy`` without optimisation.
        held: parameters that are not estimated because the record does not distinguish them from others.
    """

    task: ExcitationTask
    trial: Trial
    accuracy: Accuracy
    flat: Accuracy
    held: tuple[str, ...]

    @property
    def motion(self) -> DriveMotion:
        """Torque, angle and speed (samples,)."""
        return self.trial.fitted.motion

    @property
    def used(self) -> dict[str, float]:
        """Largest values over limits."""
        return self.task.limits.used(self.motion)

    @property
    def crest(self) -> float:
        """Crest factor of a period."""
        return crest_factor(self.trial.signal.samples())

    @property
    def gains(self) -> dict[str, float]:
        """Ratio of the standard deviation with a flat spectrum to that with this one, for the parameters to find."""
        at = [self.accuracy.names.index(name) for name in self.task.find]
        ratio = self.flat.standard_deviations[at] / self.accuracy.standard_deviations[at]
        return dict(zip(self.task.find, ratio.tolist(), strict=True))


def plan(task: ExcitationTask, rng: np.random.Generator) -> PlannedExperiment:
    """Plan the experiment for a task; ``rng`` draws the phases of its signal.

    Raises:
        ExcitationError: there is no such experiment; the text says what would be right.
        KeyError, ValueError: a parameter that the drive does not have, or that is zero and has no scale.
    """
    if task.command == "torque" and task.plant.bears_weight:
        raise ExcitationError(
            "a torque alone does not keep this drive in its place (its weight moves it away): plan a motion for its"
            " controller, with speed or angle as the reference"
        )
    random = Multisine.random(rng, task.period, task.plant.interval_s, task.grid)
    flat = _trial(task, random)
    inputs = flat.fitted.motion.inputs
    names = task.free or distinguishable(task.estimation, inputs, task.find)
    if missing := [name for name in task.find if name not in names]:
        raise ExcitationError(f"{missing[0]} is named in --find, so it must be among the free parameters")
    accuracy = task.estimation.accuracy(names, inputs)
    bases = {split_name(name)[0] for name in names}
    held = () if task.free else tuple(n for n in task.estimation.all_names if n not in bases)
    experiment = PlannedExperiment(task, flat, accuracy, accuracy, held)
    if not task.find:
        return experiment
    better = replace(random, amplitudes=_best_amplitudes(task, names))
    try:
        best = _trial(task, better)
    except ExcitationError:  # the drive can follow the flat spectrum, but not this one
        return experiment
    found = task.estimation.accuracy(names, best.fitted.motion.inputs)
    at = [names.index(name) for name in task.find]
    if np.sum(found.standard_deviations[at] ** 2) >= np.sum(accuracy.standard_deviations[at] ** 2):
        return experiment
    return replace(experiment, trial=best, accuracy=found)


def _trial(task: ExcitationTask, random: Multisine) -> Trial:
    """The signal with minimized peaks, as large as the limits allow."""
    weights = task.over_limits(task.frequency_hz)
    signal = flattened(random, list(weights.values()))
    motion = PlannedMotion(task.plant, task.schedule, signal)
    peak = max(np.abs(signal.through(G).samples()).max() for G in weights.values())
    found = fitted(motion.move, task.limits, 0.9 / peak)
    return Trial(signal.times(found.size), found, motion.reference(found.size))


def _best_amplitudes(task: ExcitationTask, names: tuple[str, ...]) -> Floats:
    """Optimal amplitudes of the lines (L,) for the parameters to find."""
    best = _optimum(task, names, task.find, task.frequency_hz).powers
    even = np.full(len(best), 1 / task.costs(task.frequency_hz).sum(axis=1).max())
    return np.asarray(np.sqrt(2 * ((1 - _EVEN_SHARE) * best + _EVEN_SHARE * even)))


def _optimum(task: ExcitationTask, names: tuple[str, ...], find: tuple[str, ...], frequency_hz: Floats) -> Optimum:
    """Optimal powers of lines at these frequencies (L,) for some of the estimated parameters.

    Raises:
        ExcitationError: the spectrum does not matter to them, or the lines do not determine all parameters.
    """
    responses = task.estimation.responses(names, frequency_hz)
    seen = linear_part(responses)
    wanted = np.array([float(names[i] in find) for i in seen])
    if not wanted.any():
        raise ExcitationError(f"the spectrum has no effect on {' and '.join(find)}: leave out --find")
    try:
        return optimal_powers(information(responses[:, seen]), task.costs(frequency_hz), wanted)
    except np.linalg.LinAlgError:
        raise ExcitationError(
            f"{len(frequency_hz)} lines do not determine {len(seen)} parameters: widen the band or lengthen the period"
        ) from None


# --- Sentences on parameters that a planned experiment does not determine, and on what would help ---------------------


_MOST_LINES = 80
_MIN_IMPROVEMENT = 1.5
"""A wider band is recommended if it reduces the standard deviation by at least this factor."""
_OFF = 0.2
"""Relative change of Coulomb friction since its configuration that temperature alone may cause."""


def warnings(experiment: PlannedExperiment) -> tuple[str, ...]:
    """Sentences on the end position, on each badly determined parameter, and on pairs that are not distinguished."""
    return (*_ends(experiment), *_poor(experiment), *experiment.accuracy.words())


def _ends(experiment: PlannedExperiment) -> Iterator[str]:
    """A torque command does not correct the end position; a controller would."""
    task, plant = experiment.task, experiment.task.plant
    if task.command != "torque" or plant.is_linear:
        return
    torque = experiment.motion.torque
    motions = [replace(plant, coulomb=factor).moved(torque) for factor in (1 - _OFF, 1 + _OFF)]
    away, speed = (max(abs(float(getattr(m, what)[-1])) for m in motions) for what in ("angle", "speed"))
    shares = [share for m in motions for share in task.limits.used(m).items() if share[1] > 1]
    name, share = max(shares, key=lambda pair: pair[1], default=("", 0.0))
    beyond = f", and reaches {100 * share:.0f} % of the {name} limit during the motion" if share else ""
    yield (
        f"The torque brings the drive back and to rest with the friction that is configured; with {percent(_OFF)} more"
        f" or less Coulomb friction it ends up to {away:.2g} rad away, at up to {speed:.2g} rad/s{beyond}. Then only"
        " friction stops it: let the controller or the brake take over at the last sample."
    )


def _poor(experiment: PlannedExperiment) -> Iterator[str]:
    task, accuracy = experiment.task, experiment.accuracy
    seconds = task.schedule.samples * task.plant.interval_s
    for name, sd in zip(accuracy.names, accuracy.standard_deviations.tolist(), strict=True):
        if sd > FAIR and np.isfinite(sd):
            yield (
                f"{name} cannot be determined to better than {percent(sd)} in {seconds:.3g} s:"
                f" {_remedy(task, accuracy.names, name, sd)}."
            )


def _remedy(task: ExcitationTask, names: tuple[str, ...], name: str, sd: float) -> str:
    longer = f"{(sd / FAIR) ** 2:.2g} times as long a record would determine it to {percent(FAIR)}"
    if names.index(name) not in linear_part(task.estimation.responses(names, task.frequency_hz)):
        return longer
    top = _better_band(task, names, name)
    if top is not None:
        return f"excite up to {top:.2g} Hz ({longer})"
    if name not in task.find:
        return f"name it in --find, or widen the limits ({longer})"
    return f"widen the limits ({longer})"


def _better_band(task: ExcitationTask, names: tuple[str, ...], name: str) -> float | None:
    """Upper frequency of a spectrum optimised for this parameter, if that helps much."""
    low, high = task.band_hz
    nyquist = 0.5 / task.plant.interval_s
    inside = np.linspace(max(low, task.frequency_hz[0]), high, _MOST_LINES)
    wide = np.concatenate([inside, np.linspace(high, 0.8 * nyquist, _MOST_LINES)[1:]])
    if high >= 0.8 * nyquist:
        return None
    try:
        best_inside, best = (_optimum(task, names, (name,), lines) for lines in (inside, wide))
    except ExcitationError:
        return None
    if best_inside.criterion < _MIN_IMPROVEMENT**2 * best.criterion:
        return None
    below = np.cumsum(best.powers) / best.powers.sum()
    top = float(wide[np.searchsorted(below, 0.95)])
    return top if top > high else None
