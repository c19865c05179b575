"""The simulated rig as a source of joint samples: what the node `simulator` publishes, without ROS and clock."""

import math
import random
from typing import Annotated, NamedTuple

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import CouplerSample, JointSample, Turn
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.start import Start, start
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.rig.person import SERVO_SECONDS, Person, PersonParams

FROM_PHASE = 'from initial_phase_percent'


class SimulatorParams(NamedTuple):
    """How the simulated rig starts, samples and errs."""

    rate: Annotated[float, Quantity('joint states per second', 'Hz', above=0.0, high=10_000.0, live=True)] = 1000.0
    real_time_factor: Annotated[
        float, Quantity('simulated seconds per second; 0: as fast as possible', low=0.0, high=1000.0, live=True)
    ] = 1.0
    publish_clock: Annotated[bool, Quantity('publish simulated time on /clock, and stamp by it')] = False
    paused: Annotated[bool, Quantity('start paused: the wheels are held until ~/pause lets them go')] = False
    initial_phase_percent: Annotated[
        float, Quantity('phase at the start, front wheel just after a strike', '% of a step', low=0.0, high=99.999)
    ] = 21.6
    theta1: Annotated[
        float, Quantity('front stance angle at the start', 'rad', -math.pi / 2, math.pi / 2, derived=FROM_PHASE)
    ] = math.nan
    omega1: Annotated[float, Quantity('front speed at the start', 'rad/s', -100.0, 100.0, derived=FROM_PHASE)] = (
        math.nan
    )
    theta2: Annotated[
        float, Quantity('rear stance angle at the start', 'rad', -math.pi / 2, math.pi / 2, derived=FROM_PHASE)
    ] = math.nan
    omega2: Annotated[float, Quantity('rear speed at the start', 'rad/s', -100.0, 100.0, derived=FROM_PHASE)] = math.nan
    noise_deg: Annotated[
        float, Quantity('noise of the encoders, one standard deviation', '°', low=0.0, high=90.0, live=True)
    ] = 0.0
    drop_percent: Annotated[float, Quantity('samples lost at random', '%', low=0.0, high=100.0, live=True)] = 0.0
    seed: Annotated[int, Quantity('of noise and losses', low=0)] = 0
    command_timeout: Annotated[
        float, Quantity('a command older than this counts as 0', 's', above=0.0, high=60.0, live=True)
    ] = 0.04
    person: PersonParams = PersonParams()

    def check_pace(self) -> None:
        """Refuse a pace that leaves the clock behind.

        Raises:
            ValueError: stamps would not keep to the clock that everybody else goes by.

        """
        if self.real_time_factor != 1.0 and not self.publish_clock:
            raise ValueError(
                f'real_time_factor {self.real_time_factor:g} needs publish_clock: true, and '
                'use_sim_time: true in the other nodes: their clock must keep the same pace'
            )

    def start(self, rig: RigParams) -> Start:
        """The start as given, and from the initial phase where not; where all is given, the feet are S0 apart.

        Raises:
            ValueError: the slope is too gentle for the speeds that the initial phase asks for.

        """
        given = (self.theta1, self.omega1, self.theta2, self.omega2)
        if not any(map(math.isnan, given)):
            return Start(rig.resolved(), State(*given))
        rig, derived = start(rig, self.initial_phase_percent / 100.0)
        return Start(rig, State(*(d if math.isnan(g) else g for g, d in zip(given, derived, strict=True))))


