"""One pair of wheels in time: Taylor series from strike to strike, standing wheels held until they are pushed over."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams, WheelParams
from dcdrw_msgs_py.rolling import rotation
from dcdrw_msgs_py.values import Real
from dcdrw_sim.model.dynamics import (
    NO_TORQUES,
    State,
    coupler,
    coupler_force,
    hub_distance,
    reset,
    stance_distance,
    tipping,
)
from dcdrw_sim.model.wheel import kept
from dcdrw_sim.motion import taylor
from dcdrw_sim.motion.ends import (
    LEAST_TIME,
    LEAVING_SPEED,
    LONGEST_STEP,
    MANY_STEPS,
    MIN_COUPLER_LENGTH,
    NONE,
    SHORTEST_STEP,
    STANDING_SPEED,
    End,
    HubsMetError,
    MotionError,
    Strike,
    accept,
)
from dcdrw_sim.motion.events import crossing, first_strike
from dcdrw_sim.motion.taylor import LANES, ORDER

PAIR_TOLERANCE = 1e-16
"""Last term of the angles' series at the end of a step [rad]."""

_THETA = (taylor.THETA1, taylor.THETA2)
_OMEGA = (taylor.OMEGA1, taylor.OMEGA2)
_FREE = (taylor.FREE1, taylor.FREE2)


class Segment(NamedTuple):
    """The motion from one step to the next, as polynomials in the time since `start`."""

    start: float
    """[s]"""
    end: float
    """[s]"""
    theta1: NDArray[np.float64]
    """Coefficients of θ1, lowest first, shape (ORDER + 1,)."""
    theta2: NDArray[np.float64]
    steps: tuple[int, int]
    """n1, n2 throughout the segment."""

    def at(self, times: Real) -> State:
        """The state at a time or an array of times [s]."""
        t = np.asarray(times) - self.start
        return State(
            *(
                np.asarray(polynomial.polyval(t, series), float)
                for theta in (self.theta1, self.theta2)
                for series in (theta, polynomial.polyder(theta))
            )
        )


class Motion(NamedTuple):
    """What sensors on the rig would read at one instant, and the strikes since the last reading."""

    time: float
    """[s]"""
    rotation1: float
    """ψ1 [rad]"""
    omega1: float
    """[rad/s]"""
    rotation2: float
    omega2: float
    length: float
    """D [m]"""
    rate: float
    """Ḋ [m/s]"""
    force: float
    """F with the external force [N], positive in tension."""
    strikes: tuple[Strike, ...]


class _Ahead(NamedTuple):
    """Where the series in use ends: at a strike of wheel 1 or 2, or for another reason (0)."""

    end: float
    wheel: int
    direction: int
    state: State


