"""The memory that further processes may take, from made files of the kernel."""

from pathlib import Path

import pytest

from service.commands.commissioning.axis.free_memory import free_memory

GB = 1_000_000_000


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A machine of which 8 GB are free, without control groups."""
    written(tmp_path / "proc/meminfo", f"MemTotal: 16000000 kB\nMemFree: 1 kB\nMemAvailable: {8 * GB // 1024} kB\n")
    return tmp_path


def written(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def test_where_nothing_is_known(tmp_path: Path) -> None:
    assert free_memory(tmp_path) is None


def test_of_a_machine(root: Path) -> None:
    assert free_memory(root) == pytest.approx(8 * GB, rel=1e-6)


def group(folder: Path, limit: str, used: int, cached: int) -> None:
    """A control group of version 2."""
    written(folder / "memory.max", f"{limit}\n")
    written(folder / "memory.current", f"{used}\n")
    written(folder / "memory.stat", f"anon 5\ninactive_file {cached}\nactive_file 7\n")


def test_of_a_service_with_a_limit(root: Path) -> None:
    """What its files in the cache take can be freed; the limit may be that of a group above."""
    written(root / "proc/self/cgroup", "0::/system.slice/a.service\n")
    folder = root / "sys/fs/cgroup/system.slice"
    group(folder / "a.service", "max", 3 * GB, 0)
    assert free_memory(root) == pytest.approx(8 * GB, rel=1e-6)
    group(folder / "a.service", str(4 * GB), 3 * GB, GB)
    assert free_memory(root) == 2 * GB + 7
    group(folder, str(3 * GB), 3 * GB, 0)
    assert free_memory(root) == 7


def test_of_a_container_that_sees_its_own_group_as_the_root(root: Path) -> None:
    written(root / "proc/self/cgroup", "0::/docker/1f\n")
    group(root / "sys/fs/cgroup", str(2 * GB), GB, 0)
    assert free_memory(root) == GB + 7


def test_of_groups_of_version_1(root: Path) -> None:
    written(root / "proc/self/cgroup", "7:cpu,cpuacct:/b\n4:memory:/a\n0::/\n")
    folder = root / "sys/fs/cgroup/memory/a"
    written(folder / "memory.limit_in_bytes", f"{2 * GB}\n")
    written(folder / "memory.usage_in_bytes", f"{3 * GB // 2}\n")
    written(folder / "memory.stat", f"cache 1\ntotal_inactive_file {GB // 4}\ntotal_active_file {GB // 4}\n")
    written(root / "sys/fs/cgroup/memory/memory.limit_in_bytes", f"{2**63 - 4096}\n")
    written(root / "sys/fs/cgroup/memory/memory.usage_in_bytes", "0\n")
    assert free_memory(root) == GB
