"""Least squares: the rig, and each trial's start, under which the model's samples are nearest to those of the trials.

Of each trial more numbers are sought: its start, the systematic errors of both wheels' rotations, and by how much one
wheel's stamps are late. Samples of an angle are continuous functions of all parameters, strikes and all: only speeds
jump. Their derivatives are differences of trajectories that run side by side, as one ensemble.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

from dcdrw_msgs_py.rolling import stance_distance
from dcdrw_msgs_py.values import Floats, Mask
from dcdrw_sim.identification.samples import Samples
from dcdrw_sim.identification.unknowns import Knowledge
from dcdrw_sim.motion.ensemble import sample_pairs, spread

TOLERANCE = 1e-13
"""Of the trajectories' series [rad]: what is left of a difference over STEP is 1e-6 of it."""
STEP = 1e-6
"""Over which derivatives are taken, in the widths of what is known, and in rad and rad/s of a start."""
WINDOWS = 1.5, 3.0, 6.0
"""The first part of each trial is explained before more of it [s]: so far a phase drifts by less than a step. Each is
twice the one before, and so on to the end of long trials."""
ROBUST = 4.0
"""Residuals of more than so many standard deviations weigh less and less."""
OUTLYING = 5.0
"""Residuals of more than so many standard deviations are left out in the end."""
COARSEST = math.radians(0.01)
"""Least noise that is assumed at first [rad]."""
ROUGHLY, SETTLED = 1e-3, 1e-6
"""Part of the sum of squares, or of the parameters, by which a last step changes them: on the way, and in the end."""
INSIDE = 0.15, 0.5, 1.0
"""Searches begin so far from lower bounds at least, in the widths of what is known: gyration and restitution have
several valleys."""
WORTHWHILE = 0.1
"""What a search begun anew must gain [of squares in standard deviations] to be followed by another."""
EVALUATIONS, SEARCHES = 60, 6
"""At most, of one search; and so many searches for one point."""
ZERO = math.radians(0.02)
"""To what a wheel's zero is taken to be known by default, as well as `dcdrw calibrate` finds it [rad]."""
PARTS, REPEATED = 12, math.radians(0.005)
"""In each of so many parts of the stance angle samples share an error that repeats from step to step, as a camera's do
that sees tags at the same angles; of this standard deviation [rad]."""
START, ERRORS = 4, 2 * (1 + PARTS)
OWN = START + ERRORS + 1
"""Numbers of a trial's own: θ1, ω1, θ2, ω2 at its first sample, the systematic errors of ψ1 and ψ2, and by how much
the rear wheel's stamps are later than the front's [s]."""
WRONG_ZERO, WRONG_STAMPS = math.radians(2.0), 0.1
"""Standard deviations of a zero [rad] and of stamps [s] that are wrong."""
EVIDENT = 8.0
"""Zeros or stamps are taken for wrong where that explains so much more [of squares in standard deviations]: by chance
that is so in one of twenty trials, whose errors are but greater then."""


class Explained(NamedTuple):
    """A trial and what the model makes of it."""

    samples: Samples
    start: Floats
    """[θ1, ω1, θ2, ω2] at the first sample."""
    systematic: Floats
    """What ψ1 and ψ2 were measured to be too great, everywhere and in each part [rad], shape (2, 1 + PARTS)."""
    late: float
    """By how much the rear wheel's stamps are later than the front's [s]."""
    residuals: Floats
    """What was measured less what the model has [rad], shape (T, 2)."""
    outliers: Mask
    """Shape (T, 2)."""
    noise: float
    """Standard deviation of the residuals, outliers left out [rad]."""
    memory: float
    """By how much the mean of many residuals varies more than if they were independent, ≥ 1."""

    @property
    def deviation(self) -> float:
        """What a sample weighs: the noise, greater where one residual resembles the next [rad]."""
        return self.noise * math.sqrt(self.memory)


