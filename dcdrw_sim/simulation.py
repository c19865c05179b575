"""One pair of wheels in time: Taylor steps between strikes, strikes located on the series, standing wheels held."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim import taylor
from dcdrw_sim.dynamics import State, accelerations, coupler, stance_distance
from dcdrw_sim.strikes import (BACKWARD, FORWARD, MIN_COUPLER_LENGTH, NONE, STALL_TIME, STANDING_SPEED, End, Strike,
                               crossing, first_strike, reset)
from dcdrw_sim.taylor import LANES, ORDER

TOLERANCE = 1e-16
"""Last term of the angles' series at the end of a step [rad]."""

_THETA = (taylor.THETA1, taylor.THETA2)
_OMEGA = (taylor.OMEGA1, taylor.OMEGA2)
_FREE = (taylor.FREE1, taylor.FREE2)


class HubsMetError(ValueError):
    """The coupler has no length, and so no direction."""


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


def work_parameters(w: taylor.Work, l: int, rig: RigParams, external_force: float = 0.0) -> None:
    """Write a rig's parameters into lane l of a work array."""
    front, rear = rig.front, rig.rear
    for row, value in (
        (taylor.G1, rig.gravity / front.length), (taylor.G2, rig.gravity / rear.length),
        (taylor.COS_SLOPE, math.cos(rig.slope)), (taylor.SIN_SLOPE, math.sin(rig.slope)),
        (taylor.L1, front.length), (taylor.L2, rear.length),
        (taylor.INV_ML1, 1.0 / (front.mass * front.length)), (taylor.INV_ML2, 1.0 / (rear.mass * rear.length)),
        (taylor.K, rig.k), (taylor.B, rig.b), (taylor.D0, rig.D0), (taylor.FORCE, external_force),
        (taylor.ALPHA1, front.alpha), (taylor.ALPHA2, rear.alpha), (taylor.FREE1, 1.0), (taylor.FREE2, 1.0),
    ):
        w[row + l] = value


