"""The synchronization monitor: how far the pair is from walking in step, and whether it stays there (contract §1, §5).

Sees only phase samples. In step is what `dcdrw_msgs_py.in_step` says, at every instant: at the samples, and at the
strikes between them. Noise is dealt with here and nowhere else: the error is smoothed before it is held against the
band, by no more than noise explains, and once within, it may stray beyond by as much, up to `band_hysteresis_percent`.
The counts of coarse encoders are noise, too. Without noise the smoothed error is the error, and the hysteresis is zero.
Noise is what the error does between strikes that no smooth motion does, whatever speeds the source gives.
"""

import math
from collections import deque
from statistics import fmean
from typing import Annotated, NamedTuple

from dcdrw_msgs_py.in_step import BAND_PERCENT, HOLD_STEPS, in_step_from, strikes_in_step, wrapped_percent
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
NOISE_MEMORY = 1.0
"""Time over which the noise of the error is measured [s]."""
NOISE_SPAN = 3.0
"""So many times itself, as root mean square, noise may carry the error from where it is."""
SURPRISE = 5.0
"""An error further than this from what its past and rate predict is motion, not noise [%]."""
WILD = 2.0
"""And further than so many times what noise explains."""
SAME = 0.02
"""But for this share, a wheel's speeds before and after a strike must tell how far it turned."""
ROUNDING = 1e-6
"""An error that is further beyond the band's edge is not on it [%]: large rotations leave so much open."""
FASTEST = 100.0
"""A speed beyond this is not a measurement [rad/s]."""
FEWEST = 4.25
"""Of fewer samples in a step, the extremes of the error lie between two of them."""
LATEST_STEPS = 8
"""So many steps tell how many samples there are in one."""
LONG_WAY = 0.1
"""A wheel that turns further than this between two samples may strike unseen [rad]."""


class SyncParams(NamedTuple):
    """What counts as synchronized, stalled and stale."""

    front: WheelPitch = WheelPitch()
    rear: WheelPitch = WheelPitch()
    band_percent: Annotated[
        float, Quantity('the pair comes into step when the error is within this', '%', above=0.0, high=50.0, live=True)
    ] = BAND_PERCENT
    band_hysteresis_percent: Annotated[
        float,
        Quantity(
            'and falls out of step when it is beyond by more than noise explains, or than this',
            '%',
            low=0.0,
            high=50.0,
            live=True,
        ),
    ] = 1.0
    hold_steps: Annotated[
        int,
        Quantity(
            'strikes of the front wheel within the band that make it synchronized', low=1, high=HISTORY, live=True
        ),
    ] = HOLD_STEPS
    stale_after: Annotated[
        float,
        Quantity(
            'without a sample for this long the input is stale; start afresh', 's', above=0.0, high=60.0, live=True
        ),
    ] = 1.0
    stall_after: Annotated[
        float,
        Quantity(
            'a wheel without a strike for this long has stalled; a step takes 0.56 s',
            's',
            above=0.0,
            high=60.0,
            live=True,
        ),
    ] = 3.0


