"""E-mail link: reports new and ended alarms in sentences; alarms at about the same time share one message."""

import asyncio
import smtplib
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from datetime import UTC, datetime, tzinfo
from email.message import EmailMessage
from email.utils import format_datetime
from time import monotonic
from typing import NamedTuple

import structlog

from monitor_core.monitoring import HIDDEN_STATES, AlarmEvent
from monitor_core.wording import sentence
from service.config.schema import SmtpConfig
from service.links.delivery import PAGE, Message, NotYetError, RefusedError, UnavailableError, answers
from service.links.link_secrets import secret, tls
from service.pipeline.snapshot import Snapshot
from service.store.alarm_table import RecordedAlarm
from service.texts.alarm_words import episode_words
from service.texts.instants import now_us

MOST_IN_FULL = 20
"""Most alarms that a message describes; for the others it states their number."""

_BEGINS = (
    AlarmEvent.RAISE,
    AlarmEvent.UNSHELVE,
    AlarmEvent.SHELF_ENDED,
    AlarmEvent.UNSUPPRESS,
    AlarmEvent.RETURN,
)
_ENDS = (AlarmEvent.CLEAR, AlarmEvent.LATCH)

log = structlog.get_logger(__name__)


class News(NamedTuple):
    """Contents of a message: alarms by what has happened to them, each once."""

    begun: list[RecordedAlarm]
    """New alarms that are still active"""
    named: list[RecordedAlarm]
    """Alarms of an earlier message whose cause is now named"""
    over: list[RecordedAlarm]
    """Ended alarms, also those that have begun since the last message"""

    def __bool__(self) -> bool:
        return any(self)


def news_in(messages: Iterable[Message]) -> News:
    """The news in transitions; actions of persons and hidden alarms are left out."""
    found = News([], [], [])
    by_alarm: dict[int, list[Message]] = {}
    for message in messages:
        by_alarm.setdefault(message.alarm.id, []).append(message)
    for group in by_alarm.values():
        events, alarm = {m.transition.event for m in group}, group[-1].alarm
        ended = any(m.transition.event in _ENDS and m.transition.from_state not in HIDDEN_STATES for m in group)
        if alarm.life.hidden:
            continue
        if ended and alarm.ended_us is not None:
            found.over.append(alarm)
        elif alarm.active and events.intersection(_BEGINS):
            found.begun.append(alarm)
        elif alarm.active and AlarmEvent.NAME in events:
            found.named.append(alarm)
    return found


class MailText:
    """Writes subject and text of a message; ``zone``: time zone of its times, None: that of this machine."""

    def __init__(self, snapshot: Callable[[], Snapshot], zone: tzinfo | None = None) -> None:
        self._snapshot, self._zone = snapshot, zone

    def subject(self, news: News) -> str:
        """The subject."""
        only = [*news.begun, *news.named, *news.over]
        if len(only) == 1:
            what = "new alarm" if news.begun else "cause is known" if news.named else "alarm has ended"
            return f"axiswatch: {only[0].axis}: {what} ({only[0].parameter}, priority {only[0].priority})"
        counts = ((len(news.begun), "new"), (len(news.named), "named"), (len(news.over), "ended"))
        return f"axiswatch: alarms: {', '.join(f'{count} {word}' for count, word in counts if count)}"

    def body(self, news: News) -> str:
        """The text."""
        parts = (
            ("New", news.begun),
            ("The cause is known now", news.named),
            ("Ended, nothing more to do unless it comes back", news.over),
        )
        lines, left = list[str](), MOST_IN_FULL
        for title, alarms in parts:
            if alarms:
                lines += [f"{title}:", ""]
                lines += [line for alarm in alarms[:left] for line in self._lines(alarm)]
                if len(alarms) > left:
                    lines += [f"... and {len(alarms) - left} more, on the page of axiswatch", ""]
                left = max(0, left - len(alarms))
        active = len([a for a in self._snapshot().alarms.standing if a.active and not a.life.hidden])
        lines += [f"Active alarms now: {active}.", "To acknowledge one: the page of axiswatch, or"]
        return "\n".join([*lines, "  axiswatch alarms ack NUMBER", ""])

    def _lines(self, a: RecordedAlarm) -> Iterable[str]:
        yield f"* Alarm {a.id}: axis {a.axis}, priority {a.priority}"
        yield f"  {episode_words(a, a.nominal, a.unit, a.same_payload)}"
        if meaning := self._meaning(a.axis, a.parameter):
            yield f"  {a.parameter} is: {meaning}"
        if a.ended_us is None:
            yield f"  since {self._time(a.since_us)}"
        else:
            latched = "; it stays active until it is acknowledged" if a.active else ""
            yield f"  from {self._time(a.since_us)} until {self._time(a.ended_us)}{latched}"
        yield ""

    def _meaning(self, axis_id: str, parameter: str) -> str:
        axis = self._snapshot().axis(axis_id)
        known = () if axis is None else axis.status.parameters
        return next((p.meaning for p in known if p.name == parameter), "")

    def _time(self, t_us: int) -> str:
        return datetime.fromtimestamp(t_us / 1e6, UTC).astimezone(self._zone).strftime("%Y-%m-%d %H:%M:%S %Z")


