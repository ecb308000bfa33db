"""Options whose value may be left out: --json alone is --json -, standard output."""

from collections.abc import Iterator
from typing import Any, ClassVar

from typer.core import TyperCommand


class OptionalValueCommand(TyperCommand):
    """A command that puts the "-" where it was left out, before the line is parsed."""

    options: ClassVar[tuple[str, ...]] = ()

    @staticmethod
    def is_value(word: str) -> bool:
        """Whether the word after such an option is its value."""
        return word == "-" or not word.startswith("-")

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As typer does it."""
        return super().parse_args(ctx, list(self._completed(args)))

    def _completed(self, args: list[str]) -> Iterator[str]:
        for position, word in enumerate(args):
            yield word
            following = args[position + 1 : position + 2]
            if word in self.options and not (following and self.is_value(following[0])):
                yield "-"
