"""The active synchronizer beside passive couplers and other laws: steps, work and power from the worst of nine starts.

    python benchmarks/control.py [--nodes]

Starts are 10 to 90 %, |F| ≤ 20 N, the paper's wheels and coupler on 2° where nothing else is said. Laws, 500 commands
a second: `deadbeat` and `lqr`, the gains of `dcdrw control` held from strike to strike by the synchronizer; `held`, the
plain law F = 80 N (p − 50 %) held likewise; `proportional`, F = 150 N (p − 50 %) at every sample. Columns: strikes
until the error stays within ±6 % at strikes, and at every instant, from the worst start; work in the first 5 s, and
power in the last 5 s, once in step, each the most of all starts, ∫ |F Ḋ| dt. Then the same with 50 ms of delay, which
the laws from `dcdrw control` know, on rigs whose masses, b and k are each 30 % more or less, which no law knows; on
other slopes; and in the band where the coupler's own damping stalls the pair, with damping added.

With --nodes the first table's deadbeat is measured through the real nodes in its place: simulator, estimator and
synchronizer, each a process, in real time at 1 kHz. A start in which the machine let a node wait for more than 20 ms,
by the nodes' own times of sending, or this process, so that the heartbeat ended, was not in real time: it is told, and
walked again.

Goals: at most 3 strike steps and 4 at every instant, 5 J, 0.05 W; with delay and another rig 5; on 1.5 to 3° 4 strike
steps; from no start slower than the passive pair.
"""

import argparse
import functools
import math
import sys
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
from typing import NamedTuple

import numpy as np
from safety import Stack, stack_of
from std_srvs.srv import SetBool

from dcdrw.console import cores
from dcdrw.suite.executables import SIMULATOR
from dcdrw_control.sync.hold import HoldGains
from dcdrw_control.sync.safety import Limits, State
from dcdrw_control.sync.synchronizer import Synchronizer, SynchronizerParams
from dcdrw_msgs_py.in_step import BAND_PERCENT, HOLD_STEPS, in_step_from, strikes_in_step, wrapped_percent
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.rolling import steps_ahead
from dcdrw_msgs_py.samples import SECOND, JointSample, PhaseSample, Turn
from dcdrw_sim.map.holding import UNCERTAIN, Law, Method, corners, eased, law, plant
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.study.points import study
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams

PAPER = preset('paper').resolved()
PHASES = tuple(i / 10 for i in range(1, 10))
PERIOD = 0.002
"""From sample to sample, and from command to command [s]."""
WORK_SECONDS = 5.0
SECONDS = 10.0
"""Length of a walk with a law."""
PASSIVE_SECONDS = 60.0
DELAY = 0.05
HELD_GAIN, PROPORTIONAL_GAIN = 80.0, 150.0
"""[N per step]"""
SLOPES = (1.5, 2.0, 2.5, 3.0)
"""[°]"""
REAL_TIME = 0.02
"""A node that waits for longer does not run in real time [s]."""
STALL_SLOPE = 1.75
"""[°]; there b̂ = 1 stalls the pair."""


class Walk(NamedTuple):
    """What one walk came to."""

    strike_steps: float
    """Infinite where the pair does not come into step; likewise `steps`."""
    steps: float
    work: float
    """In the first WORK_SECONDS [J]."""
    power: float
    """Mean of the last WORK_SECONDS [W]."""
    peak: float
    """Largest force [N]."""


class Task(NamedTuple):
    """One walk."""

    name: str
    """Of the law."""
    rig: RigParams
    """As it is."""
    known: RigParams
    """As the law takes it to be."""
    phase: float
    """At the start."""
    delay: float = 0.0
    """From a command to the force [s]."""
    damping: float = 0.0
    """That the command adds [N·s/m]."""


class PhaseLaw:
    """F = gain (p − 50 %), at every sample or held from strike to strike: in the place of a `Synchronizer`."""

    def __init__(self, gain: float, is_held: bool, rig: RigParams) -> None:
        self._gain, self._is_held, self._pitch = gain, is_held, rig.front.alpha + rig.rear.alpha
        self._last: PhaseSample | None = None
        self.force = 0.0

    def update(self, sample: PhaseSample, now: float) -> None:
        """Take the next sample, at a time [s]."""
        last, self._last = self._last, sample
        if not self._is_held or (last and sample.front_steps > last.front_steps):
            wanted = self._gain * (sample.phi.angle / self._pitch - 0.5)
            self.force = max(-Limits().max_force, min(Limits().max_force, wanted))


class Core:
    """The synchronizer, always enabled."""

    def __init__(self, params: SynchronizerParams) -> None:
        self._core = Synchronizer(params)
        self.force = 0.0

    def update(self, sample: PhaseSample, now: float) -> None:
        """Take the next sample, at a time [s]."""
        self._core.update(sample, now)
        self._core.enable(now, True)
        self.force = self._core.command(now).force


