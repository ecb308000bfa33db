"""Messages of alarms, as a real mail server gets them."""

import ssl
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC
from email import message_from_bytes, policy
from email.message import EmailMessage
from pathlib import Path
from typing import Any

import pytest
import structlog
from aiosmtpd.controller import Controller
from aiosmtpd.smtp import SMTP, AuthResult, Envelope, LoginPassword, Session

from monitor_core.monitoring import AlarmEvent, AlarmRules
from service.config.schema import SmtpConfig
from service.links.mail import MOST_IN_FULL, Mail, MailText, News, news_in
from service.pipeline.persistence.alarm_recording import NO_ALARMS
from service.pipeline.snapshot import LinkSnapshot
from service.store.alarm_transitions import Note
from tests.conftest import ROOT
from tests.ports import own_port
from tests.service.links.journals import NAMED, NOON_US, RAISED, SECOND, Inbox, Post, alarms, comment, record
from tests.service.web.conftest import whole_snapshot

TLS = ROOT / "tests" / "tls"
PASSWORD = "hunter2"
TABLE: dict[str, Any] = {
    "host": "localhost",
    "security": "none",
    "sender": "cell1@plant.example",
    "to": ("anna@plant.example", "otto@plant.example"),
}


@dataclass
class Mailbox:
    """Of the server: what it has got, and what it answers to the next messages."""

    mails: list[EmailMessage] = field(default_factory=list)
    answers: list[str] = field(default_factory=list)
    unknown: tuple[str, ...] = ()

    async def handle_RCPT(self, _server: SMTP, _session: Session, envelope: Envelope, to: str, _: Any) -> str:
        if to in self.unknown:
            return "550 no such mailbox"
        envelope.rcpt_tos.append(to)
        return "250 OK"

    async def handle_DATA(self, _server: SMTP, _session: Session, envelope: Envelope) -> str:
        if self.answers:
            return self.answers.pop(0)
        assert isinstance(envelope.content, bytes)
        mail = message_from_bytes(envelope.content, policy=policy.default)
        assert isinstance(mail, EmailMessage)
        self.mails.append(mail)
        return "250 OK"


def authenticated(_server: SMTP, _session: Session, _envelope: Envelope, _how: str, login: Any) -> AuthResult:
    return AuthResult(success=login == LoginPassword(b"cell1", PASSWORD.encode()), handled=False)


@contextmanager
def serving(mailbox: Mailbox, tls: bool = False) -> Iterator[int]:
    """A mail server on this machine; its port."""
    port = own_port()
    protected: dict[str, Any] = {}
    if tls:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(TLS / "localhost.crt", TLS / "localhost.key")
        protected = {"tls_context": context, "require_starttls": True}
        protected |= {"auth_required": True, "authenticator": authenticated}
    server = Controller(mailbox, hostname="127.0.0.1", port=port, **protected)
    server.start()
    try:
        yield port
    finally:
        server.stop()


TEXT = MailText(whole_snapshot, UTC)


@pytest.fixture
def posted(tmp_path: Path) -> Iterator[Callable[..., Post]]:
    """A journal that is delivered by mail to a port."""
    opened = list[Post]()

    def make(port: int, **changes: Any) -> Post:
        post = Post(tmp_path / f"state{len(opened)}", Inbox())
        opened.append(post)
        post.close()
        config = SmtpConfig.model_validate(TABLE | {"port": port} | changes)
        post.inbox = Mail(config, TEXT, lambda: post.clock_s, lambda: post.now_us)
        post.open()
        return post

    yield make
    for post in opened:
        post.close()


