"""What the tests of the OPC UA server share."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from service.store.tokens import TOKENS_FILE, Scope, TokenFile
from tests.ports import own_port

if TYPE_CHECKING:
    from tests.service.links.opcua_plant import Plant


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:
    """One for all tests of a file that leave it as it is: a server takes a second of the processor to begin."""
    from tests.service.links.opcua_plant import linked  # needs asyncua, which the other links do not

    folder = tmp_path_factory.mktemp("plant")
    tokens = TokenFile(folder / TOKENS_FILE)
    secrets = {"rita": tokens.new("rita", Scope.READ), "otto": tokens.new("otto", Scope.OPERATE)}
    with ExitStack() as stack:
        made = linked(stack, folder, own_port(), anonymous=True)
        made.secrets = secrets
        yield made
