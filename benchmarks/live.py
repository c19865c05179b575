"""The live page's cost beside that of a bare listener: CPU, memory and frames, with the suite at 1 kHz.

    python benchmarks/live.py [--rate 1000] [--seconds 20] [--browsers 0 1 5]

Simulator, estimator and monitor run on a domain of their own. The bare listener is a node that subscribes to the same
topics and does nothing. A browser is a WebSocket client that reads whatever comes. CPU is of the process that serves,
user and system, in percent of one core; growth is its resident memory at the end less that at the start of the
measured time, which begins once the charts' window is full.
"""

import argparse
import asyncio
import os
import subprocess
import sys
import time
from typing import Any, NamedTuple

import rclpy
from aiohttp import ClientSession
from rclpy.node import Node

from dcdrw.page.live_state import WINDOW_SECONDS
from dcdrw.suite.executables import TRIAL
from dcdrw.suite.processes import free_domain
from dcdrw_msgs_py.node import listen, run
from dcdrw_msgs_py.topics import DIAGNOSTICS, FOOTFALLS, JOINT_STATES, PHASE_STATE, SYNCHRONIZED

PAGE = 4096


class Result(NamedTuple):
    """One way to listen."""

    cpu: float
    """Percent of a core."""
    resident: float
    """Memory of the process at the end [MB]."""
    growth: float
    """[MB]"""
    frames: float
    """Per second and browser."""
    traffic: float
    """Per browser [kB/s]."""


class BareNode(Node):
    """Hears what the live page hears."""

    def __init__(self) -> None:
        super().__init__('bare')
        for topic in (JOINT_STATES, PHASE_STATE, *FOOTFALLS.values(), SYNCHRONIZED, DIAGNOSTICS):
            listen(self, topic, lambda message: None)


async def measure(command: list[str], browsers: int, seconds: float) -> Result:
    """Run a listener, let browsers watch it, and look at what it takes."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout
        told = (line.split()[2] for line in process.stdout if line.startswith('Live at'))
        address = next(told) if browsers else ''
        frames, volume = 0, 0

        async def watch(session: ClientSession) -> None:
            nonlocal frames, volume
            async with session.ws_connect(f'{address}ws', max_msg_size=0) as browser:
                async for message in browser:
                    frames += message.data.count('"state":')
                    volume += len(message.data)

        async with ClientSession() as session:
            watching = [asyncio.create_task(watch(session)) for _ in range(browsers)]
            await asyncio.sleep(WINDOW_SECONDS + 5.0)
            frames, volume = 0, 0
            used, resident, start = cpu_seconds(process.pid), memory(process.pid), time.monotonic()
            await asyncio.sleep(seconds)
            elapsed = time.monotonic() - start
            result = Result(
                100.0 * (cpu_seconds(process.pid) - used) / elapsed,
                memory(process.pid),
                memory(process.pid) - resident,
                frames / elapsed / max(browsers, 1),
                volume / elapsed / 1000.0 / max(browsers, 1),
            )
            for task in watching:
                task.cancel()
            await asyncio.gather(*watching, return_exceptions=True)
        return result
    finally:
        process.terminate()
        process.wait()


def cpu_seconds(pid: int) -> float:
    with open(f'/proc/{pid}/stat', encoding='ascii') as file:
        fields = file.read().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def memory(pid: int) -> float:
    with open(f'/proc/{pid}/statm', encoding='ascii') as file:
        return int(file.read().split()[1]) * PAGE / 1e6


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--rate', type=float, default=1000.0, metavar='HZ')
    parser.add_argument('--seconds', type=float, default=20.0, help='measured time of each row')
    parser.add_argument('--browsers', type=int, nargs='+', default=[0, 1, 5], metavar='N')
    parser.add_argument('--bare', action='store_true', help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.bare:
        return run('bare', BareNode, [])
    with free_domain() as domain:
        os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
        rclpy.init()  # so that the domain is taken
        nodes: list[Any] = [
            subprocess.Popen(
                [sys.executable, '-m', node.module, '--ros-args', '--log-level', 'warn', '-p', f'rate:={options.rate}']
            )
            for node in reversed(TRIAL)
        ]
        try:
            compare(options.browsers, options.seconds)
        finally:
            for node in nodes:
                node.terminate()
            for node in nodes:
                node.wait()
            rclpy.shutdown()
    return 0


def compare(browsers: list[int], seconds: float) -> None:
    """Measure each row, and print it."""
    print(f'{"listener":22} {"CPU %":>7} {"ratio":>6} {"MB":>7} {"growth MB":>10} {"frames/s":>9} {"kB/s":>7}')
    bare = asyncio.run(measure([sys.executable, __file__, '--bare'], 0, seconds))
    print(row('bare listener', bare, bare), flush=True)
    for count in browsers:
        command = [sys.executable, '-m', 'dcdrw.cli', 'live', '--port', '0']
        print(row(f'live, {count} browsers', asyncio.run(measure(command, count, seconds)), bare), flush=True)


def row(name: str, result: Result, bare: Result) -> str:
    cpu, resident, growth, frames, traffic = result
    return f'{name:22} {cpu:7.1f} {cpu / bare.cpu:6.2f} {resident:7.1f} {growth:10.2f} {frames:9.1f} {traffic:7.1f}'


if __name__ == '__main__':
    sys.exit(main())
