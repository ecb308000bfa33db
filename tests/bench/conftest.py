"""Tables past pytest's capture."""

from collections.abc import Iterable, Sequence

import pytest

from tests.bench.measure import Say, table


@pytest.fixture
def say(capsys: pytest.CaptureFixture[str]) -> Say:
    def tell(title: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        with capsys.disabled():
            print(table(title, header, rows))

    return tell