def test_a_message_for_a_new_alarm_and_for_its_end(posted: Callable[..., Post]) -> None:
    mailbox = Mailbox()
    with serving(mailbox) as port:
        post = posted(port)
        record(post.journal, rules=AlarmRules("high"))
        assert post.settle() == 30
        post.wait(5.0)
        record(post.journal, NAMED, rules=AlarmRules("high"))
        post.wait(25.0)
        post.settle()
        post.wait(600.0)
        record(post.journal, replace(NAMED, ended_us=NOON_US + 600 * SECOND), rules=AlarmRules("high"))
        post.settle()
    begun, over = mailbox.mails
    assert begun["to"] == "anna@plant.example, otto@plant.example"
    assert begun["from"] == "cell1@plant.example"
    assert begun["auto-submitted"] == "auto-generated"
    assert begun["subject"] == "axiswatch: demo.axis1: new alarm (fm, priority high)"
    assert begun.get_content_type() == "text/plain"
    assert begun.get_content().replace("\r", "") == (
        "New:\n\n"
        "* Alarm 1: axis demo.axis1, priority high\n"
        "  fm is 0.018 N m s/rad (30 %, 25 to 35) above its nominal value\n"
        "  fm is: viscous friction of the motor\n"
        "  since 2026-03-01 12:00:00 UTC\n\n"
        "Active alarms now: 0.\n"
        "To acknowledge one: the page of axiswatch, or\n"
        "  axiswatch alarms ack NUMBER\n"
    )
    assert over["subject"] == "axiswatch: demo.axis1: alarm has ended (fm, priority high)"
    assert "  from 2026-03-01 12:00:00 UTC until 2026-03-01 12:10:00 UTC\r\n" in over.get_content()
    assert begun["message-id"] != over["message-id"]
    assert post.delivery.snapshot.delivered == 3


def test_many_alarms_are_few_messages(posted: Callable[..., Post]) -> None:
    mailbox = Mailbox()
    with serving(mailbox) as port:
        post = posted(port)
        alarms(post.journal, 60)
        post.settle()
        post.wait(30.0)
        assert post.settle() > 1e9
        for k in range(60, 90):  # one each ten seconds
            record(post.journal, replace(RAISED, raised_us=post.now_us, updated_us=post.now_us), f"demo.axis{k}")
            post.settle()
            post.wait(10.0)
        post.settle()
    assert [mail["subject"] for mail in mailbox.mails] == [
        "axiswatch: alarms: 60 new",
        "axiswatch: alarms: 30 new",
    ]
    first = mailbox.mails[0].get_content()
    assert first.count("* Alarm") == MOST_IN_FULL
    assert "... and 40 more" in first
    assert post.delivery.snapshot.delivered == 90


def test_what_persons_do_and_what_is_hidden_is_no_news(posted: Callable[..., Post]) -> None:
    mailbox = Mailbox()
    with serving(mailbox) as port:
        post = posted(port, collect_s=0.0, interval_s=0.0)
        number = record(post.journal)
        post.settle()
        note = Note(NOON_US, "anna")
        post.journal.act(number, AlarmEvent.ACKNOWLEDGE, note)
        comment(post.journal, number)
        post.journal.act(number, AlarmEvent.SHELVE, note, NOON_US + 60 * SECOND)
        record(post.journal, axis="demo.axis2", rules=AlarmRules(suppressed=True))
        record(post.journal, replace(NAMED, ended_us=NOON_US + 9 * SECOND))  # while it is shelved
        post.settle()
        assert len(mailbox.mails) == 1
        again = record(post.journal, axis="demo.axis3")
        post.journal.act(again, AlarmEvent.SHELVE, note, NOON_US + 60 * SECOND)
        post.settle()
        assert len(mailbox.mails) == 1
        post.journal.end_shelves(NOON_US + 61 * SECOND)  # and the cause is still there
        post.settle()
    assert [mail["subject"] for mail in mailbox.mails][1:] == ["axiswatch: demo.axis3: new alarm (kT, priority medium)"]
    assert post.delivery.snapshot.pending == 0


