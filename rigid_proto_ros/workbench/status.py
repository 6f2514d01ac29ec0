# SPDX-License-Identifier: MIT
"""The line at the head of the page: what the node is doing, what went wrong there, and what to do when it is gone."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Mapping

import viser

from ..base.errors import InputError
from ..live.diagnostics import command_warnings, increase

SILENT_S = 2.5
"""[s] Without a state or a report: a node that lives sends a report every second."""

SLOW = 0.1
"""Share of a second of real time that may be lost before it is worth a word: eyes don't see less."""

QUICK_START_S = 4.0
"""[s] A node whose kernels are compiled already is there within this time."""

SHOWN_S = 8.0
"""[s] That a trouble is shown: long enough to be read."""


class Status:
    """Follows one node's reports. ``text`` is markdown."""

    def __init__(self, target: str) -> None:
        self._target = target
        self._last: Mapping[str, str] = {}
        self._heard_s = -1e9
        self._silent_since = ""
        self._waits_from_s: float | None = None
        # Troubles are counted from the report before the first one that is still shown.
        self._since: Mapping[str, str] = {}
        self._since_s = self._report_s = 0.0
        self._trouble_until_s = self._slow_until_s = -1e9

    def report(self, values: Mapping[str, str], now_s: float) -> None:
        """A report of /diagnostics."""
        last, self._last = self._last, values
        last_s, self._report_s = self._report_s, now_s
        self.received(now_s)
        if not last:
            return
        slow = increase("real_time_lost_s", last, values) > SLOW
        if slow or command_warnings(last, values):
            if now_s >= self._trouble_until_s:
                self._since, self._since_s = last, last_s
            self._trouble_until_s = now_s + SHOWN_S
            if slow:
                self._slow_until_s = self._trouble_until_s

    def _troubles(self, now_s: float) -> list[str]:
        """One line a kind, however long it has been going on."""
        if now_s >= self._trouble_until_s:
            return []
        said = command_warnings(self._since, self._last)
        if now_s < self._slow_until_s:
            lost_s, span_s = increase("real_time_lost_s", self._since, self._last), self._report_s - self._since_s
            said.append(f"this machine is too slow: in the last {span_s:.0f} s it fell {lost_s:.2g} s behind real time")
        return said

    def received(self, now_s: float) -> None:
        """The node has said something."""
        self._heard_s = now_s

    def silent(self, now_s: float) -> bool:
        """Whether the node has said nothing for longer than one that lives would."""
        return now_s - self._heard_s > SILENT_S

    def text(self, now_s: float, doing: str = "") -> str:
        """What stands on the page at ``now_s`` [s, monotonic]; doing: what the page is busy with."""
        if not self._last:
            return self._waiting(now_s)
        if self.silent(now_s):
            return self._gone()
        self._silent_since = ""
        if doing:
            return f"*{doing} …*"
        last = self._last
        state = last.get("state", "running")
        choice = last.get("integrator_choice", "")
        if state == "sleeping" and ": sleeping" in choice:
            state = choice.partition(": ")[2]  # it says why
        elif choice and choice != last.get("integrator"):
            state += f", method {choice}"
        text = f"`{self._target}` is {state.replace('flying', 'simulating', 1)}"
        warnings = [last["warning"]] if last.get("warning") else []
        return "".join([text, *(f"  \n⚠ {said}" for said in (*warnings, *self._troubles(now_s)))])

    def _waiting(self, now_s: float) -> str:
        if self._waits_from_s is None:
            self._waits_from_s = now_s
        waited_s = now_s - self._waits_from_s
        if waited_s < QUICK_START_S:
            return f"waiting for `{self._target}` …"
        return (
            f"waiting for `{self._target}` since {waited_s:.0f} s …  \n"
            "At the first start it compiles its kernels, which takes about a minute."
        )

    def _gone(self) -> str:
        self._silent_since = self._silent_since or time.strftime("%H:%M:%S")
        return (
            f"⚠ **`{self._target}` has ended or doesn't respond: no message since {self._silent_since}.** "
            "The picture shows its last state.  \nStart it again (`rigid_proto workbench`, or `rigid_body_node` in "
            "another terminal): this page continues by itself when it is back."
        )


class Announcements:
    """What is said to all browsers in their corner. activity: what the page is busy with, for the line at its head."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._said_once: set[str] = set()
        self.activity = ""

    def say(self, text: str) -> None:
        """A line to all browsers."""
        for client in self._server.get_clients().values():
            client.add_notification("Workbench", text, auto_close_seconds=10.0)

    def say_once(self, text: str) -> None:
        """The same, but not again before the next beginning."""
        if text not in self._said_once:
            self._said_once.add(text)
            self.say(text)

    def begin_anew(self) -> None:
        """A reset: what was said once may be said again."""
        self._said_once.clear()

    async def while_doing(self, what: str, work: Awaitable[object]) -> None:
        """Await work that takes a while, saying so; a refusal is said on the page and not raised."""
        self.activity = what
        try:
            await work
        except InputError as error:
            self.say(str(error))
        finally:
            self.activity = ""


ENDED = "⚠ **The workbench has ended.** Start it again with `rigid_proto workbench` and reload this page."
"""What stands on the page when its server ends."""
