"""Commands inside this process, as their users call them."""

import json
import logging
import re
import shlex
from pathlib import Path
from typing import Any

from typer.testing import CliRunner, Result

from service.commands.command_line.exit_codes import OK
from service.commands.main import app


def axiswatch(*words: object) -> Result:
    """Whatever comes of it; never a traceback."""
    logs = logging.getLogger()
    before = logs.handlers[:], logs.level
    result = CliRunner().invoke(app, [*map(str, words)], env={"COLUMNS": "200"})
    logs.handlers[:], logs.level = before  # those of the daemon write to a stream that is closed now
    assert result.exception is None or isinstance(result.exception, SystemExit), result.output
    assert "Traceback" not in result.output
    return result


def shown(*words: object, code: int = OK) -> str:
    """On standard output, of a command that ends well, or with this exit code."""
    result = axiswatch(*words)
    assert result.exit_code == code, result.output
    return result.stdout


def as_json(*words: object, code: int = OK) -> Any:
    return json.loads(shown(*words, code=code))


def refused(*words: object, code: int = 2) -> str:
    """The message on standard error, in one line; standard output stays empty."""
    result = axiswatch(*words)
    assert (result.exit_code, result.stdout) == (code, ""), result.output
    return " ".join(result.stderr.replace("│", " ").split())


def session(command: str, *given: str) -> str:
    """What a person types and reads where the command is called with these words, one after the other.

    What is wrong is in one line, without what typer says of the usage; paths are those from the working directory.
    """
    text = ""
    for words in given:
        result = axiswatch(command, *shlex.split(words))
        problem = " ".join(re.sub("[│╭╮╰╯─]+", " ", result.stderr).split())
        problem = re.sub("^Usage: .*? Error ", "", problem)
        text += f"$ axiswatch {command} {words}".rstrip() + f"\n{result.stdout}"
        text += f"{problem} (exit code {result.exit_code})\n" if problem or result.exit_code else ""
    return text.replace(f"{Path.cwd()}/", "")
