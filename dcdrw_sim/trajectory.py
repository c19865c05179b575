"""A run from start to end, and its dense output."""

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.dynamics import State, coupler, coupler_force, stance_distance
from dcdrw_sim.simulation import HubsMetError, Segment, Simulation
from dcdrw_sim.strikes import BACKWARD, STALL_TIME, End, Strike

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
    end: End

    @property
    def duration(self) -> float:
        """Time at the end [s]."""
        return self.segments[-1].end if self.segments else 0.0

    def at(self, times: Column) -> Trajectory:
        """The motion at the given times [s], ascending or not; at a strike, the state after it.

        Raises:
            ValueError: a time outside the run.

        """
        times = np.asarray(times, float)
        if times.size and not (times.min() >= 0.0 and times.max() <= self.duration):
            raise ValueError(f'times must lie in [0, {self.duration:g}] s, got {times.min():g} to {times.max():g}')
        starts = np.array([segment.start for segment in self.segments])
        which = np.searchsorted(starts, times, side='right') - 1
        theta = np.empty((2, times.size))
        omega = np.empty_like(theta)
        steps = np.empty_like(theta)
        for index in np.unique(which):
            segment, inside = self.segments[index], which == index
            t = times[inside] - segment.start
            for i, coefficients in enumerate((segment.theta1, segment.theta2)):
                theta[i, inside] = polynomial.polyval(t, coefficients)
                omega[i, inside] = polynomial.polyval(t, polynomial.polyder(coefficients))
                steps[i, inside] = segment.steps[i]
        state = State(theta[0], omega[0], theta[1], omega[1])
        spring = coupler(self.rig, state, stance_distance(self.rig, steps[0], steps[1]))
        return Trajectory(
            times, *state,
            theta[0] + 2 * self.rig.front.alpha * steps[0], theta[1] + 2 * self.rig.rear.alpha * steps[1],
            steps[0], steps[1], spring.length, spring.rate, coupler_force(self.rig, spring.length, spring.rate))


def run(rig: RigParams, state: State, seconds: float = math.inf, strikes: float = math.inf) -> Run:
    """Run a pair until a time, a number of strikes, or an end of its own (`End`), whichever is first.

    Raises:
        ValueError: impossible parameters or state, or neither limit given.

    """
    if math.isinf(seconds) and math.isinf(strikes):
        raise ValueError('a run needs a limit: seconds or strikes')
    simulation = Simulation(rig, state)
    rig = simulation.rig
    done: list[Strike] = []
    segments: list[Segment] = []
    last_direction = [0, 0]
    stall_time = STALL_TIME * math.sqrt(max(rig.front.length, rig.rear.length) / rig.gravity)
    end = End.TIME
    while simulation.time < seconds:
        if len(done) >= strikes:
            end = End.STRIKES
            break
        try:
            segment, strike = simulation.step(seconds)
        except HubsMetError:
            end = End.HUBS_MET
            break
        segments.append(segment)
        if strike:
            done.append(strike)
            pushed_over = strike.direction == last_direction[strike.wheel - 1] == BACKWARD
            last_direction[strike.wheel - 1] = strike.direction
            if pushed_over:
                end = End.FALLEN
                break
        if any(simulation.standing):
            end = End.STANDING
            break
        if simulation.time - min(simulation.last_strike) > stall_time:
            end = End.STALLED
            break
    return Run(rig, done, segments, end)
