"""Parses a text to pymoca's syntax tree.  A syntax error becomes one sentence with its line.

pymoca's tree has no line numbers, and it silently drops elements that change the drive: conditions of components, array
dimensions, algorithms.  So each node gets its file and line here (``place_of``), and dropped elements are refused by
name.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pymoca import ast
from pymoca.generated.ModelicaLexer import ModelicaLexer
from pymoca.generated.ModelicaParser import ModelicaParser
from pymoca.parser import ASTListener, ErrorListener, ModelicaFile, ModelicaSyntaxError, antlr4

from monitor_core.modeling.flat import ModelError, Origin


@dataclass(frozen=True, slots=True)
class Source:
    """A Modelica text; ``name``: the file as shown to the user, "" for the library."""

    name: str
    text: str


def parse(source: Source) -> ModelicaFile:
    """The classes of a text, and the package that it is ``within``.

    Raises:
        ModelError: a syntax error, or something that is not supported, with its line.
    """
    listener = _Listener(source.name)
    try:
        antlr4.ParseTreeWalker().walk(listener, _parse_tree(source))
    except ModelicaSyntaxError as error:
        raise ModelError(str(error.msg), Origin(file=source.name, line=error.lineno or 0)) from None
    assert listener.file_node is not None
    return listener.file_node


def place_of(node: object, component: str = "") -> Origin:
    """File and line of a node; empty for nodes that pymoca created itself."""
    return Origin(component, getattr(node, "file", ""), getattr(node, "line", 0))


def is_parameter(symbol: ast.Symbol) -> bool:
    """Whether a symbol is constant in time."""
    return not {"parameter", "constant"}.isdisjoint(symbol.prefixes)


_NOT = "is not supported"
_ONE_BY_ONE = f"{_NOT}: write linear equations and connect(...) one by one"
_WANTED = f"{_NOT}: write the model with the class that is wanted"
_REFUSED = {
    "Algorithm_sectionContext": f"an algorithm {_NOT}: write its linear equations out",
    "Equation_ifContext": f"an if-equation {_ONE_BY_ONE}",
    "Equation_forContext": f"a for-loop {_ONE_BY_ONE}",
    "Equation_whenContext": f"a when-equation {_ONE_BY_ONE}",
    "Equation_functionContext": f"a function call as an equation {_ONE_BY_ONE}",
    "Expression_ifContext": f"an if-expression {_NOT}",
    "Element_redeclarationContext": f'"redeclare" {_WANTED}',
    "Element_replaceableContext": f'"replaceable" {_WANTED}',
    "Replaceable_elementContext": f'"replaceable" {_WANTED}',
    "Class_spec_derContext": f"a class of this form {_NOT}",
    "Class_spec_extendsContext": f"a class of this form {_NOT}",
    "Named_argumentsContext": f"a call with named arguments {_NOT}",
}
"""Rules of the grammar that a drive must not use: pymoca ignores them, or they have no place in a linear drive."""


class _Listener(ASTListener):  # type: ignore[misc]
    """pymoca's builder of the syntax tree, which also notes places and refuses unsupported elements."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self._file = file
        self._names: dict[int, set[str]] = {}

    def enterEveryRule(self, ctx: Any) -> None:
        rule = type(ctx).__name__
        if rule in _REFUSED:
            self._refuse(_REFUSED[rule], ctx)

    def exitEveryRule(self, ctx: Any) -> None:
        node = self.ast.get(ctx)
        if isinstance(node, ast.Node) and not hasattr(node, "line"):
            node.file, node.line = self._file, ctx.start.line

    def exitComposition(self, ctx: Any) -> None:
        if any(child.getText() == "external" for child in ctx.children or () if not hasattr(child, "children")):
            self._refuse("an external function is not supported", ctx)
        super().exitComposition(ctx)

    def exitClass_definition(self, ctx: Any) -> None:
        super().exitClass_definition(ctx)
        node, end = self.ast[ctx], ctx.class_specifier().IDENT
        idents = end() if isinstance(end(), list) else [end()]
        if idents[-1].getText() != idents[0].getText():
            problem = (
                f'{node.type} {node.name} (line {ctx.start.line}) ends with "end {idents[-1].getText()};": '
                f'"end {node.name};" is expected'
            )
            raise ModelError(problem, Origin(file=self._file, line=ctx.stop.line))
        names = self._names.setdefault(id(self.class_node), set())
        if node.name in names:
            self._refuse(f"{node.name} is declared twice", ctx)
        names.add(node.name)

    def exitClass_spec_base(self, ctx: Any) -> None:
        super().exitClass_spec_base(ctx)
        # "input" of: connector RealInput = input Real
        self.class_node.causality = ctx.base_prefix().getText()

    def exitComponent_declaration(self, ctx: Any) -> None:
        super().exitComponent_declaration(ctx)
        name = self.ast[ctx].name
        if ctx.condition_attribute() is not None:
            self._refuse(
                "a component with a condition is not supported: leave it out, or remove the condition",
                ctx,
                name,
            )
        if self._file and (ctx.declaration().array_subscripts() or ctx.parentCtx.parentCtx.array_subscripts()):
            self._refuse("arrays are not supported: write the components one by one", ctx, name)

    def exitRegular_element(self, ctx: Any) -> None:
        super().exitRegular_element(ctx)
        if ctx.INNER() is not None or ctx.OUTER() is not None:
            self._refuse('"inner" and "outer" are not supported: connect the components instead', ctx)

    def _refuse(self, problem: str, ctx: Any, component: str = "") -> None:
        raise ModelError(problem, Origin(component, self._file, ctx.start.line))