def test_the_cause_follows_if_the_message_was_earlier(posted: Callable[..., Post]) -> None:
    mailbox = Mailbox()
    with serving(mailbox) as port:
        post = posted(port, collect_s=0.0, interval_s=0.0)
        record(post.journal)
        post.settle()
        record(post.journal, NAMED)
        post.settle()
    first, second = mailbox.mails
    assert "something has changed, at first sight kT; cause and size are not known yet" in first.get_content()
    assert second["subject"] == "axiswatch: demo.axis1: cause is known (fm, priority medium)"


def test_an_alarm_that_is_latched_or_has_come_and_gone(tmp_path: Path) -> None:
    post = Post(tmp_path, Inbox(most=9))
    gone = replace(NAMED, ended_us=NOON_US + 9 * SECOND)
    record(post.journal, gone)
    record(post.journal, gone, "demo.axis2", AlarmRules(latched=True))
    post.settle()
    news = news_in(post.inbox.got)
    assert [a.axis for a in news.over] == ["demo.axis1", "demo.axis2"]
    assert (news.begun, news.named) == ([], [])
    body = TEXT.body(news)
    assert "12:00:09 UTC\n" in body
    assert "12:00:09 UTC; it stays active until it is acknowledged\n" in body
    post.close()


def test_active_alarms_are_counted_without_the_hidden_ones(tmp_path: Path) -> None:
    post = Post(tmp_path, Inbox())
    record(post.journal)
    record(post.journal, axis="demo.axis2", rules=AlarmRules(suppressed=True))
    standing = NO_ALARMS._replace(standing=tuple(post.journal.standing()))
    text = MailText(lambda: replace(whole_snapshot(), alarms=standing), UTC)
    assert "Active alarms now: 1.\n" in text.body(News([], [], []))
    post.close()


# --- The server ---------------------------------------------------------------------------------------------


def sent(post: Post) -> LinkSnapshot:
    """What becomes of an alarm."""
    alarms(post.journal, 1)
    post.settle()
    post.wait(30.0)
    post.settle()
    return post.delivery.snapshot


@pytest.mark.parametrize(("answer", "given_up"), [("451 try later", 0), ("554 this is spam", 1), ("552 too large", 1)])
def test_the_answers_of_the_server(answer: str, given_up: int, posted: Callable[..., Post]) -> None:
    with serving(Mailbox(answers=[answer])) as port:
        link = sent(posted(port))
    assert f"localhost:{port} answers {answer}" in link.problem
    assert (link.given_up["refused"], link.pending) == (given_up, 1 - given_up)


def test_one_unknown_address_does_not_keep_the_others_from_it(posted: Callable[..., Post]) -> None:
    mailbox = Mailbox(unknown=("otto@plant.example",))
    with serving(mailbox) as port, structlog.testing.capture_logs() as logs:
        assert sent(posted(port)).delivered == len(mailbox.mails) == 1
        assert [entry["refused"] for entry in logs if "refused" in entry] == [["otto@plant.example"]]
        mailbox.unknown = TABLE["to"]
        assert "takes no message to anna@plant.example, otto" in sent(posted(port)).problem
    assert "refused" in sent(posted(port)).problem


def test_login_over_verified_tls(posted: Callable[..., Post], tmp_path: Path) -> None:
    mailbox = Mailbox()
    (tmp_path / "right").write_text(PASSWORD)
    (tmp_path / "wrong").write_text("hunter3")
    right = {
        "security": "starttls",
        "user": "cell1",
        "ca_file": TLS / "localhost.crt",
        "password_file": tmp_path / "right",
    }
    with serving(mailbox, tls=True) as port:
        assert "certificate verify failed" in sent(posted(port, **right | {"ca_file": None})).problem
        wrong = sent(posted(port, **right | {"password_file": tmp_path / "wrong"})).problem
        assert "answers 535" in wrong
        assert "hunter3" not in wrong
        assert mailbox.mails == []
        assert sent(posted(port, **right)).delivered == len(mailbox.mails) == 1
    with serving(mailbox) as port:  # which offers no TLS
        assert "STARTTLS" in sent(posted(port, **right)).problem
    assert len(mailbox.mails) == 1
