"""What a fit tells: each parameter and combination with its error, what only the prior tells, and what to measure."""

import math
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_opening

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.rolling import default_rest_length
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.identification.fit import OWN, START, Explained, Fit, Problem, unheard
from dcdrw_sim.identification.unknowns import Form, Knowledge, correlation
from dcdrw_sim.model.start import start
from dcdrw_sim.model.wheel import kept

NORMAL_90 = 1.6449
"""Half of a 90 % interval, in standard errors."""
FROM_TRIAL, FROM_PRIOR = 0.3, 0.8
"""Up to the first part of what was assumed an error comes from the trial, above the second from the assumption."""
TOGETHER = 0.95
"""Parameters whose errors correlate by so much are told together, not apart."""
BEYOND_NOISE = 1.5
"""Residuals of more than so many times the noise are not explained ..."""
TOLERATED = 0.01
"""... unless they are below this part of α: spokes are no straighter."""
SCATTERED = 0.5
"""Residuals above this part of α explain nothing, whatever the noise: they no longer tell one spoke from the next."""
IN_A_ROW, MOST_IN_ROWS = 5, 0.1
"""So many outliers in a row are a motion of their own: more than this part of the samples is not explained ..."""
MOST_OUTLIERS = 0.4
"""... nor is a trial of which more than this part are outliers, in a row or not."""
WELL = 1e-5
"""Part of the squares by which a profile's last step changes them: by little beside 1."""
PROFILE, QUICK = (0.9, 1.8, 2.7, 4.0, 6.0), 10
"""Where profiles are computed on either side, in standard errors, until they leave the 90 % interval; and evaluations
for one search at most."""
FURTHER_PHASES = (0.15, 0.5, 0.85)
"""Starts of a further trial that are thought through."""
BEYOND_CHANCE = 2.0
"""A zero or stamps that are off by so many standard errors are told, where they were sought."""
PIECES = 20
"""In so many pieces of time and stance angle it is looked for what a trial leaves unexplained."""


class Source(Enum):
    """Where the knowledge of a parameter comes from."""

    TRIAL = 'trial'
    BOTH = 'trial and assumption'
    PRIOR = 'assumption'


class Finding(NamedTuple):
    """One parameter or combination."""

    name: str
    unit: str
    value: float
    error: float
    """Standard error."""
    low: float
    """Of its 90 % interval."""
    high: float
    part: float
    """Its error over what it was before the trials, in coordinates."""

    @property
    def source(self) -> Source:
        """What tells it."""
        return Source.TRIAL if self.part < FROM_TRIAL else Source.PRIOR if self.part > FROM_PRIOR else Source.BOTH


class Combination(NamedTuple):
    """What determines a motion where no parameter does by itself."""

    name: str
    unit: str
    doc: str
    value: Callable[[RigParams], float]
    least: float = -math.inf
    """Lower bound."""


class Gain(NamedTuple):
    """What a measurement would bring."""

    what: str
    errors: dict[str, tuple[float, float]]
    """Standard errors, now and then, of what gains much."""
    score: float
    """Sum of the logarithms by which errors fall."""


class Misfit(NamedTuple):
    """What a trial leaves unexplained, where it is worst."""

    wheel: int
    """0 the front, 1 the rear."""
    begins: float
    """Time in the trial [s]."""
    ends: float
    theta: float
    """Stance angle about which the mean residual is greatest [rad]."""
    worst: float
    """Mean residual of that time [rad]."""
    outliers: float
    """Part of the trial's samples that are outliers."""

    @property
    def is_outliers(self) -> bool:
        """Whether it is the outliers for which the trial is not explained."""
        return self.outliers > MOST_OUTLIERS


class Fault(NamedTuple):
    """What is wrong with a trial's record, and was allowed for."""

    wheel: int | None
    """Whose zero it is, 0 the front's, 1 the rear's; None: the stamps of the rear beside the front."""
    value: float
    """What is measured too great [rad], or too late [s]."""
    error: float
    """Its standard error."""


class Profile(NamedTuple):
    """How much worse the best explanation is with one parameter held elsewhere."""

    name: str
    values: Floats
    deviance: Floats
    """Twice the logarithm of the likelihood's ratio; a parabola (v − v̂)²/σ² where errors are even."""

    @property
    def interval(self) -> tuple[float, float]:
        """The 90 % interval; it ends where the profile does, if it does not rise so far there."""
        roots = np.sqrt(np.maximum(self.deviance, 0.0))
        best = int(np.argmin(roots))
        low, high = (
            float(np.interp(NORMAL_90, np.maximum.accumulate(roots[side]), self.values[side]))
            for side in (slice(best, None, -1), slice(best, None))
        )
        return low, high


def preload(rig: RigParams) -> float:
    """ΔD0: by how much the coupler's rest length exceeds that at rest at φ = α [m]."""
    rig = rig.resolved()
    return rig.D0 - default_rest_length(math.nan, rig.S0, rig.front.length, rig.front.alpha)


