"""The one judge of what the pair does."""

from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_tracker.gait.sync import SyncStatus


def judge(status: SyncStatus, fresh: bool = True) -> PairState:
    """What the pair does.

    Args:
        status: a snapshot of the monitor.
        fresh: whether the last sample is recent enough to tell; always so where a recording has ended.

    """
    holds = {
        PairState.NO_DATA: not fresh or status.stamp_ns == 0,
        PairState.HELD: status.held,
        PairState.STALLED: bool(status.stalled),
        PairState.SLIPPED: status.slipped,
        PairState.LOST: status.lost,
        PairState.SYNCHRONIZED: status.synchronized,
    }
    return next(state for state in PairState if holds.get(state, True))
