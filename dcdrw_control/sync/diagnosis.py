"""What the synchronizer says of itself on `/diagnostics`."""

from dcdrw_control.sync.safety import Fault, State
from dcdrw_control.sync.synchronizer import Command, Synchronizer
from dcdrw_msgs_py.diagnosis import AGE, STATE, Diagnosis, Level

_MEANINGS: dict[Fault, str] = {
    'stale': 'phase_state has stopped',
    'not finite': 'phase_state carried a value that is not a number, or lacked a wheel',
    'new run': 'the source of phase_state started anew',
    'stalled': 'a wheel does not strike any more',
    'slipped': 'a wheel slipped a step',
    'second publisher': 'somebody else publishes the command as well',
    'clock': 'the clock went back',
}


def diagnose_synchronizer(core: Synchronizer, command: Command, age: float) -> Diagnosis:
    """The synchronizer's diagnosis; `age` of its last sample [s], NaN where there was none."""
    reason = core.safety.reason
    level, message = Level.OK, command.state.value
    if reason:
        level, message = Level.ERROR, f'fault: {_MEANINGS[reason]}; ~/reset_fault, then renew enable'
    elif core.params.law == 'off' and command.state is not State.DISABLED:
        level, message = Level.WARN, 'enabled, but the parameter law is off'
    return Diagnosis(
        level,
        message,
        {
            STATE: command.state,
            'fault': reason or 'none',
            'force [N]': command.force,
            'torque [N·m]': command.torque,
            'work [J]': core.work,
            'messages refused': core.refused,
            AGE: age,
        },
    )
