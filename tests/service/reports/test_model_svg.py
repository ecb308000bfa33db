"""The picture of a drive: well-formed, complete, nothing on top of another, and laid out from the torque outwards."""

from __future__ import annotations

import random
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.modeling.flat import FlatComponent, ModelError
from service.reports.model_svg import as_svg
from service.reports.picture_layout import lay_out
from service.reports.picture_text import formula
from tests.service.reports.drives import CHAIN, Row, components, space

SVG = "{http://www.w3.org/2000/svg}"

TREE: list[Row] = [
    ("torque", "servo", "a", {"kT": "kT"}),
    ("inertia", "motor", "a", {"J": "Jm"}),
    ("inertia", "brake", "a a2", {"J": "Jb"}),
    ("spring-damper", "short", "a2 b", {"c": "k1", "d": "d1"}),
    ("inertia", "left", "b", {"J": "J1"}),
    ("spring", "long", "a c", {"c": "k2"}),
    ("damper", "oil", "c a2", {"d": "d2"}),
    ("inertia", "middle", "c", {"J": "J2"}),
    ("spring", "on", "c d", {"c": "k3"}),
    ("inertia", "tip", "d", {"J": "J3"}),
    ("spring", "balancer", "ground d", {"c": "k4"}),
    ("damper", "bearing", "a housing", {"d": "fm"}),
    ("fixed", "wall", "housing", {}),
    ("gain", "amplifier", "", {"k": "k9"}),
]


def picture(parts: tuple[FlatComponent, ...], name: str = "drive") -> ET.Element:
    return ET.fromstring(as_svg(replace(space(name=name), components=parts)))


def titles(root: ET.Element) -> list[str]:
    return [title.text or "" for title in root.iter(f"{SVG}title")]


Box = tuple[float, float, float, float]


def placed(root: ET.Element, x: float = 0, y: float = 0) -> Iterator[tuple[ET.Element, float, float]]:
    """Every element that is not turned, with the origin of its coordinates."""
    for child in root:
        move = re.fullmatch(r"translate\((\S+) (\S+)\)", child.get("transform", "translate(0 0)"))
        if move:
            dx, dy = x + float(move[1]), y + float(move[2])
            yield child, dx, dy
            yield from placed(child, dx, dy)


def boxes(root: ET.Element) -> Iterator[Box]:
    """Left, top, right, bottom of every inertia."""
    for e, x, y in placed(root):
        if e.get("class") == "mass":
            left, top = x + float(e.get("x", "")), y + float(e.get("y", ""))
            yield left, top, left + float(e.get("width", "")), top + float(e.get("height", ""))


def springs(root: ET.Element) -> Iterator[Box]:
    """The same of every spring between two bodies."""
    for e, x, y in placed(root):
        if zigzag := re.fullmatch(r"M0 0H.*L.*H([\d.]+)", e.get("d", "")):
            yield x, y - 8, x + float(zigzag[1]), y + 8


def apart(a: Box, b: Box) -> bool:
    return a[2] < b[0] or b[2] < a[0] or a[3] < b[1] or b[3] < a[1]


def check(root: ET.Element, inertias: int) -> None:
    found = list(boxes(root))
    width, height = float(root.get("width", "")), float(root.get("height", ""))
    assert len(found) == inertias
    assert all(apart(a, b) for a, b in combinations([*found, *springs(root)], 2))
    assert all(0 < left < right < width and 0 < top < bottom < height for left, top, right, bottom in found)


@pytest.mark.parametrize(("rows", "inertias"), [(CHAIN, 3), (TREE, 5)], ids=["chain", "tree"])
def test_everything_is_drawn(rows: list[Row], inertias: int) -> None:
    root = picture(components(rows))
    check(root, inertias)
    drawn = {title.split(":")[0] for title in titles(root)}
    assert drawn == {"drive"} | {name for kind, name, _, _ in rows if kind != "fixed"}
    assert "motor: inertia, J = Jm" in titles(root)


def test_columns_and_lanes() -> None:
    layout = lay_out(components(TREE))
    places = {b.inertias[0].name: (b.column, b.lane) for b in layout.bodies}
    assert places == {"motor": (0, 0), "middle": (1, 0), "tip": (2, 0), "left": (1, 1)}
    (shaft,) = (b for b in layout.bodies if b.column == 0)
    assert [c.name for c in shaft.inertias] == ["motor", "brake"]
    assert [c.name for c in shaft.attached] == ["servo", "bearing"]
    together = {tuple(c.name for c in link.parts): link.tree for link in layout.links}
    assert together == {("short",): True, ("long", "oil"): True, ("on",): True}


