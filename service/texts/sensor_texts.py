"""Faults of sensors, which the multi-model detector may name, in the words of an operator."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from monitor_core.detection import (
    OUTPUT_NOISE,
    OUTPUT_OFFSET,
    OUTPUT_SCALE,
    OUTPUT_SIGN,
    OUTPUT_STUCK,
    TORQUE_LOST,
    TORQUE_OFFSET,
    TORQUE_SCALE,
    TORQUE_SIGN,
    TORQUE_STUCK,
)

Amount = Callable[[float], str]
"""A number as people read it, without its sign."""


def _more(size: float) -> str:
    return "less" if size < 0 else "more"


_FIXED: Mapping[str, str] = MappingProxyType(
    {
        TORQUE_SIGN: "the measured torque has changed its sign",
        OUTPUT_SIGN: "the measured motion has changed its sign",
        TORQUE_STUCK: "the measured torque is stuck: it stays the same while another one acts",
        TORQUE_LOST: "the torque that acts is not the measured one: its signal is lost, or another one",
        OUTPUT_STUCK: "the measured motion is stuck: it repeats itself in every digit",
    }
)


def sensor_words(cause: str, size: float, unit: str, amount: Amount) -> str | None:
    """A fault of a sensor in words; None: the cause is no sensor fault.

    Args:
        cause: its name.
        size: of the change, in ``unit``; NaN where it has none.
        unit: "1" for a ratio.
        amount: formats numbers.
    """
    sentences: Mapping[str, Callable[[], str]] = {
        TORQUE_SCALE: lambda: (
            f"the torque that acts is {amount(100 * size)} % {_more(size)} than the measured one, by its scale"
        ),
        OUTPUT_SCALE: lambda: (
            f"the measured motion is {amount(100 * size)} % {_more(size)} than the true one, by its scale"
        ),
        TORQUE_OFFSET: lambda: (
            f"the torque that acts is {amount(size)} {unit} {_more(size)} than the measured one, always"
        ),
        OUTPUT_OFFSET: lambda: (
            f"the measured motion is {amount(size)} {unit} {_more(size)} than the true one, always"
        ),
        OUTPUT_NOISE: lambda: f"the measured motion is noisier than it was, by {amount(100 * size)} %",
    }
    return _FIXED.get(cause) or (sentences[cause]() if cause in sentences else None)
