"""The plant links of the daemon, if it has any, and those of another configuration in their place."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from service.commands.protection import looks
from service.config import Config
from service.config.schema_links import LinksConfig
from service.links.link_secrets import LinkSecretError
from service.pipeline.reloading import ReloadError
from service.pipeline.snapshot import LinkSnapshot
from service.store.database import StoreError

if TYPE_CHECKING:
    from service.links.running import Links


class PlantLinks:
    """The links that run; where there are none, nothing of them is imported.

    Args:
        config: which ones.
        make: makes them, and raises LinkSecretError and StoreError.
    """

    def __init__(self, config: LinksConfig, make: Callable[[LinksConfig], "Links"]) -> None:
        self._config, self._make = config, make
        self._links = make(config) if config.any else None

    def start(self) -> None:
        """Start them."""
        if self._links is not None:
            self._links.start()

    def stop(self) -> None:
        """End them."""
        links, self._links = self._links, None
        if links is not None:
            links.stop()

    def snapshots(self) -> Sequence[LinkSnapshot]:
        """The newest state of each."""
        links = self._links
        return () if links is None else links.snapshots()

    @contextmanager
    def exchanged(self, new: Config) -> Iterator[None]:
        """Run those of another configuration, from where the outbox says; the former where what is done within fails.

        Raises:
            ReloadError: they cannot be run.
        """
        before = self._config
        if new.links == before:
            yield
            return
        try:
            for look in looks(new.links):
                look()
        except LinkSecretError as error:
            raise ReloadError(str(error)) from None
        try:
            self._exchange(new.links)
            yield
        except BaseException as error:
            self._exchange(before)
            if isinstance(error, LinkSecretError | StoreError):
                raise ReloadError(str(error)) from None
            raise

    def _exchange(self, config: LinksConfig) -> None:
        self.stop()
        self._config = config
        self._links = self._make(config) if config.any else None
        self.start()
