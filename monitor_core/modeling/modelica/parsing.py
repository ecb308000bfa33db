"""From text to parse tree, by pymoca's grammar; a syntax error becomes one sentence with its line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.syntax import Source


def parse_tree(source: Source) -> Any:
    """The parse tree of a text (a ``stored_definition`` of pymoca's ANTLR grammar).

    pymoca's own tree is not used: it drops conditions, array arguments, prefixes and the text behind the last class.

    Raises:
        ModelError: a syntax error, with its line and the offending text.
    """
    from pymoca.generated.ModelicaLexer import ModelicaLexer
    from pymoca.generated.ModelicaParser import ModelicaParser
    from pymoca.parser import antlr4  # pymoca's own dependency

    # The grammar wants a new line behind a last comment; some editors begin a file with a byte order mark.
    lexer = ModelicaLexer(antlr4.InputStream(source.text.removeprefix("\ufeff") + "\n"))
    tokens = antlr4.CommonTokenStream(lexer)
    parser = ModelicaParser(tokens)
    listener = _listener(source)
    for recognizer in (lexer, parser):
        recognizer.removeErrorListeners()
        recognizer.addErrorListener(listener)
    tokens.fill()
    for annotation in _annotations(tokens.tokens):
        annotation.channel = antlr4.Token.HIDDEN_CHANNEL
    tree = parser.stored_definition()
    rest = tokens.LT(1)
    if rest.type != antlr4.Token.EOF:
        raise ModelError(_stray(rest.text), Origin(file=source.name, line=rest.line))
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


def _listener(source: Source) -> Any:
    from pymoca.parser import ErrorListener

    class Listener(ErrorListener):  # type: ignore[misc]
        """Stops at the first error."""

        def syntaxError(self, recognizer: Any, token: Any, line: int, *details: Any) -> None:
            _, text, _ = details  # column, message, exception
            problem, line = _problem(recognizer, token, line, text)
            raise ModelError(problem, Origin(file=source.name, line=line))

    return Listener()


def _problem(recognizer: Any, token: Any, line: int, text: str) -> tuple[str, int]:
    """The mistake in words, and the line where it should be corrected."""
    if token is None:
        found = re.search(r"at: '(.*)'", text, re.DOTALL)
        return f"{_printed(found.group(1) if found else text)} is not Modelica", line
    if token.type == -1:
        return _unfinished([t for t in recognizer.getTokenStream().tokens[:-1] if t.channel == 0], line)
    before = _token_before(recognizer, token)
    if before is not None and re.match(r"(missing ';'|mismatched input .* expecting ';')", text):
        return f'";" is missing behind "{before.text}"', before.line
    missing = re.match(r"missing (\S+) at", text) or re.search(r"expecting ('[^']*'|IDENT)$", text)
    wanted = f", {_wanted(missing.group(1))} is expected here" if missing else ""
    behind = f' behind "{before.text}"' if before is not None else ""
    return f'syntax error: "{token.text}" cannot stand{behind}{wanted}', line


def _printed(text: str) -> str:
    return text if text.isprintable() else f"the character {text!a}"


def _wanted(name: str) -> str:
    return "a name" if name == "IDENT" else name.replace("'", '"')


def _token_before(recognizer: Any, token: Any) -> Any:
    stream = recognizer.getTokenStream()
    for index in range(token.tokenIndex - 1, -1, -1):
        if stream.get(index).channel == 0:
            return stream.get(index)
    return None


def _unfinished(tokens: list[Any], line: int) -> tuple[str, int]:
    """The text ends inside of a class: which one lacks its end, and where that should be."""
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
        return "the text ends in the middle of something", line
    sort, name, begin = opened[-1]
    return f'the text ends inside of {sort} {name} (line {begin}): is "end {name};" missing?', line


def _stray(text: str) -> str:
    return f'"{text}" cannot stand outside of a class: a model begins with "model Name" and ends with "end Name;"'


_SORTS = ("model", "class", "block", "connector", "package", "record", "type", "function")
