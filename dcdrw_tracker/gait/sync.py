"""The synchronization monitor: how far the pair is from walking in step, and whether it stays there (contract §1, §5).

Sees only phase samples. With the paper's rig the error swings by about ±3 % within each step even when the pair
is synchronized, and by more on the way there: so the band is judged all along, convergence from strike to strike.
"""

import math
from collections import deque
from typing import Annotated, NamedTuple

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, REAR, WheelPitch
from dcdrw_msgs_py.rolling import phi_pitch
from dcdrw_msgs_py.samples import PhaseSample, SyncSample, Turn
from dcdrw_tracker.gait.cadence import Cadence, CadenceStatus
from dcdrw_tracker.gait.contraction import WINDOW, contraction
from dcdrw_tracker.gait.rest import Rest

HISTORY = 10_000
"""Steps whose error is kept."""
SMOOTHING = 0.05
"""Time over which the error is smoothed, along with its rate so without lag, before it is held against the band [s]."""
SURPRISE = 5.0
"""An error that differs by more from what its past and rate foretell is no noise [%]."""
FASTEST = 100.0
"""A speed beyond this is no measurement [rad/s]."""
LONG_WAY = 0.1
"""A wheel that turns further than this between two samples may strike unseen [rad]."""


class SyncParams(NamedTuple):
    """What counts as synchronized, stalled and stale."""

    front: WheelPitch = WheelPitch()
    rear: WheelPitch = WheelPitch()
    band_percent: Annotated[
        float, Quantity('the pair comes into step when the error is within this', '%', above=0.0, high=50.0, live=True)
    ] = 6.0
    band_hysteresis_percent: Annotated[
        float,
        Quantity('and falls out of step when it is beyond by more than this', '%', low=0.0, high=50.0, live=True),
    ] = 1.0
    hold_steps: Annotated[
        int, Quantity('strikes of the front wheel within the band that make it synchronized', low=1, live=True)
    ] = 3
    stale_after: Annotated[
        float,
        Quantity('without a sample for this long the input is stale; start afresh', 's', above=0.0, live=True),
    ] = 1.0
    stall_after: Annotated[
        float,
        Quantity('a wheel without a strike for this long has stalled; a step takes 0.56 s', 's', above=0.0, live=True),
    ] = 3.0


class SyncStatus(NamedTuple):
    """A snapshot of the monitor, for diagnostics and summaries. Counts run from the last start of the source."""

    stamp_ns: int = 0
    """Of the last sample; 0 where there was none."""
    phase: float = math.nan
    """p, in steps."""
    error: float = math.nan
    """e [rad]."""
    error_percent: float = math.nan
    """100 (p − 0.5)."""
    step_difference: int = 0
    initial_phase: float = math.nan
    """p at the start."""
    steps: int = 0
    """Strikes of the front wheel."""
    held: bool = False
    """The wheels are held: they have not moved yet, or rest where none stays by itself."""
    synchronized: bool = False
    steps_to_synchronization: int | None = None
    """Strikes of the front wheel up to the first within the band for good; None while not synchronized."""
    swing_percent: tuple[float, float] = (math.nan, math.nan)
    """Least and greatest error within the last whole step of the front wheel."""
    contraction: float = math.nan
    """Ratio by which a step shrinks the distance to the fixed point: the last that could be told, or NaN."""
    history: tuple[float, ...] = ()
    """Error at each strike of the front wheel [%]."""
    slips: int = 0
    """Times that a wheel struck twice in a row."""
    slipped: bool = False
    """A step has slipped within the last `hold_steps` steps."""
    losses: int = 0
    lost: bool = False
    """Was synchronized, and is no more."""
    stalled: tuple[str, ...] = ()
    """The wheels that have stalled."""
    restarts: int = 0
    """How often the source has started anew."""
    cadence: CadenceStatus = CadenceStatus(math.nan, 0, 0, 0.0)