class Simulation:
    """A pair of wheels that one steps in time.

    Args:
        rig: the rig; derived defaults are filled in.
        state: angles within ±α_i, and speeds, at time 0.

    Raises:
        ValueError: impossible parameters or state.
        HubsMetError: the coupler has no length, at the start or while stepping.

    """

    def __init__(self, rig: RigParams, state: State) -> None:
        self._rig = check(rig).resolved()
        self._wheels: tuple[WheelParams, WheelParams] = (self._rig.front, self._rig.rear)
        for name, value in zip(State._fields, state, strict=True):
            if not math.isfinite(value):
                raise ValueError(f'{name} of the start must be finite, got {value}')
        for name, theta, wheel in (('theta1', state.theta1, self._rig.front), ('theta2', state.theta2, self._rig.rear)):
            if abs(theta) > wheel.alpha * (1 + 1e-12):
                raise ValueError(f'{name} of the start must be within ±α = ±{wheel.alpha:.6g} rad, got {theta:g}')
        self.time = 0.0
        self.steps = [0, 0]
        self.standing = [False, False]
        self.last_strike = [0.0, 0.0]
        self._force = 0.0
        self._work = [0.0] * taylor.END
        self._set_state(state)
        self._refresh()
        self._require_length()

    @property
    def rig(self) -> RigParams:
        """The rig as it is now; assign a changed one to go on with it (wheels and S0 stay as they were)."""
        return self._rig

    @rig.setter
    def rig(self, rig: RigParams) -> None:
        rig = check(rig)._replace(front=self._rig.front, rear=self._rig.rear, S0=self._rig.S0)
        self._rig = rig.resolved()
        self._refresh()

    @property
    def external_force(self) -> float:
        """Force that acts beside the coupler's, positive in tension [N]; held until it is changed."""
        return self._force

    @external_force.setter
    def external_force(self, force: float) -> None:
        if not math.isfinite(force):
            raise ValueError(f'external_force must be finite, got {force} N')
        self._force = force
        self._refresh()

    @property
    def state(self) -> State:
        """Angles and speeds now."""
        w = self._work
        return State(w[taylor.THETA1], w[taylor.OMEGA1], w[taylor.THETA2], w[taylor.OMEGA2])

    @property
    def stance_distance(self) -> float:
        """S now [m]."""
        return float(stance_distance(self._rig, *self.steps))

    def step(self, until: float = math.inf) -> tuple[Segment, Strike | None]:
        """Advance by one series: to a strike, or as far as the series reaches, or to the time `until` [s]."""
        w = self._work
        self._hold_standing()
        taylor.expand(w, 1)
        self._require_length()
        h = taylor.step_size(w, 0, TOLERANCE)
        reaches_end = self.time + h >= until
        if reaches_end:
            h = until - self.time
        event, direction = NONE, NONE
        for i in (0, 1):
            if not self.standing[i]:
                t, d = first_strike(w, _THETA[i], _OMEGA[i], 0, self._wheels[i].alpha, h)
                if d != NONE and (event == NONE or t < h):
                    h, event, direction = t, i + 1, d
        released = self._release_time(h)
        if released < h:
            h, event = released, NONE
        end = until if reaches_end and event == NONE and released >= h else self.time + h
        segment = Segment(self.time, end, _coefficients(w, taylor.THETA1), _coefficients(w, taylor.THETA2),
                          (self.steps[0], self.steps[1]))
        state = State(*(taylor.evaluate(w, row, 0, h) for row in (_THETA[0], _OMEGA[0], _THETA[1], _OMEGA[1])))
        self.time = end
        self._set_state(state)
        if event == NONE:
            return segment, None
        self._strike(event - 1, direction)
        return segment, Strike(event, end, self._before(state, event, direction), direction)

    def advance(self, until: float) -> Iterator[tuple[Segment, Strike | None]]:
        """Step to a time, whatever happens on the way; yields each step."""
        while self.time < until:
            yield self.step(until)

    def _before(self, state: State, event: int, direction: int) -> State:
        """The state before a strike with the striking wheel exactly on its guard."""
        name = f'theta{event}'
        return state._replace(**{name: direction * self._wheels[event - 1].alpha})

    def _set_state(self, state: State) -> None:
        w = self._work
        w[taylor.THETA1], w[taylor.OMEGA1], w[taylor.THETA2], w[taylor.OMEGA2] = map(float, state)

    def _refresh(self) -> None:
        work_parameters(self._work, 0, self._rig, self._force)
        self._work[taylor.S] = self.stance_distance
        for i in (0, 1):
            self._work[_FREE[i]] = 0.0 if self.standing[i] else 1.0

    def _require_length(self) -> None:
        length = float(coupler(self._rig, self.state, self.stance_distance).length)
        if not length > MIN_COUPLER_LENGTH * self._rig.front.length:
            raise HubsMetError(
                f'{End.HUBS_MET.meaning} (D = {length:.3g} m at t = {self.time:.6g} s, S = {self.stance_distance:.6g} m); '
                'start with the feet further apart (S0), or use a stiffer coupler (k, b)')

    def _strike(self, i: int, direction: int) -> None:
        w, wheel = self._work, self._wheels[i]
        theta, omega = reset(wheel.alpha, w[_OMEGA[i]], direction)
        w[_THETA[i]], w[_OMEGA[i]] = theta, omega
        self.steps[i] += direction
        self.last_strike[i] = self.time
        if abs(omega) < STANDING_SPEED * math.sqrt(self._rig.gravity / wheel.length) and not self._tips(self.state, i):
            if direction == BACKWARD:  # the same place, told from the forward spoke
                w[_THETA[i]] = -wheel.alpha
                self.steps[i] += 1
            w[_OMEGA[i]] = 0.0
            self.standing[i] = True
        self._refresh()

    def _tips(self, state: State, i: int) -> bool:
        """Whether a wheel at rest on two spokes is pushed over one of them by weight and coupler."""
        theta, alpha = state[2 * i], self._wheels[i].alpha
        at_front = self.steps[i] + (1 if theta > 0.0 else 0)
        for spoke, sign in ((-alpha, 1), (alpha, -1)):
            steps = list(self.steps)
            steps[i] = at_front if sign > 0 else at_front - 1
            at_rest = state._replace(**{f'theta{i + 1}': spoke, f'omega{i + 1}': 0.0})
            acceleration = accelerations(self._rig, at_rest, stance_distance(self._rig, *steps), self._force)[i]
            if sign * acceleration > 0.0:
                return True
        return False

    def _hold_standing(self) -> None:
        """Let go of a standing wheel that is pushed over."""
        for i in (0, 1):
            if self.standing[i] and self._tips(self.state, i):
                self._let_go(i)

    def _let_go(self, i: int) -> None:
        alpha = self._wheels[i].alpha
        state = self.state
        forward = accelerations(self._rig, state, self.stance_distance, self._force)[i] > 0.0
        if not forward:  # over the rear spoke
            self._work[_THETA[i]] = alpha
            self.steps[i] -= 1
        self.standing[i] = False
        self.last_strike[i] = self.time
        self._refresh()

    def _release_time(self, h: float) -> float:
        """When within a step a standing wheel begins to tip, by bisection; infinite where none does."""
        first = math.inf
        for i in (0, 1):
            if self.standing[i] and self._tips(self._at(h), i):
                low, high = 0.0, h
                while high - low > 1e-12 * (1.0 + h):
                    middle = 0.5 * (low + high)
                    if self._tips(self._at(middle), i):
                        high = middle
                    else:
                        low = middle
                first = min(first, high)
        return first

    def _at(self, t: float) -> State:
        return State(*(taylor.evaluate(self._work, row, 0, t) for row in (_THETA[0], _OMEGA[0], _THETA[1], _OMEGA[1])))


def _coefficients(w: taylor.Work, series: int) -> NDArray[np.float64]:
    return np.array(w[series:series + ORDER * LANES + 1:LANES])
