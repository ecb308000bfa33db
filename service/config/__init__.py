"""The configuration file: its schema and its checks, with file, line, key and value for each problem.

* ``schema/``: the keys, and those of the files that it names.
* Reading: ``loading``, with ``toml_lines`` (lines of keys), ``schema_errors``, and the cross-checks in ``rules/``;
  ``problems``: what is reported.  ``remarks``: notes on a valid file; ``certificates``: when they expire.
* What an axis is by its keys: ``drive_sources`` and ``drives``, ``conditions``, ``axis_settings``, ``axis_detectors``;
  ``bus_messages``: the messages of a bus; ``epoch_values``: other nominal values while the daemon runs.
* Its text: ``public_text`` for readers; ``written/``: what commissioning writes.
* ``unit_names``: units in the names of columns and signals.
"""

from service.config.axis_settings import predictor_of
from service.config.conditions import conditions_of, in_words, needed
from service.config.drives import drive_of, gear_ratio, given_values, limits_of, scales_of
from service.config.loading import load
from service.config.problems import ConfigErrors, ConfigProblem
from service.config.schema import AxisConfig, Config, ModelConfig, NamedAxis
