# SPDX-License-Identifier: MIT
"""The flight of one body in time: when it advances, publishes and takes commands.

Simulated time follows the wall clock by the real-time factor from an anchor, never by adding up periods, so that a late
wake-up isn't carried on. Everything here runs on the physics thread (physics_thread.py).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from ..motion.state import State
from ..scene.ghost import Ghost, ghost_of
from ..scene.scenario import Scenario, publication_ns
from ..simulation.observer import Observer
from ..simulation.simulation import Simulation
from .portions import Portions

DRAIN_NS = 10_000_000
"""Commands are taken at least this often [ns of wall time]."""

LIVELY_DRAIN_NS = 500_000
"""Between publications at most this often, while commands come in [ns of wall time]."""

LEAD = 0.2
"""Part of a publication's period before it at which commands are taken once more while they come in."""

PAUSED_NS = 100_000_000
"""States go out at 10 Hz while paused [ns of wall time]."""

FOLLOW_NS = 1_000_000
"""A followed clock is looked at this often [ns of wall time]."""

LAST_STAMP_NS = (2**31 - 1) * 1_000_000_000
"""A message's stamp counts seconds in 32 bits."""

MAX_LAG_NS = 250_000_000
"""A thread further behind than this [ns of wall time] gives the time up instead of racing after it."""


@dataclass
class Timekeeping:
    """overruns: publications more than a period late. real_time_lost_s: time given up rather than caught up."""

    overruns: int = 0
    real_time_lost_s: float = 0.0
    paused: bool = False


