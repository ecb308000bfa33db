"""Thresholds belong to one monitor: to its nominal values and to the settings of its estimator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from monitor_core.drive import AxisModel
from monitor_core.settings import Settings, Threshold
from service.config.nominal_file import structure_of
from service.config.thresholds_file import ThresholdsFile

Entry = bool | float | str | list[float] | list[str]
_SAME = 1e-6
"""Relative: numbers are written with ten digits."""


def made_with(model: AxisModel, settings: Settings) -> dict[str, Entry]:
    """The settings that thresholds depend on, by the names of the configuration, without nominal values."""
    return {
        "drive": structure_of(model.drive),
        "monitor": list(model.monitored),
        "sizes": [float(v) for v in model.scale * model.unit],
        "sample_interval_s": settings.interval_s,
        "forgetting": settings.lam,
        "innovation_variance": settings.lam0,
        "gain": [float(k) for k in settings.K],
        "torque_delay_s": settings.delay_s,
        "friction_speed_scale": settings.speed_scale,
        "information_floor": settings.information_floor,
        "min_excitation": settings.min_excitation,
        "outlier_limit": settings.outlier_limit,
        "joint_state": settings.joint_state,
        "random_walk": settings.random_walk,
    }


def with_thresholds(settings: Settings, model: AxisModel, found: ThresholdsFile) -> Settings:
    """The settings with the thresholds of a file.

    Raises:
        ValueError: they were made with other nominal values, or for another estimator.
    """
    for left, right in ((dict(model.nominal), found.nominal), (made_with(model, settings), found.made_with)):
        if reason := _difference(left, right):
            raise ValueError(
                f"{found.path.name} was made with {reason}: run `axiswatch calibrate` again, or leave out"
                " thresholds_file"
            )
    own = tuple(Threshold(entry.alpha_1, entry.alpha_2, entry.allowance) for entry in found.threshold)
    return replace(settings, thresholds=own)


def _difference(left: Mapping[str, object], right: Mapping[str, object]) -> str:
    """What differs, in words; empty: nothing."""
    for name, value in left.items():
        other = right.get(name)
        if not _alike(value, other):
            return f"{name} = {_shown(other)}, now it is {_shown(value)}"
    return ""


def _alike(left: object, right: object) -> bool:
    if isinstance(left, list) and isinstance(right, list):
        return len(left) == len(right) and all(map(_alike, left, right))
    if isinstance(left, int | float) and isinstance(right, int | float):
        return math.isclose(left, right, rel_tol=_SAME, abs_tol=1e-300)
    return left == right


def _shown(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    return f"{value:.10g}" if isinstance(value, float) else str(value)