COMBINATIONS = (
    Combination('drift', 'm/s', 'k ΔD0 / b', lambda rig: rig.k * preload(rig) / rig.b),
    Combination('damping_per_mass', '1/s', 'b / m', lambda rig: 2.0 * rig.b / (rig.front.mass + rig.rear.mass)),
    Combination('stiffness_per_mass', '1/s²', 'k / m', lambda rig: 2.0 * rig.k / (rig.front.mass + rig.rear.mass)),
    Combination(
        'friction_per_mass',
        'm/s²',
        'F_c / m',
        lambda rig: 2.0 * rig.coupler_friction / (rig.front.mass + rig.rear.mass),
        0.0,
    ),
    Combination(
        'drive',
        '',
        'sin γ − c_r α / sin α',
        lambda rig: math.sin(rig.slope) - rig.rolling_resistance * rig.front.alpha / math.sin(rig.front.alpha),
    ),
    Combination('front_kept', '', 'η of the front wheel', lambda rig: kept(rig.front)),
    Combination('rear_kept', '', 'η of the rear wheel', lambda rig: kept(rig.rear)),
)


def parameters(fit: Fit, profiled: Sequence[Profile] = ()) -> list[Finding]:
    """Each parameter that was sought, its interval from its profile where there is one, else from its error."""
    found, intervals = [], {profile.name: profile.interval for profile in profiled}
    for index, unknown in enumerate(fit.known.unknowns):
        at, error = fit.coordinates[index], math.sqrt(fit.covariance[index, index])
        low, high = (
            unknown.shown(_inside(at + sign * NORMAL_90 * error, unknown.low, unknown.form)) for sign in (-1, 1)
        )
        low, high = intervals.get(unknown.name, (low, high))
        part = error / math.sqrt(fit.known.covariance[index, index])
        found.append(Finding(unknown.name, unknown.unit, unknown.shown(at), unknown.error(at, error), low, high, part))
    return found


def combinations(fit: Fit) -> list[Finding]:
    """Each combination, by its gradient."""
    found = []
    for combination in COMBINATIONS:
        value, gradient = _gradient(fit.after, combination.value)
        error, before = (math.sqrt(gradient @ each @ gradient) for each in (fit.covariance, fit.known.covariance))
        if before > 0.0:
            low, high = max(value - NORMAL_90 * error, combination.least), value + NORMAL_90 * error
            found.append(Finding(combination.name, combination.unit, value, error, low, high, error / before))
    return found


def _inside(coordinate: float, low: float, form: Form) -> float:
    return coordinate if form is Form.LOGARITHM else max(coordinate, low)


def _gradient(known: Knowledge, value: Callable[[RigParams], float]) -> tuple[float, Floats]:
    """A combination, and its derivatives by the coordinates; away from lower bounds."""
    steps = 1e-4 * np.sqrt(np.diag(known.covariance))
    here = value(known.rig_with(known.coordinates))
    ahead = [value(known.rig_with(known.coordinates + step)) for step in np.diag(steps)]
    return here, (np.array(ahead) - here) / steps


def together(fit: Fit) -> Iterator[tuple[str, str, float]]:
    """Pairs of parameters that only go together, with the correlation of their errors."""
    correlations = correlation(fit.covariance)
    for i, one in enumerate(fit.known.unknowns):
        for j, other in enumerate(fit.known.unknowns[:i]):
            if abs(correlations[i, j]) > TOGETHER:
                yield other.name, one.name, float(correlations[i, j])


def gains(fit: Fit) -> list[Gain]:
    """What measurements would bring, best first: of one parameter each, or a further trial as long as the first."""
    found = []
    for index, unknown in enumerate(fit.known.unknowns):
        column = fit.covariance[:, index]
        covariance = fit.covariance - np.outer(column, column) / (column[index] + unknown.precision**2)
        found.append(_gain(fit, unknown.measurement, covariance))
    for phase in FURTHER_PHASES:
        try:
            information = _further(fit, phase)
        except ValueError:  # no wheel of this rig rolls by itself
            continue
        combined = np.asarray(np.linalg.inv(np.linalg.inv(fit.covariance) + information), float)
        found.append(_gain(fit, f'another trial as long, begun at {100 * phase:.0f} %', combined))
    return sorted(found, key=lambda gain: -gain.score)


def _further(fit: Fit, phase: float) -> Floats:
    """What a trial begun at a phase would tell of the unknowns."""
    after, trial = fit.after, fit.trials[0]
    state = np.array(start(after.rig_with(fit.coordinates), phase).state)
    state[0] += 1e-3  # away from its guard
    samples = trial.samples._replace(steps=1)
    problem = Problem(after, [samples], [trial.deviation])
    return problem.information(np.concatenate([fit.coordinates, state, np.zeros(OWN - START)]))