class SyncStatus(NamedTuple):
    """A snapshot of the monitor, for diagnostics and summaries. Counts run from the last start of the source."""

    stamp_ns: int = 0
    """Stamp of the last sample; 0 where there was none."""
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
    """Strikes of the front wheel up to the one from which on the pair is in step; None while not synchronized."""
    steps_at_latest: int | None = None
    """Likewise if the error left the band once more in a gap, wherever it may have; the same where no gap hides it."""
    swing_percent: tuple[float, float] = (math.nan, math.nan)
    """Least and greatest error within the last whole step of the front wheel."""
    final_band_percent: tuple[float, float] = (math.nan, math.nan)
    """Likewise over the last `hold_steps` whole steps and the one under way."""
    contraction: float = math.nan
    """Ratio by which a step shrinks the distance to the fixed point: the last that could be told, or NaN."""
    history: tuple[float, ...] = ()
    """Error at each strike of the front wheel [%]."""
    strays: int = 0
    """Lone wild samples, which are passed over."""
    slips: int = 0
    """Times that a wheel struck twice in a row."""
    slipped: bool = False
    """A step has slipped within the last `hold_steps` steps."""
    losses: int = 0
    lost: bool = False
    """Was synchronized, and is no longer."""
    stalled: tuple[str, ...] = ()
    """The wheels that have stalled."""
    resolution_percent: float = 0.0
    """How far coarse encoders leave the error open, a count of each [%]; 0 where the rotations are told finely."""
    too_coarse: bool = False
    """That is as much as the band: the error may seem to be outside or inside where it is not."""
    samples_in_step: float = math.nan
    """How many samples there are in a step of the front wheel, of late; NaN before the second step."""
    restarts: int = 0
    """How often the source has started anew."""
    cadence: CadenceStatus = CadenceStatus(math.nan, 0, 0, 0.0)

    @property
    def too_rare(self) -> bool:
        """The error may leave the band from one sample to the next and be back: nobody knows whether it does."""
        return self.samples_in_step < FEWEST

    @property
    def steps_text(self) -> str:
        """The steps to synchronization as people read them: from and to where a gap leaves them open."""
        first, last = self.steps_to_synchronization, self.steps_at_latest
        return f'{first}' if first == last or last is None else f'{first} to {last}'


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
        self._since = self._latest = 0
        self._was_seen = True
        self._seen_swing = -math.inf, math.inf
        self._fastest = self._last_fastest = 0.0
        self._noise2 = self._watched = 0.0
        self._stray = 0.0
        """How far noise, or the counts of coarse encoders, may carry the error from where it is [%]."""
        self._moves: deque[tuple[float, float]] = deque(maxlen=3)
        self._wild: float | None = None
        self._resolution = 0.0
        self._synchronized = self._lost = False
        self._losses = self._slips = self._strays = 0
        self._slipped_at: int | None = None
        self._usual = 0, 0
        self._swing = self._last_swing = math.nan, math.nan
        self._swings: list[tuple[float, float]] = []
        self._struck_ns = {FRONT: 0, REAR: 0}
        self._step_ns: deque[float] = deque(maxlen=LATEST_STEPS)
        self._samples_in_step = math.nan

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
        turned = self._turned(last, phase, dt)
        if turned is None:
            return self._restart(phase)
        front_strikes, rear_strikes, dt = turned
        self._cadence.tick(stamp_ns)
        if self._rest.update(phase):  # the time for which the wheels were held counts for no stall
            self._struck_ns = {FRONT: stamp_ns, REAR: stamp_ns}
        self._is_held = self._rest.held
        if front_strikes > 0:
            if self._steps:
                self._step_ns.append((stamp_ns - self._struck_ns[FRONT]) / front_strikes)
                self._samples_in_step = fmean(self._step_ns) / max(self._cadence.period_ns, 1)
            self._struck_ns[FRONT] = stamp_ns
        if rear_strikes > 0:
            self._struck_ns[REAR] = stamp_ns
        self._take_step_difference(n)
        self._take_error(last, phase, front_strikes, rear_strikes, dt)
        self._last = phase
        return self._sample(phase)

    def _turned(self, last: PhaseSample, now: PhaseSample, dt: float) -> tuple[int, int, float] | None:
        """Strikes of both wheels between two samples, and the time in which they turned on [s]; None where none do so.

        That is the time of the stamps, but within bursts, stamped as they arrive, the mean one, where it goes better
        with the speeds.
        """
        even = self._cadence.seconds(dt)
        found = self._struck(last, now, dt)
        other = self._struck(last, now, even) if even != dt else None
        if other and (not found or self._off(last, now, other, even) < self._off(last, now, found, dt)):
            return *other, even
        return (*found, dt) if found else None

    def _struck(self, last: PhaseSample, now: PhaseSample, dt: float) -> tuple[int, int] | None:
        """Strikes of both wheels within dt seconds; None where no pair moves so."""
        told_front, told_rear = _told_steps(last, now)
        front = _strikes(last.front, now.front, dt, self._front_alpha, told_front)
        rear = _strikes(last.rear, now.rear, dt, self._rear_alpha, told_rear)
        if front is None or rear is None:
            return None
        if now.step_difference - last.step_difference != front - rear and not _may_miss_strikes(last, now, dt):
            return None
        return front, rear

    def _off(self, last: PhaseSample, now: PhaseSample, strikes: tuple[int, int], dt: float) -> float:
        """How far the wheels are, with so many strikes, from where their speeds have them after dt seconds [rad]."""
        front, rear = strikes
        turned = abs(now.front.angle - last.front.angle + 2.0 * self._front_alpha * front) + abs(
            now.rear.angle - last.rear.angle + 2.0 * self._rear_alpha * rear
        )
        speed = 0.5 * sum(abs(rate) for rate in (last.front.rate, now.front.rate, last.rear.rate, now.rear.rate))
        return abs(speed * dt - turned)

    @property
    def held(self) -> bool:
        """Whether the wheels are held."""
        return self._is_held

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
            steps_to_synchronization=self._since if self._synchronized else None,
            steps_at_latest=max(self._since, self._latest) if self._synchronized else None,
            swing_percent=self._last_swing,
            final_band_percent=self._final_band(),
            contraction=self._contraction,
            history=tuple(self._history),
            strays=self._strays,
            slips=self._slips,
            slipped=self._slipped_at is not None and self._steps - self._slipped_at < self.params.hold_steps,
            losses=self._losses,
            lost=self._lost,
            stalled=self._stalled(last.stamp_ns),
            resolution_percent=self._resolution,
            too_coarse=self._resolution >= self.params.band_percent,
            samples_in_step=self._samples_in_step,
            restarts=self._restarts,
            cadence=self._cadence.status(),
        )

    def _final_band(self) -> tuple[float, float]:
        lows, highs = zip(*self._swings, self._swing, strict=True)
        return min(lows), max(highs)

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
        self._since = in_step_from(0, 0, self._error, self._error, self.params.band_percent + ROUNDING)
        return self._sample(phase)

    def _restart(self, phase: PhaseSample) -> SyncSample:
        self.reset()
        self._restarts += 1
        self._cadence.jump(phase.stamp_ns)
        return self._start(phase)

    def _note(self, error: float) -> None:
        self._history.append(error)
        if self._recent and abs(error - self._recent[-1]) > 50.0:
            self._recent.clear()
        self._recent.append(error)
        ratio = contraction(tuple(self._recent))
        if not math.isnan(ratio):
            self._contraction = ratio
        if len(self._history) > 1:  # what came before the first strike was no whole step
            self._swings.append(self._swing)
            del self._swings[: -self.params.hold_steps]
            if self._was_seen:
                self._seen_swing = self._swing
        if self._fastest:
            self._last_fastest, self._fastest = self._fastest, 0.0
        self._last_swing, self._swing = self._swing, (error, error)

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

    def _take_error(self, last: PhaseSample, phase: PhaseSample, front: int, rear: int, dt: float) -> None:
        """Hold the error against the band: here, and at the strikes on the way."""
        params, strikes = self.params, self._steps + front
        if phase.resolution or self._resolution:
            self._resolution = round(100.0 * phase.resolution, 6)
            self._reckon_stray()
        edge = params.band_percent + ROUNDING
        if self._since <= self._steps:  # a whole step, or more, in the band
            edge += min(params.band_hysteresis_percent, self._stray)
        is_gap = self._cadence.is_gap(dt)
        is_blind = is_gap and dt > SMOOTHING  # for so long that rates foretell nothing
        if is_blind:
            self._was_seen = False
        before, self._error = self._error, self._percent(phase.phi.angle)
        error = self._error
        foretold = by_rates = self._smooth + 50.0 * (last.phi.rate + phase.phi.rate) / self._pitch * dt
        is_wild = math.isfinite(by_rates) and abs(math.remainder(error - by_rates, 100.0)) > self._surprise
        if front or rear:
            # A wild sample tells no strike: neither on the way there nor on the way back.
            believed = math.inf if (is_wild or self._wild is not None) and not is_blind else edge
            crossed = self._cross(last, phase, front, rear, dt, believed, is_blind)
            foretold = by_rates if is_wild else crossed
        is_smooth = not (front or rear or is_gap) and dt <= SMOOTHING
        self._take_noise(math.remainder(error - before, 100.0), dt, is_smooth)
        speed = abs(phase.phi.rate)
        if speed > self._fastest:
            self._fastest = speed
        if is_blind:
            self._take_gap(before, dt, strikes, edge)
        elif front:
            self._was_seen = True
        self._steps = strikes
        if is_blind:
            foretold, is_wild = error, False
        self._judge(foretold, is_wild and not self._is_held, dt, edge)
        if phase.stamp_ns - min(self._struck_ns.values()) > self._stall_ns and not self._is_held:
            self._since = strikes + 1
        if strikes_in_step(self._since, strikes) >= params.hold_steps:
            self._synchronized, self._lost = True, False
        elif self._synchronized and self._since > strikes:
            self._synchronized, self._lost = False, True
            self._losses += 1

    def _take_gap(self, before: float, dt: float, step: int, edge: float) -> None:
        """How far the error may have gone unseen: as fast as it was of late, and within the last step that was seen."""
        after = before + math.remainder(self._error - before, 100.0)
        reach = 50.0 * max(self._fastest, self._last_fastest) / self._pitch * dt
        low, high = self._seen_swing
        middle = 0.5 * (before + after)
        low, high = max(low, middle - reach), min(high, middle + reach)
        self._latest = in_step_from(self._latest, step, low, high, edge)

    def _cross(
        self, last: PhaseSample, phase: PhaseSample, front: int, rear: int, dt: float, edge: float, is_blind: bool
    ) -> float:
        """Take the error at each forward strike between two samples; returns the error foretold for the later one."""
        one = _Turning.between(last.front, phase.front, front, dt, self._front_alpha, is_blind, self._stray)
        other = _Turning.between(last.rear, phase.rear, rear, dt, self._rear_alpha, is_blind, self._stray)

        def error(time: float) -> float:
            return self._smooth + 100.0 * (one.steps(time) - other.steps(time))

        step = self._steps
        times = [(time, True) for time in one.strikes] + [(time, False) for time in other.strikes]
        for time, is_front in sorted(times):
            at_strike = math.remainder(error(time), 100.0)
            if edge < math.inf:
                self._take_swing(at_strike)
            self._since = in_step_from(self._since, step, at_strike, at_strike, edge)
            if is_front:  # which belongs to the step that it ends and to that which it opens
                step += 1
                self._since = in_step_from(self._since, step, at_strike, at_strike, edge)
                self._note(at_strike)
        return error(dt)

    def _take_swing(self, error: float) -> None:
        low, high = self._swing
        if not low <= error <= high:
            self._swing = min(low, error), max(high, error)

    def _reckon_stray(self) -> None:
        self._stray = max(NOISE_SPAN * math.sqrt(self._noise2), self._resolution)

    @property
    def _surprise(self) -> float:
        """How far from where its rates take it an error is wild [%]."""
        return max(SURPRISE, WILD * self._stray)

    def _take_noise(self, moved: float, dt: float, is_smooth: bool) -> None:
        """Measure noise by the third difference of the error: that of a motion seen without a strike is none."""
        if not is_smooth:
            self._moves.clear()
            return
        moves = self._moves
        moves.append((moved, dt))
        if len(moves) < 3:
            return
        noise2 = _unevenness(*moves)
        if noise2 <= SURPRISE * SURPRISE:
            self._watched = min(self._watched + dt, NOISE_MEMORY)
            self._noise2 += (noise2 - self._noise2) * min(dt / self._watched, 1.0)
            self._reckon_stray()

    def _judge(self, foretold: float, is_wild: bool, dt: float, edge: float) -> None:
        """Hold the error against the band: that which its past and rate foretell, drawn as far as noise explains.

        A wild one, which is not where the rates take it, waits for the next: where that goes on from before, it was
        alone.
        """
        wild, self._wild = self._wild, None
        if is_wild and wild is None:
            self._wild, self._smooth = self._error, math.remainder(foretold, 100.0)
            return
        surprise = math.remainder(self._error - foretold, 100.0) if math.isfinite(foretold) else math.inf
        stray, limit = surprise * SMOOTHING / (dt + SMOOTHING), self._stray
        if self._is_held or is_wild or abs(surprise) > self._surprise:
            stray = 0.0
        self._smooth = smooth = math.remainder(self._error - min(max(stray, -limit), limit), 100.0)
        self._take_swing(self._error)
        self._since = in_step_from(self._since, self._steps, smooth, smooth, edge)
        if is_wild and wild is not None:
            self._take_swing(wild)
            self._since = in_step_from(self._since, self._steps, wild, wild, edge)
        elif wild is not None:
            self._strays += 1

    def _stalled(self, stamp_ns: int) -> tuple[str, ...]:
        if self._is_held:
            return ()
        return tuple([wheel for wheel, struck_ns in self._struck_ns.items() if stamp_ns - struck_ns > self._stall_ns])

    def _percent(self, phi: float) -> float:
        """100 (p − 0.5), in [−50, 50)."""
        return wrapped_percent(phi / self._pitch)

    def _sample(self, phase: PhaseSample) -> SyncSample:
        # Wheels that are held do not walk; whether a wild sample is alone is not known yet, nor is what none shows.
        synchronized = self._synchronized and not self._is_held and self._wild is None
        synchronized &= not self._samples_in_step < FEWEST
        return SyncSample(phase.stamp_ns, self._error / 100.0 * self._pitch, self._error, synchronized)


