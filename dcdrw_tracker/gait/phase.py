"""The phase estimator: from rotations to stance angles, steps, strikes and the gait phase (contract §1).

Plain data in, plain data out: time arrives in the samples, and what is refused or missing is counted.
"""

import math
from collections import deque
from typing import Annotated, Literal, NamedTuple, get_args

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams, StanceDistance, WheelShape
from dcdrw_msgs_py.rolling import default_stance_distance, phase, phi_pitch, steps_ahead
from dcdrw_msgs_py.samples import Footfall, JointSample, PhaseSample, Turn
from dcdrw_msgs_py.topics import COUPLER, FRONT_WHEEL, REAR_WHEEL
from dcdrw_tracker.gait.cadence import Cadence, CadenceStatus
from dcdrw_tracker.gait.resolution import Resolution
from dcdrw_tracker.gait.rotation import Rotation, Strike, Tolerance

Refusal = Literal['unreadable', 'unpaired', 'not finite', 'repeated', 'reversed', 'future', 'outlier']
"""Why a sample is refused: the message has neither wheel, the other wheel's message of that time is missing, a rotation
is not a number, the stamp stands still, goes back or lies ahead of the clock, or no wheel turns that fast."""

Cause = Literal['announced', 'stamp', 'rotation']
"""Why the source is taken to have started anew: it says so, its stamps went back, or its rotations jumped."""

Hint = Literal['front_sign', 'rear_sign', 'stamps', 'unit', 'revolutions', 'ratio', 'rollover', 'lone_jump']
"""A parameter that is probably set wrongly, judged by how the wheels seem to turn."""

LARGEST_ROTATION = 1e9
"""Beyond this a rotation is not a measurement, and a double no longer tells a strike [rad]."""
UNITS = {'rad': 1.0, 'deg': math.pi / 180.0, 'rev': math.tau}
"""Units in which a source may give its rotations, in rad."""
UPHILL_STEPS = 3
"""A wheel that has taken so many more steps uphill than downhill has the wrong sign: rocking takes one."""
FAR_AHEAD = 5
"""A wheel that has taken so many more steps than the other, and a quarter more, has another gear or other spokes."""
REMEMBERED = 100
"""Restarts and clock steps of which the particulars are kept."""
RECENT = 64
"""Samples among which one that comes again is known, as over a second way of the network."""
LEAST_CLOCK_STEP_NS = 200_000_000
"""A jump of the stamps by less is as good as a gap."""
BURSTS_NS = 1_000_000_000
"""So soon after the start, stamps that jump may be those of bursts that are not known yet."""
PASSED_NS, OTHER_UNIT = 2_000_000_000, 100
"""Over so much of the node's time, stamps that pass so many times as fast or as slowly are in another unit."""
OFTEN = 5
"""So often no clock is set: the stamps lack a part."""
MANY_SLOW = 5
"""So many strikes, and no other, of wheels that turn slower than any that rolls by itself make the unit doubtful."""
LONGEST_WAIT = 0.15
"""So long at most a source that vouches for its turns waits until it tells them again [s]."""
MOVING = 0.2
"""A wheel that is slower tells nothing about the clock [rad/s]."""

MaxSpeed = Annotated[
    float, Quantity('the fastest a wheel can turn; more is an outlier', 'rad/s', above=0.0, high=1000.0, live=True)
]
Sign = Annotated[int, Quantity('-1 where its rotation in joint_states falls as it rolls downhill', choices=(1, -1))]
Zero = Annotated[
    float, Quantity('its rotation in joint_states, downhill, where a spoke stands along the normal of the slope', 'rad')
]


