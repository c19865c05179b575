"""Where strikes brake a wheel, told by its rotation alone: whether its zero and its spokes are what they are thought.

A wheel that rolls by itself loses a part of its speed at each strike (cos 2α is left to a plain one), and moves
smoothly in between. So at the angle of its strikes, and nowhere else, it is braked again and again, while from one such
place to the next its rotation is a smooth function of time. What is driven (a person's leg, a wheel held by a hand)
shows no such place, and nothing is said of it.
"""

import math
from typing import NamedTuple

import numpy as np

from dcdrw_msgs_py.rolling import speed_kept
from dcdrw_msgs_py.values import Floats
from dcdrw_tracker.gait.resolution import Resolution

PLACES = 36
"""Places within a step at which strikes are looked for."""
DEGREE = 4
"""Of the polynomial in time that a wheel follows between two strikes."""
NEAR = 0.4
"""Part of a step on either side of a strike from which its loss of speed is taken."""
LEAST_LOSS = 0.04
"""Part of its speed that a wheel must seem to lose for a strike [1]: 0.13 of a plain one with 12 spokes."""
MOST_LOSS = 1.3
"""A strike takes no more than so many times what it takes of a plain wheel, which loses most; a leg slows down more."""
SAMPLES, NEAREST = 10, 0.12
"""That are enough on either side, but not within less than this part of a step: what is near is not yet blurred by the
coupler."""
FEWEST = 6
"""Strikes that tell anything."""
SURE = 4.0
"""A loss, or a difference of two, of so many standard errors is sure."""
SHARP, EVIDENCE = 1.05, 12.0
"""What is braked at once leaves so many times less, and by so much, if it is taken so."""
SURER = 6.0
"""Where many numbers of spokes are tried, one may be so by chance."""
EVEN, LEARNED = 2.0, 5000
"""What straight lines leave of the motion must be so many times the variance that an encoder's count makes of an even
one: counts come in patterns that look like strikes. So many samples tell the count."""
MOST_STEPS, MOST_IN_STEP = 48, 40
"""Steps, and samples in each, from which everything is told: more would tell little more."""
SAME, MORE = 0.03, 1.25
"""Numbers of spokes that differ by a smaller part are one; where fewer than all strikes are counted, each must cost so
many times more."""
LEAST_OFF = 0.13
"""A zero that is off by a smaller part of a step is none of ours: the coupler may draw two strikes into one."""
CLEARLY = 2.0
"""Another number of spokes must explain the motion so many times better than that of the rig."""
FEWEST_SPOKES, MOST_SPOKES = 4, 40
"""Numbers of strikes in a turn that are tried,"""
GEARS = (1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 2, 2.0, 3.0)
"""beside those of the rig at these ratios of a gear between wheel and encoder."""
FEW_PLACES, LIKELY, SCATTER = 18, 4, 0.05
"""At so many places at first; how many of them are looked at closely; and how much, at least, losses scatter."""


class Place(NamedTuple):
    """What happens to a wheel at one angle of each step."""

    at: float
    """Rotation, in [0, pitch) [rad]."""
    loss: float
    """Mean part of its speed that it loses there, in so short a time that it is a strike; negative where it gains."""
    error: float
    """Standard error of that; infinite where too few passages tell."""
    sharp: float
    """How many times less a kink leaves of the motion near by than a smooth curve does that is as free."""
    evidence: float
    """By how much less, in variances of what is left [1]."""
    roughness: float
    """Variance of what is left of the motion if it is smooth everywhere else [rad²]; NaN where that is not known."""

    @property
    def is_braked(self) -> bool:
        """Whether strikes are here."""
        return self.loss > LEAST_LOSS and self.loss > SURE * self.error

    @property
    def score(self) -> float:
        """How well strikes here explain the motion; 0 where there are none."""
        return self.loss**2 / self.roughness if self.is_braked and self.roughness > 0.0 else 0.0

    @property
    def is_sharp(self) -> bool:
        """Whether the wheel is braked at once, as by a strike, and not little by little, as by a leg or a hand."""
        return self.is_braked and self.sharp > SHARP and self.evidence > EVIDENCE

    def exceeds(self, other: 'Place') -> bool:
        """Whether this wheel is surely braked here, and by far less there."""
        more = self.loss - other.loss
        return self.is_braked and other.loss < 0.5 * self.loss and more > SURE * math.hypot(self.error, other.error)


class Doubt(NamedTuple):
    """What of a wheel is not as it was thought."""

    zero: float
    """Rotation at which a spoke stands along the normal, nearest to 0 [rad]; NaN where that is not in doubt."""
    spokes: float
    """Strikes in a turn; NaN where that is not in doubt."""


