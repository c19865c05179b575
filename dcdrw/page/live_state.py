"""What the live page shows, as plain data: samples in, one small frame at a time out. No ROS, and no clock of its own.

Everything kept here is bounded, so that hours at 1 kHz take no more memory than seconds.
"""

import json
import math
from collections import deque
from typing import Any, NamedTuple

from dcdrw.suite.executables import EXECUTABLES, PHASE_ESTIMATOR, RECORDER, SIMULATOR, SYNC_MONITOR, SYNCHRONIZER
from dcdrw.suite.parameter_file import TrialParams
from dcdrw_msgs_py.diagnosis import (
    LOST_SAMPLES,
    REFUSED,
    RESTARTS,
    Diagnosis,
    Level,
    PairState,
    RecorderState,
    SourceState,
)
from dcdrw_msgs_py.quantity import Field, fields, lookup
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_msgs_py.rolling import default_stance_distance, phi_pitch, stance, stance_distance_by_hubs
from dcdrw_msgs_py.samples import Footfall, JointSample, PhaseSample
from dcdrw_msgs_py.words import counted
from dcdrw_tracker.gait.diagnostics import diagnose_sync
from dcdrw_tracker.gait.pair_state import judge
from dcdrw_tracker.gait.rest import moves
from dcdrw_tracker.gait.sync import SyncMonitor, SyncStatus

FRAME_RATE = 25.0
"""Frames per second [Hz]."""
WINDOW_SECONDS = 20.0
"""How far back the page's charts reach [s]."""
POINT_NS = 20_000_000
"""Charts get a point per so much time, however fast samples come."""
FRAMES_KEPT = round(WINDOW_SECONDS * FRAME_RATE)
"""Frames from which a browser that comes later draws the charts."""
STALE_SECONDS = 1.0
"""Without a sample for this long the data are late [s]."""
SILENT_SECONDS = 3.0
"""A node that has said nothing on /diagnostics for this long is silent; each speaks once a second."""
STEPS_SHOWN = 60
STRANGERS_SHOWN = 24
"""Nodes of other names than the suite's that are listed at most: the last that spoke."""
_PENDING = 1000
"""Points and footfalls that wait for the next frame at most: more than any source sends from one to the next."""
_MATCHED = 1000
"""Samples of both streams kept to find a pair of one stamp, as the streams may come with different lags."""

LATE_DATA = 'late_data'
"""The state where samples came, but not of late; a page that hears nothing of `dcdrw live` is itself late."""
LONGEST_MESSAGE = 200
"""Length up to which the message of a node is shown [characters]."""

_LEFT_OUT = (LOST_SAMPLES, 'missing'), (REFUSED, 'refused')
_SUITE = {node.name for node in EXECUTABLES}
WIDEST_SLIDER = 10.0
"""Where the slider of a parameter whose default is 0 ends at most."""
CONTROLS = {field.name: field for field in fields(RigParams) if field.quantity.live and not field.quantity.derived}
"""What the page's sliders set."""
FIRST_CONTROLS = ('k', 'b', 'slope')
"""Those that are always in sight."""


class Command(NamedTuple):
    """What somebody asks for on the page."""

    do: str
    """`set`, `reset`, `pause`, `record`, `enable` or `stop`."""
    name: str = ''
    """Name of the parameter to set."""
    value: float = 0.0
    """The value to set, in SI units; for a switch, true or false."""


def read_command(text: str) -> Command:
    """Read a command as the page sends it.

    Raises:
        ValueError: it is none, or its value is impossible: named with the bounds.

    """
    content = json.loads(text)
    if not isinstance(content, dict):
        raise ValueError('a command must be an object')
    do, name, value = content.get('do'), content.get('name'), content.get('value')
    if do == 'set' and isinstance(name, str) and name in CONTROLS:
        if not isinstance(value, (int, float)):
            raise ValueError(f'{name} must be a number, got {value!r}')
        return Command('set', name, CONTROLS[name].coerce(value))
    if do in ('reset', 'stop'):
        return Command(do)
    if do in ('pause', 'record', 'enable') and isinstance(value, bool):
        return Command(do, value=value)
    raise ValueError(f'not a command: {text[:80]}')


class _Health(NamedTuple):
    said: Diagnosis
    at: float


class _PersonForce:
    """The force on a person who walks in front, since the run began [N]."""

    def __init__(self) -> None:
        self._at, self._count, self._peak, self._squares = -math.inf, 0, 0.0, 0.0

    def take(self, force: float, now: float) -> None:
        self._at, self._count = now, self._count + 1
        self._peak, self._squares = max(self._peak, abs(force)), self._squares + force * force

    def told(self, now: float) -> dict[str, Any] | None:
        """Its peak and rms; None where none is told of late."""
        if now - self._at > SILENT_SECONDS:
            return None
        return {'peak': _rounded(self._peak, 1), 'rms': _rounded(math.sqrt(self._squares / self._count), 1)}