class PhaseParams(NamedTuple):
    """What the estimator must know of the rig, and how much noise it bears."""

    front: WheelShape = WheelShape()
    rear: WheelShape = WheelShape()
    S0: StanceDistance = math.nan
    hysteresis_deg: Annotated[
        float,
        Quantity('a strike counts back only when ψ recedes by more than this', 'deg', low=0.0, high=10.0, live=True),
    ] = 1.5
    max_speed: MaxSpeed = 20.0
    max_future: Annotated[
        float, Quantity('a stamp further ahead of the clock is refused', 's', low=0.0, high=60.0, live=True)
    ] = 0.5
    restart_samples: Annotated[
        int,
        Quantity(
            'refused samples in a row that agree, and so make a restart of the source', low=2, high=1000, live=True
        ),
    ] = 5
    unit: Annotated[
        str, Quantity('unit of the rotations in joint_states; of the speeds, the same per second', choices=tuple(UNITS))
    ] = 'rad'
    front_sign: Sign = 1
    rear_sign: Sign = 1
    front_zero: Zero = 0.0
    rear_zero: Zero = 0.0
    rollover: Annotated[
        float,
        Quantity(
            'by how much a rotation jumps where the counter of its encoder rolls over',
            'rad',
            above=0.0,
            derived='whole turns, and powers of two of counts, are recognized',
            live=True,
        ),
    ] = math.nan
    front_joint: Annotated[str, Quantity('name of the front wheel in joint_states')] = FRONT_WHEEL
    rear_joint: Annotated[str, Quantity('name of the rear wheel in joint_states')] = REAR_WHEEL
    coupler_joint: Annotated[str, Quantity('name of the coupler in joint_states')] = COUPLER

    @property
    def scales(self) -> tuple[float, float]:
        """What makes rotations of the front and the rear joint ψ in rad."""
        unit = UNITS[self.unit]
        return self.front_sign * unit, self.rear_sign * unit


class PhaseUpdate(NamedTuple):
    """What one sample brought."""

    phase: PhaseSample
    footfalls: tuple[Footfall, ...]
    """Strikes since the last sample, in the order of time."""
    clock_ns: int = 0
    """Sum of the steps of the source's clock so far; stamps minus this run on evenly."""
    held: tuple[PhaseSample, ...] = ()
    """Phases of samples before it that had been held back until this one agreed."""


class Restart(NamedTuple):
    """The source has started anew."""

    stamp_ns: int
    """Stamp of the first sample after it."""
    cause: Cause
    seconds: float
    """Time since the last sample before it, by the stamps [s]."""
    front: float
    """Jump of the rotation ψ as the source gives it [rad]."""
    rear: float


class ClockStep(NamedTuple):
    """The stamps have jumped, yet the motion went on: the clock of the source was set."""

    stamp_ns: int
    """Stamp of the first sample after it."""
    seconds: float
    """Size of the step [s]."""


class PhaseStatus(NamedTuple):
    """A snapshot of the estimator, for diagnostics."""

    stamp_ns: int
    """Stamp of the last sample that was accepted; 0 where there was none."""
    accepted: int
    refused: dict[Refusal, int]
    """How many were refused for good, by the reason; with those accepted, strays and duplicates, all that came."""
    refusal: Refusal | None
    """Why samples are refused now; None since one was accepted."""
    cadence: CadenceStatus
    restarts: int
    n_uncertain: bool
    """A gap was long enough for a step unseen: n may be off since then."""
    front_steps: int
    rear_steps: int
    rollovers: int = 0
    """Times that the counter of an encoder rolled over, which was made good."""
    unstamped: int = 0
    """Samples whose stamp was missing (zero), so that the time of their arrival took its place."""
    foreign: int = 0
    """Messages that name neither wheel, and so are none of this rig's."""
    strays: int = 0
    """Lone wild samples, apart from those before and after, which are passed over."""
    duplicates: int = 0
    """Samples that came again as they were, and so cost nothing."""
    disbelieved: int = 0
    """Samples since the last restart whose speeds do not go with the rotations: those of the rotations are used."""
    clock_steps: tuple[ClockStep, ...] = ()
    """The last of them, which were bridged: nothing was lost."""
    restarted: tuple[Restart, ...] = ()
    """The last of the restarts: what came before each has no common zero with what came after."""
    hints: tuple[Hint, ...] = ()
    """Parameters that seem to be wrong."""

    @property
    def refusals(self) -> dict[Refusal, int]:
        """The reasons for which samples were refused, without those that did not occur."""
        return {why: count for why, count in self.refused.items() if count}