class _Turning(NamedTuple):
    """How a wheel turns between two samples: at a speed before its strike and another after, or evenly."""

    pitch: float
    """2α [rad]"""
    strikes: tuple[float, ...]
    """Times of its forward strikes since the first sample [s]."""
    before: float
    """[rad/s]"""
    after: float

    @classmethod
    def between(
        cls, last: Turn, now: Turn, strikes: int, dt: float, alpha: float, is_blind: bool, stray: float
    ) -> '_Turning':
        """Turning between two samples, from both and the strikes between them.

        Evenly where speeds tell nothing, or not how far it turned, but for noise that strays so far [%].
        """
        pitch, rate = 2.0 * alpha, last.rate
        turned = now.angle - last.angle + pitch * strikes
        if strikes == 1 and not is_blind and 0.0 < rate <= FASTEST and 0.0 <= now.rate <= FASTEST:
            struck = min((alpha - last.angle) / rate, dt)
            if abs(rate * struck + now.rate * (dt - struck) - turned) <= SAME * turned + pitch * stray / 100.0:
                return cls(pitch, (struck,), rate, now.rate)
        mean = turned / dt
        times = [(alpha - last.angle + pitch * strike) / mean for strike in range(strikes)] if mean > 0.0 else []
        return cls(pitch, tuple([min(max(time, 0.0), dt) for time in times]), mean, mean)

    def steps(self, time: float) -> float:
        """How far it has turned by a time since the first sample [steps]."""
        ahead = min(time, self.strikes[0]) if self.strikes else time
        return (self.before * ahead + self.after * (time - ahead)) / self.pitch