class LiveState:
    """Takes what the topics bring; `frame` tells what is new.

    Callers give the time `now` [s] by a clock that never jumps: ages are taken from it, all else from the stamps.
    """

    def __init__(self, params: TrialParams, may_enable: bool = False) -> None:
        self._params, self._may_enable = params, may_enable
        self._synchronizer = ''
        self._person = _PersonForce()
        self._monitor = SyncMonitor(params.sync)
        self._joints: deque[JointSample] = deque(maxlen=_MATCHED)
        self._phases: deque[PhaseSample] = deque(maxlen=_MATCHED)
        self._joints_at = self._phase_at = -math.inf
        self._counted, self._counted_at, self._rate = 0, -math.inf, math.nan
        self._health: dict[str, _Health] = {}
        self._feet: dict[str, float] = {}
        self._run = 0
        self._start: float | None = None
        """When the wheels were let go, by the charts' time; None where the page has not seen it."""
        self._epoch_ns: int | None = None
        self._phi_due_ns = self._force_due_ns = 0
        self._force_range = math.inf, -math.inf
        self._phis: deque[list[float]] = deque(maxlen=_PENDING)
        self._forces: deque[list[float]] = deque(maxlen=_PENDING)
        self._falls: deque[list[Any]] = deque(maxlen=_PENDING)
        self._notices: deque[dict[str, Any]] = deque(maxlen=8)
        self._board_at = -math.inf
        self._told_steps = 0
        self._controls: RigParams | None = None

    @property
    def complete(self) -> bool:
        """Something has come from every node of a trial."""
        return bool(self._phases) and SYNC_MONITOR.name in self._health

    def configure(self, **changed: Any) -> None:
        """Take changed parameters: `rig`, `phase` or `sync`, as in `TrialParams`."""
        params = self._params._replace(**changed)
        if params != self._params:
            if params.sync != self._params.sync:
                self._monitor.configure(params.sync)
            self._params = params
            self._renew()

    def take_joints(self, joints: JointSample, now: float) -> None:
        """Take a sample of `joint_states`."""
        self._joints.append(joints)
        self._joints_at = now
        force = joints.coupler.force
        if not math.isfinite(force):
            return
        low, high = self._force_range
        low, high = min(low, force), max(high, force)
        self._force_range = low, high
        if not 0 < self._force_due_ns - joints.stamp_ns <= POINT_NS:
            self._forces.append([self._seconds(joints.stamp_ns), round(low, 3), round(high, 3)])
            self._force_range = math.inf, -math.inf
            self._force_due_ns = joints.stamp_ns + POINT_NS

    def take_phase(self, phase: PhaseSample, now: float) -> None:
        """Take a sample of `phase_state`."""
        if self._monitor.update(phase) is None:
            return
        if self._begins_anew(phase, now):
            self._restart()
        if self._start is None and moves(phase) and phase.front_steps == phase.rear_steps == 0:
            self._start = self._seconds((self._phases[-1] if self._phases else phase).stamp_ns)
        self._phases.append(phase)
        self._phase_at = now
        self._counted += 1
        if not 0 < self._phi_due_ns - phase.stamp_ns <= POINT_NS:
            self._phis.append([self._seconds(phase.stamp_ns), round(math.degrees(phase.phi.angle), 3)])
            self._phi_due_ns = phase.stamp_ns + POINT_NS

    def take_footfall(self, fall: Footfall) -> None:
        """Take a strike; its place tells which step it is. One of no wheel, or nowhere, is passed over."""
        if fall.wheel not in (FRONT, REAR):
            return
        steps = fall.x / getattr(self._params.phase, fall.wheel).step_length
        if math.isfinite(steps):
            self._feet[fall.wheel] = fall.x
            self._falls.append([fall.wheel, self._seconds(fall.stamp_ns), round(steps)])

    def take_synchronizer_state(self, state: str) -> None:
        """Take what the synchronizer does."""
        self._synchronizer = state
        self._renew()

    def take_person_force(self, force: float, now: float) -> None:
        """Take the force on the person [N]; what is no number is passed over."""
        if math.isfinite(force):
            self._person.take(force, now)

    def take_health(self, name: str, said: Diagnosis, now: float) -> None:
        """Take what a node says of itself on `/diagnostics`."""
        said = said._replace(message=said.message[:LONGEST_MESSAGE])
        if name not in _SUITE:
            said = said._replace(values={})
        last = self._health.pop(name, None)
        self._health[name] = _Health(said, now)  # the last that spoke is last
        strangers = [other for other in self._health if other not in _SUITE]
        if len(strangers) > STRANGERS_SHOWN:
            del self._health[strangers[0]]
        if last is None or last.said != said:
            self._renew()

    def take_controls(self, rig: RigParams | None) -> None:
        """Take the simulator's own parameters; None where it does not answer."""
        if rig != self._controls:
            self._controls = rig
            self._renew()
        if rig:
            self.configure(rig=rig)

    def notice(self, text: str, ok: bool) -> None:
        """Tell all who watch what came of a command."""
        self._notices.append({'text': text, 'ok': ok})

    def frame(self, now: float) -> dict[str, Any]:
        """What is new since the last frame, ready for JSON: no NaN; angles in degrees where a name says so."""
        status = self._monitor.status()
        state, detail = self._judge(status, now)
        age = _rounded(now - self._phase_at, 2)
        frame: dict[str, Any] = {'state': state, 'detail': detail, 'age': age, 'run': self._run, 'start': self._start}
        if self._phases:
            frame['rig'] = self._rig()
        for name, new in (
            ('phis', self._phis),
            ('forces', self._forces),
            ('falls', self._falls),
            ('notices', self._notices),
        ):
            if new:
                frame[name] = list(new)
                new.clear()
        if now - self._counted_at >= 1.0:
            self._rate = self._counted / (now - self._counted_at)
            self._counted, self._counted_at = 0, now
        if now - self._board_at >= 1.0 or status.steps != self._told_steps:
            frame['board'] = self._board(status, now)
            self._board_at, self._told_steps = now, status.steps
        return frame

    def _begins_anew(self, phase: PhaseSample, now: float) -> bool:
        """Whether the source has started anew, or its clock was set: the stamps jumped, and no such time has passed."""
        last = self._phases[-1] if self._phases else None
        if last is None or phase.restarts != last.restarts:
            return True
        ahead = (phase.stamp_ns - last.stamp_ns) * 1e-9
        return ahead < 0.0 or (ahead > STALE_SECONDS and now - self._phase_at < 0.5 * ahead)

    def _restart(self) -> None:
        """The source has started anew, or its clock was set: what the charts had is of another run."""
        self._run += 1
        self._start = None
        self._person = _PersonForce()
        for kept in (self._phases, self._phis, self._forces, self._falls, self._feet):
            kept.clear()
        self._renew()

    def _renew(self) -> None:
        """Let the next frame tell what seldom changes."""
        self._board_at = -math.inf

    def _seconds(self, stamp_ns: int) -> float:
        """Time of the page's charts: since the first stamp that came."""
        if self._epoch_ns is None:
            self._epoch_ns = stamp_ns
        return round((stamp_ns - self._epoch_ns) * 1e-9, 4)

    def _says(self, name: str, now: float) -> Diagnosis | None:
        """What a node of the suite said last; None where it is silent."""
        health = self._health.get(name)
        return health.said if health and now - health.at <= SILENT_SECONDS else None

    def _judge(self, status: SyncStatus, now: float) -> tuple[str, str]:
        """The state, and a line that explains it."""
        age = now - self._phase_at
        if not age <= STALE_SECONDS:
            return LATE_DATA if math.isfinite(age) else PairState.NO_DATA.value, self._why_no_data(age, now)
        simulator = self._says(SIMULATOR.name, now)
        if simulator and simulator.state(SourceState) is SourceState.PAUSED:
            return PairState.HELD.value, simulator.message
        # The monitor has watched for longer than this page; where it says nothing, the same judge judges here.
        said = self._says(SYNC_MONITOR.name, now)
        state = said.state(PairState) if said else None
        if said is None or state is None or state is PairState.NO_DATA:
            said = diagnose_sync(status, 0.0, STALE_SECONDS)
            state = judge(status)
        if state is PairState.CONVERGING:
            band, hold = self._params.sync.band_percent, self._params.sync.hold_steps
            return state.value, f'until the error stays within ±{band:g} % for {counted(hold, "step")}'
        return state.value, said.message

    def _why_no_data(self, age: float, now: float) -> str:
        if now - self._joints_at <= STALE_SECONDS:
            return 'joint_states come, but no phase_state: does phase_estimator run, and does it know the joints?'
        if math.isfinite(age):
            return f'nothing has come for {age:.0f} s'
        return 'no joint_states yet: is the source running, on this ROS domain?'

    def _rig(self) -> dict[str, Any]:
        """Where the wheels are: from the last sample of the phase whose joints are known, too."""
        known = {joints.stamp_ns: joints for joints in self._joints}
        phase = next((phase for phase in reversed(self._phases) if phase.stamp_ns in known), self._phases[-1])
        joints = known.get(phase.stamp_ns, JointSample(phase.stamp_ns, phase.front, phase.rear))
        front, rear = self._params.phase.front, self._params.phase.rear
        theta1, theta2 = phase.front.angle, phase.rear.angle
        share = 100.0 * phase.phi.angle / phi_pitch(front, rear)
        return {
            'stamp_ns': str(phase.stamp_ns),  # JavaScript's numbers do not hold it
            'theta': [_rounded(theta1, 5), _rounded(theta2, 5)],
            # Which spoke stands: it shows that the wheels roll.
            'legs': [
                _rounded(stance(front.alpha, joints.front.angle - theta1)[0], 0),
                _rounded(stance(rear.alpha, joints.rear.angle - theta2)[0], 0),
            ],
            'n': phase.step_difference,
            'S': _rounded(self._stance_distance(phase, joints.coupler.length), 5),
            'phi_deg': _rounded(math.degrees(phase.phi.angle), 3),
            'phase_percent': _rounded(share, 2),
            'error_percent': _rounded(math.remainder(share - 50.0, 100.0), 2),
            'force': _rounded(joints.coupler.force, 2),
        }

    def _stance_distance(self, phase: PhaseSample, D: float) -> float:
        """S from the coupler's length D where the source knows it; else from footfalls, or from n (contract §1)."""
        front, rear = self._params.phase.front, self._params.phase.rear
        if len(self._feet) == 2:
            S = self._feet[FRONT] - self._feet[REAR]
        else:  # a trial starts just after a strike of the front wheel
            S0 = default_stance_distance(self._params.phase.S0, front.length)
            S = S0 + (1 + phase.step_difference) * front.step_length
        return stance_distance_by_hubs(front, rear, phase.front.angle, phase.rear.angle, D, S)

    def _board(self, status: SyncStatus, now: float) -> dict[str, Any]:
        """What seldom changes."""
        params = self._params
        shapes = params.phase.front, params.phase.rear
        simulator, recorder = self._says(SIMULATOR.name, now), self._says(RECORDER.name, now)
        return {
            'wheels': [[shape.length, shape.spokes] for shape in shapes],
            'slope': params.rig.slope,
            'pitch_deg': math.degrees(phi_pitch(params.sync.front, params.sync.rear)),
            'band_percent': params.sync.band_percent,
            'rate': _rounded(self._rate, 0),
            'left_out': self._left_out(now),
            'steps': status.steps,
            'errors': [_rounded(error, 2) for error in status.history[-STEPS_SHOWN:]],
            'ratio': _rounded(status.contraction, 3),
            'nodes': [self._node(name, now) for name in sorted(self._health)],
            'controls': [_control(field, params.rig) for field in CONTROLS.values()],
            'simulated': self._controls is not None and simulator is not None,
            'paused': simulator is not None and simulator.state(SourceState) is SourceState.PAUSED,
            'person': self._person.told(now),
            'synchronizer': self._synchronizer if self._says(SYNCHRONIZER.name, now) else None,
            'may_enable': self._may_enable,
            'recorder': recorder is not None,
            'recording': recorder is not None and recorder.state(RecorderState) is RecorderState.RECORDING,
        }

    def _left_out(self, now: float) -> str:
        """What the estimator says that is missing, refused or begun anew; empty where nothing is."""
        said = self._says(PHASE_ESTIMATOR.name, now)
        if said is None:
            return ''
        counts = [(said.number(key), word) for key, word in _LEFT_OUT]
        told = [f', {count:.0f} {word}' for count, word in counts if count > 0.0]
        restarts = said.number(RESTARTS)
        if restarts > 0.0:
            told.append(f', begun anew {counted(f"{restarts:.0f}", "time")}')
        return ''.join(told)

    def _node(self, name: str, now: float) -> dict[str, Any]:
        said, at = self._health[name]
        level, message = said.level, said.message
        if now - at > SILENT_SECONDS:
            level, message = Level.STALE, f'silent for {now - at:.0f} s'
        return {'name': name, 'level': level.name, 'message': message}


def _control(field: Field, rig: RigParams) -> dict[str, Any]:
    """A slider: from 0 to four times the default, or as far as makes sense where that is 0.

    Its field takes whatever the parameter may be.
    """
    quantity = field.quantity
    unit, scale = ('°', math.degrees(1.0)) if quantity.unit == 'rad' else (quantity.unit, 1.0)
    return {
        'name': field.name,
        'doc': quantity.doc,
        'unit': unit,
        'scale': scale,
        'low': _rounded(quantity.low, 6),
        'high': _rounded(quantity.high, 6),
        'top': 4.0 * field.default or min(quantity.high, WIDEST_SLIDER),
        'value': lookup(rig, field.name),
        'more': field.name not in FIRST_CONTROLS,
    }


def _rounded(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None
