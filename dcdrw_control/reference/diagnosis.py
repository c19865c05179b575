"""What the reference of the robot's legs says of itself on `/diagnostics`."""

from dcdrw_control.reference.reference import ReferenceStatus, State
from dcdrw_msgs_py.diagnosis import AGE, STATE, Diagnosis, Level, Value

_MESSAGES = {
    State.OFF: 'not enabled',
    State.WAITING: 'waits for the person to walk',
    State.STARTING: 'starts to walk with the person',
    State.WALKING: 'walks a quarter stride ahead of the person',
    State.STOPPING: 'comes to stand',
}


def diagnose_reference(status: ReferenceStatus, age: float, stale_after: float) -> Diagnosis:
    """The diagnosis.

    Args:
        status: a snapshot.
        age: of the last sample that was accepted, by a steady clock [s]; infinite where none was.
        stale_after: age from which the input is stale [s].

    """
    level, message = _judge(status, age, stale_after)
    order = status.order
    values: dict[str, Value] = {
        STATE: status.state,
        'footfalls': order.falls,
        'footfalls out of order': order.wrong,
        'footfalls off a quarter stride, rms [s]': order.lead_error,
        'footfalls later than planned [s]': order.late,
        'cadence [steps/s]': 2.0 * status.rate,
        'fastest cadence [steps/s]': 2.0 * status.fastest,
        AGE: age,
    }
    return Diagnosis(level, message, values | {f'samples refused: {why}': n for why, n in status.refused.items()})


def _judge(status: ReferenceStatus, age: float, stale_after: float) -> tuple[Level, str]:
    if not age <= stale_after:
        return Level.STALE, 'no sample of the person yet' if age == float('inf') else 'the samples have stopped'
    if status.order.twice:
        return Level.ERROR, 'footfalls out of order twice in a row: they should come 1-4-2-3'
    if False in status.order.lately:
        return Level.WARN, 'a footfall out of order: they should come 1-4-2-3'
    if status.rate > status.fastest and status.state is not State.OFF:
        return Level.WARN, 'the person walks faster than the joints may follow (max_speed)'
    return Level.OK, _MESSAGES[status.state]
