"""Remarks on a configuration that does not agree with the resolution and the turns of an encoder."""

from __future__ import annotations

import math
from collections.abc import Iterator

from service.can.dbc import find_message, find_signal, read_dbc
from service.config import AxisConfig, Config, NamedAxis, predictor_of, step_noise
from service.config.nominal import rounded

_NEARLY = 1e-3
_EXACT = 1e-7


def remarks_on_encoders(config: Config) -> Iterator[str]:
    """Noises that are smaller than the resolution, and turns that are nearly two pi.

    Raises:
        DbcError: a DBC cannot be used.
    """
    for axis in config.axes:
        yield from _too_fine(config, axis)
        yield from _nearly_a_turn(axis)


def _too_fine(config: Config, axis: NamedAxis) -> Iterator[str]:
    given, least = predictor_of(axis.config).output_noise, _least_noise(config, axis.config)
    if given is not None and least is not None and given < least * (1 - _NEARLY):
        yield (
            f"{axis.id}: output_noise = {given:.3g} is below {least:.3g}, which the resolution of the"
            f" {axis.config.output} makes by itself (a step over the root of 12): the predictor would follow the steps"
        )


def _least_noise(config: Config, axis: AxisConfig) -> float | None:
    """The noise of the encoder's resolution, or, if that is not given, of that of its signal on the bus."""
    if (noise := step_noise(axis)) is not None or axis.records_only:
        return noise
    bus = next(bus for bus in config.bus if bus.name == axis.bus)
    signal = find_signal(find_message(read_dbc(bus.dbc), axis.motion.message), axis.motion.signal)
    return None if signal.is_float else rounded(float(signal.scale) * axis.motion.factor)


def _nearly_a_turn(axis: NamedAxis) -> Iterator[str]:
    angle = axis.config.angle
    if angle is None or angle.wrap_period is None:
        return
    turns = abs(angle.factor) * angle.wrap_period / (2 * math.pi)
    short = abs(turns - round(turns))
    if round(turns) > 0 and _EXACT < short < _NEARLY:
        yield (
            f"{axis.id}: wrap_period differs from a turn by {2 * math.pi * short:.2g} rad, so the angle would jump each"
            f" time; exact is {2 * math.pi * round(turns) / abs(angle.factor):.10g}"
        )
