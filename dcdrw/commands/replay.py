"""`dcdrw replay`: a recording's joint states once more, for the same nodes."""

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from dcdrw.console import LiveLine, need, number, positive
from dcdrw.recordings.bag_file import Message
from dcdrw.recordings.derived_joints import as_messages, derived_joints, joint_topic
from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.recording import Recording
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file
from dcdrw_msgs_py.topics import COUPLER, FRONT_WHEEL, JOINT_STATES, REAR_WHEEL
from dcdrw_msgs_py.words import counted

_EPILOG = """\
The samples keep the stamps that they had, and /clock goes with them: start the nodes with use_sim_time, so that they
see the trial as it was. FACTOR is that of the stamps' time. The replay begins when somebody listens to joint_states;
until then /clock stands at the first stamp.
S counts from the recording's start, by its recorder's clock.
Exit status: 0 all was sent, 1 all but what is damaged, 2 wrong input, 130 interrupted.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Publish the joint states of a recording again, with their own stamps.'
    parser.epilog = _EPILOG
    parser.add_argument(
        'recording',
        type=Path,
        metavar='RECORDING',
        help="a recording's folder, that of a trial, or an .mcap or .db3 file",
    )
    parser.add_argument(
        '--rate',
        type=positive,
        default=1.0,
        metavar='FACTOR',
        help='how many times as fast as it was (default: %(default)g)',
    )
    parser.add_argument('--from', type=number, default=0.0, dest='begin', metavar='S', help='begin here (default: 0)')
    parser.add_argument(
        '--to', type=number, default=math.inf, dest='end', metavar='S', help='end here (default: at the end)'
    )
    parser.add_argument('--loop', action='store_true', help='begin again at the end; Ctrl-C ends it')
    parser.add_argument(
        '--rig',
        type=Path,
        metavar='FILE.yaml',
        help="parameter file with the recorded joints' names (front_joint, rear_joint, coupler_joint), "
        "which then get the suite's",
    )
    parser.add_argument(
        '--topic',
        default=JOINT_STATES.name,
        metavar='NAME',
        help='where the joint states are, in any namespace (default: %(default)s)',
    )
    parser.add_argument('--namespace', default='', metavar='NS', help='of the suite, where several were recorded')
    parser.add_argument('--into', default='', metavar='NS', help='namespace of the topics to publish')


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    need('a replay', 'rclpy')
    import rclpy

    from dcdrw.nodes.replay_node import Part, ReplayNode
    from dcdrw_msgs_py.node import run as run_node
    from dcdrw_msgs_py.node import steady_clock

    with Recording(options.recording) as recording:
        topic, joints = _joints(options, recording)
        names = _names(options.rig, topic.rpartition('/')[0])
        part = Part(*_window(options, recording), options.rate, options.loop)
        node: ReplayNode | None = None

        def make() -> ReplayNode:
            nonlocal node
            node = ReplayNode(recording, topic, joints, part, names)
            node.create_timer(0.1, show, clock=steady_clock())
            return node

        def show() -> None:
            if node and node.sent:
                line.show(f'{(node.log_ns - recording.start_ns) / 1e9:6.1f} s  {counted(node.sent, "joint state")}')
            elif node:
                line.show('waiting for a listener of joint_states ...')
            if node and node.done:
                rclpy.shutdown()

        namespace = ['-r', f'__ns:=/{options.into.strip("/")}'] if options.into else []
        with LiveLine() as line:
            status = run_node('dcdrw replay', make, ['--ros-args', *namespace])
        if node is None:
            return status
        for text in (*recording.damage, *recording.notes):
            print(f'dcdrw replay: {text}', file=sys.stderr)
        print(f'{counted(node.sent, "joint state")} sent')
        return 130 if not node.done else 1 if recording.damage else 0


def _window(options: argparse.Namespace, recording: Recording) -> tuple[int, int]:
    """Begin and end by the recorder's clock [ns]."""
    length = (recording.end_ns - recording.start_ns) / 1e9
    if not 0.0 <= options.begin < min(options.end, length):
        raise ValueError(f'--from {options.begin:g} must lie before --to and within the recording ({length:.1f} s)')
    end_ns = recording.end_ns if options.end >= length else recording.start_ns + round(options.end * 1e9)
    return recording.start_ns + round(options.begin * 1e9), end_ns


def _joints(options: argparse.Namespace, recording: Recording) -> tuple[str, Callable[[int, int], Iterator[Message]]]:
    """The topic of the joint states, and what gives those that were recorded from one time to before another."""

    def derived(*window: int) -> tuple[str, Iterator[JointBatch]] | None:
        return derived_joints(recording, options.topic, options.rig, options.namespace, window)

    def messages(begin_ns: int, end_ns: int) -> Iterator[Message]:
        made = derived(begin_ns, end_ns)
        return as_messages(*made, begin_ns) if made else recording.messages([found], begin_ns, end_ns)

    made = derived()
    if made:
        return made[0], messages
    found = joint_topic(recording, options.topic, options.namespace)
    return found.name, messages


def _names(rig: Path | None, namespace: str) -> dict[str, str]:
    """The names that are to change, and what to."""
    if rig is None:
        return {}
    joints = read_parameter_file(rig, TrialParams(), namespace).phase
    pairs = ((joints.front_joint, FRONT_WHEEL), (joints.rear_joint, REAR_WHEEL), (joints.coupler_joint, COUPLER))
    return {recorded: name for recorded, name in pairs if recorded != name}
