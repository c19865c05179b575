"""`dcdrw live`: a page that shows a running suite, and lets people act on its simulator and recorder."""

import argparse
import gc
import os
import secrets
import shutil
import socket
import sys
import tempfile
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from dcdrw.console import domain, in_words, interrupted_status, interruptible, need
from dcdrw.page.live_state import FRAMES_KEPT, Command, read_command
from dcdrw.suite.executables import RECORDER, TRIAL
from dcdrw.suite.parameter_file import TrialParams, add_rig_options, chosen_params, write_parameter_file
from dcdrw.suite.processes import NodeProcess, free_domain
from dcdrw.trials.overlay import overlay
from dcdrw.trials.results import read_trial

PORT = 8800
AUTO = 'auto'
SHORTEST_TOKEN = 8

_EPILOG = """\
The page is for this machine alone. `--host 0.0.0.0 --token auto` shows it to the network: whoever has the address
that is then printed may watch, and act on the simulator and the recorder. The nodes are asked for their parameters; a
rig file tells what they do not, and is what --trial starts with. Ctrl-C ends.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Serve a page with the wheels, the phase, the error of each step and the health of the nodes.'
    parser.epilog = _EPILOG
    add_rig_options(parser)
    parser.add_argument(
        '--trial',
        action='store_true',
        help='start simulator, phase estimator, monitor and recorder, too, on a free ROS domain',
    )
    parser.add_argument('--namespace', type=_namespace, default='', metavar='NAME', help='where the nodes are')
    parser.add_argument('--domain', type=domain, metavar='N', help='ROS domain (default: as ROS_DOMAIN_ID says)')
    parser.add_argument('--port', type=_port, default=PORT, metavar='N', help='0: any free one (default: %(default)s)')
    parser.add_argument('--host', default='127.0.0.1', metavar='ADDRESS', help='to serve at (default: %(default)s)')
    parser.add_argument('--token', help=f'what browsers must know; {AUTO}: make one up')
    parser.add_argument(
        '--over',
        type=Path,
        nargs='+',
        default=[],
        metavar='RECORDING',
        help='draw an earlier trial of the rig beneath the live one; of several, that which is chosen on the page',
    )
    parser.add_argument(
        '--allow-enable',
        action='store_true',
        help='let the page enable the synchronizer, and stop it: whoever may watch may then let it push',
    )
    parser.add_argument('--open', action='store_true', help='open the page in a browser')


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    need('the live page', 'rclpy', 'aiohttp')
    from dcdrw.page.live_page import PageServer, is_loopback, listen_at
    from dcdrw_msgs_py.node import SPIN_SECONDS

    params = chosen_params(options)
    token = secrets.token_urlsafe(16) if options.token == AUTO else options.token or ''
    if token and len(token) < SHORTEST_TOKEN:
        raise ValueError(f'--token must have at least {SHORTEST_TOKEN} characters; {AUTO} makes one up')
    if not token and not is_loopback(options.host):
        raise ValueError(f'{options.host} is open to others: give a --token, or --token {AUTO}')
    over = list(_overlays(options.over))
    with ExitStack() as stack:
        stopped = stack.enter_context(interruptible())
        listener = stack.enter_context(listen_at(options.host, options.port))
        environment = _environment(options, stack)
        nodes = _start_nodes(params, options.namespace, environment, stack) if options.trial else []
        os.environ.update(environment)
        commands: SimpleQueue[Command] = SimpleQueue()
        server = PageServer(listener, token, FRAMES_KEPT, lambda text: commands.put(read_command(text)), over)
        stack.callback(server.close)
        executor = _listener(params, options, server, commands, bool(nodes), stack)
        address = _address(listener, token)
        if stopped:  # before there was a page to end
            return interrupted_status(stopped)
        if nodes:
            joining = ' '.join(f'{name}={value}' for name, value in environment.items())
            print(f'The nodes run; `export {joining}` joins them.')
        print(f'Live at {address} (Ctrl-C ends)', flush=True)
        if options.open and not webbrowser.open(address):
            print('dcdrw live: no browser opened; go to the address yourself', file=sys.stderr)
        while not stopped:
            executor.spin_once(timeout_sec=SPIN_SECONDS)
            for dead in [node for node in nodes if node.failure]:  # the page goes on, and shows it
                print(f'dcdrw live: {dead.failure}', file=sys.stderr, flush=True)
                nodes.remove(dead)
    return 0


def _overlays(recordings: Sequence[Path]) -> Iterator[dict[str, Any]]:
    """Earlier trials; of several, one that cannot be read, or was not run, is left out."""
    for path in recordings:
        try:
            yield overlay(read_trial(path)[0], path.resolve().name)
        except (ValueError, OSError) as error:
            if len(recordings) == 1:
                raise
            print(f'dcdrw live: left out: {in_words(error)}', file=sys.stderr)


def _listener(
    params: TrialParams,
    options: argparse.Namespace,
    server: Any,
    commands: 'SimpleQueue[Command]',
    held: bool,
    stack: ExitStack,
) -> Any:
    """The executor of the node that listens."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from dcdrw.nodes.live_node import LiveNode
    from dcdrw_msgs_py.executor import StreamExecutor

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    stack.callback(rclpy.try_shutdown)
    node = LiveNode(params, server.show, commands, held, options.allow_enable, namespace=options.namespace)
    stack.callback(node.destroy_node)
    executor = StreamExecutor()
    executor.add_node(node)
    stack.callback(executor.shutdown)
    gc.freeze()  # as every node does
    return executor


