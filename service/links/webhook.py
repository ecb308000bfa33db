"""Webhook link: posts each transition of an alarm as JSON, with a signature that is valid for some minutes."""

import asyncio
import hashlib
import hmac
import ssl
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from urllib.parse import urlsplit

import httpx

from monitor_core.wording import sentence
from service.config.schema import WebhookConfig
from service.links.delivery import Message, RefusedError, UnavailableError, answers
from service.links.link_secrets import key, tls
from service.texts.instants import now_us
from service.web import views
from service.web.app_state import VERSION

TRY_AGAIN = (408, 425, 429)
"""Answers that lead to a retry, as do all 5xx; any other 4xx is a refusal."""


def signature(key: bytes, timestamp: int, body: bytes) -> str:
    """The signature header of a request; the timestamp [s since 1970] in it prevents a replay of old requests."""
    return "sha256=" + hmac.new(key, b"%d." % timestamp + body, hashlib.sha256).hexdigest()


class Webhook:
    """The receiver: posts to ``url``, which must answer within ``timeout_s``; ``context`` verifies its certificate."""

    most = 1

    def __init__(
        self,
        url: str,
        key: bytes,
        context: ssl.SSLContext,
        timeout_s: float,
        now_us: Callable[[], int] = now_us,
    ) -> None:
        self._url, self._key, self._context, self._timeout_s = url, key, context, timeout_s
        self._now_us = now_us
        self._host = urlsplit(url).netloc

    async def send(self, messages: Sequence[Message]) -> None:
        """Post messages.

        Raises:
            UnavailableError: there is no answer, or an answer that leads to a retry.
            RefusedError: any other answer than 2xx; redirects are not followed, as they may lead to any host.
        """
        for message in messages:
            now_us = self._now_us()
            body = views.alarm_message(*message, now_us)
            status, wait_s = await self._post(body.model_dump_json().encode(), now_us // 1_000_000)
            if status in TRY_AGAIN or status >= 500:
                raise UnavailableError(answers(self._host, _named(status)), wait_s)
            if not 200 <= status < 300:
                raise RefusedError(answers(self._host, _named(status)))

    async def _post(self, body: bytes, timestamp: int) -> tuple[int, float | None]:
        """Post a body; returns the status of the answer and the requested waiting time [s]; its body is not read."""
        headers = {
            "content-type": "application/json",
            "user-agent": f"axiswatch/{VERSION}",
            "x-axiswatch-timestamp": str(timestamp),
            "x-axiswatch-signature": signature(self._key, timestamp, body),
        }
        try:
            # A new connection for each post: alarms are rare, and the receiver would have closed an old one.
            # The outer time limit is for the whole request; httpx applies its own to each step.
            async with (
                asyncio.timeout(self._timeout_s),
                httpx.AsyncClient(verify=self._context, trust_env=False, timeout=self._timeout_s) as http,
                http.stream("POST", self._url, content=body, headers=headers) as answer,
            ):
                return answer.status_code, self._retry_after_s(answer.headers.get("retry-after", ""))
        except TimeoutError:
            words, within = "{place}: no answer within {seconds} s", f"{self._timeout_s:g}"
            raise UnavailableError(sentence("link no answer", words, place=self._host, seconds=within)) from None
        except httpx.TransportError as error:
            raise UnavailableError(f"{self._host}: {str(error) or type(error).__name__}") from None

    def _retry_after_s(self, text: str) -> float | None:
        """Waiting time [s] from Retry-After, which is in seconds or a date; None: not given."""
        if text.isascii() and text.isdigit():
            return float(text)
        try:
            until = parsedate_to_datetime(text)
        except ValueError:
            return None
        now = datetime.fromtimestamp(self._now_us() / 1e6, UTC)
        return (until.replace(tzinfo=until.tzinfo or UTC) - now).total_seconds()


def _named(status: int) -> str:
    return f"{status} {httpx.codes.get_reason_phrase(status)}".strip()


def webhook(config: WebhookConfig) -> Webhook:
    """The webhook of a configuration.

    Raises:
        LinkSecretError: the key or the certificate of the authority cannot be used.
    """
    signing = key(config.secret_file, config.secret_env)
    return Webhook(config.url, signing, tls(config.ca_file), config.timeout_s)
