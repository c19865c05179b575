"""The phase estimator: from rotations to stance angles, steps, strikes and the gait phase (contract §1).

Plain data in, plain data out: time arrives in the samples, and what is refused or missing is counted.
"""

import math
from itertools import pairwise
from typing import Annotated, Literal, NamedTuple, get_args

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, REAR, StanceDistance, WheelShape
from dcdrw_msgs_py.samples import Footfall, JointSample, PhaseSample, Turn
from dcdrw_msgs_py.topics import COUPLER, FRONT_WHEEL, REAR_WHEEL
from dcdrw_tracker.gait.cadence import Cadence, CadenceStatus
from dcdrw_tracker.gait.rotation import Rotation, Strike, Tolerance

Refusal = Literal['unreadable', 'not finite', 'repeated', 'reversed', 'future', 'outlier']
"""Why a sample is refused: the message lacks a wheel, a rotation is no number, the stamp stands still, goes back or
lies ahead of the clock, or no wheel turns that fast."""

LARGEST_ROTATION = 1e9
"""Beyond this a rotation is no measurement, and a double no longer tells a strike [rad]."""

MaxSpeed = Annotated[float, Quantity('the fastest a wheel can turn; more is an outlier', 'rad/s', above=0.0, live=True)]


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
    max_future: Annotated[float, Quantity('a stamp further ahead of the clock is refused', 's', low=0.0, live=True)] = (
        0.5
    )
    restart_samples: Annotated[
        int, Quantity('refused samples in a row that agree, and so make a restart of the source', low=2, live=True)
    ] = 5
    front_joint: Annotated[str, Quantity('name of the front wheel in joint_states')] = FRONT_WHEEL
    rear_joint: Annotated[str, Quantity('name of the rear wheel in joint_states')] = REAR_WHEEL
    coupler_joint: Annotated[str, Quantity('name of the coupler in joint_states')] = COUPLER


class PhaseUpdate(NamedTuple):
    """What one sample brought."""

    phase: PhaseSample
    footfalls: tuple[Footfall, ...]
    """Strikes since the last sample, in the order of time."""


class PhaseStatus(NamedTuple):
    """A snapshot of the estimator, for diagnostics."""

    stamp_ns: int
    """Of the last sample that was accepted; 0 where there was none."""
    accepted: int
    refused: dict[Refusal, int]
    refusal: Refusal | None
    """Why samples are refused now; None since one was accepted."""
    cadence: CadenceStatus
    restarts: int
    n_uncertain: bool
    """A gap was long enough for a step unseen: n may be off since then."""
    front_steps: int
    rear_steps: int