class Simulation:
    """A pair of wheels in time: `step` from series to series, or `advance_to` times of one's own choice.

    Both give the same motion, and may be mixed. The rig, the external force and the torques may change at any
    time; the change holds from the present time on.

    Args:
        rig: the rig; derived defaults are filled in.
        state: angles within ±α_i, and speeds, at time 0.

    Raises:
        ValueError: impossible parameters or state.
        HubsMetError: the coupler has no length, at the start or on the way.
        MotionError: the motion is too fast to follow.

    """

    def __init__(self, rig: RigParams, state: State) -> None:
        self._rig = accept(rig)
        self._wheels: tuple[WheelParams, WheelParams] = (self._rig.front, self._rig.rear)
        for name, value in zip(State._fields, state, strict=True):
            if not math.isfinite(value):
                raise ValueError(f'{name} of the start must be finite, got {value}')
        theta1, omega1, theta2, omega2 = map(float, state)
        for name, theta, wheel in (('theta1', theta1, self._rig.front), ('theta2', theta2, self._rig.rear)):
            if abs(theta) > wheel.alpha * (1 + 1e-12):
                raise ValueError(f'{name} of the start must be within ±α = ±{wheel.alpha:.6g} rad, got {theta:g}')
        self.time = 0.0
        """Now [s]."""
        self.steps = [0, 0]
        """n1, n2."""
        self.standing = [False, False]
        """Whether the front and the rear wheel stand still on two spokes."""
        self.last_strike = [0.0, 0.0]
        """When each wheel struck or was let go last [s]."""
        self._force, self._torques = 0.0, NO_TORQUES
        self._series_start = 0.0
        self._ahead: _Ahead | None = None
        self._untold: list[Strike] = []
        self._steps_taken, self._checked = 0, 0.0
        self._work = [0.0] * taylor.END
        self._write_state(state)
        self._write_parameters()
        self._require_length()
        for i, (theta, omega) in enumerate(((theta1, omega1), (theta2, omega2))):
            if omega == 0.0 and abs(theta) >= self._wheels[i].alpha:
                self._rest(i)

    @property
    def rig(self) -> RigParams:
        """The rig as it is now; assign a changed one to go on with it.

        Lengths, masses and spokes of the wheels, and S0, stay as they were.
        .
        """
        return self._rig

    @rig.setter
    def rig(self, rig: RigParams) -> None:
        rig = check(rig).resolved()  # its D0 goes by its own S0
        front, rear = (
            now._replace(gyration=wheel.gyration, restitution=wheel.restitution)
            for now, wheel in zip(self._wheels, (rig.front, rig.rear), strict=True)
        )
        rig = accept(rig._replace(front=front, rear=rear, S0=self._rig.S0))
        if rig != self._rig:
            self._start_anew()
            self._rig, self._wheels = rig, (rig.front, rig.rear)
            self._write_parameters()

    @property
    def external_force(self) -> float:
        """Force that acts beside the coupler's, positive in tension [N]; held until it is changed."""
        return self._force

    @external_force.setter
    def external_force(self, force: float) -> None:
        if not math.isfinite(force):
            raise ValueError(f'external_force must be finite, got {force} N')
        if force != self._force:
            self._start_anew()
            self._force = float(force)
            self._write_parameters()

    @property
    def torques(self) -> tuple[float, float]:
        """Torques on the front and the rear hub, positive where they roll it downhill [N·m]; held until changed."""
        return self._torques

    @torques.setter
    def torques(self, torques: tuple[float, float]) -> None:
        for name, torque in zip((FRONT, REAR), torques, strict=True):
            if not math.isfinite(torque):
                raise ValueError(f'the torque on the {name} hub must be finite, got {torque} N·m')
        if torques != self._torques:
            self._start_anew()
            self._torques = float(torques[0]), float(torques[1])
            self._write_parameters()

    @property
    def state(self) -> State:
        """Angles and speeds now; at a strike, after it."""
        return self._evaluate(self.time - self._series_start)

    @property
    def stance_distance(self) -> float:
        """S now [m]."""
        return self._work[taylor.S]

    @property
    def _unit(self) -> float:
        """√(ℓ/g) [s]."""
        return math.sqrt(self._rig.front.length / self._rig.gravity)

    def step(self) -> tuple[Segment, Strike | None]:
        """Go to the end of the present series: to a strike, or as far as the series reaches.

        Returns the whole segment, of which `advance_to` may have passed a part already.
        """
        ahead = self._look_ahead()
        segment = Segment(
            self._series_start,
            ahead.end,
            _coefficients(self._work, taylor.THETA1),
            _coefficients(self._work, taylor.THETA2),
            (self.steps[0], self.steps[1]),
        )
        self.time = self._series_start = ahead.end
        self._ahead = None
        self._write_state(ahead.state)
        self._steps_taken += 1
        if self._steps_taken % MANY_STEPS == 0:
            self._require_progress(self.time - self._checked >= LEAST_TIME * self._unit)
            self._checked = self.time
        if not ahead.wheel:
            return segment, None
        self._strike(ahead.wheel - 1, ahead.direction)
        return segment, Strike(ahead.wheel, ahead.end, ahead.state, ahead.direction)

    def advance_to(self, time: float) -> Motion:
        """Go to a time [s], whatever happens on the way, and read the motion there; at a strike, after it.

        Raises:
            ValueError: a time before the present one, or not finite.

        """
        if not self.time <= time < math.inf:
            raise ValueError(f'time must be finite and not before {self.time} s, got {time} s')
        self.prepare(time)
        strikes, self._untold = self._untold, []
        self.time = float(time)
        state, rig = self.state, self._rig
        spring = coupler(rig, state, self.stance_distance)
        return Motion(
            self.time,
            float(rotation(rig.front.alpha, self.steps[0], state.theta1)),
            float(state.omega1),
            float(rotation(rig.rear.alpha, self.steps[1], state.theta2)),
            float(state.omega2),
            float(spring.length),
            float(spring.rate),
            float(coupler_force(rig, spring.length, spring.rate)) + self._force,
            tuple(strikes),
        )

    def prepare(self, time: float) -> None:
        """Do now the costly part of the way to a time [s], for which `advance_to` is about to ask: the new series.

        What changes meanwhile, the rig or the force, holds from the last event on that way.
        """
        while self._look_ahead().end <= time:
            _, strike = self.step()
            if strike:
                self._untold.append(strike)

    def _look_ahead(self) -> _Ahead:
        """Expand the motion from here and find where that ends, unless it is known."""
        if self._ahead:
            return self._ahead
        self._require_length()
        for i in (0, 1):
            if self.standing[i]:
                self._rest(i)
        w = self._work
        friction = taylor.rubs(self._rig)
        taylor.expand(w, 1, friction, True if self._torques != NO_TORQUES else None)
        h = min(taylor.step_size(w, 0, PAIR_TOLERANCE), LONGEST_STEP * self._unit)
        h = self._turn_once(taylor.friction_step(w, 0, h) if friction else h)
        self._require_progress(h >= SHORTEST_STEP * self._unit)
        wheel, direction = 0, NONE
        for i in (0, 1):
            if not self.standing[i]:
                t, way = first_strike(w, _THETA[i], _OMEGA[i], 0, self._wheels[i].alpha, h)
                if way != NONE and (not wheel or t < h):
                    h, wheel, direction = t, i + 1, way
        met = self._hubs_meet(h)
        if met < h:
            h, wheel, direction = met, 0, NONE
        for i in (0, 1):
            released = self._release_time(i, h) if self.standing[i] else h
            if released < h:
                h, wheel, direction = released, 0, NONE
        state = self._evaluate(h)
        if wheel:  # exactly on its guard
            guard = direction * self._wheels[wheel - 1].alpha
            state = state._replace(theta1=guard) if wheel == 1 else state._replace(theta2=guard)
        self._ahead = _Ahead(self.time + h, wheel, direction, state)
        return self._ahead

    def _turn_once(self, h: float) -> float:
        """Shorten a step in which a wheel turns back and forth: it may touch its guard between, and leave it again."""
        for omega in _OMEGA:
            speeds = [taylor.evaluate(self._work, omega, 0, part * h) for part in (0.0, 0.25, 0.5, 0.75, 1.0)]
            turns = [j for j in range(1, 5) if speeds[j - 1] * speeds[j] < 0.0]
            if len(turns) > 1:
                h *= 0.25 * turns[0]
        return h

    def _require_progress(self, progress: bool) -> None:
        if not progress:
            raise MotionError(
                f'the motion at t = {self.time:.9g} s is too fast to follow: speeds, spokes or '
                f'external_force ({self._force:g} N) are beyond all measure'
            )

    def _hubs_meet(self, h: float) -> float:
        """When within a step the hubs meet; h where they do not. Feet on one foothold (S = 0) let D pass zero."""
        met = 0.5 * MIN_COUPLER_LENGTH * self._rig.front.length
        if taylor.evaluate(self._work, taylor.LENGTH, 0, h) > met:
            return h
        return crossing(self._work, taylor.LENGTH, 0, met, 0.0, h)

    def _require_length(self) -> None:
        length = hub_distance(self._rig, self.state, self.stance_distance)
        if not length > MIN_COUPLER_LENGTH * self._rig.front.length:
            raise HubsMetError(
                f'{End.HUBS_MET.meaning} (D = {length:.3g} m at t = {self.time:.6g} s, S = {self.stance_distance:.6g} '
                'm); start with the feet further apart (S0), or use a stiffer coupler (k, b)'
            )

    def _strike(self, i: int, direction: int) -> None:
        w, wheel = self._work, self._wheels[i]
        w[_THETA[i]], w[_OMEGA[i]] = reset(wheel.alpha, kept(wheel), w[_OMEGA[i]], direction)
        self.steps[i] += direction
        self.last_strike[i] = self.time
        if abs(w[_OMEGA[i]]) < self._speed(i, STANDING_SPEED):
            self._rest(i)
        self._write_parameters()

    def _rest(self, i: int) -> None:
        """Hold a wheel that rests on two spokes, or let it go where weight and coupler push it over one of them."""
        w, alpha = self._work, self._wheels[i].alpha
        if w[_THETA[i]] > 0.0:  # the same place, told from the forward spoke
            self.steps[i] += 1
        w[_THETA[i]], w[_OMEGA[i]] = -alpha, 0.0
        push = self._tipping(i, 0.0)
        self.standing[i] = push == 0.0
        if push != 0.0:
            self.last_strike[i] = self.time
            w[_OMEGA[i]] = math.copysign(self._speed(i, LEAVING_SPEED), push)
        if push < 0.0:  # over the spoke behind
            w[_THETA[i]] = alpha
            self.steps[i] -= 1
        self._write_parameters()

    def _tipping(self, i: int, t: float) -> float:
        return tipping(self._rig, i, self._evaluate(t), self.steps, self._force, self._torques)

    def _release_time(self, i: int, h: float) -> float:
        """When within a step a standing wheel begins to tip, by bisection; h where it does not."""
        times = (0.0, 0.25 * h, 0.5 * h, 0.75 * h, h)
        for low, high in pairwise(times):
            if self._tipping(i, high) != 0.0:
                while low < (middle := 0.5 * (low + high)) < high:
                    low, high = (low, middle) if self._tipping(i, middle) != 0.0 else (middle, high)
                return high
        return h

    def _speed(self, i: int, scaled: float) -> float:
        return scaled * math.sqrt(self._rig.gravity / self._wheels[i].length)

    def _evaluate(self, t: float) -> State:
        return State(*taylor.motion(self._work, t, t))

    def _start_anew(self) -> None:
        """Begin a new series at the present time."""
        self._write_state(self.state)
        self._series_start, self._ahead = self.time, None

    def _write_state(self, state: State) -> None:
        w = self._work
        w[taylor.THETA1], w[taylor.OMEGA1], w[taylor.THETA2], w[taylor.OMEGA2] = map(float, state)

    def _write_parameters(self) -> None:
        for row, value in taylor.work_parameters(self._rig, self._force, self._torques).items():
            self._work[row] = float(value)
        self._work[taylor.S] = float(stance_distance(self._rig, *self.steps))
        for i in (0, 1):
            self._work[_FREE[i]] = 0.0 if self.standing[i] else 1.0


def _coefficients(w: taylor.Work, series: int) -> NDArray[np.float64]:
    return np.array(w[series : series + ORDER * LANES + 1 : LANES])
