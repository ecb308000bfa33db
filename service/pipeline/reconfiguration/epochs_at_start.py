"""Finds the epochs in force when the daemon starts or reloads its configuration, and resumes their windows."""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from monitor_core.trend import LearningWindow
from monitor_core.wording import sentence
from service.config import NamedAxis
from service.config.axis_settings import monitored_model
from service.config.epoch_values import EpochValuesError, content_of, fingerprint_of, with_epoch
from service.pipeline.axes.axis_alarms import alarm_rules, quantities
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.axes.epoch_progress import Learning
from service.pipeline.persistence.restoring import Restored, restore
from service.store.checkpoints import Checkpoints
from service.store.epochs import Epoch, EpochPlan, Epochs, EpochValue
from service.store.journal import Journal


class EpochsInForce(NamedTuple):
    """Axes with the nominal values of the epochs in force, these epochs by axis, and messages to the operator."""

    axes: tuple[NamedAxis, ...]
    epochs: Mapping[str, Epoch]
    messages: tuple[str, ...]


def epochs_in_force(configured: Sequence[NamedAxis], epochs: Epochs, now_us: int) -> EpochsInForce:
    """The axes as they are to be monitored: with the configured nominal values, or with those of a later epoch.

    Raises:
        StoreError: the epochs cannot be read or written.
    """
    as_configured = {axis.id: _configured(axis) for axis in configured}
    found = epochs.begin_with(as_configured.values(), now_us)
    axes, messages = list[NamedAxis](), list[str]()
    for axis in configured:
        epoch = found[axis.id]
        if epoch.source == "configuration":
            if epoch.number > 1 and epoch.began_us == now_us:
                messages.append(
                    sentence(
                        "configuration changed",
                        "{axis}: the configuration was changed since epoch {before} began: it is used, as epoch"
                        " {epoch}; axiswatch baseline restore {axis} {before} takes that back",
                        axis=axis.id,
                        before=epoch.number - 1,
                        epoch=epoch.number,
                    )
                )
            axes.append(axis._replace(epoch=epoch.number))
            continue
        try:
            axes.append(with_epoch(axis, epoch.content, epoch.number))
            messages.append(
                sentence(
                    "epoch in force",
                    "{axis}: the nominal values of epoch {epoch} are in force, not those of the configuration",
                    axis=axis.id,
                    epoch=epoch.number,
                )
            )
        except EpochValuesError as error:
            found[axis.id] = new = epochs.refused_at_start(as_configured[axis.id], now_us)
            axes.append(axis._replace(epoch=new.number))
            messages.append(
                sentence(
                    "epoch does not fit",
                    "epoch {epoch} does not fit the configuration any more, which is used: {why}",
                    epoch=epoch.number,
                    why=error,
                )
            )
    return EpochsInForce(tuple(axes), found, tuple(messages))


def _configured(axis: NamedAxis) -> EpochPlan:
    return EpochPlan(axis.id, "configuration", content_of(axis), fingerprint_of(axis), nominal_values(axis))


def nominal_values(axis: NamedAxis, before: NamedAxis | None = None) -> tuple[EpochValue, ...]:
    """The monitored nominal values of an axis, each with its former value, if ``before`` has one.

    They have the standard deviations of the nominal file.
    """
    model, found = monitored_model(axis), axis.config.model.nominal_file
    sds = {} if found is None else found.standard_deviations
    former = {} if before is None else {v.name: v.value for v in nominal_values(before)}
    return tuple(
        EpochValue(p.name, p.unit, float(value), former.get(p.name), sds.get(p.name))
        for p, value in zip(model.parameters, model.theta0, strict=True)
    )


def resume_monitors(
    monitors: AxisMonitors,
    in_force: EpochsInForce,
    checkpoints: Checkpoints,
    journal: Journal,
    now_us: int,
    configured: Collection[str] | None = None,
) -> Restored:
    """Restore the monitors of these axes to the state of the last run, with their learning and verification windows.

    Raises:
        StoreError: a file cannot be read or written.
    """
    _resume_windows(monitors, journal.epochs, in_force.epochs)
    restored = restore(monitors, checkpoints, journal, now_us, configured)
    journal.apply_rules(alarm_rules(in_force.axes, quantities(monitors.by_id)), now_us)
    for axis_id, axis in monitors.axes.items():
        epoch = axis.epoch
        if epoch.learning is not None and not epoch.learning.window.done_s:  # its state could not be restored
            words = "{axis}: the learning window of epoch {epoch} begins again"
            message = sentence("begins again", words, axis=axis_id, epoch=epoch.learning.number)
            epoch.learning = epoch.learning._replace(restarted=message)
    return restored


def _resume_windows(monitors: AxisMonitors, epochs: Epochs, in_force: Mapping[str, Epoch]) -> None:
    """Set up the windows that were running; their state is restored afterwards."""
    for axis_id, epoch in in_force.items():
        if epoch.state == "verifying":
            monitors.axes[axis_id].epoch.verify_s = epoch.verify_s
    for epoch in epochs.learning():
        if epoch.learn_s is not None and (axis := monitors.axes.get(epoch.axis)) is not None:
            window = LearningWindow(axis.monitor.model, epoch.learn_s)
            axis.epoch.learning = Learning(epoch.number, window)
