"""The configuration file: its schema, its rules, and every problem with file, line, key and value."""

from service.config.drives import drive_of, given_values
from service.config.loading import load
from service.config.problems import ConfigErrors, Problem
from service.config.schema import (
    AxisConfig,
    BusConfig,
    Config,
    DetectorConfig,
    EstimatorConfig,
    FurtherConfig,
    ModelConfig,
    NamedAxis,
    RobotConfig,
    ServiceConfig,
    SignalConfig,
    TimeConfig,
    WebConfig,
)

__all__ = [
    "AxisConfig",
    "BusConfig",
    "Config",
    "ConfigErrors",
    "DetectorConfig",
    "EstimatorConfig",
    "FurtherConfig",
    "ModelConfig",
    "NamedAxis",
    "Problem",
    "RobotConfig",
    "ServiceConfig",
    "SignalConfig",
    "TimeConfig",
    "WebConfig",
    "drive_of",
    "given_values",
    "load",
]