class Mail:
    """The receiver: sends messages through a mail server.  ``clock``: monotonic clock [s].

    Raises:
        LinkSecretError: the password or the certificate of the authority cannot be used.
    """

    most = PAGE

    def __init__(
        self,
        config: SmtpConfig,
        text: MailText,
        clock: Callable[[], float] = monotonic,
        now_us: Callable[[], int] = now_us,
    ) -> None:
        self._config, self._text, self._clock, self._now_us = config, text, clock, now_us
        self._password = secret(config.password_file, config.password_env)
        self._context = tls(config.ca_file)
        self._next = self._clock()

    async def send(self, messages: Sequence[Message]) -> None:
        """Send one message about these transitions; none if they contain no news.

        Raises:
            NotYetError: further alarms may join the message, or the last one was sent a moment ago.
            UnavailableError: the server cannot be reached, or accepts nothing now.
            RefusedError: the server refuses the message permanently.
        """
        news = news_in(messages)
        if not news:
            return
        age_s = (self._now_us() - messages[0].transition.at_us) / 1e6
        # If the clock was set, the message must not wait longer than collect_s.
        collect_s = min(self._config.collect_s - age_s, self._config.collect_s)
        wait_s = max(collect_s, self._next - self._clock())
        if wait_s > 0:
            raise NotYetError(wait_s)
        await _in_thread(lambda: self._deliver(self._written(news, messages)))
        self._next = self._clock() + self._config.interval_s

    def _written(self, news: News, messages: Sequence[Message]) -> EmailMessage:
        mail = EmailMessage()
        mail["From"], mail["To"] = self._config.sender, ", ".join(self._config.to)
        mail["Subject"] = self._text.subject(news)
        mail["Date"] = format_datetime(datetime.fromtimestamp(self._now_us() / 1e6, UTC))
        mail["Message-ID"] = f"<{messages[0].id}.{len(messages)}@axiswatch.invalid>"
        mail["Auto-Submitted"] = "auto-generated"  # prevents automatic replies (RFC 3834)
        mail.set_content(self._text.body(news))
        return mail

    def _deliver(self, mail: EmailMessage) -> None:
        place = f"{self._config.host}:{self._config.port}"
        try:
            with self._server() as server:
                refused = server.send_message(mail)
        except smtplib.SMTPDataError as error:
            kind = RefusedError if error.smtp_code >= 500 else UnavailableError
            raise kind(answers(place, f"{error.smtp_code} {_text(error.smtp_error)}")) from None
        except smtplib.SMTPResponseException as error:
            raise UnavailableError(answers(place, f"{error.smtp_code} {_text(error.smtp_error)}")) from None
        except smtplib.SMTPRecipientsRefused as error:
            words, to = "{place} takes no message to {receivers}", ", ".join(error.recipients)
            raise UnavailableError(sentence("link takes none", words, place=place, receivers=to)) from None
        except (smtplib.SMTPException, OSError) as error:
            raise UnavailableError(f"{place}: {error}") from None
        if refused:
            log.warning("the mail server refuses some receivers of alarms", server=place, refused=sorted(refused))

    def _server(self) -> smtplib.SMTP:
        c = self._config
        if c.security == "tls":
            server: smtplib.SMTP = smtplib.SMTP_SSL(c.host, c.port, timeout=c.timeout_s, context=self._context)
        else:
            server = smtplib.SMTP(c.host, c.port, timeout=c.timeout_s)
        try:
            if c.security == "starttls":
                server.starttls(context=self._context)
            if c.user is not None and self._password is not None:
                server.login(c.user, self._password)
        except BaseException:
            server.close()
            raise
        return server


def _text(answer: bytes | str) -> str:
    return answer if isinstance(answer, str) else answer.decode("utf-8", "replace")


async def _in_thread(work: Callable[[], None]) -> None:
    """Run ``work`` in a daemon thread, as a stopping daemon would wait for threads of asyncio."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[None] = loop.create_future()

    def finish(error: BaseException | None) -> None:
        if not done.done():
            done.set_result(None) if error is None else done.set_exception(error)

    def run() -> None:
        failure: BaseException | None = None
        try:
            work()
        except BaseException as error:
            failure = error
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(finish, failure)

    threading.Thread(target=run, name="mail", daemon=True).start()
    await done
