"""Two rimless wheels joined by a rigid bar in the coupler's place (Smith and Berkemeier 1997).

Feet S apart and hubs a bar apart make a four-bar linkage: one degree of freedom between strikes. Bar and spokes have
no mass, and each stance foot stays where it is, whatever pulls at it. The bar is as long as the rig's D0.

At a strike the hubs keep what the new contacts allow of their velocities: the new foot, the other wheel's foot and
the bar push only along the two spokes and the bar, so the velocities are projected, weighted by mass, on the one
motion of the new linkage. It is the limit of ever stiffer springs and dampers: rule A or B first projects on what the
new foot allows, the coupler then on what a bar does, and the two projections in turn are this one.

The geometry of a strike is the same in every step, and so is the part of the kinetic energy that it leaves. Between
strikes energy is conserved: the kinetic energy after a strike follows an affine map, as that of a single wheel does.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

from dcdrw_msgs_py.quantity import check, lookup
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.dynamics import State, coupler
from dcdrw_sim.model.wheel import kinetic_energy

STEEPEST = math.pi / 4
"""Steepest slope of a rig [rad]."""
PHASE_COUNT = 41
"""Phases among which the fastest is sought first."""
NEAR_TOGETHER = 1e-6
"""Phase that stands for the limit p → 0, where the wheels strike one right after the other."""


class Impact(NamedTuple):
    """A strike, and the impulses that make it [N·s]."""

    state: State
    """Just after."""
    kept: float
    """Part of the kinetic energy that is left."""
    front_foot: float
    """Along the front spoke; negative where the foot would lift off, were it not held down."""
    rear_foot: float
    bar: float
    """Positive in tension."""


class Stance(NamedTuple):
    """The motion from one strike to the next."""

    S: float
    """Distance of the feet [m]."""
    start: tuple[float, float]
    """θ1, θ2 [rad]"""
    end: tuple[float, float]
    struck: tuple[bool, bool]
    """Whether the front and the rear wheel strike at its end."""
    kept: float
    """Part of the kinetic energy that is left by that strike."""
    drop: float
    """Energy that the slope gives [J]."""
    climb: float
    """Kinetic energy that it takes to come over the highest point [J]."""
    top: float
    """θ1 there [rad]."""


class Gait(NamedTuple):
    """A steady gait; NaN where the slope is too gentle for it."""

    energy: float
    """Kinetic energy just after a strike of the front wheel [J]."""
    period: float
    """Time of a step [s]."""
    velocity: float
    """Mean speed down the slope [m/s]."""


class RigidPair:
    """A rigid pair at one gait phase, which it never leaves.

    Args:
        rig: wheels of equal step length, D0 the length of the bar. S0 follows from the phase; k and b have no meaning.
        phase: p in [0, 1) at strikes of the front wheel: θ2 = α2 (1 − 2 p) there. At 0 both strike at once.

    Raises:
        ValueError: impossible parameters or phase, unequal step lengths, or a bar too short for these wheels.

    """

    def __init__(self, rig: RigParams, phase: float) -> None:
        rig = check(rig).resolved()
        front, rear = rig.front, rig.rear
        if not 0.0 <= phase < 1.0:
            raise ValueError(f'phase must be in [0, 1), got {phase}')
        if not math.isclose(front.step_length, rear.step_length, rel_tol=1e-9):
            raise ValueError(
                f'a rigid pair needs wheels of equal step length, got {front.step_length:.6g} m in front '
                f'and {rear.step_length:.6g} m behind'
            )
        for name in ('front.gyration', 'rear.gyration', 'front.restitution', 'rear.restitution', 'rolling_resistance'):
            if lookup(rig, name):
                raise ValueError(
                    f'a rigid pair is one of point masses that roll without loss: {name} must be 0, '
                    f'got {lookup(rig, name):g}'
                )
        self.rig, self.phase = rig, phase
        rear_angle = rear.alpha * (1.0 - 2.0 * phase)
        rise = front.length * math.cos(front.alpha) - rear.length * math.cos(rear_angle)
        run = math.sqrt(self._possible(rig.D0**2 - rise**2))
        S = run - front.length * math.sin(front.alpha) + rear.length * math.sin(rear_angle)
        self.rig = rig._replace(S0=S)
        if phase == 0.0:
            self.stances = [self._stance(S, (-front.alpha, -rear.alpha), (front.alpha, rear.alpha), (True, True))]
        else:
            S_between = S + front.step_length
            front_angle = self.front_angle(rear.alpha, S_between)
            self._possible(front.alpha - abs(front_angle))
            self.stances = [
                self._stance(S_between, (-front.alpha, rear_angle), (front_angle, rear.alpha), (False, True)),
                self._stance(S, (front_angle, -rear.alpha), (front.alpha, rear_angle), (True, False)),
            ]

    # Geometry

    def rear_angle(self, theta1: float, S: float) -> float:
        """θ2 [rad] that the bar leaves at a front angle θ1, feet S apart."""
        front, rear = self.rig.front, self.rig.rear
        return self._spoke(front.length * math.sin(theta1) + S, front.length * math.cos(theta1), rear.length, -1.0)

    def front_angle(self, theta2: float, S: float) -> float:
        """θ1 [rad] that the bar leaves at a rear angle θ2, feet S apart."""
        front, rear = self.rig.front, self.rig.rear
        return self._spoke(rear.length * math.sin(theta2) - S, rear.length * math.cos(theta2), front.length, 1.0)

    def _spoke(self, x: float, y: float, length: float, side: float) -> float:
        """Angle of a spoke, its foot at the origin, whose hub is a bar ahead of (1) or behind (−1) another at x, y."""
        distance = math.hypot(x, y)
        cosine = (distance**2 + length**2 - self.rig.D0**2) / (2.0 * length * distance)
        self._possible(1.0 - abs(cosine))
        return math.atan2(x, y) + side * math.acos(cosine)

    def _possible(self, margin: float) -> float:
        """What must not be negative for the linkage to close and to turn."""
        if not margin >= 0.0:
            raise ValueError(
                f'a bar of {self.rig.D0:.6g} m is too short: with it these wheels cannot roll at a phase '
                f'of {100.0 * self.phase:g} %; make D0 longer'
            )
        return margin

    def state(self, theta1: float, theta2: float, S: float, energy: float) -> State:
        """The state at these angles with that kinetic energy [J], rolling downhill."""
        front, rear = self.rig.front, self.rig.rear
        levers = coupler(self.rig, State(theta1, 0.0, theta2, 0.0), S)
        p1, p2 = float(levers.p1), float(levers.p2)
        self._possible(min(p1, p2))
        omega1, omega2 = rear.length * p2, front.length * p1  # Ḋ = 0: ℓ1 p1 θ̇1 = ℓ2 p2 θ̇2
        scale = math.sqrt(energy / (kinetic_energy(front, omega1) + kinetic_energy(rear, omega2)))
        return State(theta1, scale * omega1, theta2, scale * omega2)

    # Energy and strikes

    def kinetic_energy(self, state: State) -> float:
        """Kinetic energy of both wheels [J]."""
        return float(kinetic_energy(self.rig.front, state.omega1) + kinetic_energy(self.rig.rear, state.omega2))

    def potential_energy(self, theta1: float, theta2: float, S: float) -> float:
        """Weight of both hubs times their height above the rear foot [J]."""
        front, rear, slope = self.rig.front, self.rig.rear, self.rig.slope
        height1 = front.length * math.cos(theta1 + slope) - S * math.sin(slope)
        return self.rig.gravity * (front.mass * height1 + rear.mass * rear.length * math.cos(theta2 + slope))

    def impact(self, before: State, S: float, struck: tuple[bool, bool]) -> Impact:
        """The strike of the front, the rear or both wheels, from a state of the linkage with its feet S apart."""
        front, rear = self.rig.front, self.rig.rear
        S_after = S + struck[0] * front.step_length - struck[1] * rear.step_length
        allowed = self.state(
            -front.alpha if struck[0] else float(before.theta1),
            -rear.alpha if struck[1] else float(before.theta2),
            S_after,
            self.kinetic_energy(before),
        )
        mass = np.array([front.mass, front.mass, rear.mass, rear.mass])
        velocity, direction = self._velocities(before), self._velocities(allowed)
        share = float(direction @ (mass * velocity) / (direction @ (mass * direction)))
        after = allowed._replace(omega1=share * allowed.omega1, omega2=share * allowed.omega2)
        bar = self._bar(after, S_after)
        pushes = np.array(
            [
                [math.sin(after.theta1), math.cos(after.theta1), 0.0, 0.0],
                [0.0, 0.0, math.sin(after.theta2), math.cos(after.theta2)],
                [-bar[0], -bar[1], bar[0], bar[1]],
            ]
        )
        impulses = np.linalg.lstsq(pushes.T, mass * (share * direction - velocity), rcond=None)[0]
        return Impact(after, share**2, *impulses.tolist())

    def _velocities(self, state: State) -> NDArray[np.float64]:
        """Velocities of the front and the rear hub, along the slope and along its normal [m/s]."""
        v1, v2 = self.rig.front.length * state.omega1, self.rig.rear.length * state.omega2
        return np.array(
            [
                v1 * math.cos(state.theta1),
                -v1 * math.sin(state.theta1),
                v2 * math.cos(state.theta2),
                -v2 * math.sin(state.theta2),
            ]
        )

    def _bar(self, state: State, S: float) -> tuple[float, float]:
        """Its direction, from the rear hub to the front one."""
        l1, l2 = self.rig.front.length, self.rig.rear.length
        return (
            (l1 * math.sin(state.theta1) - l2 * math.sin(state.theta2) + S) / self.rig.D0,
            (l1 * math.cos(state.theta1) - l2 * math.cos(state.theta2)) / self.rig.D0,
        )

    def _stance(
        self, S: float, start: tuple[float, float], end: tuple[float, float], struck: tuple[bool, bool]
    ) -> Stance:
        def depth(theta1: float) -> float:
            return -self.potential_energy(theta1, self.rear_angle(theta1, S), S)

        top = minimize_scalar(depth, bounds=(start[0], end[0]), method='bounded', options={'xatol': 1e-9})
        kept = self.impact(self.state(*end, S, 1.0), S, struck).kept
        height = self.potential_energy(*start, S)
        return Stance(
            S,
            start,
            end,
            struck,
            kept,
            height - self.potential_energy(*end, S),
            max(-float(top.fun) - height, 0.0),
            float(top.x),
        )

    # Gait

    @property
    def multiplier(self) -> float:
        """What a step leaves of a small deviation from the steady gait: the part of the energy that strikes keep."""
        return math.prod(stance.kept for stance in self.stances)

    def next_energy(self, energy: float) -> float:
        """The step map: kinetic energy just after a strike of the front wheel [J] → after its next one.

        NaN where the pair does not come over its highest point.
        """
        for stance in self.stances:
            if not energy > stance.climb:
                return math.nan
            energy = stance.kept * (energy + stance.drop)
        return energy

    @property
    def margin(self) -> float:
        """Least kinetic energy on the steady gait [J]; negative where the slope is too gentle for it."""
        return min(energy - stance.climb for stance, energy in self._steady())

    def gait(self) -> Gait:
        """The steady gait."""
        if not self.margin > 0.0:
            return Gait(math.nan, math.nan, math.nan)
        energies = [energy for _, energy in self._steady()]
        period = sum(self._duration(stance, energy) for stance, energy in self._steady())
        return Gait(energies[0], period, self.rig.front.step_length / period)

    def impacts(self) -> list[Impact]:
        """The strikes of the steady gait, in the order of `stances`."""
        return [
            self.impact(self.state(*stance.end, stance.S, energy + stance.drop), stance.S, stance.struck)
            for stance, energy in self._steady()
        ]

    def _steady(self) -> Iterator[tuple[Stance, float]]:
        """The stances, with the kinetic energy at the start of each that returns after a step."""
        gained = 0.0
        for stance in self.stances:
            gained = stance.kept * (gained + stance.drop)
        energy = gained / (1.0 - self.multiplier)
        for stance in self.stances:
            yield stance, energy
            energy = stance.kept * (energy + stance.drop)

    def _duration(self, stance: Stance, energy: float) -> float:
        """∫ dθ1 / θ̇1 over a stance [s]."""
        total = energy + self.potential_energy(*stance.start, stance.S)

        def pace(theta1: float) -> float:
            theta2 = self.rear_angle(theta1, stance.S)
            left = total - self.potential_energy(theta1, theta2, stance.S)
            return 1.0 / float(self.state(theta1, theta2, stance.S, left).omega1)

        return float(quad(pace, stance.start[0], stance.end[0], points=[stance.top], epsabs=0.0, epsrel=1e-10)[0])


def energy_per_metre(rig: RigParams) -> float:
    """What a steady gait loses at its strikes per metre travelled: (m1 + m2) g sin γ [J/m], at any phase."""
    return (rig.front.mass + rig.rear.mass) * rig.gravity * math.sin(rig.slope)


def gentlest_slope_at_phase(rig: RigParams, phase: float) -> float:
    """The slope [rad] above which the rigid pair has a steady gait at this phase."""

    def margin(slope: float) -> float:
        return RigidPair(rig._replace(slope=slope), phase).margin

    if not margin(STEEPEST) > 0.0:
        return math.nan
    return float(brentq(margin, 0.0, STEEPEST, xtol=1e-12))


def fastest_phase(rig: RigParams) -> float:
    """The phase p in (0, 1) at which the rigid pair is fastest on this slope.

    Raises:
        ValueError: the slope is too gentle for a gait at any phase, or as `RigidPair`.

    """

    def slowness(phase: float) -> float:
        return -_velocity(rig, phase)

    phases = np.linspace(NEAR_TOGETHER, 1.0 - NEAR_TOGETHER, PHASE_COUNT)
    speeds = [_velocity(rig, phase) for phase in phases]
    best = int(np.argmax(speeds))
    if not speeds[best] > 0.0:
        raise ValueError(
            f'slope {math.degrees(rig.slope):.4g}° is too gentle for the rigid pair; make it steeper than '
            f'{math.degrees(gentlest_slope_at_phase(rig, 0.5)):.4g}°, which 50 % needs'
        )
    around = (phases[max(best - 1, 0)], phases[min(best + 1, PHASE_COUNT - 1)])
    return float(minimize_scalar(slowness, bounds=around, method='bounded', options={'xatol': 1e-7}).x)


def slope_for_velocity(rig: RigParams, phase: float, velocity: float) -> float:
    """The slope [rad] on which the rigid pair has that mean speed [m/s] at this phase.

    Raises:
        ValueError: no slope up to 45° gives that speed.

    """

    def excess(slope: float) -> float:
        return _velocity(rig._replace(slope=slope), phase) - velocity

    if not (velocity > 0.0 and excess(STEEPEST) > 0.0):
        raise ValueError(f'no slope up to 45° gives the rigid pair a speed of {velocity:g} m/s')
    return float(brentq(excess, 0.0, STEEPEST, xtol=1e-10))


def _velocity(rig: RigParams, phase: float) -> float:
    """Mean velocity of the steady gait [m/s]; 0 where there is none."""
    velocity = RigidPair(rig, phase).gait().velocity
    return 0.0 if math.isnan(velocity) else velocity