class SimulatedRig:
    """A rig in simulation, read at times of the caller's choice.

    Raises:
        ValueError: the rig, its start or the person's walk is impossible.

    """

    def __init__(self, rig: RigParams, params: SimulatorParams) -> None:
        self.params = params
        self._rig = rig
        self._random = random.Random(params.seed)
        self.reset()

    def reset(self) -> None:
        """Put the wheels back to the start; time is 0 again."""
        params = self.params
        rig, state = params.start(self._rig)
        self.simulation = Simulation(rig, state)
        self.person = Person(params.person, rig, float(state.theta1), params.seed) if params.person.walks else None
        self._servo_ticks = 0

    def configure(self, rig: RigParams) -> None:
        """Take a changed coupler or slope from now on.

        Raises:
            ValueError: the rig is impossible.

        """
        self.simulation.rig = rig
        self._rig = rig

    @property
    def rear_torque(self) -> float:
        """Torque on the rear hub, positive where it rolls it downhill [N·m]; held until it is changed."""
        return self.simulation.torques[1]

    @rear_torque.setter
    def rear_torque(self, torque: float) -> None:
        self.simulation.torques = self.simulation.torques[0], torque

    def read(self, t: float, stamp_ns: int, held: bool = False) -> JointSample | None:
        """The joints at a time t [s], not before the last one; None where the sample is lost.

        Args:
            t: simulated time [s].
            stamp_ns: the sample's stamp.
            held: the wheels are held where they are, at rest.

        Raises:
            MotionError: the hubs met on the way, or the motion is too fast to follow.

        """
        if not held:
            self._walk_to(t)
        params, motion = self.params, self.simulation.advance_to(t)
        if params.drop_percent and self._random.random() * 100.0 < params.drop_percent:
            return None
        noise = math.radians(params.noise_deg)
        rotation1, rotation2 = motion.rotation1, motion.rotation2
        if noise:
            rotation1 += self._random.gauss(0.0, noise)
            rotation2 += self._random.gauss(0.0, noise)
        if held:
            rig = self.simulation.rig
            force = rig.k * (motion.length - rig.D0)
            return JointSample(
                stamp_ns, Turn(rotation1, 0.0), Turn(rotation2, 0.0), CouplerSample(motion.length, 0.0, force)
            )
        return JointSample(
            stamp_ns,
            Turn(rotation1, motion.omega1),
            Turn(rotation2, motion.omega2),
            CouplerSample(motion.length, motion.rate, motion.force),
        )

    def prepare(self, t: float) -> None:
        """Do now the costly part of the way to a time [s] that is about to be read, as `Simulation.prepare`."""
        self.simulation.prepare(min(t, self._servo_ticks * SERVO_SECONDS) if self.person else t)

    def _walk_to(self, t: float) -> None:
        """Sample the person's servo whenever it is due up to a time [s]."""
        while self.person and (due := self._servo_ticks * SERVO_SECONDS) <= t:
            motion = self.simulation.advance_to(due)
            torque = self.person.torque(due, motion.rotation1, motion.omega1)
            self.simulation.torques = torque, self.rear_torque
            self._servo_ticks += 1


class Timeline:
    """Which samples are due: the pace of simulated time against a clock, and the times at which to sample.

    Two times run along it: the stamp's, which always goes on, and the rig's, which stands while the rig is held.
    """

    def __init__(self, rate: float, factor: float, now: float) -> None:
        self._factor = factor
        self._anchor = now, 0.0
        self._rate = rate
        self._first, self._index = 0.0, 0
        self._held_for = self._least = 0.0

    @property
    def due(self) -> float:
        """Stamp time of the next sample, since the start [s]."""
        return self._first + self._index / self._rate

    @property
    def rig_time(self) -> float:
        """Rig time of the next sample [s]: never before that of the last one, by rounding neither."""
        return max(self.due - self._held_for, self._least)

    def reached(self, now: float) -> float:
        """Stamp time that the pace has reached at a clock's reading [s]; infinite as fast as possible."""
        start, time = self._anchor
        return time + (now - start) * self._factor if self._factor > 0.0 else math.inf

    def step(self, held: bool) -> None:
        """Go on to the next sample; a held rig does not age."""
        due, self._least = self.due, self.rig_time
        self._index += 1
        if held:
            self._held_for += self.due - due

    def configure(self, rate: float, factor: float, now: float) -> None:
        """Go on from here at another rate or pace."""
        if rate != self._rate:
            self._first, self._index, self._rate = self.due, 0, rate
        if factor != self._factor:
            self._anchor, self._factor = (now, min(self.reached(now), self.due)), factor

    def restart_clock(self, now: float) -> None:
        """Go on from here after the clock stood still or jumped."""
        self._anchor = now, self.due
