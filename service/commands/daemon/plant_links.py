"""The links of the daemon to the plant: started, stopped, and replaced when the configuration is read again."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from service.commands.daemon.protection import looks
from service.config import Config
from service.config.schema import LinksConfig
from service.links.link_secrets import LinkSecretError
from service.pipeline.persistence.recording import Extracts
from service.pipeline.reconfiguration.reloading import ReloadError
from service.pipeline.snapshot import LinkSnapshot, Snapshot
from service.store.database import StoreError
from service.store.journal import Journal

if TYPE_CHECKING:
    from service.links.running import Links


class PlantLinks:
    """The running links; without configured links no module of them is imported.

    Args:
        config: the configured links, and the state directory.
        journal: the alarms to deliver.
        snapshot: returns the newest snapshot.
        extracts: the recorder of frames around alarms; None: no recordings.

    Raises:
        LinkSecretError: a secret or a certificate cannot be used.
        StoreError: the outbox cannot be used.
    """

    def __init__(
        self, config: Config, journal: Journal, snapshot: Callable[[], Snapshot], extracts: Extracts | None
    ) -> None:
        self._config, self._state_dir = config.links, config.service.state_dir
        self._journal, self._snapshot, self._extracts = journal, snapshot, extracts
        self._links = self._make_links()

    def _make_links(self) -> "Links | None":
        if not self._config.any:
            return None
        from service.links.running import Links

        return Links(self._config, self._state_dir, self._journal, self._snapshot, self._recording_of)

    def _recording_of(self, t_us: int) -> str | None:
        return None if self._extracts is None else self._extracts.folder.holding(t_us)

    def start(self) -> None:
        """Start the links."""
        if self._links is not None:
            self._links.start()

    def stop(self) -> None:
        """Stop the links."""
        links, self._links = self._links, None
        if links is not None:
            links.stop()

    def snapshots(self) -> Sequence[LinkSnapshot]:
        """The latest state of each link."""
        links = self._links
        return () if links is None else links.snapshots()

    @contextmanager
    def replaced(self, new: Config) -> Iterator[None]:
        """Run the links of another configuration from the outbox; if the block fails, the former links run again.

        Raises:
            ReloadError: the new links cannot be run.
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
            self._replace(new.links)
            yield
        except BaseException as error:
            self._replace(before)
            if isinstance(error, LinkSecretError | StoreError):
                raise ReloadError(str(error)) from None
            raise

    def _replace(self, config: LinksConfig) -> None:
        self.stop()
        self._config = config
        self._links = self._make_links()
        self.start()