def test_a_loop_has_a_lane_of_its_own() -> None:
    loop: list[Row] = [*TREE, ("spring", "loop", "b d", {"c": "k5"})]
    layout = lay_out(components(loop))
    assert sum(not link.tree for link in layout.links) == 1
    check(picture(components(loop)), 5)


def test_without_a_torque_and_in_two_pieces() -> None:
    rows: list[Row] = [
        ("inertia", "one", "a", {"J": "J1"}),
        ("inertia", "two", "b", {"J": "J2"}),
        ("inertia", "held", "ground", {"J": "J3"}),
        ("torque", "servo", "b", {}),
    ]
    layout = lay_out(components(rows))
    assert sorted((b.column, b.lane) for b in layout.bodies) == [(0, 0), (0, 1), (0, 2)]
    check(picture(components(rows)), 3)


@given(parents=st.lists(st.integers(0, 1000), max_size=12), seed=st.integers(0, 2**32))
def test_trees_of_any_shape(parents: list[int], seed: int) -> None:
    parents = [p % (i + 1) for i, p in enumerate(parents)]
    rows: list[Row] = [("torque", "servo", "n0", {})]
    rows += [
        ("inertia", f"mass {i}", f"n{i}", {"J": "J" * (1 + seed % (7 * i + 1) % 30)})
        for i in range(len(parents) + 1)
    ]
    rows += [("spring-damper", f"s{i}", f"n{p} n{i}", {"c": "c", "d": "d"}) for i, p in enumerate(parents, 1)]
    random.Random(seed).shuffle(rows)
    layout = lay_out(components(rows))
    column = {b.inertias[0].name: b.column for b in layout.bodies}
    depth = [0]
    for p in parents:
        depth.append(depth[p] + 1)
    assert [column[f"mass {i}"] for i in range(len(depth))] == depth
    assert len({(b.column, b.lane) for b in layout.bodies}) == len(layout.bodies)
    assert layout.lanes == max(1, sum(i not in parents for i in range(len(depth))))
    assert all(link.tree for link in layout.links)
    check(picture(components(rows)), len(depth))


@given(st.text(min_size=1, max_size=60), st.text(min_size=1, max_size=60))
def test_whatever_the_drawing_calls_it(name: str, parameter: str) -> None:
    rows: list[Row] = [("inertia", name, "a", {"J": parameter}), ("torque", "<&>", "a", {parameter: "k"})]
    root = picture(components(rows), name=name)
    assert any(title.startswith("<&>: torque") for title in titles(root))


def test_a_hundred_masses() -> None:
    rows: list[Row] = [("inertia", f"m{i}", f"n{i}", {"J": f"J{i}"}) for i in range(100)]
    rows += [("spring", f"s{i}", f"n{i} n{i + 1}", {"c": f"c{i}"}) for i in range(99)]
    check(picture(components(rows)), 100)


def test_nothing_to_draw() -> None:
    with pytest.raises(ModelError, match="no components"):
        as_svg(replace(space(), components=()))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Jm", "Jm"),
        ("tau0", "τ0"),
        ("1/r", "1/r"),
        ("m*l^2", "m\u2009l2"),
        ("-k_b", "−kb"),
        ("motor.J", "Jmotor"),
    ],
)
def test_formulas(text: str, shown: str) -> None:
    root = ET.fromstring(f"<text>{formula(text)}</text>")
    assert "".join(root.itertext()) == shown


def test_subscripts_come_back_to_the_line() -> None:
    assert formula("Jm/r") == (
        '<tspan class="letter">J</tspan><tspan class="small" dy="3">m</tspan>'
        '<tspan class="word" dy="-3">/</tspan><tspan class="letter">r</tspan>'
    )


def test_light_and_dark() -> None:
    text = as_svg(space())
    assert "@media (prefers-color-scheme: dark)" in text
    styled = set(re.findall(r"\.([a-z]+)\b(?=[^{}]*\{)", text))
    used = {word for words in re.findall(r'class="([^"]+)"', text) for word in words.split()}
    assert used - styled == {"word"}
