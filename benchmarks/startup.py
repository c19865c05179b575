"""How long the command and the nodes take to start, beside what they cannot do without.

    python benchmarks/startup.py [--repeat 7]

Processor time, the least of several runs, so that other work on the machine counts little. The command is held
against `import numpy`; the nodes, up to where they are ready to be made, against rclpy with their messages.
"""

import argparse
import os
import sys

from dcdrw.cli import COMMANDS
from dcdrw.entry import EXECUTABLES

NUMPY = 'import numpy'
ROS = (
    'import rclpy.node\n'
    'from rcl_interfaces.msg import ParameterDescriptor\n'
    'from sensor_msgs.msg import JointState\n'
    'from geometry_msgs.msg import PointStamped\n'
    'from diagnostic_msgs.msg import DiagnosticArray\n'
    'from std_msgs.msg import Float64'
)
COMMAND = 'import sys; from dcdrw.entry import run; sys.argv[1:] = {!r}; sys.exit(run("dcdrw"))'


def seconds(code: str, repeat: int) -> float:
    """The least processor time of a Python that runs some code [s]."""
    return min(_once(code) for _ in range(repeat))


def _once(code: str) -> float:
    child = os.posix_spawn(
        sys.executable,
        [sys.executable, '-c', code],
        os.environ,
        file_actions=[(os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_WRONLY, 0) for fd in (1, 2)],
    )
    _, _, usage = os.wait4(child, 0)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description='Measure start-up.')
    parser.add_argument('--repeat', type=int, default=7, help='runs of each, the best of which counts (default: 7)')
    repeat = parser.parse_args().repeat
    bare = seconds('pass', repeat)
    print(f'{"python":34}{1e3 * bare:6.0f} ms')
    numpy = seconds(NUMPY, repeat)
    print(f'{"import numpy":34}{1e3 * numpy:6.0f} ms')
    lines = [['--help'], ['--version'], ['trail'], *([name, '--help'] for name in COMMANDS)]
    for line in lines:
        took = seconds(COMMAND.format(line), repeat)
        print(f'{"dcdrw " + " ".join(line):34}{1e3 * took:6.0f} ms  {took / numpy:5.2f} × import numpy')
    ros = seconds(ROS, repeat)
    print(f'{"rclpy with its messages":34}{1e3 * ros:6.0f} ms')
    for name, module in EXECUTABLES.items():
        if name != 'dcdrw':
            took = seconds(f'import {module}', repeat)
            print(f'{name:34}{1e3 * took:6.0f} ms  {took / ros:5.2f} × rclpy')


if __name__ == '__main__':
    main()
