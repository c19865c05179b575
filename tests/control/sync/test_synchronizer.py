"""The law `hold` on the pair itself: the paper's coupler, judged at strikes and at every instant."""

import math

import hypothesis.strategies as st
import pytest
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from dcdrw.suite.hub_gains import hub_gains
from dcdrw_control.sync.hold import HoldGains
from dcdrw_control.sync.safety import State
from dcdrw_control.sync.synchronizer import Synchronizer, SynchronizerParams
from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import JointSample, PhaseSample, Turn
from dcdrw_sim.map.holding import Law, corners, eased, law, plant
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.ends import End
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.motion.trajectory import run
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams

PAPER = preset('paper')
ALPHA = PAPER.front.alpha
RATE = 500.0


def params_for(rig: RigParams, name: str = 'hold') -> SynchronizerParams:
    return SynchronizerParams(law=name, hold=gains_of(law(plant(rig))))


def gains_of(found: Law) -> HoldGains:
    state, gain = (tuple(map(float, values)) for values in (found.state, found.gain))
    return HoldGains(state, gain, found.force, found.gain_before, found.middle)


HOLD = params_for(PAPER)


def walk(rig: RigParams, params: SynchronizerParams, phase: float, seconds: float, core: Synchronizer | None = None):
    """Let a synchronizer act on the pair: (strikes of the front wheel, 100 (p − 0.5), force, Ḋ, state) per sample."""
    begun = start(rig, phase)
    pair, estimator, core = Simulation(*begun), PhaseEstimator(PhaseParams()), core or Synchronizer(params)
    strikes = 0
    for tick in range(round(seconds * RATE)):
        t = tick / RATE
        motion = pair.advance_to(t)
        strikes += sum(strike.wheel == 1 for strike in motion.strikes)
        joints = JointSample(
            round(t * 1e9) + 1, Turn(motion.rotation1, motion.omega1), Turn(motion.rotation2, motion.omega2)
        )
        core.update(estimator.update(joints).phase, t)
        core.enable(t, True)
        command = core.command(t)
        turned1, turned2 = motion.rotation1 / (2 * rig.front.alpha), motion.rotation2 / (2 * rig.rear.alpha)
        yield strikes, 100.0 * ((turned1 - turned2) % 1.0 - 0.5), pair.external_force, motion.rate, command.state
        if command.force != pair.external_force:
            pair.external_force = command.force


def steps(rows) -> int:
    return max((strikes + 1 for strikes, error, *_ in rows if abs(error) > 6.0), default=0)


@pytest.mark.parametrize('percent', [10, 30, 70, 90])
def test_hold_brings_the_papers_pair_into_step_within_three_steps_with_little_work(percent):
    rows = list(walk(PAPER, HOLD, percent / 100.0, 10.0))
    assert steps(rows) <= 3
    assert max(abs(force) for _, _, force, _, _ in rows) <= HOLD.limits.max_force
    work = [abs(force * rate) / RATE for _, _, force, rate, _ in rows]
    assert sum(work[: round(5.0 * RATE)]) <= 5.0
    assert sum(work[round(5.0 * RATE) :]) / 5.0 <= 0.05


def test_on_its_limit_cycle_the_pair_needs_no_force():
    rows = list(walk(PAPER, HOLD, 0.48, 25.0))
    assert max(abs(force) for _, _, force, _, _ in rows[-round(5.0 * RATE) :]) < 0.1


@pytest.mark.parametrize(('corner', 'percent'), [(4, 10), (5, 50), (5, 70), (1, 70), (2, 90)])
def test_a_rig_that_is_not_the_one_that_was_told_comes_into_step_all_the_same(corner, percent):
    """Masses, b and k each 30 % less or more: its swing lies about 50 % elsewhere, and the aim goes there."""
    rig = corners(PAPER.resolved(), 0.3)[corner]
    about = plant(PAPER)
    params = SynchronizerParams(law='hold', hold=gains_of(eased(law(about), about)))
    rows = list(walk(rig, params, percent / 100.0, 15.0))
    assert steps(rows) <= (0 if percent == 50 else 5)
    assert max(abs(force) for _, _, force, _, _ in rows[-round(3.0 * RATE) :]) < 0.2


def test_with_law_off_it_stays_armed_and_commands_nothing():
    rows = list(walk(PAPER, params_for(PAPER, 'off'), 0.2, 3.0))
    assert {force for _, _, force, _, _ in rows} == {0.0}
    assert {state for *_, state in rows} == {State.ARMED}