class PhaseEstimator:
    """Follows both wheels; one sample in, the phase out.

    A sample that no wheel can have made is refused. When `restart_samples` of them in a row agree with each other
    (a recording that loops, a simulator that was reset), the source has started anew: the estimator then counts
    from the first of these, so no strike is lost. A source that numbers its runs says itself when it starts anew, and
    that no turn is lost in between.

    Where the stamps jump while both wheels go on as they went, only the source's clock was set: this is bridged.
    """

    def __init__(self, params: PhaseParams) -> None:
        self.configure(params)
        self._cadence = Cadence()
        self._refused: dict[Refusal, int] = dict.fromkeys(get_args(Refusal), 0)
        self._refusal: Refusal | None = None
        self._accepted = self._unstamped = self._foreign = self._duplicates = self._strays = self._too_fast = 0
        self._slow_strikes: int | None = 0
        self._restarts = self._rolled_before = self._now_ns = 0
        self._restarted: deque[Restart] = deque(maxlen=REMEMBERED)
        self._clock_steps: deque[ClockStep] = deque(maxlen=REMEMBERED)
        self._is_fine = True
        self.reset()

    def configure(self, params: PhaseParams) -> None:
        """Take changed parameters at once; those that are not `live` hold for the rotations from the next start on."""
        self.params = params
        self._tolerance = Tolerance(math.radians(params.hysteresis_deg), params.max_speed, params.rollover)
        self._front_scale, self._rear_scale = params.scales
        self._scaled = params.scales != (1.0, 1.0)

    def reset(self) -> None:
        """Start afresh with the next sample (n = 0); the counts of samples stay."""
        self._last: JointSample | None = None
        self._recent: deque[JointSample] = deque(maxlen=RECENT)
        self._held: list[_Held] = []
        self._wild: tuple[_Wild, ...] = ()
        self._clock_ns = self._arrived_ns = self._begun_ns = self._begun_now_ns = 0
        self._front = self._rear = Rotation(self.params.front.alpha, 0, 0.0, math.nan, self._tolerance)
        self._n_uncertain = False
        if self._is_fine:  # what starts may have other encoders; one whose counts seem to be jumps is learned on
            self._is_fine, self._resolution = False, 0.0
            self._front_resolution, self._rear_resolution = Resolution(), Resolution()
            self._seen: JointSample | None = None

    def refuse(self, why: Refusal, samples: int = 1) -> None:
        """Count samples that are of no use; callers report what they cannot even convert (`unreadable`)."""
        self._refused[why] += samples
        self._refusal = why

    @property
    def accepted(self) -> int:
        """How many samples were accepted."""
        return self._accepted

    def note_foreign(self, messages: int = 1) -> None:
        """Count messages that name neither wheel: another robot's, unless the wheels have other names."""
        self._foreign += messages
        if not self._accepted:
            self._refusal = 'unreadable'

    def note_unstamped(self, samples: int) -> None:
        """Count samples to which the caller gave the time of their arrival, for want of a stamp."""
        self._unstamped += samples

    def update(self, joints: JointSample, now_ns: int = 0, arrival_ns: int = 0) -> PhaseUpdate | None:
        """Take the next sample; None where it is refused or has to wait for others, which is counted.

        Args:
            joints: the rotations, unbounded or wrapped to a turn, and the speeds, NaN where unknown, both in `unit`.
            now_ns: the node's clock; 0 where it is unknown, as a simulated clock that has not started.
            arrival_ns: when the sample arrived, by whatever clock; 0: at `now_ns`.

        """
        self._now_ns, arrival_ns = now_ns, arrival_ns or now_ns
        if self._scaled:
            joints = joints._replace(
                front=_scaled(joints.front, self._front_scale), rear=_scaled(joints.rear, self._rear_scale)
            )
        stamp_ns, front, rear, _, run = joints
        if not (
            -LARGEST_ROTATION <= front.angle <= LARGEST_ROTATION and -LARGEST_ROTATION <= rear.angle <= LARGEST_ROTATION
        ):
            self.refuse('not finite')
            return None
        if now_ns and stamp_ns - now_ns > self.params.max_future * 1e9:
            self.refuse('future')
            return None
        if stamp_ns == 0 and now_ns and self._is_unstamped(joints):
            joints = joints._replace(stamp_ns=now_ns)
            self._unstamped += 1
            stamp_ns = now_ns
        if self._clock_ns:
            stamp_ns -= self._clock_ns
            joints = joints._replace(stamp_ns=stamp_ns)
        if not self._is_fine:
            self._resolve(joints)
        last = self._last
        if last is None:
            self._cadence.tick(stamp_ns)
            return self._start(joints)
        if last.run and run != last.run:  # a run that is told late was that of the samples before
            self._cadence.tick(stamp_ns)
            return self._restart([_Held(joints, 'reversed', arrival_ns)], 'announced')
        elapsed_ns = stamp_ns - last.stamp_ns
        if elapsed_ns >= LEAST_CLOCK_STEP_NS and self._may_be_clock_step(joints, elapsed_ns, arrival_ns):
            return self._hold(joints, 'future', arrival_ns)
        self._cadence.tick(stamp_ns)
        if elapsed_ns > 0:
            # While outliers are held, a sample that could go on from either belongs to the nearer.
            stray = self._held[-1].joints if self._held and self._held[-1].why == 'outlier' else None
            if stray is None or self._apart(joints, last) <= self._apart(joints, stray):
                update = self._advance(joints, elapsed_ns * 1e-9)
                if update or self._wild:
                    if arrival_ns - self._arrived_ns > PASSED_NS:  # a pause tells nothing of the clocks
                        self._begun_ns, self._begun_now_ns = stamp_ns, now_ns
                    self._arrived_ns = arrival_ns
                    return update
            return self._hold(joints, 'outlier', arrival_ns)
        if self._came_before(joints):
            self._duplicates += 1
            self._refusal = 'reversed' if elapsed_ns else 'repeated'
            return None
        if elapsed_ns == 0 or (self._held and stamp_ns == self._held[-1].joints.stamp_ns):
            self.refuse('repeated')
            return None
        return self._hold(joints, 'reversed', arrival_ns)

    def status(self) -> PhaseStatus:
        """A snapshot."""
        return PhaseStatus(
            stamp_ns=self._last.stamp_ns + self._clock_ns if self._last else 0,
            accepted=self._accepted,
            refused=self._refused.copy(),
            refusal=self._refusal,
            cadence=self._cadence.status(),
            restarts=self._restarts,
            n_uncertain=self._n_uncertain,
            front_steps=self._front.steps,
            rear_steps=self._rear.steps,
            rollovers=self._rolled_before + self._front.rollovers + self._rear.rollovers,
            unstamped=self._unstamped,
            foreign=self._foreign,
            strays=self._strays,
            duplicates=self._duplicates,
            disbelieved=max(self._front.disbelieved, self._rear.disbelieved),
            clock_steps=tuple(self._clock_steps),
            restarted=tuple(self._restarted),
            hints=self._hints(),
        )

    def _came_before(self, joints: JointSample) -> bool:
        """Whether this is one of the last samples again; speeds tell nothing, for NaN equals nothing."""
        stamp_ns, front, rear, *_ = joints
        return any(
            stamp_ns == one.stamp_ns and front.angle == one.front.angle and rear.angle == one.rear.angle
            for one in self._recent
        )

    def _resolve(self, joints: JointSample) -> None:
        """Learn how finely the rotations are told, also from samples that are refused."""
        last, self._seen = self._seen, joints
        dt = (joints.stamp_ns - last.stamp_ns) * 1e-9 if last else 0.0
        if last is None or dt <= 0.0:
            return
        front, rear = self._front_resolution, self._rear_resolution
        front.take(joints.front.angle - last.front.angle, dt)
        rear.take(joints.rear.angle - last.rear.angle, dt)
        self._is_fine = front.is_fine and rear.is_fine
        self._resolution = 0.5 * (front.count / self.params.front.alpha + rear.count / self.params.rear.alpha)

    def _are_stamps_off(self) -> bool:
        """Whether the stamps pass far faster or slower than the node's clock, or begin anew again and again."""
        passed_ns = self._now_ns - self._begun_now_ns
        if self._last is None or not self._begun_now_ns or passed_ns < PASSED_NS:
            return False
        told_ns = self._last.stamp_ns - self._begun_ns
        is_other_unit = not passed_ns < OTHER_UNIT * told_ns < OTHER_UNIT * OTHER_UNIT * passed_ns
        return is_other_unit or len(self._clock_steps) >= OFTEN

    def _hints(self) -> tuple[Hint, ...]:
        if self._are_stamps_off():
            return ('stamps',)  # by which all else is judged
        hints: list[Hint] = []
        swift = self.params.unit == 'rad' and any(
            abs(wheel.pace) > _fastest_rolling(shape)
            for wheel, shape in ((self._front, self.params.front), (self._rear, self.params.rear))
        )
        if swift or self._too_fast > max(2 * self.params.restart_samples, self._accepted // 4):
            hints.append('unit')
        if self._slow_strikes is not None and self._slow_strikes > MANY_SLOW:
            hints.append('revolutions')
        if self._front.steps <= -UPHILL_STEPS:
            hints.append('front_sign')
        if self._rear.steps <= -UPHILL_STEPS:
            hints.append('rear_sign')
        if self._is_ahead():
            hints.append('ratio')
        if not (self._front.is_zero_known and self._rear.is_zero_known):
            hints.append('rollover')
        if any(map(self._jumped_alone, self._restarted)):
            hints.append('lone_jump')
        return tuple(hints)

    def _is_ahead(self) -> bool:
        """Whether one wheel takes far more steps than the other although both turn on."""
        fewer, more = sorted((self._front.steps, self._rear.steps))
        turn = min(abs(self._front.pace), abs(self._rear.pace)) >= MOVING
        return turn and fewer > 0 and more - fewer >= FAR_AHEAD and more >= 1.25 * fewer

    def _jumped_alone(self, restart: Restart) -> bool:
        """Whether one wheel alone jumped by more than a step, as a counter does that rolls over."""
        pitches = 2.0 * self.params.front.alpha, 2.0 * self.params.rear.alpha
        jumped = [abs(jump) > pitch for jump, pitch in zip((restart.front, restart.rear), pitches, strict=True)]
        return restart.cause == 'rotation' and sum(jumped) == 1

    def _is_unstamped(self, joints: JointSample) -> bool:
        """Whether a stamp of zero is none: the wheels have turned since the last one, which was zero, too."""
        if self._unstamped:
            return True
        last = self._last
        if last is None or last.stamp_ns != 0 or last[1:3] == joints[1:3]:
            return False
        self.reset()  # the first sample had no time
        self._cadence = Cadence()
        return True

    def _may_be_clock_step(self, joints: JointSample, elapsed_ns: int, arrival_ns: int) -> bool:
        """Whether the stamps have jumped forward although both wheels have only moved on by a sample or so.

        Where whole turns may not show, the samples must also have arrived without a pause.
        """
        period_ns = self._cadence.period_ns
        slowest = min(abs(self._front.pace), abs(self._rear.pace))
        if not period_ns or elapsed_ns <= 10 * period_ns or slowest * elapsed_ns < 4e9 * self._tolerance.hysteresis:
            return False
        if joints.stamp_ns - self._begun_ns < BURSTS_NS or not self._cadence.is_gap(elapsed_ns * 1e-9):
            return False
        paused_ns = arrival_ns - self._arrived_ns if self._arrived_ns and arrival_ns else elapsed_ns
        may_wrap = not joints.run and (self._front.may_wrap or self._rear.may_wrap)
        if may_wrap and paused_ns > elapsed_ns // 2:
            return False
        first = self._held[0].joints if self._held else joints
        passed = self._passed(first) + max(joints.stamp_ns - first.stamp_ns, 0) * 1e-9
        return 2e9 * passed < elapsed_ns and self._goes_on(joints, passed)

    def _passed(self, joints: JointSample) -> float:
        """Time that has truly passed since the last sample, were the clock set [s]; NaN where it cannot have been.

        A period, or where the source vouches for its turns, as from poses, of which it waits for some: as long as the
        wheels took at their pace.
        """
        assert self._last
        period = self._cadence.period_ns * 1e-9
        pairs = (self._front, joints.front, self._last.front), (self._rear, joints.rear, self._last.rear)
        if not joints.run or any(abs(wheel.pace) < MOVING for wheel, *_ in pairs):
            return period
        took = sum((now.angle - then.angle) / wheel.pace for wheel, now, then in pairs) / len(pairs)
        return max(took, period) if took <= max(LONGEST_WAIT, 2.0 * period) else math.nan

    def _goes_on(self, joints: JointSample, dt: float) -> bool:
        """Whether both wheels move, and are where their pace takes them within dt."""
        return all(
            abs(wheel.pace) >= MOVING and wheel.is_at(turn.angle, dt, self._tolerance)
            for wheel, turn in ((self._front, joints.front), (self._rear, joints.rear))
        )

    def _start(self, joints: JointSample) -> PhaseUpdate:
        params = self.params
        self._begun_ns, self._begun_now_ns = joints.stamp_ns, self._now_ns
        self._front, self._rear = (
            Rotation(shape.alpha, joints.stamp_ns, turn.angle, self._speed(turn), self._tolerance, zero)
            for shape, turn, zero in (
                (params.front, joints.front, params.front_zero),
                (params.rear, joints.rear, params.rear_zero),
            )
        )
        return PhaseUpdate(self._take(joints), (), self._clock_ns)

    def _follow(self, joints: JointSample, dt: float) -> PhaseUpdate | None:
        """Move both wheels on by a sample that is dt seconds later; None where they cannot get there."""
        reached = self._reach(joints, dt)
        return self._move(joints, dt, reached) if reached else None

    def _reach(self, joints: JointSample, dt: float) -> tuple[float, float] | None:
        """The rotations ψ of both wheels that a sample means; None where they cannot get there within dt seconds."""
        front = self._front.continued(joints.front.angle, dt, self._tolerance)
        rear = self._rear.continued(joints.rear.angle, dt, self._tolerance)
        return None if front is None or rear is None else (front, rear)

    def _advance(self, joints: JointSample, dt: float) -> PhaseUpdate | None:
        """Move on by a sample, unless no wheel gets there, or it is wild: then it waits for the next ones.

        It is believed with the next one, if they are in line, or the two next, where the wheel would turn too fast, as
        by the stamps of a burst. One alone is passed over.
        """
        wild, self._wild = self._wild, ()
        reached = self._reach(joints, dt)
        if reached is None:
            return self._believe(wild, joints) if wild and self._goes_on_from(wild[-1], joints, dt) else None
        front, rear, tolerance = self._front, self._rear, self._tolerance
        # Each wheel learns from each sample how far off is usual.
        is_wild = front.is_wild(reached[0], dt, tolerance) | rear.is_wild(reached[1], dt, tolerance)
        if not (wild or is_wild):
            return self._move(joints, dt, reached)
        in_row = wild[-1].in_row + 1 if wild else 1
        if wild and not self._are_in_line(wild[-1], reached, dt):
            wild = ()
        fastest = max(abs(reached[0] - front.psi), abs(reached[1] - rear.psi)) / dt
        enough = 2 if fastest > tolerance.max_speed else 1
        if not is_wild or len(wild) >= enough or in_row > self.params.restart_samples:
            return self._believe(wild, joints)
        self._strays += 1
        self._wild = (*wild, _Wild(joints, dt, reached, in_row))
        return None

    def _goes_on_from(self, before: '_Wild', joints: JointSample, dt: float) -> bool:
        """Whether a sample that the wheels only reach by way of a wild one goes with that."""
        front, rear = (
            psi + now.angle - then.angle
            for psi, now, then in zip(before.reached, joints[1:3], before.joints[1:3], strict=True)
        )
        return self._are_in_line(before, (front, rear), dt)

    def _are_in_line(self, before: '_Wild', reached: tuple[float, float], dt: float) -> bool:
        """Whether two wild samples go with each other: both wheels jumped and go on, or have another speed."""
        return all(
            wheel.are_in_line(psi, before.dt, later, dt, self._tolerance)
            for wheel, psi, later in zip((self._front, self._rear), before.reached, reached, strict=True)
        )

    def _believe(self, wild: tuple['_Wild', ...], joints: JointSample) -> PhaseUpdate | None:
        """Follow samples that had to wait, and the one with which they go."""
        self._strays -= len(wild)
        return self._follow_all([*(one.joints for one in wild), joints], 'outlier')

    def _follow_all(self, samples: list[JointSample], why: Refusal) -> PhaseUpdate | None:
        """Move on by one sample after the other, and refuse those at which the wheels do not get; None for all."""
        phases: list[PhaseSample] = []
        footfalls: tuple[Footfall, ...] = ()
        for joints in samples:
            assert self._last
            if followed := self._follow(joints, (joints.stamp_ns - self._last.stamp_ns) * 1e-9):
                phases.append(followed.phase)
                footfalls += followed.footfalls
            else:
                self.refuse(why)
        return PhaseUpdate(phases[-1], footfalls, self._clock_ns, tuple(phases[:-1])) if phases else None

    def _move(self, joints: JointSample, dt: float, reached: tuple[float, float]) -> PhaseUpdate:
        """Move both wheels on to where a sample, dt seconds later, has them."""
        front, rear, tolerance = self._front, self._rear, self._tolerance
        front_psi, rear_psi = reached
        stamp_ns, front_raw, rear_raw, _, run = joints
        if not run and (front.may_step(dt) or rear.may_step(dt)):
            self._n_uncertain = True
        burst = self._cadence.burst
        front_strikes = front.advance(stamp_ns, front_raw.angle, front_psi, self._speed(front_raw), tolerance, burst)
        rear_strikes = rear.advance(stamp_ns, rear_raw.angle, rear_psi, self._speed(rear_raw), tolerance, burst)
        footfalls = self._footfalls(front_strikes, rear_strikes) if front_strikes or rear_strikes else ()
        if footfalls and self._slow_strikes is not None:
            slow = all(
                abs(wheel.pace) < 0.5 * _slowest_rolling(wheel.alpha, shape)
                for wheel, shape in ((front, self.params.front), (rear, self.params.rear))
            )
            self._slow_strikes = self._slow_strikes + len(footfalls) if slow else None
        return PhaseUpdate(self._take(joints), footfalls, self._clock_ns)

    def _take(self, joints: JointSample) -> PhaseSample:
        """The phase where the wheels are now: φ from ψ alone (contract §1)."""
        self._accepted += 1
        self._last = joints
        self._recent.append(joints)
        self._refusal = None
        if self._held:
            self._held = []
        front, rear = self._front, self._rear
        pitch = phi_pitch(front, rear)
        phi = phase(front, rear, front.psi, rear.psi) * pitch
        phi_rate = steps_ahead(front, rear, front.rate, rear.rate) * pitch
        return PhaseSample(
            joints.stamp_ns + self._clock_ns,
            Turn(front.theta, front.rate),
            Turn(rear.theta, rear.rate),
            Turn(phi, phi_rate),
            front.steps - rear.steps,
            self._restarts,
            front.steps,
            rear.steps,
            resolution=self._resolution,
        )

    def _hold(self, joints: JointSample, why: Refusal, arrival_ns: int) -> PhaseUpdate | None:
        """Refuse a sample for now; go on from it, or start anew, where enough of them agree."""
        self.refuse(why)
        self._wild = ()
        held = self._held
        if held:
            latest = held[-1].joints
            if self._moves_too_fast(latest, joints):
                self._too_fast += 1
            if not self._agree(latest, joints):
                held.clear()
        held.append(_Held(joints, why, arrival_ns))
        if len(held) < self.params.restart_samples or not self._has_turned(held):
            return None
        if held[0].why == 'outlier':
            return self._restart(held, 'rotation')
        passed = self._passed(held[0].joints)
        if self._go_on(held, passed):
            return self._bridge(held, passed)
        return self._adopt(held) if held[0].why == 'future' else self._restart(held, 'stamp')

    def _go_on(self, held: list['_Held'], passed: float) -> bool:
        """Whether these samples go on from the last one as if no more time had passed [s]."""
        first, latest = held[0].joints, held[-1].joints
        if not passed or not self._goes_on(first, passed):
            return False
        if held[0].why == 'reversed' and (self._front.wraps or self._rear.wraps):  # whole turns do not show
            return False
        span = (latest.stamp_ns - first.stamp_ns) * 1e-9
        return all(
            abs(math.remainder(there.angle - here.angle, math.tau) / span - wheel.pace) <= 0.75 * abs(wheel.pace)
            for wheel, here, there in ((self._front, first.front, latest.front), (self._rear, first.rear, latest.rear))
        )

    def _has_turned(self, held: list['_Held']) -> bool:
        """Whether samples by a clock that may have been set span enough time to tell whether the wheels still turn."""
        if held[0].why == 'outlier' or not self._goes_on(held[0].joints, self._passed(held[0].joints)):
            return True
        span = (held[-1].joints.stamp_ns - held[0].joints.stamp_ns) * 1e-9
        slowest = min(abs(self._front.pace), abs(self._rear.pace))
        return slowest < MOVING or slowest * span >= 4.0 * self._tolerance.hysteresis

    def _bridge(self, held: list['_Held'], passed: float) -> PhaseUpdate | None:
        """Go on from samples by a clock that was set, of which the first came so much after the last before it [s]."""
        assert self._last
        first_ns = held[0].joints.stamp_ns
        step_ns = first_ns - self._last.stamp_ns - round(passed * 1e9)
        self._clock_steps.append(ClockStep(first_ns + self._clock_ns, step_ns * 1e-9))
        self._clock_ns += step_ns
        return self._adopt(
            [one._replace(joints=one.joints._replace(stamp_ns=one.joints.stamp_ns - step_ns)) for one in held]
        )

    def _adopt(self, held: list['_Held']) -> PhaseUpdate | None:
        """Follow samples that were held back."""
        self._unrefuse(held)
        for one in held:
            self._cadence.tick(one.joints.stamp_ns)
        self._arrived_ns = held[-1].arrival_ns
        return self._follow_all([one.joints for one in held], held[0].why)

    def _unrefuse(self, held: list['_Held']) -> None:
        for one in held:
            self._refused[one.why] -= 1

    def _restart(self, held: list['_Held'], cause: Cause) -> PhaseUpdate:
        last, first, clock_ns = self._last, held[0].joints, self._clock_ns
        assert last
        self._restarted.append(
            Restart(
                first.stamp_ns + clock_ns,
                cause,
                (first.stamp_ns - last.stamp_ns) * 1e-9,
                first.front.angle - last.front.angle,
                first.rear.angle - last.rear.angle,
            )
        )
        if cause != 'announced':
            self._unrefuse(held)
        self._rolled_before += self._front.rollovers + self._rear.rollovers
        self.reset()
        self._restarts += 1
        samples = [one.joints._replace(stamp_ns=one.joints.stamp_ns + clock_ns) for one in held]
        self._arrived_ns = held[-1].arrival_ns
        self._cadence.jump(samples[-1].stamp_ns)
        start = self._start(samples[0])
        rest = self._follow_all(samples[1:], 'outlier')
        return rest._replace(held=(start.phase, *rest.held)) if rest else start

    def _moves_too_fast(self, earlier: JointSample, later: JointSample) -> bool:
        """Whether a wheel seems to turn as fast as it would if degrees were taken for radians."""
        dt = (later.stamp_ns - earlier.stamp_ns) * 1e-9
        if self.params.unit != 'rad' or dt <= 0.0:
            return False
        return any(
            self.params.max_speed < abs(there.angle - here.angle) / dt <= _fastest_rolling(shape) / UNITS['deg']
            for shape, here, there in (
                (self.params.front, earlier.front, later.front),
                (self.params.rear, earlier.rear, later.rear),
            )
        )

    def _agree(self, earlier: JointSample, later: JointSample) -> bool:
        """Whether wheels can turn from one sample to the other."""
        reach = self.params.max_speed * (later.stamp_ns - earlier.stamp_ns) * 1e-9 + 4.0 * self._tolerance.hysteresis
        return later.stamp_ns > earlier.stamp_ns and _distance(earlier, later) <= reach

    def _apart(self, one: JointSample, other: JointSample) -> float:
        """How far apart two samples are: the wheel that differs most, whole turns aside where it is known to wrap."""
        return max(
            abs(math.remainder(here.angle - there.angle, math.tau) if wheel.wraps else here.angle - there.angle)
            for wheel, here, there in ((self._front, one.front, other.front), (self._rear, one.rear, other.rear))
        )

    def _speed(self, turn: Turn) -> float:
        """The source's own speed, where it gives one that a wheel can have."""
        rate, limit = turn.rate, self._tolerance.max_speed
        return rate if -limit <= rate <= limit else math.nan

    def _footfalls(self, front: list[Strike], rear: list[Strike]) -> tuple[Footfall, ...]:
        rig = self.params
        S0 = default_stance_distance(rig.S0, rig.front.length)  # before the strike with which a trial starts
        clock_ns = self._clock_ns
        falls = [
            Footfall(FRONT, stamp_ns + clock_ns, S0 + (n1 + 1) * rig.front.step_length, n1) for stamp_ns, n1 in front
        ]
        falls += [Footfall(REAR, stamp_ns + clock_ns, n2 * rig.rear.step_length, n2) for stamp_ns, n2 in rear]
        return tuple(sorted(falls, key=lambda fall: fall.stamp_ns))


class _Wild(NamedTuple):
    """A sample that is passed over unless the next ones go with it."""

    joints: JointSample
    dt: float
    """Time since the last sample that was taken [s]."""
    reached: tuple[float, float]
    """The rotations ψ that it means [rad]."""
    in_row: int
    """How many came one after the other."""


class _Held(NamedTuple):
    """A sample that is refused unless others agree with it."""

    joints: JointSample
    why: Refusal
    arrival_ns: int


def _scaled(turn: Turn, scale: float) -> Turn:
    return Turn(turn.angle * scale, turn.rate * scale)


def _fastest_rolling(shape: WheelShape) -> float:
    """Twice the speed at which a wheel would leave the ground, ω² ℓ = g: none that rolls is faster [rad/s]."""
    return 2.0 * math.sqrt(RigParams().gravity / shape.length)


def _slowest_rolling(alpha: float, shape: WheelShape) -> float:
    """The speed after a strike of a wheel that just passes its apex: a slower one does not roll by itself [rad/s].

    ω² ℓ = 2 g (1 − cos α) before the strike, which keeps cos 2α of it.
    """
    return math.cos(2.0 * alpha) * math.sqrt(2.0 * RigParams().gravity / shape.length * (1.0 - math.cos(alpha)))


def _distance(one: JointSample, other: JointSample) -> float:
    """How far apart two samples are, whole turns aside: the wheel that differs most [rad]."""
    front = math.remainder(one.front.angle - other.front.angle, math.tau)
    rear = math.remainder(one.rear.angle - other.rear.angle, math.tau)
    return max(abs(front), abs(rear))
