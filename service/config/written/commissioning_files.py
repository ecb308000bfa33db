"""Names of the files that commissioning writes beside the configuration."""

REPORT = "report.html"
"""Name of the summary of a commissioned robot, beside its configuration"""
RECORDS, _MOTIONS = "records", "motion"
"""Folders of recorded frames and of planned motions, beside the report"""


def pages_of(axis_id: str) -> tuple[str, str]:
    """File names of the identification report and the calibration report of an axis, beside the summary."""
    return f"{axis_id}-identification.html", f"{axis_id}-calibration.html"


def motion_file(axis_id: str) -> str:
    """File name of the planned motion of an axis."""
    return f"{_MOTIONS}/{axis_id}.csv"
