"""Rules for an axis's estimator."""

from collections.abc import Callable, Iterator

from monitor_core.monitoring.recommended_settings import MIN_MEMORY_SAMPLES
from service.config.base_table import present
from service.config.encoder import step_noise
from service.config.model_rules import usable_drive
from service.config.nominal import nominal_file_of
from service.config.schema import AxisConfig
from service.config.validation_messages import Finding


def predictor(axis: AxisConfig) -> Iterator[Finding]:
    """The predictor fits what is measured."""
    estimator = axis.estimator
    if (found := nominal_file_of(axis)) is not None:
        if found.predictor.kind == "output-error" and axis.output == "angle":
            message = "found by output error, which diverges with the angle: identify it with innovations"
            yield Finding(("model", "nominal_file"), message)
        return
    if estimator.predictor == "output-error":
        if axis.output == "angle":
            message = 'needs speed; from the angle without a gain it diverges: use "innovations"'
            yield Finding(("estimator", "predictor"), message)
        if estimator.gain:
            yield Finding(("estimator", "gain"), 'the predictor "output-error" has none: remove it')
    elif estimator.gain and axis.output == "angle" and not any(estimator.gain):
        yield Finding(("estimator", "gain"), "must not be zero: with the angle the prediction diverges")


def noises(axis: AxisConfig) -> Iterator[Finding]:
    """What the filter gain and lambda_0 are to be computed from is there."""
    estimator = axis.estimator
    if nominal_file_of(axis) is not None or axis.records_only:
        return
    steps = step_noise(axis) if present(axis, "angle", "speed") else None
    pair = {"torque_noise": estimator.torque_noise, "output_noise": estimator.output_noise or steps}
    missing = [name for name, value in pair.items() if value is None]
    if estimator.predictor == "output-error":
        if estimator.innovation_variance is None and pair["output_noise"] is None:
            yield Finding(("estimator", "output_noise"), "missing: give output_noise or innovation_variance")
    elif not estimator.gain:
        for name in missing:
            message = "missing: the filter gain needs torque_noise and output_noise (or give gain)"
            yield Finding(("estimator", name), message)
    elif estimator.innovation_variance is None and missing:
        message = "missing: beside a gain give it, or torque_noise and output_noise"
        yield Finding(("estimator", "innovation_variance"), message)


def gain_length(axis: AxisConfig) -> Iterator[Finding]:
    """One gain for each state."""
    if nominal_file_of(axis) is not None:
        return
    axis.output  # noqa: B018 - where that is not said, nothing can be counted
    states = usable_drive(axis).states
    gain = axis.estimator.gain
    if gain and len(gain) != len(states):
        names = ", ".join(state.name for state in states)
        message = f"has {len(gain)} numbers, must have {len(states)}, one for each state: {names}"
        yield Finding(("estimator", "gain"), message)


def memory(axis: AxisConfig) -> Iterator[Finding]:
    """One memory, of samples enough."""
    e = axis.estimator
    if e.memory_s is None:
        return
    if e.forgetting is not None:
        yield Finding(("estimator", "forgetting"), "beside memory_s: give one of the two")
    least = MIN_MEMORY_SAMPLES * axis.sample_interval_s
    if e.memory_s < least:
        yield Finding(
            ("estimator", "memory_s"), f"must be at least {MIN_MEMORY_SAMPLES} sample intervals, {least:g} s"
        )


def initial_p(axis: AxisConfig) -> Iterator[Finding]:
    """P(0) is given for all monitored parameters or for none."""
    given = axis.estimator.initial_p
    for name in axis.model.monitor:
        if given and name not in given:
            yield Finding(("estimator", "initial_p", name), "missing: give all monitored parameters, or none")


ESTIMATOR_RULES: tuple[Callable[[AxisConfig], Iterator[Finding]], ...] = (
    predictor,
    noises,
    gain_length,
    memory,
    initial_p,
)
