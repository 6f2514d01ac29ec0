# SPDX-License-Identifier: MIT
"""One body in real time: when it is advanced, publishes and takes commands. All runs on the physics thread
(live_simulation.py); where states go and commands come from is up to its endpoints.
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
"""Between publications at most this often, while commands come in [ns of wall time]."""

LEAD = 0.2
"""Part of a publication's period before it at which commands are taken once more while they come in."""

PAUSED_NS = 100_000_000
"""States go out at 10 Hz while paused [ns of wall time]."""

IDLE_NS = 500_000_000
"""A loop whose states nobody takes wakes this often [ns of wall time], so that what a command means by now is near."""

FOLLOW_NS = 1_000_000
"""A followed clock is read this often [ns of wall time]."""

RAREST_NS = 100_000_000
"""Where publications are further apart than this [ns of wall time], the motion is advanced between them, too."""

STEP_PATIENCE_S = 10.0
"""How long a request to step waits for the end of it."""


HOLD_NS = 1_000_000_000
"""Time stays at 0 for the next list of a script for so long [ns of wall time]."""


class Endpoints:
    """What surrounds a loop; by itself it does nothing. All but the last three are called on the physics thread."""

    def __init__(self) -> None:
        self._woken = threading.Event()

    def publish(self, run: ScenarioRun) -> None:
        """Publish the present state, which is due."""

    def has_subscribers(self) -> bool:
        """Whether anybody gets states; without, none is built for them."""
        return False

    def take_commands(self, _commands: CommandReceiver, _wall_ns: int, _at_once: bool) -> bool:
        """Give ``_commands`` what has arrived, on quiet topics too if ``_at_once``; whether commands come in these
        seconds.
        """
        return False

    def serve_steps(self, loop: SimulationLoop) -> None:
        """Answer requests for steps."""

    def parameters_changed(self) -> None:
        """Parameters have changed, by whatever, or a recording has stopped by itself."""

    def wait(self, timeout_s: float) -> bool:
        """Wait until a command, a request for a step or a subscriber comes, ``wake`` is called, or the time is over;
        whether one may have come.
        """
        self._woken.wait(timeout_s)
        self._woken.clear()
        return False

    def wake(self) -> None:
        """End the wait."""
        self._woken.set()

    def say(self, message: str) -> None:
        """Tell the user, who may want to know."""

    def warn(self, message: str) -> None:
        """Warn the user."""
        print(message, file=sys.stderr)