def _unevenness(one: tuple[float, float], two: tuple[float, float], three: tuple[float, float]) -> float:
    """The mean square of the noise of four values, by how far each of them moves, in what time, from the one before.

    By their third divided difference, and how noise adds up in it: at even intervals, twentyfold in the mean square.
    """
    (move1, dt1), (move2, dt2), (move3, dt3) = one, two, three
    early, late, whole = dt1 + dt2, dt2 + dt3, dt1 + dt2 + dt3
    slope = move2 / dt2
    difference = (move3 / dt3 - slope) / late - (slope - move1 / dt1) / early
    weight1, weight2 = whole / (dt1 * dt2 * late), whole / (early * dt2 * dt3)
    weight0, weight3 = 1.0 / (dt1 * early), 1.0 / (late * dt3)
    return difference**2 / (weight0 * weight0 + weight1 * weight1 + weight2 * weight2 + weight3 * weight3)


def _told_steps(last: PhaseSample, now: PhaseSample) -> tuple[int | None, int | None]:
    """The strikes of both wheels between two samples, where their source counts the steps."""
    ahead = now.front_steps - now.rear_steps
    if not (now.front_steps or now.rear_steps) or ahead != now.step_difference:
        return None, None
    return now.front_steps - last.front_steps, now.rear_steps - last.rear_steps


def _strikes(last: Turn, now: Turn, dt: float, alpha: float, told: int | None) -> int | None:
    """Forward strikes of a wheel between two samples, negative for backward ones; None where no wheel moves so.

    Its angle falls (rises) by 2α at each. As many as are told, or as go best with its speeds.
    """
    expected = _expected(last, now, dt)
    change = now.angle - last.angle
    strikes = round((expected - change) / (2.0 * alpha)) if told is None else told
    surprise = change + 2.0 * alpha * strikes - expected
    return strikes if abs(surprise) <= 0.5 * alpha + abs(expected) else None


def _expected(last: Turn, now: Turn, dt: float) -> float:
    """How far a wheel turns between two samples at their speeds [rad]."""
    rate = 0.5 * (last.rate + now.rate)
    return rate * dt if -FASTEST <= rate <= FASTEST else 0.0


def _may_miss_strikes(last: PhaseSample, now: PhaseSample, dt: float) -> bool:
    """Whether a wheel may strike unseen between two samples: n is then taken as it comes."""
    return max(abs(_expected(last.front, now.front, dt)), abs(_expected(last.rear, now.rear, dt))) > LONG_WAY
