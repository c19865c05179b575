"""Many rigs judged at once: each from several starts, with its limit cycle and both regressions."""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.map.limit_cycles import NEUTRAL, LimitCycles, find_limit_cycles, losses
from dcdrw_sim.map.regression import TRIAL_PHASES, fit_affine, fit_raw
from dcdrw_sim.map.return_map import Complexes, spectrum
from dcdrw_sim.model.rigs import Rigs, rig_at, take
from dcdrw_sim.model.start import require_rolling, starts, uncoupled_speed
from dcdrw_sim.motion.ensemble import Ensemble, run_pairs
from dcdrw_sim.study.verdict import BAND, Judgement, Sections, Verdict, judge

ROCKING = 200
"""Room for the strikes of two wheels that rock until they stand: each about ln(1e-6)/ln(cos 30°) = 96."""


class Points(NamedTuple):
    """What became of N rigs from each of M starts, and what the return map says of them."""

    motions: Judgement
    """Each array of shape (N M,), the starts of a rig side by side: what each motion did while it was simulated."""
    sections: Sections
    walks: NDArray[np.bool_]
    """Which motions come back to the section of the map: those that walk on without a slip, shape (N M,)."""
    cycles: LimitCycles
    """To which they tend."""
    verdicts: NDArray[np.int8]
    """`Verdict` for good, shape (N, M): in step only where the limit cycle is, too."""

    @property
    def steps(self) -> Floats:
        """Steps to synchronization from each start, for good; NaN where it never is. Shape (N, M)."""
        return self._of_those_in_step(self.motions.steps)

    @property
    def times(self) -> Floats:
        """The same as time [s]."""
        return self._of_those_in_step(self.motions.time)

    def _of_those_in_step(self, values: Floats) -> Floats:
        return np.where(self.verdicts == Verdict.IN_STEP, values.reshape(self.verdicts.shape), math.nan)


def study(
    rigs: Rigs,
    seconds: float,
    phases: tuple[float, ...] = TRIAL_PHASES,
    band_percent: float = BAND_PERCENT,
    theta2_band: float = BAND,
    room: int | None = None,
) -> Points:
    """Judge N rigs from each of M starts, by their motions and by their limit cycles.

    A motion that is within the band when the time is over is in step for good only where there is a limit cycle for
    it to tend to, where that attracts it, and where its swing is within the band.

    Args:
        rigs: as `dcdrw_sim.motion.ensemble.spread` gives them.
        seconds: how long to simulate.
        phases: starts, as `ReturnMap.at_phase`: the front wheel about to strike.
        band_percent: in step is within ± this [% of a step].
        theta2_band: in place of BAND [rad].
        room: how many sections of a motion to keep; by default `section_room`.

    Raises:
        ValueError: an uncoupled wheel does not roll, and so no phase tells where to start.

    """
    starts = len(phases)
    room = section_room(rigs, seconds) if room is None else room
    pairs, ensemble = run_starts(rigs, seconds, phases, room)
    motions, sections = judge(ensemble, pairs, room, band_percent, theta2_band)
    # What walks on without a slip comes back to the section of the map.
    walks = (motions.verdict <= Verdict.ELSEWHERE) & (motions.slips == 0) & (motions.sections > 1)
    lasts = np.minimum(motions.sections, room)
    cycles = find_limit_cycles(rigs, _guesses(sections, lasts, walks, motions.verdict, starts))
    return Points(motions, sections, walks, cycles, _for_good(motions, cycles, starts, band_percent))


def _for_good(motions: Judgement, cycles: LimitCycles, starts: int, band_percent: float) -> NDArray[np.int8]:
    """The verdict of each motion, as `Points.verdicts`."""
    verdicts = motions.verdict.reshape(-1, starts)
    swings_within = (abs(cycles.swings) <= band_percent).all(axis=1)
    # Without a coupler every phase is a limit cycle: a multiplier is 1, and the pair stays where it is.
    holds = swings_within & (abs(cycles.multipliers[:, 0]) <= 1.0 + NEUTRAL)
    swings_beyond = cycles.stable & ~swings_within
    instead = np.where(swings_beyond, Verdict.SWINGS, Verdict.UNDECIDED)[:, None]
    return np.where((verdicts == Verdict.IN_STEP) & ~holds[:, None], instead, verdicts).astype(np.int8)


def judge_points(
    rigs: Rigs,
    seconds: float,
    phases: tuple[float, ...] = TRIAL_PHASES,
    band_percent: float = BAND_PERCENT,
    theta2_band: float = BAND,
    room: int | None = None,
) -> dict[str, NDArray[Any]]:
    """Every variable that `dcdrw_sim.study.sweep_dataset.VARIABLES` describes, for N rigs; arguments as of `study`.

    The result of a rig depends on no other.

    Returns:
        Arrays of shape (N, ...), by name; as many sections as the longest motion has.

    Raises:
        ValueError: as `study`.

    """
    points = study(rigs, seconds, phases, band_percent, theta2_band, room)
    judgement, sections, walks, cycles, _ = points
    count, starts = len(rigs.k), len(phases)
    lasts = np.minimum(judgement.sections, sections.time.shape[1])
    longest = int(lasts.max(initial=1))
    return {
        **_of_points(points),
        **_of_cycles(rigs, cycles),
        **_regressions(sections, lasts, walks, starts),
        **{f'start_{name}': value.reshape(count, starts) for name, value in judgement._asdict().items()},
        **{
            f'section_{name}': value[:, :longest].reshape(count, starts, longest)
            for name, value in sections._asdict().items()
        },
    }