class SimulationLoop(ScenarioRun):
    """observer: gets every publication, in bundles where nobody subscribes to the endpoints; without subscribers and an
    observer that takes states none is made, and the body crosses the time between two moments at which commands are
    taken at once. stamps: those of a clock that is followed from the start, a reset and the end of a pause on.
    step_requested: whether a step is to follow the command taken last, before the next one is taken.
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

    # For functions that other threads hand over

    def check_change(self, scenario: Scenario) -> None:
        """Raises InputError where this scenario can't follow the present one."""
        if self.pace.followed and scenario.parameters.publish_clock:
            raise InputError(
                "publish_clock", True, "false, while simulated time follows the /clock of another node (use_sim_time)"
            )
        super().check_change(scenario)

    def replace(self, scenario: Scenario) -> Setup:
        """Put another scenario in force; its real time factor takes effect at once, too."""
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
        """See ScenarioRun; while time stands, a command of now has acted when this returns."""
        when_ns = super().take(command, at_ns, listed, at_hand)
        if self.paused:
            self.act()
        return when_ns

    def act(self) -> None:
        """Let the commands that are due now act."""
        if self.simulation.act():
            # What is published of this time was published before they acted.
            self.publications.pass_over(self.simulation.time_ns)
            if self.ghost is not None:
                self.ghost.act(self.simulation.time_ns)

    def settle(self) -> None:
        """While time stands, let act what is due now and what was sent before."""
        if self.paused:
            self.take_commands()
            self.act()

    def planned(self, changes: Mapping[str, object], at_hand: Scenario) -> Scenario:
        """The scenario that these parameters would make now. Raises InputError, counted; at_hand: see ``take``."""
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
        """Change parameters now, to what ``planned`` gave."""
        if self.simulation.failure:
            self.replace(scenario)  # for the run after the reset: nothing acts any more in this one
        else:
            self.take(Change(dict(changes)), at_hand=scenario)
            self.act()

    def watch(self, observer: Observer) -> None:
        """Tell another observer from now on."""
        self.observer = observer
        self.simulation.watch(observer)
        if self.ghost is not None:
            self.ghost.watch(observer)

    def pause(self, paused: bool) -> None:
        """Stop or resume simulated time; what was sent while it stood is taken before it goes on. Raises InputError
        where the motion has failed.
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
        """Advance to this tick's present, or as far towards it as the tick's time allows: what a command means by now.
        Without commands nobody needs it. While time stands, what is due acts.
        """
        if self.paused:
            self.act()
        elif self._present_ns > self.simulation.time_ns:
            self._caught_up = self._budget.advance(self.simulation, self._present_ns)
            self._check_failure()

    def step(self, periods: int = 1) -> bool:
        """While paused, take all commands that have arrived and begin to advance over so many publications; whether
        they are made already, else ``stepping`` says.
        """
        # This very step follows what is taken now, also where each command would have one of its own.
        self._in_step = True
        self.take_commands()
        self._in_step = False
        return self._begin_step(periods)

    def _begin_step(self, periods: int) -> bool:
        self.simulation.log("step", {"periods": periods} if periods > 1 else {})
        # Who has subscribed since the last publication waits for these.
        self._check_listeners()
        self.publications.find_after(self.simulation.time_ns)
        self._steps_left = periods
        self._steps_begun += 1
        self._budget.begin_tick()
        self._step_on()
        return not self.stepping

    def steps(self, periods: int = 1) -> Iterator[None]:
        """While paused, advance over so many publications; yields while the thread's ticks make them.

        Raises InputError while time runs, where the motion has failed, where the step is given up since time is resumed
        or reset, and when it takes longer than STEP_PATIENCE_S; the step goes on by itself then.
        """
        if not self.paused:
            raise InputError("step", "the simulation is running; pause it first")
        end = time.monotonic() + STEP_PATIENCE_S
        begun = 0
        # One after another: a step that somebody else has begun is made first.
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
        """Of the step under way, and of those requested, no more publications are made."""
        if self.stepping:
            self._given_up = self._steps_begun
        self._steps_left, self.step_requested = 0, False

    def _refuse_failed(self, asked: str) -> None:
        if self.simulation.failure:
            raise InputError(asked, f"stopped in the last good state until a reset: {self.simulation.failure}")

    def request_step(self) -> None:
        """A wrench or thruster command has come: paused and in lockstep it is followed by a step."""
        if self.paused and self.scenario.parameters.lockstep and not self._in_step:
            self.step_requested = True

    @property
    def stepping(self) -> bool:
        """Whether publications of a step are still to be made."""
        return self._steps_left > 0

    def reset(self) -> None:
        """Time 0 and the initial state; paused or running stays."""
        self.resets += 1
        self._held_until_ns = 0
        self.simulation.reset(self.scenario.setup)
        if self.ghost is not None or Published in self.observer.takes:
            self.begin_ghost()
        self.publications.restart()
        self._give_up_steps()
        self._present_ns = 0
        self._anchor()
        # Stamped anew: the message that is latched is from before.
        self.simulation.announce()
        self.endpoints.say("reset: simulated time is 0")

    def hold(self) -> None:
        """Keep running time at 0, where a reset has just put it, until ``hold_on`` says otherwise."""
        if not self.paused:
            self._held_until_ns = time.monotonic_ns() + HOLD_NS

    def hold_on(self, more: bool) -> None:
        """A list has come: time that is held is held for the next one, or goes on."""
        if self._held_until_ns:
            self.hold()
            if not more:
                self._let_go()

    def _let_go(self) -> None:
        self._held_until_ns = 0
        self._anchor()

    # In the thread's loop

    def start(self) -> None:
        """Simulated time begins now."""
        if Published in self.observer.takes:
            self.begin_ghost()
        self._anchor()

    def tick(self, arrived: bool = True) -> None:
        """Do what is due, for no longer than pacing.WORK_NS. arrived: commands or requests may have come."""
        self._budget.begin_tick()
        if self.paused or self._held_until_ns:
            self._tick_standing(arrived)
        else:
            self._tick_running(arrived)

    def prepare_request(self) -> None:
        """Bring simulated time up to now for a request, unless a publication comes first."""
        self._budget.begin_tick()
        if not (self.paused or self._held_until_ns):
            self._present_ns = min(self._simulated_present_ns(), LAST_STAMP_NS)
            if self._present_ns < self.publications.next_ns:
                self.catch_up()

    def _tick_running(self, arrived: bool) -> None:
        """Advance to the present: publish what is due, then take the commands that have arrived."""
        wall_ns = time.monotonic_ns()
        # Before somebody who has come is noticed: what has passed isn't published for them.
        present_ns = self._simulated_present_ns()
        check = wall_ns >= self._next_listener_check_ns or (arrived and not self._has_subscribers)
        if check:
            self._next_listener_check_ns = wall_ns + TICK_NS
            self._check_listeners()
        if check or arrived:
            self.endpoints.serve_steps(self)  # refuses them
        if present_ns > LAST_STAMP_NS:
            self._stop_at_the_last_stamp()
            return
        ends = present_ns >= self._end_ns
        present_ns = min(present_ns, self._end_ns)
        due_ns = self.publications.next_ns
        while due_ns <= present_ns:
            if not self._publish_next():
                # Stopped for good, or out of time: then now is as far as it came, and the rest is for the next tick.
                present_ns = self.simulation.time_ns
                break
            due_ns = self.publications.next_ns
            if due_ns <= present_ns and self._has_subscribers and self.pace.factor > 0.0 and not self.pace.followed:
                self.pace.overruns += 1
        self._last_drain_ns = wall_ns
        self._present_ns = present_ns
        self._commands_come = self.endpoints.take_commands(self.commands, wall_ns, arrived)
        # Else what acts in between, and reports of it, would wait for the next publication.
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
            self._let_go()
            self.endpoints.warn(
                f"a script said that more of it follows, and nothing came for {HOLD_NS / 1e9:g} s: it runs without"
            )
            return
        if self.stepping:
            self._step_on()
        if self.pace.followed and not self.pace.anchored_ns:
            # A /clock that had not begun when the pause did.
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
        """Advance to the next publication and make it; False when the tick's time is over before, or the
        motion stopped.
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
        """Simulated time goes on from where it is."""
        self.pace.anchor(self.simulation.time_ns)
        self._begin_anew(stamps_stay)

    def _begin_anew(self, stamps_stay: bool = False) -> None:
        """Everything that goes by the wall clock is due from now on. Stamps are the followed clock's; the log keeps how
        far they are ahead of simulated time.
        """
        if not stamps_stay and self.pace.offset_ns != self.stamps.offset_ns:
            self.stamps.offset_ns = self.pace.offset_ns
            self.simulation.log("clock", {"offset_ns": self.stamps.offset_ns})
        self._last_drain_ns = time.monotonic_ns()
        self._paused_publication_ns = 0
        self._next_listener_check_ns = 0
        self._caught_up = True

    def _jump(self, by_ns: int) -> None:
        """The followed clock has jumped, and stamps go with it: ahead, simulated time does, without motion; back, it
        goes on, and what waits for a time of before is dropped.
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
            self._begin_anew()
        if idle:
            self.publications.pass_over(min(present_ns, self._end_ns))
        return present_ns

    def next_wake_ns(self) -> int:
        """When ``tick`` is due next [ns of wall time], unless something arrives before."""
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
            # Recordings and viewers take states in bundles: theirs are made together, at 1 kHz ten a wake-up.
            return min(latest_ns, self.pace.wall_ns(min(self.simulation.next_event_ns, self._end_ns)))
        publication_ns = self.pace.wall_ns(self.publications.next_ns)
        if self._commands_come:
            # Commands taken a little before a publication show in it; those taken with it would show a period later.
            early_ns = self.pace.wall_ns(self.publications.next_ns - int(LEAD * 1e9 / self.publications.rate))
            if early_ns - self._last_drain_ns >= ACTIVE_DRAIN_NS:
                return min(latest_ns, early_ns)
        return min(latest_ns, publication_ns)