def gains(chosen: Law) -> HoldGains:
    """A law as parameters of the node."""
    state, gain = (tuple(map(float, values)) for values in (chosen.state, chosen.gain))
    return HoldGains(state, gain, chosen.force, chosen.gain_before, chosen.middle)


@functools.cache
def hold_law(rig: RigParams, delay: float, method: Method) -> Law:
    """The law as `dcdrw control` computes it."""
    about = plant(rig, delay=delay)
    return eased(law(about, method), about)


def controller(task: Task) -> PhaseLaw | Core:
    """What computes the force."""
    known = task.known
    if task.name == 'held':
        return PhaseLaw(HELD_GAIN, True, known)
    if task.name == 'proportional':
        return PhaseLaw(PROPORTIONAL_GAIN, False, known)
    method: Method = 'lqr' if task.name == 'lqr' else 'deadbeat'
    chosen = hold_law(known._replace(b=known.b + task.damping), task.delay, method)
    return Core(SynchronizerParams(law='hold', hold=gains(chosen), damping=task.damping))


def walk(task: Task) -> Walk:
    """Let a law act on the pair."""
    rig, _ = begun = start(task.rig, task.phase)
    pair, estimator, law_ = Simulation(*begun), PhaseEstimator(PhaseParams()), controller(task)
    under_way = deque([0.0] * round(task.delay / PERIOD))
    rotations, powers, peak = [], [], 0.0
    for tick in range(round(SECONDS / PERIOD)):
        t = tick * PERIOD
        motion = pair.advance_to(t)
        front, rear = Turn(motion.rotation1, motion.omega1), Turn(motion.rotation2, motion.omega2)
        update = estimator.update(JointSample(round(t * 1e9) + 1, front, rear))
        assert update
        rotations.append((motion.rotation1, motion.rotation2))
        powers.append(abs(pair.external_force * motion.rate))
        peak = max(peak, abs(pair.external_force))
        law_.update(update.phase, t)
        under_way.append(law_.force)
        pair.external_force = under_way.popleft()
    return Walk(*steps_of(rig, rotations), *work_and_power(powers, PERIOD), peak)