@pytest.mark.parametrize('name', ['hold', 'rear'])
def test_wheels_that_are_held_are_not_pushed_and_have_not_stalled(name):
    params = HOLD._replace(law=name, hub=hub_gains(PAPER.resolved()))
    core, estimator = Synchronizer(params), PhaseEstimator(PhaseParams())
    for tick in range(round(5.0 * RATE)):
        t = tick / RATE
        core.update(estimator.update(JointSample(round(t * 1e9) + 1, Turn(0.1, 0.0), Turn(0.2, 0.0))).phase, t)
        core.enable(t, True)
        command = core.command(t)
        assert (command.force, command.torque) == (0.0, 0.0)
    assert command.state is State.ARMED


def pushing() -> tuple[Synchronizer, PhaseSample, float]:
    """A synchronizer that pushes, with its last sample and time."""
    core = Synchronizer(HOLD)
    for *_, force, _, state in walk(PAPER, HOLD, 0.2, 1.2, core):
        last = force, state
    assert last[1] is State.ACTIVE
    assert last[0] != 0.0
    assert core._last is not None
    return core, core._last, 1.2


@pytest.mark.parametrize(
    ('change', 'fault'),
    [
        ({'front': Turn(math.nan, 1.0)}, 'not finite'),
        ({'rear': Turn(0.1, math.inf)}, 'not finite'),
        ({'restarts': 1}, 'new run'),
        ({'step_difference': 2}, 'slipped'),
        ({'stamp_ns': 5}, 'clock'),
    ],
)
def test_each_bad_sample_has_its_fault_and_ends_the_force_at_once(change, fault):
    core, sample, now = pushing()
    core.update(sample._replace(**{'stamp_ns': sample.stamp_ns + 1_000_000, **change}), now)
    command = core.command(now)
    assert (command.force, command.state, core.safety.reason) == (0.0, State.FAULT, fault)


def test_silence_is_a_fault_within_100_ms_and_a_wheel_without_strikes_is_one():
    core, _, now = pushing()
    for tick in range(1, 51):
        core.enable(now + 0.002 * tick, True)
        command = core.command(now + 0.002 * tick)
    assert (command.force, core.safety.reason) == (0.0, 'stale')
    core, sample, now = pushing()
    for tick in range(1200):
        now += 0.002
        core.update(sample._replace(stamp_ns=sample.stamp_ns + (tick + 1) * 2_000_000), now)
        core.enable(now, True)
        command = core.command(now)
    assert (command.force, core.safety.reason) == (0.0, 'stalled')


def test_a_process_that_could_not_run_reads_what_waited_before_it_judges():
    """So does one on a machine that paused as a whole, whose input has yet to go on."""
    core, sample, now = pushing()
    for late in (0.3, 0.302, 0.32):
        core.enable(now + late, True)
        assert core.command(now + late).force == 0.0
    core.update(sample._replace(stamp_ns=sample.stamp_ns + 300_000_000), now + 0.32)
    forces = [core.command(now + 0.32 + 0.002 * tick).force for tick in range(1, 6)]
    assert core.safety.state is State.ACTIVE
    assert [abs(force) for force in forces] == sorted(abs(force) for force in forces)
    assert abs(forces[0]) <= HOLD.limits.max_slew * 0.002 * (1 + 1e-9)


def test_an_input_that_falls_silent_ends_the_ramp_at_once():
    core, _, now = pushing()
    core.safety.stop()
    assert core.command(now + 0.002).force != 0.0
    command = core.command(now + 0.08)
    assert (command.force, core.safety.state) == (0.0, State.DISABLED)


def test_a_heartbeat_that_ends_ramps_the_force_down():
    core, sample, now = pushing()
    core.enable(now, False)
    forces = []
    for tick in range(60):
        now += 0.002
        core.update(sample._replace(stamp_ns=sample.stamp_ns + (tick + 1) * 2_000_000), now)
        forces.append(abs(core.command(now).force))
    assert forces == sorted(forces, reverse=True)
    assert forces[-11] == 0.0  # after 100 ms
    assert core.safety.state is State.DISABLED