def _environment(options: argparse.Namespace, stack: ExitStack) -> dict[str, str]:
    """Where the nodes are; simulated ones are kept off the domain of a real rig."""
    if options.domain is not None:
        return {'ROS_DOMAIN_ID': str(options.domain)}
    if options.trial:
        chosen = stack.enter_context(free_domain())
        return {'ROS_DOMAIN_ID': str(chosen), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    return {}


def _start_nodes(
    params: TrialParams, namespace: str, environment: dict[str, str], stack: ExitStack
) -> list[NodeProcess]:
    folder = Path(tempfile.mkdtemp(prefix='dcdrw-live-'))
    stack.callback(shutil.rmtree, folder, ignore_errors=True)
    file = folder / 'parameters.yaml'
    write_parameter_file(params._replace(simulator=params.simulator._replace(paused=True)), file)
    arguments = ['--ros-args', '--params-file', str(file)]
    if namespace:
        arguments += ['-r', f'__ns:=/{namespace}']
    nodes = [
        NodeProcess(node.name, 'dcdrw.entry', [node.name, *arguments], environment, folder / f'{node.name}.log')
        for node in (RECORDER, *reversed(TRIAL))
    ]  # who listens, first

    def stop() -> None:
        for node in nodes:
            node.interrupt()
        for node in nodes:
            node.wait()

    stack.callback(stop)
    return nodes


def _address(listener: socket.socket, token: str) -> str:
    """What to type into a browser; of a socket that serves every address, the one towards the network."""
    host, port = listener.getsockname()[:2]
    if host in ('0.0.0.0', '::'):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.connect(('192.0.2.1', 9))  # sends nothing: only asks for the way
                host = probe.getsockname()[0]
            except OSError:
                host = socket.gethostname()
    return f'http://{f"[{host}]" if ":" in host else host}:{port}/{f"?token={token}" if token else ""}'


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f'must be a whole number from 0 to 65535, got {text!r}')
    return int(text)


def _namespace(text: str) -> str:
    name = text.strip('/')
    if name and not all(part.isidentifier() and part.isascii() for part in name.split('/')):
        raise argparse.ArgumentTypeError(f'must be names of letters, digits and _, with / between, got {text!r}')
    return name
