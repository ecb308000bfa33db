"""What a process costs, from /proc."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import NamedTuple

TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class Cpu(NamedTuple):
    """Time that a process has used [s], at one moment."""

    at_s: float
    user_s: float
    system_s: float

    def share_since(self, before: Cpu) -> str:
        """Share of one core since then."""
        elapsed_s = self.at_s - before.at_s
        user, system = self.user_s - before.user_s, self.system_s - before.system_s
        return f"{100 * (user + system) / elapsed_s:.1f} % ({100 * system / elapsed_s:.1f} % system)"


def cpu(pid: int) -> Cpu:
    """Of all threads, also those that have ended."""
    # Behind the name, which may hold anything: state is field 3, utime 14, stime 15.
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return Cpu(time.monotonic(), int(fields[11]) / TICKS_PER_S, int(fields[12]) / TICKS_PER_S)


def memory_mb(pid: int, what: str = "VmRSS") -> float:
    """Resident memory in MB (1e6 bytes); ``VmHWM``: the most there was."""
    for line in Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines():
        if line.startswith(f"{what}:"):
            return int(line.split()[1]) * 1024 / 1e6
    raise ValueError(f"no {what} of process {pid}")
