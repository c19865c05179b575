"""A run from start to end, and its dense output."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_msgs_py.rolling import rotation
from dcdrw_sim.model.dynamics import State, coupler, coupler_force, stance_distance
from dcdrw_sim.motion.ends import BACKWARD, NONE, STALL_TIME, End, HubsMetError, Strike
from dcdrw_sim.motion.pair import Segment, Simulation

WHEELS = (FRONT, REAR)

Column = NDArray[np.float64]


class Trajectory(NamedTuple):
    """The motion at chosen times, each column of the same shape (N,)."""

    time: Column
    """[s]"""
    theta1: Column
    """[rad]"""
    omega1: Column
    """[rad/s]"""
    theta2: Column
    omega2: Column
    rotation1: Column
    """ψ1 [rad]."""
    rotation2: Column
    steps1: Column
    """n1."""
    steps2: Column
    coupler_length: Column
    """D [m]."""
    coupler_rate: Column
    """Ḋ [m/s]."""
    coupler_force: Column
    """F [N]."""


class Run(NamedTuple):
    """One run: its strikes, its motion in polynomials, and why it ended."""

    rig: RigParams
    strikes: list[Strike]
    segments: list[Segment]
    """Without gaps from 0 to the end; at least one, but where the hubs met at once."""
    end: End
    wheel: int = 0
    """The wheel that stands, was pushed over or hangs: 1 the front, 2 the rear; 0 where no wheel is to blame."""

    @property
    def duration(self) -> float:
        """Time at the end [s]."""
        return self.segments[-1].end if self.segments else 0.0

    @property
    def reason(self) -> str:
        """Why it ended, in words that name the wheel."""
        return self.end.meaning.replace('a wheel', f'the {WHEELS[self.wheel - 1]} wheel', 1 if self.wheel else 0)

    def at(self, times: ArrayLike) -> Trajectory:
        """The motion at the given times [s], ascending or not; at a strike, the state after it.

        Raises:
            ValueError: a time outside the run.

        """
        t: Column = np.atleast_1d(np.asarray(times, float))
        if not np.all((t >= 0.0) & (t <= self.duration)):
            raise ValueError(f'times must lie in [0, {self.duration:g}] s, got {t.min():g} to {t.max():g}')
        which = np.searchsorted([segment.start for segment in self.segments], t, side='right') - 1
        motion, steps = np.empty((4, t.size)), np.empty((2, t.size))
        for index in np.unique(which):
            inside = which == index
            motion[:, inside] = self.segments[index].at(t[inside])
            steps[:, inside] = np.reshape(self.segments[index].steps, (2, 1))
        state, (steps1, steps2) = State(*motion), steps
        spring = coupler(self.rig, state, stance_distance(self.rig, steps1, steps2))
        columns = (
            t,
            *state,
            rotation(self.rig.front.alpha, steps1, state.theta1),
            rotation(self.rig.rear.alpha, steps2, state.theta2),
            steps1,
            steps2,
            spring.length,
            spring.rate,
            coupler_force(self.rig, spring.length, spring.rate),
        )
        return Trajectory(*map(np.asarray, columns))


def run(
    rig: RigParams, state: State, seconds: float = math.inf, strikes: float = math.inf, external_force: float = 0.0
) -> Run:
    """Run a pair until a time, a number of strikes, or an end of its own (`End`), whichever is first.

    A constant `external_force` [N] adds to the coupler's, positive in tension.

    Raises:
        ValueError: impossible parameters or state, or no sensible limit.
        MotionError: the motion is too fast to follow.

    """
    if not seconds >= 0.0 or not strikes >= 1 or (math.isinf(seconds) and math.isinf(strikes)):
        raise ValueError(f'a run needs a limit, seconds ≥ 0 or strikes ≥ 1; got seconds {seconds}, strikes {strikes}')
    simulation = Simulation(rig, state)
    simulation.external_force = external_force
    rig = simulation.rig
    patience = STALL_TIME * math.sqrt(max(rig.front.length, rig.rear.length) / rig.gravity)
    result = Run(rig, [], [], End.TIME)
    last_direction = [NONE, NONE]
    while True:
        if any(simulation.standing):
            return result._replace(end=End.STANDING, wheel=1 + simulation.standing.index(True))
        if len(result.strikes) >= strikes:
            return result._replace(end=End.STRIKES)
        try:
            segment, strike = simulation.step()
        except HubsMetError:
            return result._replace(end=End.HUBS_MET)
        if segment.end > seconds:
            result.segments.append(segment._replace(end=seconds))
            return result
        result.segments.append(segment)
        if strike:
            result.strikes.append(strike)
            before, last_direction[strike.wheel - 1] = last_direction[strike.wheel - 1], strike.direction
            if strike.direction == before == BACKWARD:
                return result._replace(end=End.FALLEN, wheel=strike.wheel)
        oldest = min(simulation.last_strike)
        if simulation.time - oldest > patience:
            return result._replace(end=End.STALLED, wheel=1 + simulation.last_strike.index(oldest))
