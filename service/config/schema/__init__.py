"""Schema of the configuration and of the files that it names: every key with unit, bounds and default.

* ``configuration``: the tables of the file; ``signal_keys``, ``model_keys``, ``bus_keys``, ``link_keys``: theirs.
* ``base_table``: the base class of all tables, types of their values, and keys of earlier versions.
* ``canopen_axis`` and ``robot_defaults``: keys that follow from others.
* ``found_file``: the files of identify and calibrate; ``nominal_file``, ``thresholds_file``.
"""

from service.config.schema.bus_keys import FLOAT_BITS, LAST_STANDARD_ID, MAX_BYTES, BitsConfig, BusConfig, MessageConfig
from service.config.schema.configuration import AxisConfig, Config, NamedAxis, RobotConfig, WebConfig
from service.config.schema.link_keys import (
    LINK_FILES,
    SECRET_FILES,
    AlarmLimits,
    LinksConfig,
    MqttConfig,
    OpcUaConfig,
    SmtpConfig,
    WebhookConfig,
    concealed,
    is_local,
)
from service.config.schema.model_keys import (
    REPLACED_BY_NOMINAL_FILE,
    REPLACED_BY_THRESHOLDS_FILE,
    AlarmsConfig,
    DetectorConfig,
    EstimatorConfig,
    ModelConfig,
    ScheduleConfig,
)
from service.config.schema.signal_keys import (
    MOST_LATE,
    AngleConfig,
    FurtherSignalConfig,
    GateConfig,
    SignalConfig,
    SpeedConfig,
    TimeConfig,
)
