"""Bodies of REST requests and answers.  Descriptions state the units; a number that is not finite is null."""

from service.web.models.alarm_bodies import (
    Alarm,
    AlarmChange,
    AlarmComment,
    AlarmMessage,
    AlarmNote,
    AlarmRecord,
    Alarms,
    AlarmShelf,
    AlarmStatistics,
    AlarmTransition,
    PastName,
    ReplayReport,
)
from service.web.models.axis_bodies import Axes, Axis, AxisState, OutOfService, Parameter, ParameterState
from service.web.models.bodies import (
    SENTENCES,
    Body,
    GivenText,
    GivenTime,
    Number,
    Sentence,
    TextOrNull,
    Time,
    sentence_bodies,
    sentences,
)
from service.web.models.daemon_bodies import (
    Health,
    Lack,
    Problem,
    Readiness,
    Recording,
    Recordings,
    Service,
)
from service.web.models.history_bodies import Drift, History, LongTermHistory, Reach, Trend
