"""Rules for an axis whose angle starts again after each turn."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from monitor_core.kernel.tables import COSINE, SINE
from service.config.model_rules import usable_drive
from service.config.schema import AxisConfig
from service.config.skew import watched_values
from service.config.validation_messages import Finding

_NEARLY = 1e-3
"""Of a turn: as exactly as somebody may have written 2 pi."""


def wrapping_under_gravity(axis: AxisConfig) -> Iterator[Finding]:
    """Where gravity acts, an angle that starts again still tells where the weight stands."""
    if axis.angle is None or axis.angle.wrap_period is None:
        return
    drive = usable_drive(axis)
    try:
        ratio = drive.matrix("ratio", drive.complete(watched_values(axis)))[:, 0].tolist()
    except (KeyError, ValueError):  # a value is missing, which another rule says
        return
    period = abs(axis.angle.factor) * axis.angle.wrap_period
    turns = [
        period * abs(r) / (2 * math.pi)
        for r, of in zip(ratio, drive.inputs, strict=True)
        if of in (COSINE, SINE)
    ]
    parts = [t for t in turns if round(t) == 0 or abs(t - round(t)) > _NEARLY]
    if parts:
        message = (
            f"gravity needs to know where the arm stands, and the angle starts again after {parts[0]:.3g} of its turns:"
            " send one that goes on"
        )
        yield Finding(("angle", "wrap_period"), message)


ENCODER_RULES: tuple[Callable[[AxisConfig], Iterator[Finding]], ...] = (wrapping_under_gravity,)
