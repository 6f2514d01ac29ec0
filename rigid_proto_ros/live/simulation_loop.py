# SPDX-License-Identifier: MIT
"""The real-time loop of one body: advances it, publishes states and takes commands at the right times. Everything here
runs on the physics thread (live_simulation.py); endpoints connect the loop to topics or other transports.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping

from ..base.errors import CommandRefused, InputError
from ..scene.scenario import Scenario
from ..scene.scenario_run import ScenarioRun
from ..simulation.commands import Change, Command, Listed
from ..simulation.observer import Observer, Published
from ..simulation.setup import Setup
from .command_receiver import CommandReceiver
from .pacing import LAST_STAMP_NS, TICK_NS, Pace, Stamps, WorkBudget

ACTIVE_DRAIN_NS = 500_000
"""Shortest period [ns of wall time] of taking commands between publications, while commands arrive."""

LEAD = 0.2
"""While commands arrive, they are taken once more this fraction of a period before each publication."""

PAUSED_NS = 100_000_000
"""Period of publication while paused [ns of wall time]."""

IDLE_NS = 500_000_000
"""Longest period [ns of wall time] between two ticks without listeners; it bounds the time that a new command has to
catch up.
"""

FOLLOW_NS = 1_000_000
"""Period at which a followed clock is read [ns of wall time]."""

RAREST_NS = 100_000_000
"""If the publication period is longer than this [ns of wall time], the motion is also advanced in between."""

STEP_PATIENCE_S = 10.0
"""Timeout of a request to step [s]."""

HOLD_NS = 1_000_000_000
"""Timeout [ns of wall time] for the next list of a script while time is held at 0."""


class Endpoints:
    """Callbacks of a loop; the defaults do nothing. All but the last three are called on the physics thread."""

    def __init__(self) -> None:
        self._woken = threading.Event()

    def publish(self, run: ScenarioRun) -> None:
        """Publish the present state."""

    def has_subscribers(self) -> bool:
        """Whether states have subscribers; without any, none are published."""
        return False

    def take_commands(self, _commands: CommandReceiver, _wall_ns: int, _at_once: bool) -> bool:
        """Pass the messages that have arrived to ``_commands``; with ``_at_once``, poll quiet topics, too. Returns
        whether commands have arrived recently.
        """
        return False

    def serve_steps(self, loop: SimulationLoop) -> None:
        """Answer requests for steps."""

    def parameters_changed(self) -> None:
        """Parameters have changed for any reason, or a recording has failed."""

    def wait(self, timeout_s: float) -> bool:
        """Wait until a command, a request for a step or a subscriber arrives, ``wake`` is called, or the timeout ends.
        Returns whether something may have arrived.
        """
        self._woken.wait(timeout_s)
        self._woken.clear()
        return False

    def wake(self) -> None:
        """End the wait."""
        self._woken.set()

    def say(self, message: str) -> None:
        """Inform the user."""

    def warn(self, message: str) -> None:
        """Warn the user."""
        print(message, file=sys.stderr)


class SimulationLoop(ScenarioRun):
    """A scenario run in real time.

    observer: receives every publication, in batches if the endpoints have no subscribers. Without subscribers and
    without an observer of states no publications are made, and the body is advanced in one go from one taking of
    commands to the next. stamps: of the followed clock, if any; anchored at the start, at a reset and at the end of a
    pause. step_requested: a step must follow the last command before the next command is taken.
    """

    def __init__(
        self,
        scenario: Scenario,
        observer: Observer | None = None,
        endpoints: Endpoints | None = None,
        stamps: Stamps | None = None,
    ) -> None:
        super().__init__(scenario, observer)
        self.paused = scenario.parameters.start_paused
        self.stamps = stamps or Stamps()
        self.endpoints = endpoints or Endpoints()
        self.commands = CommandReceiver(self)
        self._has_subscribers = self._has_listeners = True
        self._budget = WorkBudget()
        self.pace = Pace(scenario.parameters.real_time_factor, self.stamps.clock)
        self.resets = 0
        self.step_requested = False
        self._steps_left = 0
        self._in_step = False
        self._steps_begun = self._given_up = 0
        self._commands_come = False
        self._present_ns = self._held_until_ns = 0
        self._last_drain_ns = 0
        self._paused_publication_ns = 0
        self._next_listener_check_ns = 0
        self._caught_up = True
        self._end_ns = LAST_STAMP_NS + 1
        self._on_end: Callable[[], None] = lambda: None
        self._anchor(stamps_stay=True)

    def end_at(self, time_ns: int, on_end: Callable[[], None]) -> None:
        """Stop when simulated time reaches ``time_ns``, and call on_end()."""
        self._end_ns, self._on_end = time_ns, on_end

    # Called by requests of other threads

    def check_change(self, scenario: Scenario) -> None:
        """Raises InputError if this scenario can't replace the present one."""
        if self.pace.followed and scenario.parameters.publish_clock:
            raise InputError(
                "publish_clock", True, "false, while simulated time follows the /clock of another node (use_sim_time)"
            )
        super().check_change(scenario)

    def replace(self, scenario: Scenario) -> Setup:
        """Replace the scenario; its real-time factor takes effect at once, too."""
        setup = super().replace(scenario)
        self.endpoints.parameters_changed()
        if scenario.parameters.real_time_factor != self.pace.factor:
            self.pace.factor = scenario.parameters.real_time_factor
            if not (self.pace.followed or self._held_until_ns):
                self._anchor()
        return setup

    def take(
        self,
        command: Command,
        at_ns: int | None = None,
        listed: Listed | None = None,
        at_hand: Scenario | None = None,
    ) -> int:
        """See ScenarioRun; while paused, a command for now acts before this returns."""
        when_ns = super().take(command, at_ns, listed, at_hand)
        if self.paused:
            self.act()
        return when_ns

    def act(self) -> None:
        """Apply the commands that are due now."""
        if self.simulation.act():
            # The publication of this time was made before they acted.
            self.publications.pass_over(self.simulation.time_ns)
            if self.ghost is not None:
                self.ghost.act(self.simulation.time_ns)

    def settle(self) -> None:
        """While paused, take and apply the commands that were sent before now."""
        if self.paused:
            self.take_commands()
            self.act()

    def planned(self, changes: Mapping[str, object], at_hand: Scenario) -> Scenario:
        """The scenario that results if these parameters change now. Raises InputError; counts a CommandRefused.
        at_hand: see ``take``.
        """
        self.settle()
        self.act()
        try:
            scenario = self.scenario.with_changes(changes, at_hand=at_hand)
            self.check_change(scenario)
        except CommandRefused as refusal:
            self.simulation.refuse(refusal)
            raise
        return scenario

    def change(self, changes: Mapping[str, object], scenario: Scenario) -> None:
        """Change parameters now; scenario: the result of ``planned``."""
        if self.simulation.failure:
            self.replace(scenario)  # for the run after the reset: a failed simulation takes no commands
        else:
            self.take(Change(dict(changes)), at_hand=scenario)
            self.act()

    def watch(self, observer: Observer) -> None:
        """Replace the observer."""
        self.observer = observer
        self.simulation.watch(observer)
        if self.ghost is not None:
            self.ghost.watch(observer)

    def pause(self, paused: bool) -> None:
        """Pause or resume simulated time. Commands sent while paused are taken before time resumes. Raises InputError
        on resuming a failed motion.
        """
        if paused != self.paused:
            if not paused:
                self._refuse_failed("pause")
                self.take_commands()
            self.paused = paused
            self._held_until_ns = 0
            self._give_up_steps()
            self.simulation.log("pause", {"data": paused})
            self.endpoints.say(f"{'paused' if paused else 'resumed'} at {self.simulation.time_ns / 1e9:.9g} s")
            self.simulation.notify_floor()
            self._anchor(stamps_stay=paused)

    def take_commands(self) -> None:
        """Take all commands that have arrived."""
        self.endpoints.take_commands(self.commands, time.monotonic_ns(), True)

    def catch_up(self) -> None:
        """Advance towards this tick's present, within the tick's budget, so that a command for now acts at this time.
        Not needed without commands. While paused, apply the commands that are due.
        """
        if self.paused:
            self.act()
        elif self._present_ns > self.simulation.time_ns:
            self._caught_up = self._budget.advance(self.simulation, self._present_ns)
            self._check_failure()

    def step(self, periods: int = 1) -> bool:
        """While paused, take all commands that have arrived and start to advance over ``periods`` publications. Returns
        whether the step is complete; otherwise ``stepping`` is true until it is.
        """
        # In lockstep, commands taken here share this step instead of each requesting its own.
        self._in_step = True
        self.take_commands()
        self._in_step = False
        return self._begin_step(periods)

    def _begin_step(self, periods: int) -> bool:
        self.simulation.log("step", {"periods": periods} if periods > 1 else {})
        # Clients that subscribed since the last publication expect these.
        self._check_listeners()
        self.publications.find_after(self.simulation.time_ns)
        self._steps_left = periods
        self._steps_begun += 1
        self._budget.begin_tick()
        self._step_on()
        return not self.stepping

    def steps(self, periods: int = 1) -> Iterator[None]:
        """While paused, advance over ``periods`` publications; yields until the thread's ticks have made them.

        Raises InputError while time runs, if the motion has failed, if the step is aborted because time is resumed or
        reset, and if it takes longer than STEP_PATIENCE_S; in the last case the step continues.
        """
        if not self.paused:
            raise InputError("step", "the simulation is running; pause it first")
        end = time.monotonic() + STEP_PATIENCE_S
        begun = 0
        # A step that another client has started is completed first.
        while self.stepping or not begun:
            if time.monotonic() > end:
                reached_s = self.simulation.time_ns / 1e9
                text = f"{reached_s:.9g} s reached after {STEP_PATIENCE_S:g} s of computing; the step continues"
                raise InputError("step", text)
            if not self.stepping:
                made, begun = self.step(periods), self._steps_begun
                if made:
                    break
            yield
        self._refuse_failed("step")
        if self._given_up == begun:
            raise InputError("step", "given up, since simulated time was resumed or reset meanwhile")

    def _give_up_steps(self) -> None:
        """Abort the step in progress and any requested step."""
        if self.stepping:
            self._given_up = self._steps_begun
        self._steps_left, self.step_requested = 0, False

    def _refuse_failed(self, asked: str) -> None:
        if self.simulation.failure:
            raise InputError(asked, f"stopped in the last good state until a reset: {self.simulation.failure}")

    def request_step(self) -> None:
        """Request a step after a wrench or thruster command, if paused and in lockstep."""
        if self.paused and self.scenario.parameters.lockstep and not self._in_step:
            self.step_requested = True

    @property
    def stepping(self) -> bool:
        """Whether a step is in progress."""
        return self._steps_left > 0

    def reset(self) -> None:
        """Return to time 0 and the initial state; keeps paused or running."""
        self.resets += 1
        self._held_until_ns = 0
        self.simulation.reset(self.scenario.setup)
        if self.ghost is not None or Published in self.observer.takes:
            self.begin_ghost()
        self.publications.restart()
        self._give_up_steps()
        self._present_ns = 0
        self._anchor()
        # Replaces the latched message, whose stamp is from before the reset.
        self.simulation.announce()
        self.endpoints.say("reset: simulated time is 0")

    def hold(self) -> None:
        """If running, hold time at 0 after a reset, until ``hold_on`` releases it or HOLD_NS passes."""
        if not self.paused:
            self._held_until_ns = time.monotonic_ns() + HOLD_NS

    def hold_on(self, more: bool) -> None:
        """After a list has arrived: keep holding time for the next list (``more``), or release it."""
        if self._held_until_ns:
            self.hold()
            if not more:
                self._release_hold()

    def _release_hold(self) -> None:
        self._held_until_ns = 0
        self._anchor()

    # Called by the thread's loop

    def start(self) -> None:
        """Start simulated time."""
        if Published in self.observer.takes:
            self.begin_ghost()
        self._anchor()

    def tick(self, arrived: bool = True) -> None:
        """Do what is due, within pacing.WORK_NS. arrived: commands or requests may have arrived."""
        self._budget.begin_tick()
        if self.paused or self._held_until_ns:
            self._tick_standing(arrived)
        else:
            self._tick_running(arrived)

    def prepare_request(self) -> None:
        """Advance simulated time to now for a request, unless a publication is due before."""
        self._budget.begin_tick()
        if not (self.paused or self._held_until_ns):
            self._present_ns = min(self._simulated_present_ns(), LAST_STAMP_NS)
            if self._present_ns < self.publications.next_ns:
                self.catch_up()

    def _tick_running(self, arrived: bool) -> None:
        """Advance to the present: publish what is due, then take the commands that have arrived."""
        wall_ns = time.monotonic_ns()
        # Before new subscribers are detected: past states aren't published for them.
        present_ns = self._simulated_present_ns()
        check = wall_ns >= self._next_listener_check_ns or (arrived and not self._has_subscribers)
        if check:
            self._next_listener_check_ns = wall_ns + TICK_NS
            self._check_listeners()
        if check or arrived:
            self.endpoints.serve_steps(self)  # answers with an error while running
        if present_ns > LAST_STAMP_NS:
            self._stop_at_the_last_stamp()
            return
        ends = present_ns >= self._end_ns
        present_ns = min(present_ns, self._end_ns)
        due_ns = self.publications.next_ns
        while due_ns <= present_ns:
            if not self._publish_next():
                # Failed, or out of budget: the present is the time reached; the next tick continues from there.
                present_ns = self.simulation.time_ns
                break
            due_ns = self.publications.next_ns
            if due_ns <= present_ns and self._has_subscribers and self.pace.factor > 0.0 and not self.pace.followed:
                self.pace.overruns += 1
        self._last_drain_ns = wall_ns
        self._present_ns = present_ns
        self._commands_come = self.endpoints.take_commands(self.commands, wall_ns, arrived)
        # Otherwise commands between publications, and their events, would wait for the next publication.
        rarely = self.publications.rate * self.pace.factor * RAREST_NS < 1e9
        if ends or rarely or not self._has_listeners or self.pace.followed or not self._caught_up:
            self.catch_up()
        if self.simulation.time_ns >= self._end_ns:
            self.paused = True
            self._on_end()

    def _check_listeners(self) -> None:
        self._has_subscribers = self.endpoints.has_subscribers()
        self._has_listeners = self._has_subscribers or Published in self.observer.takes

    def _step_on(self) -> None:
        while self._steps_left and self._publish_next():
            self._steps_left -= 1
        if self.simulation.failure:
            self._give_up_steps()

    def _tick_standing(self, arrived: bool) -> None:
        if 0 < self._held_until_ns <= time.monotonic_ns():
            self._release_hold()
            self.endpoints.warn(
                f"a script said that more of it follows, and nothing came for {HOLD_NS / 1e9:g} s: it runs without"
            )
            return
        if self.stepping:
            self._step_on()
        if self.pace.followed and not self.pace.anchored_ns:
            # /clock had not started when the pause began.
            self._anchor()
        now_ns = time.monotonic_ns()
        self._last_drain_ns = now_ns
        if arrived and not self._has_subscribers:
            self._check_listeners()
        self._commands_come = self.endpoints.take_commands(self.commands, now_ns, arrived)
        if self.step_requested and not self.stepping:
            self.step_requested = False
            self._begin_step(1)
        self.endpoints.serve_steps(self)
        if now_ns >= self._paused_publication_ns and not self.stepping:
            self._paused_publication_ns = now_ns + PAUSED_NS
            self._check_listeners()
            self.endpoints.publish(self)

    def _publish_next(self) -> bool:
        """Advance to the next publication and publish it; False if the tick's budget ends before or the
        motion failed.
        """
        if self.publications.next_ns > LAST_STAMP_NS:
            self._stop_at_the_last_stamp()
            return False
        self._caught_up = self._budget.advance(self.simulation, self.publications.next_ns)
        if self._check_failure() or not self._caught_up:
            return False
        state = self.simulation.state
        self.publications.pass_over(state.time_ns)
        self.publish(state.time_ns, state.row)
        self.endpoints.publish(self)
        return True

    def _stop_at_the_last_stamp(self) -> None:
        self.simulation.failure = (
            f"simulated time beyond {LAST_STAMP_NS // 1_000_000_000} s, the largest that a stamp can hold"
        )
        self._check_failure()

    def _check_failure(self) -> bool:
        if not self.simulation.failure:
            return False
        if not self.paused:
            self.paused = True
            self.endpoints.warn(f"paused in the last good state: {self.simulation.failure}")
        return True

    # Time

    def _anchor(self, stamps_stay: bool = False) -> None:
        """Anchor the present simulated time at the clock's present reading."""
        self.pace.anchor(self.simulation.time_ns)
        self._restart_timers(stamps_stay)

    def _restart_timers(self, stamps_stay: bool = False) -> None:
        """Restart all deadlines in wall time. Unless stamps_stay, update the stamps' offset to the followed clock and
        log it.
        """
        if not stamps_stay and self.pace.offset_ns != self.stamps.offset_ns:
            self.stamps.offset_ns = self.pace.offset_ns
            self.simulation.log("clock", {"offset_ns": self.stamps.offset_ns})
        self._last_drain_ns = time.monotonic_ns()
        self._paused_publication_ns = 0
        self._next_listener_check_ns = 0
        self._caught_up = True

    def _jump(self, by_ns: int) -> None:
        """Handle a jump of the followed clock. Forward: simulated time jumps along, without motion. Backward: simulated
        time continues, stamps go back, and scheduled commands are dropped.
        """
        self.endpoints.warn(
            f"/clock jumped by {by_ns / 1e9:+.9g} s: "
            + ("nothing moves in between" if by_ns > 0 else "commands that waited are dropped")
        )
        self._present_ns = self.pace.present_before_ns
        self.catch_up()
        if by_ns > 0:
            if self.ghost is not None:
                self.ghost.simulation.advance(self.simulation.time_ns)
                self.ghost.simulation.leap(by_ns)
            self.simulation.leap(by_ns)
            self.publications.pass_over(self.simulation.time_ns)
        else:
            if self.ghost is not None:
                self.ghost.simulation.drop_commands()
            self.simulation.drop_commands()
            self.simulation.log("jump", {"by_ns": by_ns})
            self._anchor()

    def _simulated_present_ns(self) -> int:
        if jump_ns := self.pace.jump():
            self._jump(jump_ns)
        anchored_ns = self.pace.anchored_ns
        idle = not self._has_listeners and self._caught_up and (self.pace.factor > 0.0 or bool(self.pace.followed))
        present_ns = self.pace.present_ns(self.simulation.time_ns, self.publications.next_ns, idle)
        if self.pace.anchored_ns != anchored_ns:
            self._restart_timers()
        if idle:
            self.publications.pass_over(min(present_ns, self._end_ns))
        return present_ns

    def next_wake_ns(self) -> int:
        """Wall time [ns] at which ``tick`` is due next, unless something arrives earlier."""
        factor = self.pace.factor
        if self.stepping or self.step_requested or not self._caught_up:
            return 0
        if self.paused or self._held_until_ns:
            soon_ns = self._paused_publication_ns + (0 if self._has_subscribers else IDLE_NS)
            return min(soon_ns, self._held_until_ns or soon_ns)
        if self.pace.followed:
            return self._last_drain_ns + (FOLLOW_NS if self._has_listeners else TICK_NS)
        latest_ns = self._last_drain_ns + (TICK_NS if self._has_listeners else IDLE_NS)
        if factor == 0.0:
            return 0
        if not self._has_subscribers:
            # Recordings and viewers take states in batches, at 1 kHz ten per wake-up.
            return min(latest_ns, self.pace.wall_ns(min(self.simulation.next_event_ns, self._end_ns)))
        publication_ns = self.pace.wall_ns(self.publications.next_ns)
        if self._commands_come:
            # Commands taken shortly before a publication act on it; those taken with it would show a period later.
            early_ns = self.pace.wall_ns(self.publications.next_ns - int(LEAD * 1e9 / self.publications.rate))
            if early_ns - self._last_drain_ns >= ACTIVE_DRAIN_NS:
                return min(latest_ns, early_ns)
        return min(latest_ns, publication_ns)
