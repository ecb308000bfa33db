"""The metrics of axes, alarms, buses and links: type, help text and labels of each."""

from collections.abc import Sequence
from typing import Literal, NamedTuple

_SI = "in the parameter's SI unit"
_PER_SECOND = "in the parameter's SI unit per second; absent until enough is known"
_GAUGES = {
    "axis parameter": {
        "parameter_estimate": f"Estimated value, {_SI}.",
        "parameter_nominal": f"Commissioned value, which may follow operating conditions, {_SI}.",
        "parameter_standard_deviation": f"Standard deviation, {_SI}.",
        "parameter_p_diagonal": "P_ii of the recursion; the variance of the estimate is lambda_0 P_ii / (1 + lambda).",
        "parameter_observed": "Observability of the parameter in the last samples: 1 as at commissioning, 0.5 weak, "
        "0 not observed; then the estimate is the last that was observed.",
        "parameter_tested": "1 while a change of the parameter would be found, else 0: "
        "the absence of an alarm then says nothing.",
        "cusum_threshold": f"Threshold h of both CUSUMs, {_SI} times samples.",
        "alarm_probability": "Probability that the parameter is the cause of a named open alarm, else 0.",
        "parameter_slope": f"Long-term drift, {_PER_SECOND}.",
        "parameter_slope_standard_deviation": f"Standard deviation of the long-term drift, {_PER_SECOND}.",
        "parameter_drift_probability": "Probability of a long-term drift of the parameter; absent until enough is "
        "known.",
    },
    "axis parameter direction": {
        "cusum": f"CUSUM g for an increase (up) and a decrease (down), {_SI} times samples.",
        "alarm_active": "1 while an alarm is open, waits for its off-delay or is latched, else 0.",
        "alarm_named": "1 while an alarm is open and has been named, else 0.",
        "alarm_hidden": "1 while all active alarms of that name are shelved, suppressed or out of service, else 0.",
    },
    "state priority": {
        "alarms": "Alarms by state and priority, except those that are over; those that are not yet recorded are "
        "counted, too."
    },
    "axis parameter limit bound": {
        "limit_reached_seconds": "Time from the last entry of the long-term history until a limit is reached, in "
        "seconds: lower (low) and upper (high) end of the 90 % interval; negative where it has been reached; no upper "
        "end where it is open."
    },
    "axis parameter limit": {
        "limit_alarm_active": "1 while an alarm is active because a limit will be reached soon, or has been, else 0."
    },
    "axis detector": {
        "detector_alarms": "1 for the detector that raises the alarms, 0 for one that runs in shadow mode.",
        "detector_evidence": "Largest test statistic of a detector, over its threshold.",
    },
    "axis": {
        "innovation_variance": "Running variance of the prediction error, in the square of the output's unit (rad or "
        "rad/s).",
        "axis_gated": "1 while operating conditions exclude the samples from estimation, else 0.",
        "axis_epoch": "Number of the epoch of the axis that is in force: of its nominal values and thresholds.",
        "axis_learning": "1 while a learning window of the axis runs, else 0.",
        "axis_out_of_service": "1 while the alarms of the axis are not announced, as it is maintained, else 0.",
        "axis_verifying": "1 while a new epoch of the axis is being verified, else 0.",
        "axis_heat_watts": "Friction power that would keep the axis as warm as it is, in watts; absent where nothing "
        "follows the heat of the axis.",
        "stamp_scatter_seconds": "Standard deviation of receipt time minus sample time, in seconds; where the receipt "
        "time is the sample time, that of the intervals divided by the square root of two.",
        "last_sample_age_seconds": "Time since the last sample, in seconds; +Inf before the first.",
    },
    "link": {
        "link_connected": "1 while the plant link works, 0 while its receiver cannot be reached.",
        "link_pending": "Transitions of alarms that wait for the link.",
    },
    "bus": {"bus_up": "1 while the bus can be read, else 0."},
    "use": {
        "certificate_expiry_seconds": "Time until the certificate of a server expires, or the first of its chain, in "
        "seconds; negative: it has. web: page, API and metrics; opcua: the OPC UA server."
    },
    "": {
        "alarms_not_recorded": "Alarms of which the journal does not have all yet, as the disk refuses it.",
        "history_waiting_points": "Points of the history that are not yet in its file.",
        "configuration_refused": "1 while a configuration is refused that SIGHUP was to load, and the former one stays "
        "in force, else 0.",
        "snapshot_age_seconds": "Time since the worker last reported, in seconds.",
        "checkpoint_age_seconds": "Time since the state of the monitors was last saved, in seconds; absent before the "
        "first time.",
    },
}
"""Help texts by labels and name; in the output a name starts with axiswatch_"""
_COUNTERS = {
    "axis": {
        "samples": "Samples received with the present nominal values, over restarts of the daemon.",
        "histories_lost": "Long-term histories that could not be restored at the start: damaged, or of another model.",
    },
    "axis parameter": {
        "parameter_tested_seconds": "Time for which the parameter has been tested with its present nominal "
        "values, over restarts of the daemon, in seconds."
    },
    "axis fate": {
        "samples_by_fate": "Samples by their use; starved: too little excitation; gated: excluded by operating "
        "conditions; projected: used, and an estimate was held within its bounds."
    },
    "axis reason": {"values_dropped": "Decoded values that did not become a sample."},
    "axis cause": {
        "clock_restarts": "Restarts of the time base of the samples: the controller restarted, or a clock was set."
    },
    "reason": {"history_dropped_points": "Points of the history that were dropped."},
    "link": {"link_delivered": "Transitions of alarms that the plant link has delivered."},
    "link reason": {
        "link_given_up": "Transitions of alarms that the plant link has given up: too old, or refused by the receiver."
    },
    "bus": {"frames": "Frames received."},
    "bus reason": {"frames_dropped": "Frames that were dropped."},
}


class Family(NamedTuple):
    """Type, help text and labels of a metric; in the output, the name of a counter ends with _total."""

    kind: Literal["gauge", "counter"]
    words: str
    labels: Sequence[str]


_KINDS: tuple[tuple[Literal["gauge", "counter"], dict[str, dict[str, str]]], ...] = (
    ("gauge", _GAUGES),
    ("counter", _COUNTERS),
)
FAMILIES = {
    name: Family(kind, words, labels.split())
    for kind, groups in _KINDS
    for labels, group in groups.items()
    for name, words in group.items()
}
"""The metrics of axes, alarms, buses and links, by name"""
