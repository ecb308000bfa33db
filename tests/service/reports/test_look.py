"""The reports look as the dashboard does: the same colours, type and spacing, and the same lines in the plots."""

import re
from pathlib import Path

import pytest

from service.reports.formats import TEMPLATES
from service.reports.plot_style import COLOURS, DOWN, ESTIMATE, LIMIT, NOMINAL, UP, LineStyle
from tests.conftest import ROOT

DASHBOARD = ROOT / "service" / "web" / "dashboard" / "src"
TOKENS = (TEMPLATES / "tokens.css").read_text(encoding="utf-8")
COLOUR = re.compile(r"--([\w-]+): #[0-9a-f]{3,6};")


def test_every_colour_is_defined_once_for_the_light_and_once_for_the_dark() -> None:
    light, rest = TOKENS.split("@media screen and (prefers-color-scheme: dark)")
    dark, paper = rest.split("@media print")
    assert COLOUR.findall(light) == COLOUR.findall(dark) != []
    assert set(COLOUR.findall(paper)) < set(COLOUR.findall(light))
    assert set(COLOURS.values()) <= set(COLOUR.findall(light))


@pytest.mark.parametrize("path", [DASHBOARD / "page.css", TEMPLATES / "style.css"], ids=["dashboard", "reports"])
def test_both_style_sheets_take_them_from_there(path: Path) -> None:
    """The dashboard sets its own only for what belongs to an alarm, and for its tiles."""
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"#[0-9a-fA-F]{3,8}\b(?=[;,) ])", re.sub(r"rgb\([^)]*\)", "", text))
    defined = {*re.findall(r"--([\w-]+):", TOKENS), *re.findall(r"--([\w-]+):", text), "bar", "zoom"}
    assert set(re.findall(r"var\(--([\w-]+)", text)) <= defined
    for name in ("size", "font", "size-h1", "size-h2", "size-small", "cell", "inset", "radius", "margin"):
        assert f"var(--{name})" in text, name


@pytest.mark.parametrize(
    ("name", "look"),
    [("ESTIMATE", ESTIMATE), ("NOMINAL", NOMINAL), ("THRESHOLD", LIMIT), ("UP", UP), ("DOWN", DOWN)],
)
def test_lines_are_those_of_the_dashboard(name: str, look: LineStyle) -> None:
    """Dashes are counted in pixels there, in widths of the line here."""
    source = (DASHBOARD / "axis_page.tsx").read_text(encoding="utf-8")
    line = re.search(rf'const {name} = {{ colour: "(\w+)"(?:, dash: \[(\d+), (\d+)\])?(?:, width: (\d+))? }}', source)
    assert line is not None
    assert COLOURS[look["color"]] == line[1]
    width = float(line[4] or 1.5)
    dashes = (0, tuple(float(dash) / width for dash in line.groups()[1:3])) if line[2] else "-"
    assert look.get("ls", "-") == (dashes if dashes == "-" else (0, pytest.approx(dashes[1], abs=0.05)))
