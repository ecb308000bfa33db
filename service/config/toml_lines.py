"""The line of each key of a TOML text, from a syntax tree, as tomllib does not report lines."""

import tomllib
from collections.abc import Iterable, Mapping

import tree_sitter_toml
from tree_sitter import Language, Node, Parser

Keys = tuple[str | int, ...]
"""Keys and indices from the top of the file: ("robot", 0, "axis", 1, "torque", "message")."""
_LANGUAGE = Language(tree_sitter_toml.language())
_KEYS = ("bare_key", "quoted_key", "dotted_key")


def positions(text: str) -> dict[Keys, int]:
    """The line of each key, table header and array element of a TOML text that tomllib has accepted."""
    finder = _Finder()
    finder.document(Parser(_LANGUAGE).parse(text.encode()).root_node)
    return finder.found


def nearest(found: Mapping[Keys, int], path: Keys) -> int:
    """The line of a path; for a missing key, the line of the innermost table around it."""
    for length in range(len(path), 0, -1):
        if path[:length] in found:
            return found[path[:length]]
    return 1


class _Finder:
    def __init__(self) -> None:
        self.found: dict[Keys, int] = {}
        self._elements: dict[Keys, int] = {}  # number of [[elements]] so far in each array of tables

    def document(self, root: Node) -> None:
        self._pairs(root, ())
        for table in root.named_children:
            if table.type == "table":
                self._pairs(table, self._header(table))
            elif table.type == "table_array_element":
                self._pairs(table, self._element(table))

    def _header(self, table: Node) -> Keys:
        path = self._current(_names(_key(table)))
        self._add(path, table, replace=True)
        return path

    def _element(self, table: Node) -> Keys:
        names = _names(_key(table))
        array = (*self._current(names[:-1]), names[-1])
        index = self._elements.get(array, 0)
        self._elements[array] = index + 1
        self._add(array, table)
        self._add((*array, index), table)
        return (*array, index)

    def _current(self, names: Iterable[str]) -> Keys:
        """The path of a header; a name of an array of tables means its last element."""
        path: Keys = ()
        for name in names:
            path = (*path, name)
            if path in self._elements:
                path = (*path, self._elements[path] - 1)
        return path

    def _pairs(self, parent: Node, path: Keys) -> None:
        for pair in parent.named_children:
            if pair.type == "pair":
                key, value = _key(pair), pair.named_children[-1]
                inner = path
                for name in _names(key):
                    inner = (*inner, name)
                    self._add(inner, key)
                self._value(value, inner)

    def _value(self, value: Node, path: Keys) -> None:
        if value.type == "inline_table":
            self._pairs(value, path)
        elif value.type == "array":
            elements = [node for node in value.named_children if node.type != "comment"]
            for index, element in enumerate(elements):
                self._add((*path, index), element)
                self._value(element, (*path, index))

    def _add(self, path: Keys, node: Node, replace: bool = False) -> None:
        line = node.start_point.row + 1
        if replace:
            self.found[path] = line
        else:
            self.found.setdefault(path, line)


def _key(node: Node) -> Node:
    return next(child for child in node.named_children if child.type in _KEYS)


def _names(key: Node) -> list[str]:
    """The parts of a possibly dotted key, without quotes and escapes."""
    if key.type == "dotted_key":
        return [name for part in key.named_children for name in _names(part)]
    text = (key.text or b"").decode()
    return [*tomllib.loads(f"{text} = 0")] if key.type == "quoted_key" else [text]
