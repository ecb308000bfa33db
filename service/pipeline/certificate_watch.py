"""Warns before the certificates of the daemon's servers expire."""

from collections.abc import Sequence

import structlog

from service.config import Config
from service.config.certificates import Expiry, expiries

log = structlog.get_logger(__name__)


class CertificateWatch:
    """Knows when the certificates expire that the servers show; the log has one line for each warning.

    Args:
        config: the configuration with which the servers have started.
    """

    def __init__(self, config: Config) -> None:
        self._links, self._logged = config.links, set[str]()
        self.expiries: tuple[Expiry, ...] = tuple(expiries(config))
        """Those in use; replaced at a reload, by another thread"""

    def reloaded(self, config: Config) -> None:
        """The servers have this configuration now.  Links that are not changed go on with the certificate they have."""
        found = tuple(expiries(config))
        if config.links == self._links:
            kept = (expiry for expiry in self.expiries if expiry.use == "opcua")
            found = (*(expiry for expiry in found if expiry.use != "opcua"), *kept)
        self._links, self.expiries = config.links, found

    def warnings(self, now_us: int) -> Sequence[str]:
        """Messages to the operator about certificates that expire soon, or have; called by the worker."""
        found = [warning for expiry in self.expiries if (warning := expiry.warning(now_us)) is not None]
        for warning in found:
            if warning not in self._logged:
                self._logged.add(warning)
                log.warning("certificate", message=warning)
        return found