def doubt(time: Floats, psi: Floats, alpha: float) -> Doubt | None:
    """What the strikes of a wheel say against its zero or its spokes; None where they do not, or are too few.

    Args:
        time: of samples of a wheel that rolls downhill without a pause, ascending, shape (N,) [s].
        psi: its rotation then [rad].
        alpha: half the angle between two spokes, as it is thought [rad].

    """
    pitch = 2.0 * alpha
    if _is_even(time, psi, pitch):
        return None
    time, psi = _enough(time, psi, pitch)
    if len(psi) < FEWEST * FEWEST or psi[-1] - psi[0] < FEWEST * pitch:
        return None
    thought = place(time, psi, pitch, alpha)
    if thought.is_braked and thought.loss > 0.5 * _plain_loss(pitch):
        return None
    best = _best(places(time, psi, pitch))
    if best.is_braked and not best.is_sharp:
        return None
    is_right = thought.is_braked and not best.exceeds(thought)
    pitches = [pitch * gear for gear in (2.0, 3.0)] if is_right else _likely(time, psi, pitch)
    others = [(one, _best(places(time, psi, one))) for one in pitches]
    most = max(at.loss for _, at in others)
    other, at = min((pair for pair in others if MORE * pair[1].loss >= most), key=lambda pair: pair[0])
    if other > pitch:  # fewer strikes: each of them costs more than all that were thought, on average
        more = at.loss > MORE * best.loss and at.loss - best.loss > SURE * math.hypot(at.error, best.error)
    else:
        more = at.score > CLEARLY * best.score
    if (
        at.is_sharp
        and at.loss < MOST_LOSS * _plain_loss(max(other, pitch))
        and at.exceeds(thought)
        and at.loss > SURER * at.error
        and more
        and abs(other / pitch - 1.0) > SAME
    ):
        return Doubt(math.nan, math.tau / other)
    zero = math.remainder(best.at - alpha, pitch)
    is_off = best.exceeds(thought) and best.loss < MOST_LOSS * _plain_loss(pitch) and abs(zero) > LEAST_OFF * pitch
    return Doubt(zero, math.nan) if is_off else None


def _plain_loss(pitch: float) -> float:
    """The part of its speed that a plain wheel loses by a strike."""
    return 1.0 - speed_kept(0.5 * pitch)


def _is_even(time: Floats, psi: Floats, pitch: float) -> bool:
    """Whether a wheel turns as evenly as its encoder can tell, so that nothing shows where it is braked."""
    resolution = Resolution()
    for moved, dt in zip(np.diff(psi[:LEARNED]).tolist(), np.diff(time[:LEARNED]).tolist(), strict=True):
        resolution.take(moved, dt)
    return bool(resolution.count) and _roughness(time, psi, pitch, 0.0, 1) < EVEN * resolution.count**2 / 12.0


def _enough(time: Floats, psi: Floats, pitch: float) -> tuple[Floats, Floats]:
    """The first steps, with neighbouring samples taken together by their mean where there are many in a step."""
    steps = (psi[-1] - psi[0]) / pitch if len(psi) else 0.0
    last = int(np.searchsorted(psi, psi[0] + MOST_STEPS * pitch)) if steps > MOST_STEPS else len(psi)
    together = max(int(len(psi) / max(steps, 1.0) / MOST_IN_STEP), 1)
    last = last // together * together
    return time[:last].reshape(-1, together).mean(axis=1), psi[:last].reshape(-1, together).mean(axis=1)


def _best(found: list[Place]) -> Place:
    """The sharpest next to that which explains the motion best."""
    index = max(range(len(found)), key=lambda k: (found[k].score, found[k].loss))
    near = (found[(index + k) % len(found)] for k in (-2, -1, 0, 1, 2))
    sharpest = max(near, key=lambda one: one.sharp)
    return sharpest if sharpest.is_sharp else found[index]


def _likely(time: Floats, psi: Floats, pitch: float) -> list[float]:
    """The angles between strikes, other than that which is thought, at which the wheel is braked most surely."""
    spokes = {*map(float, range(FEWEST_SPOKES, MOST_SPOKES + 1)), *(math.tau / pitch * gear for gear in GEARS)}
    sure: dict[float, float] = {}
    for one in (
        math.tau / number
        for number in spokes
        if number >= FEWEST_SPOKES and abs(number * pitch / math.tau - 1.0) > SAME
    ):
        if psi[-1] - psi[0] >= 2 * FEWEST * one:
            losses = [_loss(time, psi, one, one * k / FEW_PLACES) for k in range(FEW_PLACES)]
            least = SCATTER * math.sqrt(one / (psi[-1] - psi[0]))
            sure[one] = max(loss / math.hypot(error, least) for loss, error, *_ in losses)
    return sorted(sure, key=sure.__getitem__)[-LIKELY:] or [2.0 * pitch]


def places(time: Floats, psi: Floats, pitch: float) -> list[Place]:
    """All places within a step."""
    return [place(time, psi, pitch, pitch * k / PLACES) for k in range(PLACES)]


def place(time: Floats, psi: Floats, pitch: float, at: float) -> Place:
    """What happens at rotations `at` + pitch · j."""
    return Place(at, *_loss(time, psi, pitch, at), _roughness(time, psi, pitch, at))


