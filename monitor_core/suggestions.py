"""Words for messages about names that do not exist."""

import difflib
from collections.abc import Iterable

_MOST = 20


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A suggestion for an unknown name, and what there is: 'did you mean "port"? There is host, port'."""
    names = list(known)
    if not names:
        return "there is none"
    folded = {name.casefold(): name for name in reversed(names)}
    close = difflib.get_close_matches(word.casefold(), folded, n=1)
    suggestion = f'did you mean "{folded[close[0]]}"? ' if close else ""
    rest = f" and {len(names) - _MOST} more" if len(names) > _MOST else ""
    return f"{suggestion}there is {', '.join(names[:_MOST])}{rest}"