class SyncMonitor:
    """Follows the phase; one sample in, the synchronization error out.

    Everything but the counts of gaps and restarts starts afresh when the source does: where it says so
    (`PhaseSample.restarts`), stamps that go back, a silence of `stale_after`, or a jump that no wheel makes.
    """

    def __init__(self, params: SyncParams) -> None:
        self.configure(params)
        self._cadence = Cadence()
        self._restarts = 0
        self.reset()

    def configure(self, params: SyncParams) -> None:
        """Take changed parameters at once."""
        self.params = params
        self._front_alpha, self._rear_alpha = params.front.alpha, params.rear.alpha
        self._pitch = phi_pitch(params.front, params.rear)
        self._stall_ns = params.stall_after * 1e9

    def reset(self) -> None:
        """Start afresh with the next sample."""
        self._last: PhaseSample | None = None
        self._is_held = False
        self._error = self._smooth = self._initial_phase = self._contraction = math.nan
        self._steps = 0
        self._history: deque[float] = deque(maxlen=HISTORY)
        self._recent: deque[float] = deque(maxlen=WINDOW)
        self._entered: int | None = None
        self._held = 0
        self._synchronized = self._lost = False
        self._losses = self._slips = 0
        self._slipped_at: int | None = None
        self._usual = 0, 0
        self._swing = self._last_swing = math.nan, math.nan
        self._struck_ns = {FRONT: 0, REAR: 0}

    def update(self, phase: PhaseSample) -> SyncSample | None:
        """Take the next sample; None where an angle is none, or where the stamp is that of the last sample."""
        stamp_ns, now_front, now_rear, phi, n, restarts, *_ = phase
        front, rear = now_front.angle, now_rear.angle
        if not (-math.pi <= front <= math.pi and -math.pi <= rear <= math.pi and -math.pi <= phi.angle <= math.pi):
            return None
        last = self._last
        if last is None:
            return self._start(phase)
        dt = (stamp_ns - last.stamp_ns) * 1e-9
        if dt == 0.0 and restarts == last.restarts:
            return None
        if restarts != last.restarts or not 0.0 < dt <= self.params.stale_after:
            return self._restart(phase)
        front_strikes = _strikes(last.front, now_front, dt, self._front_alpha)
        rear_strikes = _strikes(last.rear, now_rear, dt, self._rear_alpha)
        if front_strikes is None or rear_strikes is None:
            return self._restart(phase)
        if n - last.step_difference != front_strikes - rear_strikes and not _may_miss_strikes(last, phase, dt):
            return self._restart(phase)
        self._cadence.tick(stamp_ns)
        if self._rest.update(phase):  # the time for which the wheels were held counts for no stall
            self._struck_ns = {FRONT: stamp_ns, REAR: stamp_ns}
        self._is_held = self._rest.held
        if front_strikes or rear_strikes:
            self._take_strikes(last, phase, front_strikes, rear_strikes)
        self._take_step_difference(n)
        self._take_error(last, phase, front_strikes, dt)
        self._last = phase
        return self._sample(phase)

    @property
    def restarts(self) -> int:
        """How often the source has started anew."""
        return self._restarts

    def status(self) -> SyncStatus:
        """A snapshot."""
        last = self._last
        if last is None:
            return SyncStatus(restarts=self._restarts, cadence=self._cadence.status())
        return SyncStatus(
            stamp_ns=last.stamp_ns,
            phase=0.5 + self._error / 100.0,
            error=self._error / 100.0 * self._pitch,
            error_percent=self._error,
            step_difference=last.step_difference,
            initial_phase=self._initial_phase,
            steps=self._steps,
            held=self._is_held,
            synchronized=self._synchronized,
            steps_to_synchronization=self._entered if self._synchronized else None,
            swing_percent=self._last_swing,
            contraction=self._contraction,
            history=tuple(self._history),
            slips=self._slips,
            slipped=self._slipped_at is not None and self._steps - self._slipped_at < self.params.hold_steps,
            losses=self._losses,
            lost=self._lost,
            stalled=self._stalled(last.stamp_ns),
            restarts=self._restarts,
            cadence=self._cadence.status(),
        )

    def _start(self, phase: PhaseSample) -> SyncSample:
        self._cadence.tick(phase.stamp_ns)
        self._last = phase
        self._rest = Rest(phase, self._front_alpha, self._rear_alpha)
        self._is_held = self._rest.held
        self._error = self._smooth = self._percent(phase.phi.angle)
        self._initial_phase = 0.5 + self._error / 100.0
        self._usual = phase.step_difference, phase.step_difference
        self._swing = self._error, self._error
        self._struck_ns = {FRONT: phase.stamp_ns, REAR: phase.stamp_ns}
        self._entered = 0 if abs(self._error) <= self.params.band_percent else None
        return self._sample(phase)

    def _restart(self, phase: PhaseSample) -> SyncSample:
        self.reset()
        self._restarts += 1
        self._cadence.jump(phase.stamp_ns)
        return self._start(phase)

    def _take_strikes(self, last: PhaseSample, phase: PhaseSample, front: int, rear: int) -> None:
        """Note the error at each forward strike of the front wheel; φ is continuous there, so it is interpolated."""
        if front > 0:
            self._struck_ns[FRONT] = phase.stamp_ns
            error = self._percent(last.phi.angle)
            change = math.remainder(self._percent(phase.phi.angle) - error, 100.0)
            motion = phase.front.angle - last.front.angle + 2.0 * self._front_alpha * front
            for strike in range(front):
                share = (self._front_alpha * (1 + 2 * strike) - last.front.angle) / (motion or 1.0)
                self._note(math.remainder(error + min(max(share, 0.0), 1.0) * change, 100.0))
        if rear > 0:
            self._struck_ns[REAR] = phase.stamp_ns

    def _note(self, error: float) -> None:
        self._history.append(error)
        if self._recent and abs(error - self._recent[-1]) > 50.0:
            self._recent.clear()
        self._recent.append(error)
        ratio = contraction(tuple(self._recent))
        if not math.isnan(ratio):
            self._contraction = ratio
        self._last_swing, self._swing = self._swing, (self._error, self._error)

    def _take_step_difference(self, n: int) -> None:
        """n takes two neighbouring values in normal operation; where it leaves them, a wheel has slipped."""
        low, high = self._usual
        if low <= n <= high and low < high:
            return
        slips = max(n - 1 - low, high - 1 - n, 0)
        if slips:
            self._slips += slips
            self._slipped_at = self._steps
        self._usual = max(min(low, n), n - 1), min(max(high, n), n + 1)

    def _take_error(self, last: PhaseSample, phase: PhaseSample, strikes: int, dt: float) -> None:
        """Latch after `hold_steps` strikes within ±band; unlatch beyond ±(band + hysteresis)."""
        params = self.params
        self._error = error = self._percent(phase.phi.angle)
        low, high = self._swing
        if not low <= error <= high:
            self._swing = min(low, error), max(high, error)
        self._smooth = self._smoothed(last, phase, dt)
        first = self._steps + 1
        self._steps += strikes
        edge = params.band_percent + (params.band_hysteresis_percent if self._synchronized else 0.0)
        if abs(self._smooth) <= edge and not self._stalled(phase.stamp_ns):
            if self._entered is None:
                self._entered = first
            self._held += max(strikes, 0)
            if self._held >= params.hold_steps:
                self._synchronized, self._lost = True, False
        else:
            self._entered, self._held = None, 0
            if self._synchronized:
                self._synchronized, self._lost = False, True
                self._losses += 1

    def _smoothed(self, last: PhaseSample, phase: PhaseSample, dt: float) -> float:
        """The error that its past and rate foretell, drawn towards the new one; the new one where they disagree."""
        rate = 50.0 * (last.phi.rate + phase.phi.rate) / self._pitch
        foretold = self._smooth + (rate * dt if abs(rate) <= 100.0 * FASTEST else 0.0)
        surprise = math.remainder(self._error - foretold, 100.0)
        if abs(surprise) > SURPRISE:
            return self._error
        return math.remainder(foretold + surprise * dt / (dt + SMOOTHING), 100.0)

    def _stalled(self, stamp_ns: int) -> tuple[str, ...]:
        if self._is_held:
            return ()
        return tuple([wheel for wheel, struck_ns in self._struck_ns.items() if stamp_ns - struck_ns > self._stall_ns])

    def _percent(self, phi: float) -> float:
        """100 (p − 0.5), in [−50, 50)."""
        percent = (100.0 * phi / self._pitch) % 100.0
        return percent - 50.0 if percent < 100.0 else -50.0

    def _sample(self, phase: PhaseSample) -> SyncSample:
        synchronized = self._synchronized and not self._is_held  # wheels that are held do not walk
        return SyncSample(phase.stamp_ns, self._error / 100.0 * self._pitch, self._error, synchronized)


def _strikes(last: Turn, now: Turn, dt: float, alpha: float) -> int | None:
    """Forward strikes of a wheel between two samples, negative for backward ones; None where no wheel moves so.

    Its angle falls (rises) by 2α at each.
    """
    expected = _expected(last, now, dt)
    change = now.angle - last.angle
    strikes = round((expected - change) / (2.0 * alpha))
    surprise = change + 2.0 * alpha * strikes - expected
    return strikes if abs(surprise) <= 0.5 * alpha + abs(expected) else None


def _expected(last: Turn, now: Turn, dt: float) -> float:
    """How far a wheel turns between two samples at their speeds [rad]."""
    rate = 0.5 * (last.rate + now.rate)
    return rate * dt if -FASTEST <= rate <= FASTEST else 0.0


def _may_miss_strikes(last: PhaseSample, now: PhaseSample, dt: float) -> bool:
    """Whether a wheel may strike unseen between two samples: n is then taken as it comes."""
    return max(abs(_expected(last.front, now.front, dt)), abs(_expected(last.rear, now.rear, dt))) > LONG_WAY
