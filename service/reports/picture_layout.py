"""Where the masses and springs of a drive go in its picture: columns away from the torque, branches on lanes."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from monitor_core.modeling.flat import FlatComponent

GROUND = "ground"


@dataclass(frozen=True, slots=True)
class Body:
    """What turns as one: no inertia (a mere node), one, or several; and all that acts on it alone.

    ``attached``: torques, sensors, friction, springs to ground.
    """

    inertias: tuple[FlatComponent, ...]
    attached: tuple[FlatComponent, ...]
    column: int
    lane: int


@dataclass(frozen=True, slots=True)
class Link:
    """Springs, dampers and gears side by side between two bodies, given by their indices.

    ``tree``: the body ``end`` is reached from the torque through this link; other links close loops.
    """

    start: int
    end: int
    parts: tuple[FlatComponent, ...]
    tree: bool


@dataclass(frozen=True, slots=True)
class Layout:
    """Bodies, links, and ``lanes``: how many the bodies take.

    ``gains``: what the motor torque is multiplied by before it acts, where there is one torque only.
    """

    bodies: tuple[Body, ...]
    links: tuple[Link, ...]
    lanes: int
    gains: tuple[FlatComponent, ...]


def lay_out(components: Sequence[FlatComponent]) -> Layout:
    """Bodies in columns by their distance from the torque; the longest branch goes straight on."""
    shafts = _Shafts(components)
    links: dict[tuple[int, int], list[FlatComponent]] = defaultdict(list)
    inertias: dict[int, list[FlatComponent]] = defaultdict(list)
    attached: dict[int, list[FlatComponent]] = defaultdict(list)
    for component in components:
        ends = shafts.of(component)
        if component.kind == "inertia":
            inertias[ends[0]].append(component)
        elif len(ends) == 2 and ends[0] != ends[1]:
            links[min(ends), max(ends)].append(component)
        elif ends and component.kind != "fixed":
            attached[ends[0]].append(component)
    roots = [shafts.of(c)[0] for c in components if c.kind == "torque" and shafts.of(c)]
    tree = _Tree(shafts.count, list(links), roots)
    bodies = tuple(
        Body(tuple(inertias[i]), tuple(attached[i]), tree.column[i], tree.lane[i])
        for i in range(shafts.count)
    )
    gains = tuple(c for c in components if c.kind == "gain" and len(roots) == 1)
    return Layout(bodies, tuple(tree.link(ends, parts) for ends, parts in links.items()), tree.lanes, gains)


class _Shafts:
    """Numbers the sets of nodes that turn together, because inertias join them."""

    def __init__(self, components: Iterable[FlatComponent]) -> None:
        parts = [c for c in components if c.nodes]
        self._fixed = {GROUND, *(node for c in parts if c.kind == "fixed" for node in c.nodes)}
        self._parent: dict[str, str] = {}
        for c in parts:
            for node in self._keys(c):
                self._parent.setdefault(node, node)
            if c.kind == "inertia":
                for node in self._keys(c)[1:]:
                    self._parent[self._root(node)] = self._root(self._keys(c)[0])
        roots = dict.fromkeys(self._root(node) for node in self._parent)
        self._number = {root: number for number, root in enumerate(roots)}
        self.count = len(roots)

    def of(self, component: FlatComponent) -> tuple[int, ...]:
        """The shafts that a component is on, ground left out."""
        return tuple(self._number[self._root(node)] for node in self._keys(component))

    def _keys(self, component: FlatComponent) -> tuple[str, ...]:
        """Its nodes; an inertia that is held fast keeps a place of its own."""
        free = tuple(node for node in component.nodes if node not in self._fixed)
        held = component.kind == "inertia" and component.nodes and not free
        return (f"{GROUND}: {component.name}",) if held else free

    def _root(self, node: str) -> str:
        while self._parent[node] != node:
            self._parent[node] = node = self._parent[self._parent[node]]
        return node


class _Tree:
    """The bodies as a tree that grows from the torque: columns by depth, a lane for each branch."""

    def __init__(self, count: int, links: list[tuple[int, int]], roots: list[int]) -> None:
        self._neighbours: dict[int, list[int]] = defaultdict(list)
        for a, b in links:
            self._neighbours[a].append(b)
            self._neighbours[b].append(a)
        self.column: dict[int, int] = {}
        self.lane: dict[int, int] = {}
        self._parent: dict[int, int] = {}
        self._children: dict[int, list[int]] = defaultdict(list)
        self.lanes = 0
        for root in [*roots, *range(count)]:
            if root not in self.column:
                self._spread(root)

    def link(self, ends: tuple[int, int], parts: Iterable[FlatComponent]) -> Link:
        """The link between two bodies, the one nearer to the torque first."""
        start, end = sorted(ends, key=lambda body: (self.column[body], self.lane[body]))
        return Link(start, end, tuple(parts), self._parent.get(end) == start)

    def _spread(self, root: int) -> None:
        """All that hangs together with this body: breadth first, so that columns are distances."""
        self.column[root] = 0
        queue, order = deque([root]), [root]
        while queue:
            body = queue.popleft()
            for other in self._neighbours[body]:
                if other not in self.column:
                    self.column[other] = self.column[body] + 1
                    self._parent[other] = body
                    self._children[body].append(other)
                    queue.append(other)
                    order.append(other)
        self._give_lanes(root, order)

    def _give_lanes(self, root: int, order: list[int]) -> None:
        height = dict.fromkeys(order, 0)
        for body in reversed(order[1:]):
            parent = self._parent[body]
            height[parent] = max(height[parent], height[body] + 1)
        waiting = [root]
        while waiting:
            body = waiting.pop()
            straight = body != root and self._straight(self._parent[body], height) == body
            self.lane[body] = self.lane[self._parent[body]] if straight else self.lanes
            self.lanes += not straight
            main = self._straight(body, height)
            others = [c for c in self._children[body] if c != main]
            # The last one is taken next: straight on first, then the branches in the order of the drawing.
            waiting += [*reversed(others), *([main] if main is not None else [])]

    def _straight(self, body: int, height: dict[int, int]) -> int | None:
        """The child that goes on in the same lane: the one with the longest way behind it."""
        return max(self._children[body], key=lambda child: height[child], default=None)
