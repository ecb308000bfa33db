"""All facts about a drive, computed once; as text, and as JSON.

The text shows the drive after reduction, matrices, poles and resonances, and the identifiable parameters.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from monitor_core.drive import COSINE, COULOMB, ONE, SINE, TORQUE
from monitor_core.modeling import (
    Laurent,
    Resonances,
    StateSpace,
    modes,
    nominal_of,
    resonances_of,
    structural,
)
from service.config.unit_names import UNITS
from service.reports.formats import json_text

_MOST_STATES = 100
"""Most states for an identifiability analysis; with more of them it would take minutes."""
_MOST_MERGED = 60
"""Most parameters that occur only inside of merged ones; each of them takes a further pass."""


@dataclass(frozen=True, slots=True)
class Facts:
    """A drive, its known ``nominal`` values, and the results of the analysis.

    ``missing``: parameters without a nominal value; with any of them there is no ``motion``.
    ``motion``: poles [1/s], resonances and anti-resonances from the torque to the first output.
    ``identifiability``: sentences.
    """

    space: StateSpace
    nominal: Mapping[str, float]
    missing: tuple[str, ...]
    motion: Resonances | None
    identifiability: tuple[str, ...]


def facts_of(space: StateSpace, values: Mapping[str, float] | None = None) -> Facts:
    """All facts about a drive; given nominal values take precedence over those of the drawing."""
    nominal = nominal_of(space, values)
    missing = tuple(p.name for p in space.parameters if p.name not in nominal)
    motion = None if missing else resonances_of(space, nominal)
    why = _not_examined(space)
    identifiability = (f"Not examined: {why}.",) if why else structural(space).words()
    return Facts(space, nominal, missing, motion, identifiability)


def _not_examined(space: StateSpace) -> str:
    """Why the analysis would take too long; empty if it does not."""
    if len(space.states) > _MOST_STATES:
        return f"the drive has more than {_MOST_STATES} states"
    merged = {name for definition in space.definitions for name in definition.value.names}
    if len(merged) > _MOST_MERGED:
        return f"more than {_MOST_MERGED} parameters are merged into others"
    return ""


def matrices(space: StateSpace) -> dict[str, list[list[str]]]:
    """The entries of A (n, n), B (n, m) and C (p, n) as text."""
    n, m, p = len(space.states), len(space.inputs), len(space.sensors)
    zero = Laurent()
    return {
        letter: [[str(entries.get((i, j), zero)) for j in range(columns)] for i in range(rows)]
        for letter, entries, rows, columns in (
            ("A", space.A, n, n),
            ("B", space.B, n, m),
            ("C", space.C, p, n),
        )
    }


# --- For people -------------------------------------------------------------------------------------------------------


_PAPER = "three-mass"
_INDENT = 2


def print_text(facts: Facts, console: Console) -> None:
    """The report, as wide as the console; in a file or a pipe without blanks at the ends of lines."""
    with console.capture() as captured:
        _print(facts, console)
    text = captured.get()
    if not console.is_terminal:
        text = "".join(f"{line.rstrip()}\n" for line in text.splitlines())
    console.file.write(text)


def _print(facts: Facts, console: Console) -> None:
    space, ascii_only = facts.space, console.options.ascii_only
    console.print(Text(space.name, style="bold"), soft_wrap=True)
    console.print(Text(elimination_words(space)))
    sections: list[tuple[str, RenderableType | None]] = [
        ("States, inputs, outputs", _signals(space)),
        ("Parameters", _parameters(facts)),
        (
            "Merged parameters",
            _lines(f"{d.name} = {d.value}" for d in space.definitions if str(d.value) != d.name),
        ),
        ("x' = A x + B u,  y = C x", _state_space(space, console.width - _INDENT, ascii_only)),
        ("Poles at nominal", _poles(facts, "+-" if ascii_only else "±")),
        ("Resonances at nominal", _resonances(facts.motion) if facts.motion else None),
        ("Identifiability", _sentences(facts.identifiability)),
        ("Notes", _sentences(space.notes)),
    ]
    for title, content in sections:
        if content is not None:
            console.print()
            console.print(Text(title, style="bold"))
            console.print(Padding(content, (0, 0, 0, _INDENT)))


def elimination_words(space: StateSpace) -> str:
    """The steps of the elimination, in the words of the paper; for the drive of the paper also its own counts."""
    r = space.report
    words = (
        f"flat equations {r.flat_equations}, states {r.flat_states} -> minimal {len(space.states)}, "
        f"equations left {r.remaining_equations}"
    )
    if space.name == _PAPER:
        words += (
            "; the paper counts for its tool and library 55, 9, 6 and 5 with the speed as the output, 6 with the angle"
        )
    return words


def _grid(
    rows: Iterable[tuple[str, ...]], *titles: str, right: Collection[str] = (), key: str = "", gap: int = 2
) -> Table:
    """A table without lines; cells are folded, never cut, except those of the first column, in this style."""
    cells = list(rows)
    table = Table(box=None, padding=(0, gap, 0, 0), show_header=bool(titles), header_style="dim")
    for number, name in enumerate(titles or [""] * max(map(len, cells), default=0)):
        unbroken = number == 0 and not titles
        justify: Literal["right", "left"] = "right" if name in right else "left"
        style = key if number == 0 else ""
        table.add_column(name, justify=justify, overflow="fold", no_wrap=unbroken, style=style)
    for row in cells:
        table.add_row(*map(Text, row))
    return table


def _signals(space: StateSpace) -> Table:
    rows = [(f"x{i}", f"{s.name}, {s.unit}") for i, s in enumerate(space.states, 1)]
    for i, u in enumerate(space.inputs, 1):
        _, words = _INPUTS[u.kind]
        rows.append((f"u{i}", words if u.kind == ONE else f"{u.name}: {words}"))
    for i, s in enumerate(space.sensors, 1):
        rows.append((f"y{i}", f"{s.name}: {s.quantity}, {UNITS[s.quantity]}"))
    return _grid(rows, key="cyan")


_INPUTS = {
    TORQUE: ("torque", "motor torque, N m"),
    COULOMB: ("direction", "direction of motion, tanh(speed/scale)"),
    ONE: ("one", "constant 1"),
    COSINE: ("cosine", "cosine of the angle"),
    SINE: ("sine", "sine of the angle"),
}
"""Kinds of inputs in JSON, and in words"""


def _parameters(facts: Facts) -> Table:
    rows = [
        (
            p.name,
            f"{facts.nominal[p.name]:.6g}" if p.name in facts.nominal else "-",
            "" if p.unit == "1" else p.unit,
            p.meaning,
        )
        for p in facts.space.parameters
    ]
    return _grid(rows, "name", "nominal", "unit", "meaning", right=("nominal",), key="cyan")


def _poles(facts: Facts, both: str) -> RenderableType | None:
    if facts.motion is None:
        return Text(f"not known: no nominal value for {', '.join(facts.missing)}")
    rows = []
    for p in facts.motion.poles:
        decay = f"{-1 / p.real:.3g} s" if p.real < 0 else ""
        for mode in modes([p]):
            pair = f"{p.real:.4g} {both} {p.imag:.4g}i"
            rows.append((pair, f"{mode.frequency_hz:.4g}", f"{mode.damping + 0.0:.3g}", decay))
        if not modes([p, p.conjugate()]):
            rows.append((f"{p.real:.4g}" if p.real else "0", "", "", decay))
    titles = ("1/s", "Hz", "damping", "time constant")
    return _grid(rows, *titles, right=titles)


def _resonances(motion: Resonances) -> RenderableType:
    found = [("resonance", m) for m in motion.resonances]
    found += [("anti-resonance", m) for m in motion.antiresonances]
    found.sort(key=lambda pair: pair[1].frequency_hz)
    rows = [(kind, f"{mode.frequency_hz:.4g}", f"{mode.damping + 0.0:.3g}") for kind, mode in found]
    return _grid(rows, "", "Hz", "damping", right=("Hz", "damping")) if rows else Text("none")


def _lines(lines: Iterable[str]) -> RenderableType | None:
    found = list(lines)
    return Group(*(Text(line, overflow="fold") for line in found)) if found else None


def _sentences(sentences: Iterable[str]) -> RenderableType | None:
    table = _grid((("-", sentence) for sentence in sentences), gap=1)
    return table if table.row_count else None


# --- A, B and C in lines of text: as matrices where they fit, else entry by entry ------------------------------------


_GAP = 3


def _state_space(space: StateSpace, width: int, ascii_only: bool) -> RenderableType | None:
    """The three matrices if they fit, else their nonzero entries."""
    blocks = [matrix(letter, cells, ascii_only) for letter, cells in matrices(space).items()]
    if all(len(line) <= width for block in blocks for line in block):
        return _lines([line for block in blocks for line in (*block, "")][:-1])
    rows = ((letter, *entry) for letter, M in matrices(space).items() for entry in _entries(M))
    return _grid(((f"{letter}[{i},{j}] =", text) for letter, i, j, text in rows), gap=1)


def _entries(M: list[list[str]]) -> Iterator[tuple[int, int, str]]:
    """Row and column, from 1 on, and the text of each nonzero entry."""
    for i, row in enumerate(M, 1):
        yield from ((i, j, text) for j, text in enumerate(row, 1) if text != "0")


def matrix(letter: str, cells: list[list[str]], ascii_only: bool = False) -> list[str]:
    """The rows, entries in aligned columns, "A =" beside the middle one."""
    last = len(cells) - 1
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = []
    for number, row in enumerate(cells):
        head = f"{letter} = " if number == last // 2 else " " * (len(letter) + 3)
        body = (" " * _GAP).join(cell.center(size) for cell, size in zip(row, widths, strict=True))
        brackets = "⎡⎤" if number == 0 else "⎣⎦" if number == last else "⎢⎥"
        brackets = "[]" if ascii_only or not last else brackets
        lines.append(f"{head}{brackets[0]} {body} {brackets[1]}")
    return lines


# --- JSON -------------------------------------------------------------------------------------------------------------


def as_json(facts: Facts) -> str:
    """All facts for JSON: entries of A, B, C as expressions, and numbers where they are known.

    Entries that need nominal values are null if one is missing (``missing_nominal``).
    """
    space, report, motion = facts.space, facts.space.report, facts.motion
    return json_text(
        {
            "name": space.name,
            "states": space.states,
            "inputs": [{"name": u.name, "kind": _INPUTS[u.kind][0]} for u in space.inputs],
            "outputs": [{"name": s.name, "quantity": s.quantity, "unit": UNITS[s.quantity]} for s in space.sensors],
            "parameters": [
                {"name": p.name, "unit": p.unit, "meaning": p.meaning, "nominal": facts.nominal.get(p.name)}
                for p in space.parameters
            ],
            "merged": [{"name": d.name, "definition": str(d.value)} for d in space.definitions],
            "missing_nominal": facts.missing,
            **matrices(space),
            "poles": [{"re": p.real, "im": p.imag} for p in motion.poles] if motion else None,
            "resonances_hz": [m.frequency_hz for m in motion.resonances] if motion else None,
            "antiresonances_hz": [m.frequency_hz for m in motion.antiresonances] if motion else None,
            "flat_equations": report.flat_equations,
            "flat_states": report.flat_states,
            "remaining_equations": report.remaining_equations,
            "identifiability": facts.identifiability,
            "notes": space.notes,
        }
    )