class Problem:
    """Residuals and their derivatives.

    Args:
        known: of the rig.
        trials: to be explained.
        deviations: standard deviation of each trial's samples [rad].
        used: samples of each trial that count, shape (T, 2); None: all that are plausible.
        zero: to what the wheels' zeros are known [rad].
        late: to what it is known that both wheels' samples are of one time [s]; 0: they are.

    """

    def __init__(
        self,
        known: Knowledge,
        trials: Sequence[Samples],
        deviations: Sequence[float],
        used: Sequence[Mask] | None = None,
        zero: float = ZERO,
        late: float = 0.0,
    ) -> None:
        self.known, self.trials, self._deviations = known, trials, deviations
        self._zero, self._late = zero, late
        self._used = used or [trial.plausible for trial in trials]
        self._size = len(known.unknowns)
        self._steps = STEP * np.sqrt(np.diag(known.covariance))
        self._root = np.linalg.cholesky(known.covariance)
        self._at: Floats = np.empty(0)
        self._found: tuple[Floats, Floats] = (self._at, self._at)
        front, rear = known.rig.front, known.rig.rear
        self._shares = [shares(trial, np.array([front.alpha, rear.alpha])) for trial in trials]
        farthest = np.tile([front.alpha, math.inf, rear.alpha, math.inf, *[math.inf] * (OWN - START)], len(trials))
        low, high = known.bounds()
        self.low, self.high = np.concatenate([low, -farthest]), np.concatenate([high, farthest])

    def rotations(self, trial: int, points: Floats) -> Floats:
        """ψ of a trial's samples [rad] at N points: coordinates and the trial's own, all as late; shape (N, T, 2)."""
        columns = {
            name: column
            for unknown, coordinates in zip(self.known.unknowns, points.T, strict=False)
            for name, column in unknown.columns(coordinates).items()
        }
        rig, samples = self.known.rig, self.trials[trial]
        rig = rig._replace(S0=float(stance_distance(rig.front, rig.rear, rig.S0, samples.steps, 0)))
        starts, systematic, late = np.split(points[:, self._size :], [START, START + ERRORS], axis=1)
        times = samples.seconds[:, None] + np.maximum([late[0, 0], -late[0, 0]], 0.0)  # of the wheel that is not late
        asked, places = np.unique(times, return_inverse=True)
        rotations = sample_pairs(spread(rig, len(points), columns), starts, asked, TOLERANCE)
        rotations = rotations[:, places.reshape(times.shape), [0, 1]]
        errors = np.einsum('twk,nwk->ntw', self._shares[trial], systematic.reshape(len(points), 2, -1))
        return np.asarray(rotations + errors)

    @property
    def allowing(self) -> bool:
        """Whether zeros and stamps that are wrong are allowed for."""
        return self._late > 0.0

    def residuals(self, x: Floats) -> Floats:
        """Weighed residuals; then, in standard deviations, by what systematic errors and unknowns are off."""
        return self._evaluate(x)[0]

    def jacobian(self, x: Floats) -> Floats:
        """Derivatives of the residuals."""
        return self._evaluate(x)[1]

    def _evaluate(self, x: Floats) -> tuple[Floats, Floats]:
        if np.array_equal(x, self._at):
            return self._found
        size, residuals, blocks = self._size, [], []
        for index, (samples, used, deviation) in enumerate(zip(self.trials, self._used, self._deviations, strict=True)):
            mine = self._own(index)
            moved, added = [*range(size), *mine[:START]], mine[START:]
            steps = np.concatenate([self._steps, np.full(START, STEP)])
            steps = np.where(x[moved] + steps > self.high[moved], -steps, steps)
            points = np.tile(x[[*moved, *added]], (1 + len(moved), 1))
            points[1:, : len(moved)] += np.diag(steps)
            rotations = self.rotations(index, points)
            residuals.append((rotations[0] - samples.rotations)[used] / deviation)
            block = np.zeros((np.count_nonzero(used), len(x)))
            block[:, moved] = (rotations[1:] - rotations[0])[:, used].T / steps / deviation
            parts = np.einsum('twk,wv->twvk', self._shares[index], np.eye(2)).reshape(*samples.rotations.shape, -1)
            block[:, added[:-1]] = parts[used] / deviation
            if self.allowing:
                later = points[:1] + STEP * (np.arange(points.shape[1]) == points.shape[1] - 1)
                block[:, added[-1]] = (self.rotations(index, later) - rotations[0])[0, used] / STEP / deviation
            blocks.append(block)
        assumed = [place for index in range(len(self.trials)) for place in self._own(index)[START:]]
        widths = np.tile([*[self._zero, *[REPEATED] * PARTS] * 2, self._late or STEP], len(self.trials))
        residuals.append(x[assumed] / widths)
        blocks.append(np.eye(len(x))[assumed] / widths[:, None])
        residuals.append(solve_triangular(self._root, x[:size] - self.known.coordinates, lower=True))
        before = np.zeros((size, len(x)))
        before[:, :size] = solve_triangular(self._root, np.eye(size), lower=True)
        self._at, self._found = x.copy(), (np.concatenate(residuals), np.vstack([*blocks, before]))
        return self._found

    def _own(self, trial: int) -> range:
        """Where a trial's own numbers stand in a point."""
        first = self._size + OWN * trial
        return range(first, first + OWN)

    def own(self, trial: int, x: Floats) -> tuple[Floats, Floats, float]:
        """Start, systematic errors and lateness of a trial, at a point or in its errors."""
        start, systematic, late = np.split(x[self._own(trial)], [START, START + ERRORS])
        return start, systematic.reshape(2, -1), float(late[0])

    def misfit(self, x: Floats) -> float:
        """The sum that a robust `solve` makes small."""
        squares = (self.residuals(x) / ROBUST) ** 2
        return float(np.sum(np.sqrt(1.0 + squares) - 1.0))

    def squares(self, x: Floats) -> float:
        """The sum that a `solve` which is not robust makes small: minus twice the logarithm of the likelihood."""
        return float(np.sum(self.residuals(x) ** 2))

    def covariance(self, x: Floats) -> Floats:
        """Of the point that a `solve` which is not robust found."""
        derivatives = self.jacobian(x)
        return np.asarray(np.linalg.inv(derivatives.T @ derivatives))

    def released(self, x: Floats) -> Floats:
        """A better point than x, where the search that led there stuck to a bound, else x.

        Each unknown that lies on its bound is let go, all others following as their errors correlate.
        """
        best, before = x, math.inf
        while self.squares(best) < before - WORTHWHILE:
            before = self.squares(best)
            for index in np.flatnonzero(self._bound(x)):
                column = self.covariance(best)[:, index]
                moved = best + column / math.sqrt(column[index])
                found = self.solve(moved, robust=False, settled=SETTLED)
                best = min(best, found, key=self.squares)
        return best

    def _bound(self, x: Floats) -> Mask:
        """Which numbers lie on their lower bounds."""
        bound = np.zeros(len(x), bool)
        bound[: self._size] = x[: self._size] <= self.low[: self._size] + self._steps
        return bound

    def held(self, index: int, coordinate: float) -> tuple['Problem', float]:
        """The same with one unknown held, and what that adds to the squares."""
        known, square = self.known.held(index, coordinate)
        return Problem(known, self.trials, self._deviations, self._used, self._zero, self._late), square

    def weighed(self, trials: Sequence[Explained], zero: float | None = None, late: float | None = None) -> 'Problem':
        """The same with samples that weigh, and outliers that are left out, as trials were explained."""
        return Problem(
            self.known,
            self.trials,
            [trial.deviation for trial in trials],
            [~trial.outliers for trial in trials],
            self._zero if zero is None else zero,
            self._late if late is None else late,
        )

    def solve(self, x: Floats, robust: bool = True, settled: float = ROUGHLY, evaluations: int = EVALUATIONS) -> Floats:
        """The best point, from x on; errors that repeat are sought in the end only, where it is not robust.

        A search that comes to a bound may stop short of the best point along it: what lies there is held, and the
        others are sought again. In a long valley one search does not get to the end.
        """
        x, held = np.clip(x, self.low, self.high), np.zeros(len(x), bool)
        for _ in range(SEARCHES):
            x, arrived = self._search(x, held, robust, settled, evaluations)
            if (self._bound(x) == held).all() and (arrived or robust):
                break
            held = self._bound(x)
        return x

    def _search(self, begin: Floats, held: Mask, robust: bool, settled: float, evaluations: int) -> tuple[Floats, bool]:
        free = ~held
        if robust:
            for trial in range(len(self.trials)):
                free[self._own(trial)[START:]] = [*np.tile(np.arange(1 + PARTS) == 0, 2), False]

        def whole(sought: Floats) -> Floats:
            point: Floats = begin.copy()
            point[free] = sought
            return point

        found = least_squares(
            lambda sought: self.residuals(whole(sought)),
            begin[free],
            lambda sought: self.jacobian(whole(sought))[:, free],
            bounds=(self.low[free], self.high[free]),
            method='dogbox',
            x_scale='jac',
            loss='soft_l1' if robust else 'linear',
            f_scale=ROBUST,
            ftol=settled,
            xtol=1e-8,
            gtol=1e-10,
            max_nfev=evaluations,
        )
        return whole(np.asarray(found.x, float)), found.status > 0

    def information(self, x: Floats) -> Floats:
        """What the trials tell of the unknowns, their own being unknown: an inverse covariance, shape (P, P)."""
        size = self._size
        weighed = self.jacobian(x)[:-size]
        whole = weighed.T @ weighed
        cross, own = whole[:size, size:], whole[size:, size:]
        return np.asarray(whole[:size, :size] - cross @ np.linalg.solve(own, cross.T))