def run_starts(rigs: Rigs, seconds: float, phases: tuple[float, ...], room: int) -> tuple[Rigs, Ensemble]:
    """The motions of N rigs from every start, and the rig of each motion; arguments as of `judge_points`."""
    states = np.concatenate([_start_states(alone, phases) for alone in uncoupled(rigs)])
    pairs = take(rigs, np.repeat(np.arange(len(rigs.k)), len(phases)))
    return pairs, run_pairs(pairs, states, seconds, 2 * room + ROCKING, strict=False, extremes=True)


def section_room(rigs: Rigs, seconds: float) -> int:
    """Room for more sections than a motion goes through: all steps at the fastest that an uncoupled wheel rolls.

    Raises:
        ValueError: one does not roll.

    """
    fastest = max(map(_fastest, set(uncoupled(rigs))), default=0.0)
    return math.ceil(fastest * seconds) + 2


def uncoupled(rigs: Rigs) -> Iterator[RigParams]:
    """Every rig but for its coupler: all that the limit cycles of its wheels alone depend on."""
    for index in range(len(rigs.k)):
        rig = rig_at(rigs, index)
        yield RigParams(
            rig.front,
            rig.rear,
            slope=rig.slope,
            gravity=rig.gravity,
            rolling_resistance=rig.rolling_resistance,
            friction_speed=rig.friction_speed,
        )


def _fastest(rig: RigParams) -> float:
    """Steps per second of the faster wheel, were it always at its fastest."""
    require_rolling(rig)
    return max(float(uncoupled_speed(rig, wheel, wheel.alpha)) / (2.0 * wheel.alpha) for wheel in (rig.front, rig.rear))


@lru_cache(maxsize=1024)
def _start_states(rig: RigParams, phases: tuple[float, ...]) -> Floats:
    """As `starts`, shape (starts, 4)."""
    return starts(rig, phases)


def _of_points(points: Points) -> dict[str, NDArray[Any]]:
    """What the starts of each point have in common."""
    verdicts, motions = points.verdicts, points.motions
    enters, settles, strike_steps = (
        value.reshape(verdicts.shape) for value in (motions.enters, motions.settles, motions.strike_steps)
    )
    return {
        'verdict': verdicts.max(axis=1),
        'in_step': (verdicts == Verdict.IN_STEP).mean(axis=1),
        'steps': points.steps.max(axis=1),
        'time': points.times.max(axis=1),
        'strike_steps': strike_steps.max(axis=1),
        'enters': enters.mean(axis=1),
        'settles': settles.mean(axis=1),
    }


def _of_cycles(rigs: Rigs, cycles: LimitCycles) -> dict[str, NDArray[Any]]:
    """The limit cycles."""
    walking = losses(rigs, cycles)
    omega1, theta2, omega2 = cycles.states.T
    return {
        'cycle_omega1': omega1,
        'cycle_theta2': theta2,
        'cycle_omega2': omega2,
        'cycle_period': cycles.periods,
        'cycle_low': cycles.swings[:, 0],
        'cycle_high': cycles.swings[:, 1],
        'stable': cycles.stable,
        'speed': walking.speed,
        'strike_loss': walking.strikes,
        'damper_loss': walking.damper,
        **_polar('multiplier', cycles.multipliers),
    }


def _regressions(
    sections: Sections, lasts: NDArray[np.int64], walks: NDArray[np.bool_], starts: int
) -> dict[str, NDArray[Any]]:
    """Both regressions, of the motions that walk."""
    count = len(walks) // starts
    states = np.stack([sections.omega1, sections.theta2, sections.omega2, sections.coupler_length], axis=-1)
    variables: dict[str, NDArray[Any]] = {}
    for name, fit, size in (('raw', fit_raw, 4), ('affine', fit_affine, 3)):
        matrices, ranks = np.full((count, size, size), math.nan), np.zeros(count, np.int8)
        for point in range(count):
            which = [pair for pair in range(point * starts, (point + 1) * starts) if walks[pair]]
            if which:
                found = fit(states[pair, : lasts[pair], :size] for pair in which)
                matrices[point], ranks[point] = found.matrix, found.rank
        values = np.full((count, size), complex(math.nan, math.nan))
        values[ranks > 0] = spectrum(matrices[ranks > 0])
        variables |= _polar(f'{name}_eigenvalue', values) | {f'{name}_rank': ranks}
    return variables


def _polar(name: str, values: Complexes) -> dict[str, NDArray[Any]]:
    """Complex numbers by modulus and angle."""
    return {f'{name}s': np.hypot(values.real, values.imag), f'{name}_angles': np.arctan2(values.imag, values.real)}


def _guesses(
    sections: Sections,
    lasts: NDArray[np.int64],
    walks: NDArray[np.bool_],
    verdicts: NDArray[np.int8],
    starts: int,
) -> Floats:
    """Where to search each point's limit cycle: the last section of the motion that changed least, of those in step."""
    states = np.stack([sections.omega1, sections.theta2, sections.omega2], axis=-1)
    rows = np.arange(len(lasts))
    last, before = (states[rows, np.maximum(lasts - back, 0)] for back in (1, 2))
    change = abs(last[:, 1] - before[:, 1]) + np.where(verdicts == Verdict.IN_STEP, 0.0, 2.0 * math.pi)
    change = np.where(walks, change, math.inf).reshape(-1, starts)
    best = change.argmin(axis=1)
    guesses: Floats = last.reshape(-1, starts, 3)[np.arange(len(best)), best]
    guesses[~walks.reshape(-1, starts).any(axis=1)] = math.nan
    return guesses
