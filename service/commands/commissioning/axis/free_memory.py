"""How much memory further processes may take, on Linux: of the machine, and of the control groups of this process."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple


class _Files(NamedTuple):
    """Files of a control group: the limit of its memory, what it uses, and of that the cached files, by name."""

    limit: str
    used: str
    cached: tuple[str, ...]


_VERSION_1 = _Files("memory.limit_in_bytes", "memory.usage_in_bytes", ("total_inactive_file", "total_active_file"))
_VERSION_2 = _Files("memory.max", "memory.current", ("inactive_file", "active_file"))


def free_memory(root: Path = Path("/")) -> int | None:
    """Memory that is free or can be made free [bytes]; None: not known, as on systems other than Linux.

    A container or a service may have less than the machine: the least of what its control groups leave.

    ``root``: folder with the file systems of the kernel.
    """
    free = [*_of_machine(root / "proc/meminfo"), *_of_groups(root)]
    return min(free, default=None)


def _of_machine(meminfo: Path) -> Iterator[int]:
    for line in _lines(meminfo):
        if line.startswith("MemAvailable:"):
            yield 1024 * int(line.split()[1])


def _of_groups(root: Path) -> Iterator[int]:
    """What each control group of this process leaves, from its own one up to that of the machine or container."""
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, path = line.split(":", 2)
        if "memory" in controllers.split(","):
            mounted, files = root / "sys/fs/cgroup/memory", _VERSION_1
        elif not controllers:
            mounted, files = root / "sys/fs/cgroup", _VERSION_2
        else:
            continue
        own = mounted / path.lstrip("/")
        for folder in (own, *own.parents):
            yield from _left(folder, files)


def _left(folder: Path, files: _Files) -> Iterator[int]:
    limit, used = (next(iter(_lines(folder / name)), "") for name in (files.limit, files.used))
    if limit.isdecimal() and used.isdecimal():  # not "max"
        stat = dict(line.split(maxsplit=1) for line in _lines(folder / "memory.stat"))
        cached = sum(int(stat.get(name, 0)) for name in files.cached)
        yield max(int(limit) - int(used) + cached, 0)


def _lines(path: Path) -> list[str]:
    """The lines of a file; none if it does not exist: a container sees only some of them."""
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
