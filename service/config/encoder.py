"""What the steps of an encoder are to the estimator: noise."""

import math

from service.config.schema import AxisConfig


def step_noise(axis: AxisConfig) -> float | None:
    """Standard deviation of the angle or speed from its resolution alone [rad, rad/s]; None: it is not given.

    A value anywhere within a step, each as likely: resolution / sqrt(12).
    """
    motion = axis.angle or axis.speed
    if motion is None or motion.resolution is None:
        return None
    return rounded(motion.resolution * motion.factor)


def rounded(step: float) -> float:
    """Standard deviation of what rounding to that step leaves."""
    return abs(step) / math.sqrt(12)
