#!/usr/bin/env python3
"""Run the demo on the root file system of an image, read-only, as a user whom it does not know, and ask it.

Usage: try-image.py ROOT FILE, with the environment of the image in FILE.  Runs in mounts of its own (unshare), as root.
"""

import json
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

USER = 4711
PATIENCE_S = 180.0


def main() -> None:
    root, environment = (
        Path(sys.argv[1]),
        dict(line.split("=", 1) for line in Path(sys.argv[2]).read_text().split("\n") if line),
    )
    mount_read_only(root)
    start = time.monotonic()
    command = [*as_stranger(root), "axiswatch", "demo", "--port", "0"]
    demo = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        page = address(demo)
        wait(lambda: ask(page + "healthz") is not None, "/healthz")
        print(f"/healthz answers: {time.monotonic() - start:.1f} s after the start")
        wait(lambda: any(axis["counters"]["used"] for axis in axes(page)), "an estimate")
        print(f"first estimate: {time.monotonic() - start:.1f} s after the start")
        print(f"/api/v1/axes: {len(axes(page))} axes")
        compiled = [file for file in (root / "tmp").rglob("*.nb[ci]") if not file.is_symlink()]
        if compiled:
            sys.exit(f"compiled at the start, so the image lacks it: {', '.join(file.name for file in compiled)}")
        print("nothing was compiled")
    finally:
        demo.send_signal(signal.SIGINT)
        code = demo.wait(30)
    if code:
        sys.exit(f"the demo ended with exit code {code}")


def mount_read_only(root: Path) -> None:
    """The root and nothing below it can be written, but for /tmp."""
    for words in (
        ["--bind", root, root],
        ["-o", "remount,ro,bind", root],
        ["-t", "tmpfs", "-o", "mode=1777", "tmpfs", root / "tmp"],
        ["-t", "proc", "proc", root / "proc"],
        ["--rbind", "/dev", root / "dev"],
    ):
        subprocess.run(["mount", *map(str, words)], check=True)
    probe = subprocess.run(["chroot", root, "touch", "/opt/probe"], capture_output=True, check=False)
    if not probe.returncode:
        sys.exit("the root is not read-only")


def as_stranger(root: Path) -> list[str]:
    """The words before a command that runs it in the image, as a user without a name there."""
    return ["chroot", f"--userspec={USER}:{USER}", str(root)]


def address(demo: "subprocess.Popen[str]") -> str:
    """The address of the page, which the demo prints; what it prints besides is shown."""
    assert demo.stdout is not None
    for line in demo.stdout:
        print(f"  {line}", end="")
        if found := re.search(r"dashboard: (http://\S+)", line):
            threading.Thread(target=demo.stdout.read, daemon=True).start()
            return found[1]
    sys.exit(f"the demo has ended with exit code {demo.wait()}")


def ask(url: str) -> str | None:
    try:
        with urllib.request.urlopen(url, timeout=10) as answer:
            return str(answer.read(), "utf-8")
    except urllib.error.URLError:
        return None


def axes(page: str) -> list[dict]:
    return json.loads(ask(page + "api/v1/axes") or '{"axes": []}')["axes"]


def wait(done, what: str) -> None:
    end = time.monotonic() + PATIENCE_S
    while not done():
        if time.monotonic() > end:
            sys.exit(f"waited {PATIENCE_S:.0f} s in vain for {what}")
        time.sleep(0.05)


if __name__ == "__main__":
    main()