def _loss(time: Floats, psi: Floats, pitch: float, at: float) -> tuple[float, float, float, float]:
    """The mean part of its speed that the wheel loses at its passages, its standard error, and how sharp that is.

    From a cubic in time, with another slope and curvature after each passage. The error is that by the scatter of the
    passages, or by what is left of the samples about the cubics, if that is more: of few passages, either may be small
    by chance.
    """
    low, high = np.ceil((psi[0] - at) / pitch), np.floor((psi[-1] - at) / pitch)
    angles = at + pitch * np.arange(low, high + 1)
    if len(angles) < FEWEST:
        return 0.0, math.inf, 1.0, 0.0
    passed = np.interp(angles, psi, time)
    steps = np.diff(passed)
    half = np.maximum(np.minimum(np.append(steps, steps[-1]), np.append(steps[0], steps)), 1e-9)
    half *= min(max(SAMPLES * float(np.median(np.diff(time))) / float(np.median(steps)), NEAREST), NEAR)
    first, last = np.searchsorted(time, passed - half), np.searchsorted(time, passed + half)
    index = first[:, None] + np.arange((last - first).max())
    inside = index < last[:, None]
    index = np.minimum(index, len(time) - 1)
    x = np.where(inside, (time[index] - passed[:, None]) / half[:, None], 0.0)
    y = np.where(inside, psi[index] - angles[:, None], 0.0)
    bent = np.abs(x)
    columns = np.stack([np.ones_like(x), x, x * x, x**3, bent, x * bent], axis=-1) * inside[..., None]
    normal = np.einsum('pni,pnj->pij', columns, columns) + 1e-9 * np.eye(6)
    inverse = np.linalg.inv(normal)
    found = np.einsum('pij,pnj,pn->pi', inverse, columns, y)
    before, bend = found[:, 1] - found[:, 4], found[:, 4]
    enough = (((x < 0.0) & inside).sum(axis=1) >= 3) & (((x > 0.0) & inside).sum(axis=1) >= 3)
    enough &= (inside.sum(axis=1) >= 7) & (before > 0.0)
    count = int(enough.sum())
    if count < FEWEST:
        return 0.0, math.inf, 1.0, 0.0
    losses = -2.0 * bend[enough] / before[enough]
    left = (y - np.einsum('pni,pi->pn', columns, found))[enough]
    spare = int(inside[enough].sum()) - 6 * count
    variance = (left**2).sum() / spare
    smooth = x[enough][..., None] ** np.arange(6) * inside[enough][..., None]
    curves = np.linalg.solve(
        np.einsum('pni,pnj->pij', smooth, smooth) + 1e-9 * np.eye(6),
        np.einsum('pni,pn->pi', smooth, y[enough])[..., None],
    )
    rest = ((y[enough] - (smooth @ curves)[..., 0]) ** 2).sum() / spare
    errors = variance * 4.0 * inverse[enough, 4, 4] / before[enough] ** 2
    error = max(float(losses.std(ddof=1)), math.sqrt(float(errors.mean()))) / math.sqrt(count)
    sharp = float(rest / max(variance, 1e-15))
    return float(losses.mean()), error, sharp, (sharp - 1.0) * spare


def _roughness(time: Floats, psi: Floats, pitch: float, at: float, degree: int = DEGREE) -> float:
    """The variance that polynomials in time leave of the motion, one from each of these places to the next [rad²]."""
    step = np.floor((psi - at) / pitch)
    begins = np.flatnonzero(np.diff(step)) + 1  # the first step is not whole, nor is the last
    if len(begins) < 2:
        return math.nan
    counts = np.diff(begins)
    number = np.repeat(np.arange(len(counts)), counts)
    t, y = time[begins[0] : begins[-1]], psi[begins[0] : begins[-1]]
    starts = begins[:-1] - begins[0]
    first, last = t[starts], t[starts + counts - 1]
    half = np.where(last > first, 0.5 * (last - first), 1.0)
    x = (t - 0.5 * (first + last)[number]) / half[number]
    y = y - (np.add.reduceat(y, starts) / counts)[number]
    moments = np.add.reduceat(x[:, None] ** np.arange(2 * degree + 1), starts)
    along = np.add.reduceat(x[:, None] ** np.arange(degree + 1) * y[:, None], starts)
    pause = np.maximum.reduceat(np.diff(t, append=t[-1]), starts)
    whole = (counts > degree + 1) & (np.diff(step[begins]) == 1) & (pause <= NEAR * half)
    if not whole.any():
        return math.nan
    normal = moments[whole][:, np.add.outer(np.arange(degree + 1), np.arange(degree + 1))]
    solved = np.linalg.solve(normal + 1e-9 * np.eye(degree + 1), along[whole][..., None])[..., 0]
    left = np.add.reduceat(y * y, starts)[whole] - np.einsum('si,si->s', solved, along[whole])
    return max(float(left.sum()), 1e-12) / float((counts[whole] - degree - 1).sum())