class Flight:
    """publish(state) is called for every publication; take_commands(wall_ns, whole) at every tick, to
    submit what has arrived, on all topics if ``whole``; it says whether commands come in these seconds.

    anybody_listens() says whether publications reach a subscriber, is_viewed() whether a recording or viewer takes the states.
    For these alone states are made in bundles, at the looks at the commands; for nobody none is made, and the body crosses
    the time between two looks at once.
    on_failure(message) is called when the motion stopped in its last good state. followed_clock() gives nanoseconds of a clock
    that simulated time follows instead of the wall's.
    """

    def __init__(
        self,
        scenario: Scenario,
        observer: Observer,
        publish: Callable[[State], None],
        take_commands: Callable[[int, bool], bool],
        on_failure: Callable[[str], None],
        followed_clock: Callable[[], int] | None = None,
        anybody_listens: Callable[[], bool] = lambda: True,
        is_viewed: Callable[[], bool] = lambda: False,
    ) -> None:
        self.scenario = scenario
        self.observer = observer
        self.simulation = Simulation(scenario.setup, observer)
        self.timekeeping = Timekeeping(paused=scenario.parameters.start_paused)
        self._publish = publish
        self._take_commands = take_commands
        self._on_failure = on_failure
        self._followed_clock = followed_clock
        self._anybody_listens = anybody_listens
        self._heard = self._listeners = True
        self._is_viewed = is_viewed
        self._ghost: Ghost | None = None
        self._portions = Portions()
        self._stepping = False
        self._lively = False
        self._publication = 0
        self._present_ns = 0
        self._anchor()

    # For functions that other threads hand over

    def change(self, scenario: Scenario) -> None:
        """Take on another scenario's time settings; its setup reaches the motion by a command."""
        rate_changed = scenario.parameters.publish_rate != self.scenario.parameters.publish_rate
        pace_changed = scenario.parameters.real_time_factor != self.scenario.parameters.real_time_factor
        self.scenario = scenario
        # One that isn't there would have missed what was commanded so far: it begins at the next reset.
        if self._ghost is not None:
            self._ghost.change(self.simulation.time_ns, scenario, self.simulation.listed)
        if rate_changed:
            self._find_next_publication()
        if pace_changed:
            self._anchor()

    def watch(self, observer: Observer) -> None:
        """Tell another observer from now on."""
        self.observer = observer
        self.simulation.watch(observer)
        if self._ghost is not None:
            self._ghost.watch(observer)

    def pause(self, paused: bool) -> None:
        """Stop or resume simulated time; what was sent while it stood is taken before it goes on."""
        if paused != self.timekeeping.paused:
            if not paused:
                self._take_commands(time.monotonic_ns(), True)
            self.timekeeping.paused = paused
            self._stepping = False
            self.simulation.log("pause", {"data": paused})
            self.simulation.tell_status(paused)
            self._anchor()

    def catch_up(self) -> None:
        """Advance to this tick's present, or as far towards it as the tick's time allows: what a command means by now.
        Without commands nobody needs it.
        """
        if not self.timekeeping.paused and self._present_ns > self.simulation.time_ns:
            self._caught_up = self._portions.advance(self.simulation, self._present_ns)
            self._check_failure()

    def step(self) -> bool:
        """While paused, begin to advance to the next publication; whether it is made already, else ``stepping`` says."""
        self._take_commands(time.monotonic_ns(), True)
        self.simulation.log("step", {})
        self._find_next_publication()
        self._stepping = True
        self._portions.begin_tick()
        self._step_on()
        return not self._stepping

    @property
    def stepping(self) -> bool:
        """A step is on its way."""
        return self._stepping

    def reset(self) -> None:
        """Time 0 and the initial state; paused or running stays."""
        # Changes still waiting for the paused time to go on are dropped with the schedule; the parameters stay.
        self.simulation.reset(self.scenario.setup)
        if self._ghost is not None:
            self._ghost.reset(self.scenario)
        elif self._is_viewed():
            self._ghost = ghost_of(self.scenario, self.simulation, self.observer)
        self._publication = 0
        self._stepping = False
        self._anchor()

    # In the thread's loop

    def start(self) -> None:
        """Simulated time begins now."""
        if self._is_viewed():
            self._ghost = ghost_of(self.scenario, self.simulation, self.observer)
        self._anchor()

    def tick(self) -> None:
        """Do what is due, for no longer than portions.WORK_NS."""
        self._portions.begin_tick()
        if self.timekeeping.paused:
            self._tick_paused()
        else:
            self._tick_running()

    def meet_request(self) -> None:
        """Bring simulated time up to now for a request, unless a publication comes first."""
        self._portions.begin_tick()
        if not self.timekeeping.paused:
            self._present_ns = min(self._simulated_present_ns(), LAST_STAMP_NS)
            if self._present_ns < self._publication_ns():
                self.catch_up()

    def _tick_running(self) -> None:
        """Advance to the present: publish what is due, then take the commands that have arrived."""
        wall_ns = time.monotonic_ns()
        if wall_ns >= self._next_look_ns:
            self._next_look_ns = wall_ns + DRAIN_NS
            self._look_for_listeners()
        present_ns = self._simulated_present_ns()
        if present_ns > LAST_STAMP_NS:
            self._stop_at_the_last_stamp()
            return
        if not self._listeners and self._caught_up:
            self._pass_over(present_ns)
        due_ns = self._publication_ns()
        while due_ns <= present_ns:
            if not self._publish_next():
                # Stopped for good, or out of time: then now is as far as it came, and the rest is for the next tick.
                present_ns = self.simulation.time_ns
                break
            due_ns = self._publication_ns()
            if due_ns <= present_ns and self._heard and self._factor > 0.0 and not self._followed_clock:
                self.timekeeping.overruns += 1
        self._last_drain_ns = wall_ns
        self._present_ns = present_ns
        self._lively = self._take_commands(wall_ns, False)
        if not self._listeners or self._followed_clock or not self._caught_up:
            self.catch_up()

    def _look_for_listeners(self) -> None:
        self._heard = self._anybody_listens()
        self._listeners = self._heard or self._is_viewed()

    def _pass_over(self, present_ns: int) -> None:
        """Make no publication up to the present, but for what a run without pacing goes by."""
        if self._factor > 0.0 or self._followed_clock:
            numerator, denominator = float(self.scenario.parameters.publish_rate).as_integer_ratio()
            # One early, and then on: the estimate is floored and publications are rounded.
            self._publication = max(self._publication, present_ns * numerator // (1_000_000_000 * denominator) - 1)
            while self._publication_ns() <= present_ns:
                self._publication += 1

    def _step_on(self) -> None:
        if self._publish_next() or self.simulation.failure:
            self._stepping = False

    def _tick_paused(self) -> None:
        if self._stepping:
            self._step_on()
        now_ns = time.monotonic_ns()
        self._last_drain_ns = now_ns
        self._take_commands(now_ns, False)
        if now_ns >= self._paused_publication_ns and not self._stepping:
            self._paused_publication_ns = now_ns + PAUSED_NS
            self._look_for_listeners()
            self._publish(self.simulation.state)

    def _publish_next(self) -> bool:
        """Advance to the next publication and make it; False when the tick's time is over before, or the motion stopped."""
        if self._publication_ns() > LAST_STAMP_NS:
            self._stop_at_the_last_stamp()
            return False
        self._caught_up = self._portions.advance(self.simulation, self._publication_ns())
        if self._check_failure() or not self._caught_up:
            return False
        state = self.simulation.state
        self._publication += 1
        self.observer.state(state.time_ns, state.row)
        self.simulation.tell_status()
        if self._ghost is not None:
            self._ghost.advance(state.time_ns)
        self._publish(state)
        return True

    def _stop_at_the_last_stamp(self) -> None:
        self.simulation.failure = (
            f"simulated time beyond {LAST_STAMP_NS // 1_000_000_000} s, the largest that a stamp can hold"
        )
        self._stepping = False
        self._check_failure()

    def _check_failure(self) -> bool:
        if not self.simulation.failure:
            return False
        if not self.timekeeping.paused:
            self.timekeeping.paused = True
            self._on_failure(self.simulation.failure)
        return True

    # Time

    @property
    def _factor(self) -> float:
        return self.scenario.parameters.real_time_factor

    def _publication_ns(self) -> int:
        return publication_ns(self._publication, self.scenario.parameters.publish_rate)

    def _find_next_publication(self) -> None:
        """The first publication after the present."""
        now_ns = self.simulation.time_ns
        self._publication = max(0, int(now_ns * 1e-9 * self.scenario.parameters.publish_rate) - 1)
        while self._publication_ns() <= now_ns:
            self._publication += 1

    def _anchor(self) -> None:
        self._last_drain_ns = time.monotonic_ns()
        self._anchor_wall_ns = self._followed_clock() if self._followed_clock else self._last_drain_ns
        self._last_reading_ns = self._anchor_wall_ns
        self._anchor_simulated_ns = self.simulation.time_ns
        self._paused_publication_ns = 0
        self._next_look_ns = 0
        self._caught_up = True

    def _simulated_present_ns(self) -> int:
        """Simulated time that the wall clock asks for; time lost beyond MAX_LAG_NS is given up and counted."""
        if self._followed_clock:
            reading_ns = self._followed_clock()
            if self._anchor_wall_ns == 0 or reading_ns < self._last_reading_ns:
                # It hasn't begun before, or was set back: its steps count from here, simulated time goes on.
                self._anchor()
            self._last_reading_ns = reading_ns
            return max(self.simulation.time_ns, self._anchor_simulated_ns + reading_ns - self._anchor_wall_ns)
        if self._factor == 0.0:
            return self._publication_ns()
        present_ns = self._anchor_simulated_ns + int((time.monotonic_ns() - self._anchor_wall_ns) * self._factor)
        expected_ns = max(self.simulation.time_ns, self._publication_ns())
        lag_ns = (present_ns - expected_ns) / self._factor
        if lag_ns > MAX_LAG_NS:
            self.timekeeping.real_time_lost_s += lag_ns * 1e-9
            self.timekeeping.overruns += 1
            self._anchor()
            self._anchor_simulated_ns = expected_ns
            present_ns = expected_ns
        return present_ns

    def next_wake_ns(self) -> int:
        """When ``tick`` is due next [ns of wall time]."""
        latest_ns = self._last_drain_ns + DRAIN_NS
        if self._stepping or not self._caught_up:
            return 0
        if self._followed_clock:
            return min(latest_ns, self._last_drain_ns + FOLLOW_NS)
        if self.timekeeping.paused:
            return latest_ns
        if self._factor == 0.0:
            return 0
        if not self._heard:
            # Recordings and viewers take states in bundles: theirs are made together, at 1 kHz ten a wake-up.
            return latest_ns
        ahead_ns = self._publication_ns() - self._anchor_simulated_ns
        publication_ns = self._anchor_wall_ns + int(ahead_ns / self._factor) + 1
        if self._lively:
            # Commands taken a little before a publication show in it; those taken with it would show a period later.
            early_ns = publication_ns - int(LEAD * 1e9 / (self.scenario.parameters.publish_rate * self._factor))
            if early_ns - self._last_drain_ns >= LIVELY_DRAIN_NS:
                return min(latest_ns, early_ns)
        return min(latest_ns, publication_ns)
