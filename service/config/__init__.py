"""The configuration file: its schema and its checks, with file, line, key and value for each problem."""

from service.config.axis_settings import predictor_of
from service.config.conditions import conditions_of, in_words, needed
from service.config.drives import drive_of, gear_ratio, given_values, limits_of, scales_of
from service.config.loading import load
from service.config.problems import ConfigErrors, ConfigProblem
from service.config.schema import AxisConfig, Config, NamedAxis
from service.config.schema_model import ModelConfig
