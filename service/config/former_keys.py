"""Keys of earlier versions, in the configuration and in the files of an identification or a calibration."""

from collections.abc import Mapping

RENAMED_KEYS: Mapping[str, str] = {
    "dbc": "messages",
    "averaged": "interval_mean",
    "least_excitation": "min_excitation",
    "least_information": "information_floor",
    "least_speed": "min_speed",
    "maximum_age_s": "max_age_s",
    "maximum_gap_s": "max_gap_s",
    "varying": "schedule",
    "warn_before": "lead_time",
    "widening": "covariance_reset",
    "wraps_at": "wrap_period",
}
"""Keys of earlier versions: an old key is an error that names the new one."""
REMOVED_KEYS: Mapping[str, str] = {
    "components": 'draw the drive as a Modelica file, and give drive = "....mo" instead',
    "forgetting": "give memory_s = sample_interval_s / (1 - forgetting) instead",
    "history_length_s": "the history is kept in a file: give history_raw_days instead",
    "gain": "follows from torque_noise and output_noise, or from an identification: give nominal_file",
    "password": "a secret does not belong here: write it into a file, and give password_file, or password_env",
    "secret": "a secret does not belong here: write it into a file, and give secret_file, or secret_env",
    "speed_noise": "angle and speed are no longer used together: give one of the two tables, and output_noise for it",
}


def hint(key: str) -> str | None:
    """What to do with a key of an earlier version, or one for a secret; None: it never was a key."""
    if key in RENAMED_KEYS:
        return f"is now called {RENAMED_KEYS[key]}"
    return REMOVED_KEYS.get(key)
