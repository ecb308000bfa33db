"""From text to parse tree, by pymoca's grammar; a syntax error becomes one sentence with its line."""

from __future__ import annotations

import re
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

    lexer = ModelicaLexer(
        antlr4.InputStream(source.text + "\n")
    )  # the grammar wants it behind a last comment
    tokens = antlr4.CommonTokenStream(lexer)
    parser = ModelicaParser(tokens)
    listener = _listener(source)
    for recognizer in (lexer, parser):
        recognizer.removeErrorListeners()
        recognizer.addErrorListener(listener)
    tree = parser.stored_definition()
    rest = tokens.LT(1)
    if rest.type != antlr4.Token.EOF:
        raise ModelError(_stray(rest.text), Origin(file=source.name, line=rest.line))
    return tree


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
    """What is wrong in words, and the line where it is to be mended."""
    if token is None:
        found = re.search(r"at: '(.*)'", text, re.DOTALL)
        return f"{found.group(1) if found else text!r} is not Modelica", line
    if token.type == -1:
        last = _token_before(recognizer, token)
        return _unfinished(recognizer), last.line if last is not None else line
    before = _token_before(recognizer, token)
    if before is not None and re.match(r"(missing ';'|mismatched input .* expecting ';')", text):
        return f'";" is missing behind "{before.text}"', before.line
    missing = re.match(r"missing (\S+) at", text) or re.search(r"expecting ('[^']*'|IDENT)$", text)
    wanted = f", {_wanted(missing.group(1))} is expected here" if missing else ""
    behind = f' behind "{before.text}"' if before is not None else ""
    return f'syntax error: "{token.text}" cannot stand{behind}{wanted}', line


def _wanted(name: str) -> str:
    return "a name" if name == "IDENT" else name.replace("'", '"')


def _token_before(recognizer: Any, token: Any) -> Any:
    stream = recognizer.getTokenStream()
    for index in range(token.tokenIndex - 1, -1, -1):
        if stream.get(index).channel == 0:
            return stream.get(index)
    return None


def _unfinished(recognizer: Any) -> str:
    """The innermost class that is open where the text ends."""
    context = recognizer._ctx
    while context is not None and type(context).__name__ != "Class_definitionContext":
        context = context.parentCtx
    if context is None:
        return "the text ends in the middle of something"
    words = [token.text for token in recognizer.getTokenStream().tokens[context.start.tokenIndex :]]
    sort = next((k for k, word in enumerate(words) if word in _SORTS), 0)
    name = words[sort + 1] if sort + 1 < len(words) else "?"
    return (
        f'the text ends inside of {words[sort]} {name} (line {context.start.line}): is "end {name};" missing?'
    )


def _stray(text: str) -> str:
    return f'"{text}" cannot stand outside of a class: a model begins with "model Name" and ends with "end Name;"'


_SORTS = ("model", "class", "block", "connector", "package", "record", "type", "function")
