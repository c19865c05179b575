"""Several nodes in one process: `ros2 run dcdrw suite [NODE ...] --ros-args ...`.

By default estimator, monitor and synchronizer. Each keeps its name, topics, parameters and services; a parameter or a
remapping of one node is given as `-p NODE:name:=value` and `-r NODE:from:=to`. A sample that one of them publishes is
handed to the others directly, and goes over DDS only while somebody outside listens.
"""

import sys
from importlib import import_module

from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from dcdrw.suite.executables import EXECUTABLES, HOSTED
from dcdrw_msgs_py.node import run_all, share_process


def make_nodes(names: tuple[str, ...]) -> list[Node]:
    """The nodes of these names, those that publish before those that listen.

    Raises:
        ValueError: there is no such node.

    """
    known = [executable.name for executable in EXECUTABLES]
    for name in names:
        if name not in known:
            raise ValueError(f'{name} is not a node of the suite; there are {", ".join(known)}')
    share_process()
    return [_node_class(executable.module)() for executable in EXECUTABLES if executable.name in names]


def _node_class(module: str) -> type[Node]:
    """The node that a module defines."""
    (found,) = (
        one
        for one in vars(import_module(module)).values()
        if isinstance(one, type) and issubclass(one, Node) and one.__module__ == module
    )
    return found


def main(args: list[str] | None = None) -> int:
    """Run the nodes."""
    arguments = sys.argv if args is None else [sys.argv[0], *args]
    names = tuple(remove_ros_args(arguments)[1:]) or HOSTED
    return run_all('suite', lambda: make_nodes(names), arguments[1:])


if __name__ == '__main__':
    sys.exit(main())