class Fit(NamedTuple):
    """The outcome of least squares."""

    problem: Problem
    """As it was solved in the end."""
    point: Floats
    """Its solution: coordinates, then each trial's own."""
    whole_covariance: Floats
    """Of the point."""
    trials: tuple[Explained, ...]

    @property
    def allowing(self) -> bool:
        """Whether zeros and stamps that are wrong were allowed for."""
        return self.problem.allowing

    @property
    def known(self) -> Knowledge:
        """What was known of the rig before."""
        return self.problem.known

    @property
    def coordinates(self) -> Floats:
        """Of the unknowns, shape (P,)."""
        return self.point[: len(self.known.unknowns)]

    @property
    def covariance(self) -> Floats:
        """Of these, shape (P, P)."""
        size = len(self.known.unknowns)
        return self.whole_covariance[:size, :size]

    @property
    def after(self) -> Knowledge:
        """What is known of the rig now."""
        return self.known._replace(coordinates=self.coordinates, covariance=self.covariance)


def unheard(_: str) -> None:
    """Who follows the work: nobody."""


def identify(
    known: Knowledge, trials: Sequence[Samples], zero: float = ZERO, told: Callable[[str], None] = unheard
) -> Fit:
    """The rig that explains trials best, beside what was known of it.

    From the first seconds on to the whole, so that a phase that drifts does not lead astray; outliers lose their weight
    first, and are left out at last. The noise is that of the residuals; where one resembles the next, fewer count.
    Zeros and stamps are taken for wrong only where that explains evidently more; then they are sought, too.

    Args:
        known: of the rig before.
        trials: at least one.
        zero: to what the zeros of both wheels are known [rad].
        told: what is done next.

    Raises:
        ValueError: the rig is impossible.

    """
    rough = [max(trial.noise(), COARSEST) for trial in trials]
    owns = [np.append(trial.first_state(), np.zeros(OWN - START)) for trial in trials]
    first = [Problem(known, [trial.until(window) for trial in trials], rough, zero=zero) for window in WINDOWS]
    ends = []
    for number, inside in enumerate(INSIDE, 1):
        told(f'explaining the first {WINDOWS[-1]:g} s, from start {number} of {len(INSIDE)} ...')
        least = known.bounds()[0] + inside * np.sqrt(np.diag(known.covariance))
        x = np.concatenate([np.maximum(known.coordinates, least), *owns])
        for problem in first:
            x = problem.solve(x)
        ends.append(x)
    x, window = min(ends, key=first[-1].misfit), 2.0 * WINDOWS[-1]
    while window < max(trial.seconds[-1] for trial in trials):
        told(f'explaining the first {window:g} s ...')
        x = Problem(known, [trial.until(window) for trial in trials], rough, zero=zero).solve(x)
        window *= 2.0
    told('explaining all samples ...')
    whole = Problem(known, trials, rough, zero=zero)
    x = whole.solve(x)
    told('explaining all samples but outliers ...')
    fit = _ended(whole, x)
    told('looking for wrong zeros and late stamps ...')
    doubtful = fit.problem.weighed(fit.trials, max(zero, WRONG_ZERO), WRONG_STAMPS)
    x = doubtful.solve(fit.point, robust=False, settled=SETTLED)
    if fit.problem.squares(fit.point) - doubtful.squares(x) < EVIDENT:
        return fit
    return _ended(doubtful, x)


