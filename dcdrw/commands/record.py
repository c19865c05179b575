"""`dcdrw record`: every topic of a running suite into a recording."""

import argparse
import os
import sys
from pathlib import Path

from dcdrw.console import LiveLine, domain, need
from dcdrw.recordings.recorder import new_folder, require_libraries
from dcdrw_msgs_py.words import counted

_EPILOG = """\
The recording is rosbag2's (MCAP): for ros2 bag info and play, Foxglove, PlotJuggler, dcdrw replay and dcdrw analyze.
It keeps what nodes publish, their parameters, and who recorded what on which machine (custom_data in metadata.yaml).
Ctrl-C ends it; a kill costs a second at most. Exit status: 0 ended by Ctrl-C, 1 the disk is full, 2 wrong input.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Record every topic of the suite, images and rig_markers aside, as it comes off the wire.'
    parser.epilog = _EPILOG
    parser.add_argument(
        '--out',
        type=Path,
        metavar='DIR',
        help='folder of the recording; must not exist (default: recordings/DATE-TIME)',
    )
    parser.add_argument('--note', default='', metavar='TEXT', help='what to keep with the recording')
    parser.add_argument(
        '--topics', nargs='+', default=[], metavar='NAME', help='further topics, image_raw or rig_markers for instance'
    )
    parser.add_argument('--namespace', default='', metavar='NS', help='of the suite')
    parser.add_argument('--domain', type=domain, metavar='N', help='ROS domain (default: ROS_DOMAIN_ID, or 0)')


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    need('a recording', 'rclpy')
    import rclpy
    from rclpy.parameter import Parameter

    require_libraries()
    if options.domain is not None:
        os.environ['ROS_DOMAIN_ID'] = str(options.domain)
    from dcdrw.nodes.recorder_node import RecorderNode
    from dcdrw_msgs_py.node import run as run_node
    from dcdrw_msgs_py.node import steady_clock

    folder = options.out or new_folder()
    values = {'record': True, 'folder': str(folder), 'note': options.note, 'topics': ' '.join(options.topics)}
    node: RecorderNode | None = None

    def make() -> RecorderNode:
        nonlocal node
        node = RecorderNode(parameter_overrides=[Parameter(name, value=value) for name, value in values.items()])
        node.create_timer(1.0, show, clock=steady_clock())
        return node

    def show() -> None:
        if node and node.failure:
            rclpy.shutdown()
        elif node and node.recorder:
            line.show(f'{counted(sum(node.recorder.counts.values()), "message")}, {node.recorder.size / 1e6:.1f} MB')

    namespace = ['-r', f'__ns:=/{options.namespace.strip("/")}'] if options.namespace else []
    with LiveLine() as line:
        status = run_node('dcdrw record', make, ['--ros-args', *namespace])
    if node and node.failure:
        print(f'dcdrw record: {node.failure}', file=sys.stderr)
        return 1
    return status