def _gain(fit: Fit, what: str, covariance: Floats) -> Gain:
    now, then = (np.sqrt(np.diag(each)) for each in (fit.covariance, covariance))
    errors = {
        unknown.name: (unknown.error(at, before), unknown.error(at, after))
        for unknown, at, before, after in zip(fit.known.unknowns, fit.coordinates, now, then, strict=True)
        if after < 0.7 * before
    }
    return Gain(what, errors, float(np.log(now / then).sum()))


def misfit(fit: Fit, trial: Explained) -> Misfit | None:
    """Where a trial departs from what any parameters explain; None where it does not."""
    rig, noise = fit.known.rig, max(trial.samples.noise(), 1e-9)
    tolerated = min(max(BEYOND_NOISE * noise, TOLERATED * rig.front.alpha), SCATTERED * rig.front.alpha)
    outliers = float(trial.outliers.mean())
    in_rows = binary_opening(trial.outliers, np.ones((IN_A_ROW, 1))).mean()
    if trial.noise <= tolerated and in_rows <= MOST_IN_ROWS and outliers <= MOST_OUTLIERS:
        return None
    pieces = np.array_split(np.arange(len(trial.residuals)), PIECES)
    means = np.array([np.median(trial.residuals[piece], axis=0) for piece in pieces])
    piece, wheel = np.unravel_index(int(np.abs(means).argmax()), means.shape)
    alpha = (rig.front.alpha, rig.rear.alpha)[wheel]
    theta = (trial.samples.rotations[:, wheel] + alpha) % (2.0 * alpha) - alpha
    edges = np.linspace(-alpha, alpha, PIECES + 1)
    of_angle = [
        np.abs(np.median(trial.residuals[inside, wheel])) if inside.any() else 0.0
        for inside in (np.digitize(theta, edges) - 1 == np.arange(PIECES)[:, None])
    ]
    at = int(np.argmax(of_angle))
    seconds = trial.samples.begins + trial.samples.seconds[pieces[piece]]
    return Misfit(
        int(wheel),
        float(seconds[0]),
        float(seconds[-1]),
        float(0.5 * (edges[at] + edges[at + 1])),
        float(means[piece, wheel]),
        outliers,
    )


def faults(fit: Fit, index: int) -> list[Fault]:
    """Zeros and stamps of a trial that are wrong, as far as the trial tells."""
    errors = np.sqrt(np.diag(fit.whole_covariance))
    (_, zeros, late), (_, of_zeros, of_late) = (fit.problem.own(index, x) for x in (fit.point, errors))
    found = [Fault(wheel, float(zeros[wheel, 0]), float(of_zeros[wheel, 0])) for wheel in range(2)]
    found.append(Fault(None, late, of_late))
    return [one for one in found if fit.allowing and abs(one.value) > BEYOND_CHANCE * one.error]


def profiles(fit: Fit, told: Callable[[str], None] = unheard) -> list[Profile]:
    """The profile of each parameter: all others, and the starts, sought anew with it held; `told` what is done next."""
    found, best = [], fit.problem.squares(fit.point)
    curvature: Floats = np.asarray(np.linalg.inv(fit.whole_covariance))
    for index, unknown in enumerate(fit.known.unknowns):
        told(f'how well {unknown.name} is known ({index + 1} of {len(fit.known.unknowns)}) ...')
        at, error = fit.coordinates[index], math.sqrt(fit.covariance[index, index])
        bounds = [bound[index] for bound in fit.known.bounds()]
        points = {at: 0.0}
        for way in (-1.0, 1.0):
            point, deviance = fit.point, 0.0
            for factor in PROFILE:
                value = float(np.clip(at + way * factor * error, *bounds))
                if value in points or deviance > NORMAL_90**2:
                    break
                held, more = fit.problem.held(index, value)
                others = np.delete(_followed(fit.problem, curvature, point, index, value), index)
                others = held.solve(others, robust=False, settled=WELL, evaluations=QUICK)
                deviance = points[value] = held.squares(others) + more - best
                point = np.insert(others, index, value)
        values = sorted(points)
        shown = np.array([unknown.shown(value) for value in values])
        found.append(Profile(unknown.name, shown, np.array([points[value] for value in values])))
    return found


def _followed(problem: Problem, curvature: Floats, point: Floats, index: int, value: float) -> Floats:
    """Where the best point goes when one unknown is moved, as far as the problem is linear and bounds allow."""
    moved: Floats = point.copy()
    held = np.arange(len(point)) == index
    moved[index] = value
    while True:
        off = curvature[np.ix_(~held, held)] @ (moved - point)[held]
        moved[~held] = point[~held] - np.linalg.solve(curvature[np.ix_(~held, ~held)], off)
        inside = np.clip(moved, problem.low, problem.high)
        beyond = (inside != moved) & ~held
        if not beyond.any():
            return moved
        moved, held = inside, held | beyond