def _parse_tree(source: Source) -> Any:
    """The parse tree of a text (a ``stored_definition`` of pymoca's ANTLR grammar)."""
    # The grammar wants a new line behind a last comment; some editors begin a file with a byte order mark.
    lexer = ModelicaLexer(antlr4.InputStream(source.text.removeprefix("\ufeff") + "\n"))
    tokens = antlr4.CommonTokenStream(lexer)
    parser = ModelicaParser(tokens)
    listener = _FirstError(source.name)
    for recognizer in (lexer, parser):
        recognizer.removeErrorListeners()
        recognizer.addErrorListener(listener)
    tokens.fill()
    for annotation in _annotations(tokens.tokens):
        annotation.channel = antlr4.Token.HIDDEN_CHANNEL
    tree = parser.stored_definition()
    rest = tokens.LT(1)
    if rest.type != antlr4.Token.EOF:
        problem = f'"{rest.text}" cannot stand outside of a class'
        right = 'a model begins with "model Name" and ends with "end Name;"'
        raise ModelError(f"{problem}: {right}", Origin(file=source.name, line=rest.line))
    return tree


def _annotations(tokens: list[Any]) -> Iterator[Any]:
    """Ranges of the brackets of ``annotation(...)``: most of a drawing's text, without effect here."""
    shown = [token for token in tokens if token.channel == 0]
    words = [token.text for token in shown]
    k = 0
    while k < len(words):
        end = _closing(words, k + 1) if words[k] == "annotation" else k
        yield from shown[k + 2 : end]
        k = max(k, end) + 1


def _closing(words: list[str], start: int) -> int:
    """The index of the bracket that closes the one at ``start``; 0 if it is not closed before the statement's end."""
    opened: list[str] = []
    for k in range(start, len(words)):
        if words[k] in _CLOSING:
            opened.append(_CLOSING[words[k]])
        elif opened and words[k] == opened[-1]:
            opened.pop()
        elif words[k] == ";" and opened[-1:] != ["]"]:
            return 0
        if not opened:
            return k
    return 0


_CLOSING = {"(": ")", "{": "}", "[": "]"}


class _FirstError(ErrorListener):  # type: ignore[misc]
    """Stops at the first syntax error."""

    def __init__(self, file: str) -> None:
        self._file = file

    def syntaxError(self, recognizer: Any, token: Any, line: int, *details: Any) -> None:
        _, text, _ = details  # column, message, exception
        problem, line = _problem(recognizer, token, line, text)
        raise ModelError(problem, Origin(file=self._file, line=line))


def _problem(recognizer: Any, token: Any, line: int, text: str) -> tuple[str, int]:
    """The mistake in words, and the line where it should be corrected."""
    if token is None:
        found = re.search(r"at: '(.*)'", text, re.DOTALL)
        shown = found.group(1) if found else text
        return f"{shown if shown.isprintable() else f'the character {shown!a}'} is not Modelica", line
    if token.type == -1:
        return _unfinished([t for t in recognizer.getTokenStream().tokens[:-1] if t.channel == 0], line)
    before = _token_before(recognizer, token)
    if before is not None and re.match(r"(missing ';'|mismatched input .* expecting ';')", text):
        return f'";" is missing behind "{before.text}"', before.line
    missing = re.match(r"missing (\S+) at", text) or re.search(r"expecting ('[^']*'|IDENT)$", text)
    wanted = missing.group(1).replace("'", '"').replace("IDENT", "a name") if missing else ""
    expected = f", {wanted} is expected here" if missing else ""
    behind = f' behind "{before.text}"' if before is not None else ""
    return f'syntax error: "{token.text}" cannot stand{behind}{expected}', line


def _token_before(recognizer: Any, token: Any) -> Any:
    stream = recognizer.getTokenStream()
    for index in range(token.tokenIndex - 1, -1, -1):
        if stream.get(index).channel == 0:
            return stream.get(index)
    return None


def _unfinished(tokens: list[Any], line: int) -> tuple[str, int]:
    """Message for a text that ends inside a class: the class without an end, and the line where it should end."""
    opened: list[tuple[str, str, int]] = []
    words = [*(token.text for token in tokens), "?", "?"]
    for k, token in enumerate(tokens):
        name = words[k + 1]
        if token.text == "end" and name in [n for _, n, _ in opened]:
            sort, inner, begin = opened.pop()
            if inner != name:
                return f'{sort} {inner} (line {begin}) has no "end {inner};" before "end {name};"', token.line
        elif token.text in _SORTS and words[k + 2] != "=":
            opened.append((token.text, name, token.line))
    line = tokens[-1].line if tokens else line
    if not opened:
        return "the text ends in the middle of a statement", line
    sort, name, begin = opened[-1]
    return f'the text ends inside of {sort} {name} (line {begin}): is "end {name};" missing?', line


_SORTS = ("model", "class", "block", "connector", "package", "record", "type", "function")
