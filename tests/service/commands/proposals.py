"""Tables that ``init`` reads, and what it proposes for them."""

from pathlib import Path

from service.config import AxisConfig, load


def proposed() -> list[AxisConfig]:
    return [axis.config for axis in load(Path("axis.toml")).axes]


def rename_columns(record: Path, names: str) -> None:
    _, _, rows = record.read_text(encoding="utf-8").partition("\n")
    record.write_text(f"{names}\n{rows}", encoding="utf-8")
