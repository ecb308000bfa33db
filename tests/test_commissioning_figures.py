"""The pictures of docs/commissioning.md stand alone, are small, and the text shows them."""

import xml.etree.ElementTree as ET

import pytest

from docs.commissioning_figures import motion_figure
from tests.conftest import ROOT

FIGURES = ROOT / "docs" / "figures"
SMALL = 100_000
"""Bytes."""


def test_the_planned_motion_is_the_same_twice() -> None:
    text = motion_figure()
    assert text == motion_figure()
    assert ET.fromstring(text).tag.endswith("svg")


@pytest.mark.parametrize("name", ["motion.svg", "replay.svg"])
def test_pictures(name: str) -> None:
    text = (FIGURES / name).read_text(encoding="utf-8")
    assert len(text) < SMALL
    assert ET.fromstring(text).tag.endswith("svg")
    assert f"(figures/{name})" in (ROOT / "docs" / "commissioning.md").read_text(encoding="utf-8")