class Anything(RuleBasedStateMachine):
    """Whatever is heard, in whatever order: a force needs a fresh heartbeat and a fresh, sound input, or is gone."""

    def __init__(self) -> None:
        super().__init__()
        self.core = Synchronizer(HOLD)
        self.now, self.stamp_ns, self.turned, self.restarts = 1.0, 1_000_000_000, 0.0, 0
        self.heartbeat = self.heard = self.allowed = -math.inf
        self.may_push = True
        """Nothing has stopped it since the heartbeat was last seen to be absent."""

    def ask(self) -> None:
        """A command, held against what was heard."""
        command, params = self.core.command(self.now), HOLD
        enabled = self.now - self.heartbeat <= params.enable_timeout
        fresh = self.now - self.heard <= params.stale_after
        if not enabled and self.core.safety.state is not State.FAULT:
            self.may_push = True
        if enabled and fresh and self.may_push:
            self.allowed = self.now
        assert abs(command.force) <= params.limits.max_force
        if command.force:
            assert command.state in (State.ACTIVE, State.RAMP_DOWN)
            assert fresh
            assert self.now - self.allowed <= 0.1
        if command.state is State.ACTIVE:
            assert self.may_push

    def sample(self, **change) -> None:
        self.stamp_ns += 5_000_000
        front, rear = (
            Turn((self.turned + ahead * 2.0 * ALPHA) % (2.0 * ALPHA) - ALPHA, 1.1) for ahead in (0.0, self.lead)
        )
        sample = PhaseSample(self.stamp_ns, front, rear, Turn(), 0, self.restarts)._replace(**change)
        self.core.update(sample, self.now)

    @initialize(lead=st.floats(0.05, 0.95))
    def begin(self, lead):
        self.lead = lead

    @rule(samples=st.integers(1, 200), enabled=st.booleans())
    def walk(self, samples, enabled):
        for _ in range(samples):
            self.now += 0.005
            self.turned += 1.1 * 0.005
            self.sample()
            self.heard = self.now
            self.core.enable(self.now, enabled)
            self.heartbeat = self.now if enabled else -math.inf
            self.ask()

    @rule(ticks=st.integers(1, 60), dt=st.floats(0.001, 0.02), enabled=st.booleans())
    def hear_nothing(self, ticks, dt, enabled):
        for _ in range(ticks):
            self.now += dt
            if enabled:
                self.core.enable(self.now, True)
                self.heartbeat = self.now
            self.ask()

    @rule(
        change=st.sampled_from(
            [
                {'front': Turn(math.nan, 1.0)},
                {'rear': Turn(0.1, -math.inf)},
                {'step_difference': -2},
                {'stamp_ns': 7},
                'new run',
                'no sample',
                'clock',
                'second publisher',
                'stop',
            ]
        )
    )
    def spoil(self, change):
        pushes = self.core.safety.state in (State.ACTIVE, State.RAMP_DOWN)
        if change == 'stop':
            self.core.safety.stop()
            self.may_push = False
            return
        if change == 'no sample':
            self.core.refuse()
        elif change in ('clock', 'second publisher'):
            self.core.conflict(change)
        elif change == 'new run':
            self.restarts += 1
            self.sample()
        else:
            self.sample(**change)
            if 'stamp_ns' in change:
                self.stamp_ns = 7
        if pushes:
            self.may_push = False
            assert self.core.safety.state is State.FAULT
            assert self.core.command(self.now).force == 0.0

    @rule()
    def reset(self):
        self.core.safety.reset_fault()


TestAnything = Anything.TestCase
TestAnything.settings = settings(deadline=None, max_examples=60, stateful_step_count=25)


def test_hold_without_gains_is_refused_with_the_mend():
    with pytest.raises(ValueError, match='dcdrw control'):
        SynchronizerParams(law='hold').check_law()
    with pytest.raises(ValueError, match='law must be off or hold or rear'):
        check(SynchronizerParams(law='grip'))


def test_with_added_damping_a_pair_that_would_stall_walks_in_step():
    """b̂ = 1 on 1.75°: the coupler alone stalls the pair; more damping leads out of that band, and takes no power."""
    unit = nondimensional(PAPER)[1].damping
    rig = PAPER._replace(k=0.005 * nondimensional(PAPER)[1].stiffness, b=unit, slope=math.radians(1.75)).resolved()
    added = unit
    params = params_for(rig._replace(b=rig.b + added))._replace(damping=added)
    rows = list(walk(rig, params, 0.2, 15.0))
    assert steps(rows) <= 4
    assert max(abs(force) for _, _, force, _, _ in rows) <= params.limits.max_force
    assert sum(force * rate for _, _, force, rate, _ in rows[-round(5.0 * RATE) :]) > 0.0  # it brakes
    assert run(*start(rig, 0.2), seconds=120.0).end in (
        End.STANDING,
        End.STALLED,
        End.FALLEN,
    )  # alone it does not walk on