def steps_of(rig: RigParams, rotations: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Steps until the pair is in step at strikes, and at every instant: by rotations ψ1, ψ2 [rad], closely sampled."""
    pitch, alpha = 2.0 * rig.front.alpha, rig.front.alpha
    at_strikes = since = step = 0
    psi, first = rotations[0], math.floor((rotations[0][0] + alpha) / pitch)
    error = wrapped_percent(steps_ahead(rig.front, rig.rear, *psi))
    since = at_strikes = in_step_from(0, 0, error, error, BAND_PERCENT)
    for now in rotations[1:]:
        strikes = math.floor((now[0] + alpha) / pitch) - first
        if strikes > step:  # the error at the strike itself, which belongs to both of its steps
            share = ((first + strikes) * pitch - alpha - psi[0]) / (now[0] - psi[0])
            at = wrapped_percent(
                steps_ahead(rig.front, rig.rear, *(a + share * (b - a) for a, b in zip(psi, now, strict=True)))
            )
            since = in_step_from(since, step, at, at, BAND_PERCENT)
            step = strikes
            since = in_step_from(since, step, at, at, BAND_PERCENT)
            at_strikes = in_step_from(at_strikes, step, at, at, BAND_PERCENT)
        error, psi = wrapped_percent(steps_ahead(rig.front, rig.rear, *now)), now
        since = in_step_from(since, step, error, error, BAND_PERCENT)
    return tuple(float(one) if strikes_in_step(one, step) >= HOLD_STEPS else math.inf for one in (at_strikes, since))


def work_and_power(powers: Sequence[float], period: float) -> tuple[float, float]:
    """Work of the first WORK_SECONDS [J], and mean power of the last [W]."""
    count = round(WORK_SECONDS / period)
    return sum(powers[:count]) * period, sum(powers[-count:]) / count


def passive(rig: RigParams) -> list[Walk]:
    """The pair without a law, from every start."""
    found = study(spread(rig, 1, {}), PASSIVE_SECONDS, PHASES, BAND_PERCENT)
    strike_steps, steps = (np.nan_to_num(one, nan=math.inf) for one in (found.motions.strike_steps, found.steps[0]))
    return [Walk(*each, 0.0, 0.0, 0.0) for each in zip(strike_steps.tolist(), steps.tolist(), strict=True)]


def through_nodes(phase: float, stack: Stack) -> Walk:
    """Deadbeat on the paper's pair, by the real nodes."""
    stack.rest()
    stack.kill(SIMULATOR.name)
    stack.set({'initial_phase_percent': 100.0 * phase, 'paused': True})
    stack.rest()
    stack.commands.clear()
    stack.joints.clear()
    stack.wait(lambda: stack.joints and not stack.joints[-1][1].rear.rate, 'wheels that are held')
    stack.wait_for_estimator()
    stack.enabled = True
    stack.wait(lambda: stack.state == State.ARMED.value, 'a synchronizer that waits')
    stack.joints.clear()
    stack.states.clear()
    while not any(sample.rear.rate for _, sample in stack.joints):
        stack.call('simulator/pause', SetBool, data=False)
        stack.listen(0.2)
    stack.listen(SECONDS)
    rolling = [sample for _, sample in stack.joints if sample.rear.rate]
    late = max(when - sample.stamp_ns / SECOND for when, sample in stack.joints if sample.rear.rate)
    begun = rolling[0].stamp_ns / SECOND
    sent = [when for when, _ in stack.commands if when > begun]
    waited = max(late, *np.diff(sent))
    # Each state is told again every second.
    went = [state for state, _ in groupby(stack.states) if state != State.ARMED.value]
    if waited > REAL_TIME or went != [State.ACTIVE.value]:
        why = f'a node had to wait for {1e3 * waited:.0f} ms, {", ".join(went)}'
        print(f'from {100 * phase:.0f} %: {why}: once more', file=sys.stderr)
        return through_nodes(phase, stack)
    forces = [stack.external_force(sample) for sample in rolling]
    powers = [abs(force * sample.coupler.rate) for force, sample in zip(forces, rolling, strict=True)]
    period = (rolling[-1].stamp_ns - rolling[0].stamp_ns) / SECOND / (len(rolling) - 1)
    return Walk(
        *steps_of(stack.rig, [(sample.front.angle, sample.rear.angle) for sample in rolling]),
        *work_and_power(powers, period),
        max(map(abs, forces)),
    )


def told(steps: float) -> str:
    return 'never' if math.isinf(steps) else f'{steps:.0f}'


def row(name: str, walks: Sequence[Walk]) -> str:
    worst = Walk(*(max(values) for values in zip(*walks, strict=True)))
    return (
        f'{name:38} {told(worst.strike_steps):>7} {told(worst.steps):>7} {worst.work:8.2f} {worst.power:8.4f} '
        f'{worst.peak:7.1f}'
    )


def table() -> list[tuple[str, list[Task], RigParams]]:
    """Each row: its name, its walks, and the rig."""
    rows = []
    for name in ('deadbeat', 'lqr', 'held', 'proportional'):
        rows.append((name, [Task(name, PAPER, PAPER, phase) for phase in PHASES], PAPER))
    for rig in corners(PAPER, UNCERTAIN):
        factors = rig.front.mass / PAPER.front.mass, rig.b / PAPER.b, rig.k / PAPER.k
        told_ = ', '.join(f'{"mbk"[i]} {100 * factor - 100:+.0f} %' for i, factor in enumerate(factors))
        for name in ('deadbeat', 'proportional'):
            rows.append((f'{name}, 50 ms, {told_}', [Task(name, rig, PAPER, p, DELAY) for p in PHASES], rig))
    for degrees in SLOPES:
        rig = PAPER._replace(slope=math.radians(degrees))
        rows.append((f'deadbeat, {degrees:g}°', [Task('deadbeat', rig, rig, p) for p in PHASES], rig))
    unit = nondimensional(PAPER)[1]
    rig = PAPER._replace(k=0.005 * unit.stiffness, b=unit.damping, slope=math.radians(STALL_SLOPE), D0=math.nan)
    rig = rig.resolved()
    name = f'deadbeat + {unit.damping:.0f} N·s/m, {STALL_SLOPE:g}°, b̂ 1'
    rows.append((name, [Task('deadbeat', rig, rig, p, damping=unit.damping) for p in PHASES], rig))
    return rows


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else '')
    parser.add_argument('--nodes', action='store_true', help='through the real nodes (three minutes)')
    options = parser.parse_args()
    print(f'{"":38} {"strikes":>7} {"always":>7} {"work J":>8} {"power W":>8} {"peak N":>7}')
    if options.nodes:
        with stack_of(PAPER) as stack:
            walks = []
            for phase in PHASES:
                walks.append(through_nodes(phase, stack))
                print(row(f'deadbeat by real nodes, from {100 * phase:.0f} %', walks[-1:]), flush=True)
            print(row('deadbeat by real nodes at 1 kHz', walks))
        return 0
    with ProcessPoolExecutor(cores()) as pool:
        alone = {}
        for name, tasks, rig in table():
            if rig not in alone:
                alone[rig] = passive(rig)
                print(row(f'passive{name[name.find(",") :] if "," in name else ""}', alone[rig]), flush=True)
            walks = list(pool.map(walk, tasks))
            slower = [
                f'{100 * phase:.0f} %'
                for phase, one, other in zip(PHASES, walks, alone[rig], strict=True)
                if one.strike_steps > other.strike_steps or one.steps > other.steps
            ]
            print(row(name, walks) + (f'  slower than passive from {", ".join(slower)}' if slower else ''), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
