"""Environments for peers that are no part of the program's own: each in a folder of .cache, from PyPI."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.end_to_end.processes import ROOT


def environment(name: str, packages: Sequence[str]) -> Path | str:
    """The interpreter of the peers, installed if need be; or why there is none."""
    folder = ROOT / ".cache" / name
    python, ready = folder / "bin" / "python", folder / ".ready"
    wanted = "\n".join(packages)
    if ready.exists() and ready.read_text(encoding="utf-8") == wanted:
        return python
    make = [sys.executable, "-m", "venv", str(folder)]
    pip = [str(python), "-m", "pip", "install", "--quiet", *packages]
    if any(subprocess.run(step, capture_output=True, check=False).returncode for step in (make, pip)):
        return "could not be installed"
    ready.write_text(wanted, encoding="utf-8")
    return python
