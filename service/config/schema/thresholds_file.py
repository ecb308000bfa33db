"""thresholds.toml, the result of `axiswatch calibrate`, and the settings of the monitor that it belongs to."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Literal

from pydantic import Field, field_validator

from monitor_core.drive import AxisModel
from monitor_core.monitoring import PoseMap
from monitor_core.settings import Settings, Threshold
from service.config.schema.base_table import NotNegative, Positive, Real
from service.config.schema.found_file import FoundFile, FoundTable, alike
from service.config.schema.nominal_file import structure_of

TomlValue = bool | float | str | list[float] | list[str]


class ThresholdTable(FoundTable):
    """[[threshold]]: nu = alpha_1 sqrt(lambda_0 P_ii) + allowance * size, h = alpha_2 * size.

    size_error: error of the estimate on the healthy axis beyond what P tells, as a share of the size.
    """

    parameter: str
    alpha_1: NotNegative
    alpha_2: Positive
    allowance: NotNegative
    size_error: NotNegative = 0.0


class HypothesisTable(FoundTable):
    """[[hypothesis]]: a hypothesis of the multi-model detector; alarm when its g exceeds h.  Some have no size.

    size_error: error of the size of its cause on the healthy axis, in the unit of size.
    """

    cause: str
    size: Real | None = None
    h: Positive
    allowance: NotNegative = 0.0
    alike: tuple[str, ...] = ()
    size_error: NotNegative = 0.0


class NamingTable(FoundTable):
    """[naming]: evidence_share, the share of the evidence that counts for the probabilities of causes."""

    evidence_share: float = Field(gt=0, le=1)


class RangeTable(FoundTable):
    """[[range]]: lowest and highest value of a condition in the calibration records."""

    condition: str
    low: Real
    high: Real


class PosesTable(FoundTable):
    """[[poses]]: a map of the poses of two axes in the calibration records.

    known: cells of 5 by 5 or 10 by 10 degrees, one bit each, in hexadecimal digits; those of a row have the same first
    angle.
    """

    angles: tuple[str, str]
    known: str

    @field_validator("known")
    @classmethod
    def _is_a_map(cls, known: str) -> str:
        PoseMap.from_hex(("", ""), known)
        return known


class ThresholdsFile(FoundFile):
    """The whole file.

    ``made_with``, ``nominal``: settings and nominal values of the monitor that the thresholds fit.
    """

    KIND: ClassVar[str] = "thresholds"
    kind: Literal["thresholds"]
    axis: str
    date: str
    made_with: dict[str, TomlValue]
    nominal: dict[str, Real]
    threshold: tuple[ThresholdTable, ...] = Field(min_length=1)
    hypothesis: tuple[HypothesisTable, ...] = ()
    """Thresholds of the multi-model detector, if it was calibrated"""
    naming: NamingTable | None = None
    """Of the multi-model detector; absent in files of earlier versions, in which all of the evidence counts"""
    range: tuple[RangeTable, ...] = ()
    """Ranges of the rms and top speed and of the signals; empty in files of earlier versions"""
    poses: tuple[PosesTable, ...] = ()
    """Maps of the poses, if the load on the axis follows them; empty in files of earlier versions"""


# --- Thresholds belong to the nominal values and the estimator settings of one monitor --------------------------------


def made_with(model: AxisModel, settings: Settings) -> dict[str, TomlValue]:
    """The settings that thresholds depend on, without nominal values, by the names of the configuration."""
    return {
        "drive": structure_of(model.drive),
        "monitor": list(model.monitored),
        "sizes": [float(v) for v in model.scale],
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
    }


def with_thresholds(settings: Settings, model: AxisModel, found: ThresholdsFile) -> Settings:
    """The settings with the thresholds of a file.

    Raises:
        ValueError: the thresholds were made with other nominal values or for another estimator.
    """
    for left, right in ((dict(model.nominal), found.nominal), (made_with(model, settings), found.made_with)):
        if reason := _difference(left, right):
            raise ValueError(
                f"{found.path.name} was made with {reason}: run `axiswatch calibrate` again, or leave out"
                " thresholds_file"
            )
    own = tuple(Threshold(t.alpha_1, t.alpha_2, t.allowance, t.size_error) for t in found.threshold)
    return replace(settings, thresholds=own)


def _difference(left: Mapping[str, object], right: Mapping[str, object]) -> str:
    # A setting of an earlier version is off where it is not known any more.
    for name, value in {**dict.fromkeys(right, False), **left}.items():
        other = right.get(name)
        if not alike(value, other):
            return f"{name} = {_shown(other)}, now it is {_shown(value)}"
    return ""


def _shown(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    return f"{value:.10g}" if isinstance(value, float) else str(value)
