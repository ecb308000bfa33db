"""How far a search has come."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with the steps done and how many there are at most; the first only grows, and in the end is the second.

A search that ends early leaves steps out, so the number may leap.
"""


class Steps:
    """Tells of steps done, each number once.

    Args:
        tell: whom; None: nobody.
        of: how many steps there are.
    """

    def __init__(self, tell: Progress | None, of: int) -> None:
        self._tell, self._of, self._done = tell, of, 0

    def reached(self, done: int) -> None:
        """Tell of ``done`` steps of all, unless that is nothing new."""
        if self._tell and self._done < done <= self._of:
            self._done = done
            self._tell(done, self._of)

    def part(self, first: int, count: int) -> Callable[[int], None]:
        """The same for the ``count`` steps after the ``first`` ones."""
        return lambda done: self.reached(first + min(done, count))
