"""A changed file of a running daemon: SIGHUP takes all of it over, or nothing."""

import signal
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from service.simulation.robot import SimulatedFault
from tests.end_to_end.played_robot import played_robot
from tests.end_to_end.processes import PATIENCE_S, Daemon, daemon, demo_config, edit, robot, wait_for
from tests.service.links.http_receiver import Answers, receiving

USED, REFUSED = "SIGHUP: the configuration is used", "SIGHUP: nothing was changed"
MISTAKEN = "SIGHUP: the configuration has mistakes; nothing was changed"
HOST = "axiswatch.plant.example"


def hung_up(d: Daemon, answer: str) -> dict[str, Any]:
    """What the daemon says after SIGHUP."""
    before = [e["event"] for e in d.events()].count(answer)
    d.process.send_signal(signal.SIGHUP)
    wait_for(lambda: [e["event"] for e in d.events()].count(answer) > before)
    return [e for e in d.events() if e["event"] == answer][-1]


def shows(d: Daemon, refusal: str) -> None:
    """The operator sees why the file was refused; empty: that it was not."""

    def found() -> list[str]:
        messages = d.get("api/v1/service")["messages"]
        return [words for words in messages if "The former configuration stays in force" in words]

    wait_for(lambda: any(refusal in words for words in found()) if refusal else not found())


def asked_as(d: Daemon, host: str) -> int:
    try:
        request = urllib.request.Request(d.page + "healthz", headers={"Host": host})
        return int(urllib.request.urlopen(request, timeout=PATIENCE_S).status)
    except urllib.error.HTTPError as error:
        return error.code


def test_buses_links_and_names_are_taken_over_and_what_needs_a_restart_is_refused(tmp_path: Path, seed: int) -> None:
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
    config, other = demo_config(tmp_path / "first"), demo_config(tmp_path / "second")
    bus, moved = (
        next(line for line in file.read_text(encoding="utf-8").splitlines() if line.startswith("options = "))
        for file in (config, other)
    )
    answers = Answers()
    with daemon(config) as d, receiving(answers) as port:
        with robot(config):
            wait_for(lambda: d.axis()["samples"] > 400)
        before = d.axis()["samples"]

        # The robot is on another bus, with a fault that a new link tells.
        (tmp_path / "first" / "secret").write_text("0123456789abcdef", encoding="utf-8")
        link = f'name = "orders"\nurl = "http://127.0.0.1:{port}/"\nsecret_file = "secret"'
        channel, away = (
            next(x for x in f.read_text(encoding="utf-8").splitlines() if x.startswith("channel"))
            for f in (config, other)
        )
        new = f'[web]\nhosts = ["{HOST}"]\n\n[[links.webhook]]\n{link}\n\n[[bus]]'
        edit(config, (bus, moved), (channel, away), ("[[bus]]", new))
        assert asked_as(d, HOST) == 421
        used = hung_up(d, USED)
        assert (used["kept"], used["changed"], used["added"], used["removed"]) == (2, [], [], [])
        assert used["tables"] == ["[[bus]] can0", "[links]", "[web]"]
        assert asked_as(d, HOST) == 200
        with played_robot(other, 14, seed, SimulatedFault("demo.axis2", {"fm": 1.6}, 5.0)):
            wait_for(lambda: d.axis()["samples"] > before + 400)
            wait_for(lambda: answers.requests)
        with robot(other):
            # Nothing of a file is used of which one key needs a restart, or whose link cannot be used.
            edit(config, ("state_dir", "checkpoint_interval_s = 7\nstate_dir"), (HOST, "another.example"))
            reason = hung_up(d, REFUSED)["reason"]
            assert reason == "a change of [service] checkpoint_interval_s needs a restart"
            edit(config, ("checkpoint_interval_s = 7\n", ""), ('"secret"', '"no secret"'))
            assert "no secret: cannot read the secret" in hung_up(d, REFUSED)["reason"]
            shows(d, "no secret: cannot read the secret")
            edit(config, ("[[links.webhook]]", "[[links.webhok]]"))
            hung_up(d, MISTAKEN)
            shows(d, 'links.webhok: unknown key: did you mean "webhook"')
            edit(config, ("[[links.webhok]]", "[[links.webhook]]"))
            assert [asked_as(d, name) for name in (HOST, "another.example")] == [200, 421]
            assert [link["name"] for link in d.get("api/v1/service")["links"]] == ["orders"]

            # A bus that cannot be opened: the one that was there goes on, and so do the links.
            edit(config, ('"no secret"', '"secret"'), ('"orders"', '"others"'), (away, 'channel = "10.0.0.1"'))
            assert "cannot open udp_multicast 10.0.0.1" in hung_up(d, REFUSED)["reason"]
            count = d.axis()["samples"]
            wait_for(lambda: d.axis()["samples"] > count + 200)
            assert [link["name"] for link in d.get("api/v1/service")["links"]] == ["orders"]

        edit(
            config,
            ('channel = "10.0.0.1"', away),
            (f"[[links.webhook]]\n{link}".replace("orders", "others"), ""),
        )
        assert hung_up(d, USED)["tables"] == ["[links]", "[web]"]
        shows(d, "")
        assert d.get("api/v1/service")["links"] == []
        assert d.axis()["counters"]["started"] == 1
        assert d.stop() == 0