def _ended(problem: Problem, x: Floats) -> Fit:
    """The fit by which a search ends: outliers are left out as they are at first, the noise is as it is at last."""
    problem = problem.weighed(_explained(problem, x))
    x = problem.released(problem.solve(x, robust=False, settled=SETTLED))
    explained = _explained(problem, x)
    problem = problem.weighed(explained)
    return Fit(problem, x, problem.covariance(x), tuple(explained))


def _explained(problem: Problem, x: Floats) -> list[Explained]:
    size, found = len(problem.known.unknowns), []
    for index, samples in enumerate(problem.trials):
        start, systematic, late = problem.own(index, x)
        rotations = problem.rotations(index, np.concatenate([x[:size], start, systematic.ravel(), [late]])[None])[0]
        residuals = samples.rotations - rotations
        spread_of = max(float(np.median(np.abs(residuals[samples.plausible]))) / 0.6745, 1e-9)
        outliers = ~samples.plausible | (np.abs(residuals) > OUTLYING * spread_of)
        noise = float(np.sqrt(np.mean(residuals[~outliers] ** 2)))
        memory = _memory(residuals, outliers)
        found.append(Explained(samples, start, systematic, late, residuals, outliers, max(noise, 1e-9), memory))
    return found


def shares(samples: Samples, alphas: Floats) -> Floats:
    """What systematic errors of 1 add to a trial's rotations, shape (T, 2, 1 + PARTS)."""
    angles = (samples.rotations + alphas) / (2.0 * alphas)
    part = (angles % 1.0 * PARTS).astype(int)
    return np.concatenate([np.ones((*part.shape, 1)), part[..., None] == np.arange(PARTS)], axis=-1)


def _memory(residuals: Floats, outliers: Mask) -> float:
    """1 + 2 Σ ρ_k, over the first lags k at which the correlation ρ_k of residuals is beyond chance."""
    kept: Any = np.where(outliers, 0.0, residuals)
    kept = kept - kept.mean(axis=0)
    power, count, total = float((kept**2).sum()), len(kept), 1.0
    for lag in range(1, count // 10):
        part = float((kept[lag:] * kept[:-lag]).sum()) / max(power, 1e-300)
        if part < 2.0 / math.sqrt(2.0 * count):
            break
        total += 2.0 * part
    return total
