"""In step: the one rule (contract §7), for samples as they come and for simulated motion alike.

A pair is in step from step k on when its error, e = 100 (p − 0.5) % of a step, stays within a band at every later
instant. Steps are those of the front wheel: step j lies between its strikes j and j + 1, and the start counts as
strike 0. So k is the number of strikes up to the one that opens the first step lived wholly inside, for ever after:
one more than the last step in which the error left the band.

The functions take numbers and give numbers, so that compiled kernels use them as they are.
"""

BAND_PERCENT = 6.0
"""A pair is in step within ± this [% of a step]: the paper's."""
HOLD_STEPS = 3
"""Strikes within the band that make a pair synchronized."""


def in_step_from(since: int, step: int, low: float, high: float, band: float) -> int:
    """The first step that may be lived wholly inside the band, after one more piece of a motion; 0 at the start.

    Args:
        since: the same before this piece.
        step: the step j to which the piece belongs.
        low: least error in the piece, in the band's unit.
        high: greatest error in the piece.
        band: largest modulus of the error that counts as in step.

    """
    return since if -band <= low and high <= band else step + 1


def strikes_in_step(since: int, strikes: int) -> int:
    """How many strikes the pair has been in step for, of so many since the start; the start is none of them."""
    return max(strikes - max(since, 1) + 1, 0)


def wrapped_percent(steps: float) -> float:
    """A phase in steps, of any number of turns, as an error in percent of a step, in [−50, 50)."""
    percent = 100.0 * (steps % 1.0)
    return percent - 50.0 if percent < 100.0 else -50.0