class PhaseEstimator:
    """Follows both wheels; one sample in, the phase out.

    A sample that no wheel can have made is refused. When `restart_samples` of them in a row agree with each other
    (a recording that loops, a simulator that was reset), the source has started anew: the estimator then counts
    from the first of these, so no strike is lost. A source that numbers its runs says itself when it starts anew, and
    that no turn is lost in between.
    """

    def __init__(self, params: PhaseParams) -> None:
        self.configure(params)
        self._cadence = Cadence()
        self._refused: dict[Refusal, int] = dict.fromkeys(get_args(Refusal), 0)
        self._refusal: Refusal | None = None
        self._accepted = 0
        self._restarts = 0
        self.reset()

    def configure(self, params: PhaseParams) -> None:
        """Take changed parameters at once; those that are not `live` hold for the rotations from the next start on."""
        self.params = params
        self._tolerance = Tolerance(math.radians(params.hysteresis_deg), params.max_speed)

    def reset(self) -> None:
        """Start afresh with the next sample (n = 0); the counts of samples stay."""
        self._last: JointSample | None = None
        self._held: list[JointSample] = []
        self._front = self._rear = Rotation(self.params.front.alpha, 0, 0.0, math.nan, self._tolerance)
        self._n_uncertain = False

    def refuse(self, why: Refusal) -> None:
        """Count a sample that is of no use; callers report what they cannot even convert (`unreadable`)."""
        self._refused[why] += 1
        self._refusal = why

    def update(self, joints: JointSample, now_ns: int = 0) -> PhaseUpdate | None:
        """Take the next sample; None where it is refused, which is counted.

        Args:
            joints: ψ [rad], unbounded or wrapped to a turn, and ψ̇ [rad/s], NaN where unknown.
            now_ns: the node's clock; 0 where it is unknown, as a simulated clock that has not started.

        """
        stamp_ns, front, rear, _, run = joints
        if not (
            -LARGEST_ROTATION <= front.angle <= LARGEST_ROTATION and -LARGEST_ROTATION <= rear.angle <= LARGEST_ROTATION
        ):
            self.refuse('not finite')
            return None
        if now_ns and stamp_ns - now_ns > self.params.max_future * 1e9:
            self.refuse('future')
            return None
        self._cadence.tick(stamp_ns)
        last = self._last
        if last is None:
            return self._start(joints)
        if run != last.run:
            return self._restart([joints])
        elapsed_ns = stamp_ns - last.stamp_ns
        if elapsed_ns > 0:
            # While outliers are held, a sample that could go on from either belongs to the nearer.
            stray = self._held[-1] if self._held and self._held[-1].stamp_ns > last.stamp_ns else None
            if stray is None or _distance(joints, last) <= _distance(joints, stray):
                update = self._follow(joints, elapsed_ns * 1e-9)
                if update:
                    return update
            self.refuse('outlier')
        elif elapsed_ns == 0 or (self._held and stamp_ns == self._held[-1].stamp_ns):
            self.refuse('repeated')
            return None
        else:
            self.refuse('reversed')
        return self._hold(joints)

    def status(self) -> PhaseStatus:
        """A snapshot."""
        return PhaseStatus(
            stamp_ns=self._last.stamp_ns if self._last else 0,
            accepted=self._accepted,
            refused=self._refused.copy(),
            refusal=self._refusal,
            cadence=self._cadence.status(),
            restarts=self._restarts,
            n_uncertain=self._n_uncertain,
            front_steps=self._front.steps,
            rear_steps=self._rear.steps,
        )

    def _start(self, joints: JointSample) -> PhaseUpdate:
        stamp_ns, front, rear = joints[:3]
        self._front = Rotation(self.params.front.alpha, stamp_ns, front.angle, self._speed(front), self._tolerance)
        self._rear = Rotation(self.params.rear.alpha, stamp_ns, rear.angle, self._speed(rear), self._tolerance)
        return PhaseUpdate(self._take(joints), ())

    def _follow(self, joints: JointSample, dt: float) -> PhaseUpdate | None:
        """Move both wheels on by a sample that is dt seconds later; None where they cannot get there."""
        front, rear, tolerance = self._front, self._rear, self._tolerance
        front_psi = front.continued(joints.front.angle, dt, tolerance)
        rear_psi = rear.continued(joints.rear.angle, dt, tolerance)
        if front_psi is None or rear_psi is None:
            return None
        stamp_ns, front_raw, rear_raw, _, run = joints
        if not run and (front.may_step(dt) or rear.may_step(dt)):
            self._n_uncertain = True
        front_strikes = front.advance(stamp_ns, front_raw.angle, front_psi, self._speed(front_raw), tolerance)
        rear_strikes = rear.advance(stamp_ns, rear_raw.angle, rear_psi, self._speed(rear_raw), tolerance)
        footfalls = self._footfalls(front_strikes, rear_strikes) if front_strikes or rear_strikes else ()
        return PhaseUpdate(self._take(joints), footfalls)

    def _take(self, joints: JointSample) -> PhaseSample:
        """The phase where the wheels are now: φ from ψ alone (contract §1)."""
        self._accepted += 1
        self._last = joints
        self._refusal = None
        if self._held:
            self._held = []
        front, rear = self._front, self._rear
        pitch = front.alpha + rear.alpha
        phi = (front.psi / front.pitch - rear.psi / rear.pitch) % 1.0 * pitch
        phi_rate = (front.rate / front.pitch - rear.rate / rear.pitch) * pitch
        return PhaseSample(
            joints.stamp_ns,
            Turn(front.theta, front.rate),
            Turn(rear.theta, rear.rate),
            Turn(phi if phi < pitch else 0.0, phi_rate),
            front.steps - rear.steps,
            self._restarts,
        )

    def _hold(self, joints: JointSample) -> PhaseUpdate | None:
        """Keep a refused sample; start anew where enough of them agree."""
        held = self._held
        if held and not self._agree(held[-1], joints):
            held.clear()
        held.append(joints)
        return self._restart(held) if len(held) >= self.params.restart_samples else None

    def _restart(self, held: list[JointSample]) -> PhaseUpdate:
        self.reset()
        self._restarts += 1
        self._cadence.jump(held[-1].stamp_ns)
        update = self._start(held[0])
        footfalls: tuple[Footfall, ...] = ()
        for last, joints in pairwise(held):
            update = self._follow(joints, (joints.stamp_ns - last.stamp_ns) * 1e-9) or update
            footfalls += update.footfalls
        return update._replace(footfalls=footfalls)

    def _agree(self, earlier: JointSample, later: JointSample) -> bool:
        """Whether wheels can turn from one sample to the other."""
        reach = self.params.max_speed * (later.stamp_ns - earlier.stamp_ns) * 1e-9 + 4.0 * self._tolerance.hysteresis
        return later.stamp_ns > earlier.stamp_ns and _distance(earlier, later) <= reach

    def _speed(self, turn: Turn) -> float:
        """The source's own speed, where it gives one that a wheel can have."""
        rate, limit = turn.rate, self._tolerance.max_speed
        return rate if -limit <= rate <= limit else math.nan

    def _footfalls(self, front: list[Strike], rear: list[Strike]) -> tuple[Footfall, ...]:
        rig = self.params
        S0 = rig.front.length if math.isnan(rig.S0) else rig.S0  # before the strike with which a trial starts
        falls = [Footfall(FRONT, stamp_ns, S0 + (n1 + 1) * rig.front.step_length, n1) for stamp_ns, n1 in front]
        falls += [Footfall(REAR, stamp_ns, n2 * rig.rear.step_length, n2) for stamp_ns, n2 in rear]
        return tuple(sorted(falls, key=lambda fall: fall.stamp_ns))


def _distance(one: JointSample, other: JointSample) -> float:
    """How far apart two samples are, whole turns aside: the wheel that differs most [rad]."""
    front = math.remainder(one.front.angle - other.front.angle, math.tau)
    rear = math.remainder(one.rear.angle - other.rear.angle, math.tau)
    return max(abs(front), abs(rear))
