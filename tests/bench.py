"""A bench for nodes: real processes over real DDS on a domain of their own, and a listener that waits for messages."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from dcdrw.suite.processes import free_domain
from dcdrw_msgs_py.executor import StreamExecutor
from dcdrw_msgs_py.node import advertise, message_type
from dcdrw_msgs_py.topics import Topic
from tests.patience import PATIENCE


class Bench:
    """Starts nodes, publishes, listens; ends everything when the test ends."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._stack = ExitStack()
        self.domain = self._stack.enter_context(free_domain())
        self.processes: list[subprocess.Popen[bytes]] = []
        self.context = Context()
        rclpy.init(args=[], context=self.context, domain_id=self.domain)
        self.node = rclpy.create_node('bench', context=self.context)
        self.executor = StreamExecutor(context=self.context)
        self.executor.add_node(self.node)
        assert 'fastrtps_port' not in Path('/proc/self/maps').read_text()  # tests/conftest.py says why

    def close(self) -> None:
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.wait()
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()
        self._stack.close()

    def start(self, name: str, *arguments: str, **parameters: Any) -> subprocess.Popen[bytes]:
        """Start a node with parameters; double underscores stand for dots."""
        overrides = [
            part for key, value in parameters.items() for part in ('-p', f'{key.replace("__", ".")}:={_yaml(value)}')
        ]
        with (self.folder / f'{name}.log').open('ab') as log:
            process = subprocess.Popen(
                [sys.executable, '-m', 'dcdrw.entry', name, '--ros-args', *overrides, *arguments],
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, 'ROS_DOMAIN_ID': str(self.domain)},
            )
        self.processes.append(process)
        return process

    def output(self, name: str) -> str:
        return (self.folder / f'{name}.log').read_text()

    def end(self, process: subprocess.Popen[bytes], number: int = signal.SIGINT) -> int:
        """Send a signal and return the exit status."""
        process.send_signal(number)
        return process.wait(PATIENCE)

    def hear(self, topic: Topic, name: str = '') -> list[Any]:
        """Listen to a topic; the list fills as the bench spins."""
        name = name or topic.name
        messages: list[Any] = []
        durability = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
        qos = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE, durability=durability)
        self.node.create_subscription(message_type(topic), name, messages.append, qos)
        return messages

    def wake(self, publisher: Any, message: Callable[[int], Any], *answers: list[Any]) -> None:
        """Send messages with growing stamps until each answer has come, so that the way is open; then forget them."""

        def answered() -> bool:
            publisher.publish(message(self.node.get_clock().now().nanoseconds))
            self.spin(0.02)
            return all(answers)

        self.wait(answered, 'an answer')
        self.spin(0.1)  # what is still under way
        for answer in answers:
            answer.clear()

    def publisher(self, topic: Topic, readers: int = 1) -> Any:
        """Advertise a topic, and wait until a node listens."""
        publisher = advertise(self.node, topic)
        self.wait(lambda: publisher.get_subscription_count() >= readers, f'a listener of {topic.name}')
        return publisher

    def call(self, service_type: Any, name: str, request: Any) -> Any:
        """Call a service and return its answer."""
        client = self.node.create_client(service_type, name)
        self.wait(client.service_is_ready, f'the service {name}')
        answers = []

        def answered() -> Any:
            # A server may find the client later than the client finds it; its answer is then lost: ask again.
            if not answers or time.monotonic() - asked > 3.0:
                ask()
            return next((answer for answer in answers if answer.done()), None)

        def ask() -> None:
            nonlocal asked
            asked = time.monotonic()
            answers.append(client.call_async(request))

        asked = 0.0
        return self.wait(answered, f'an answer of {name}').result()

    def wait(self, condition: Callable[[], Any], what: str, limit: float = PATIENCE) -> Any:
        """Spin until a condition holds; fail at the limit. Returns what the condition returned."""
        end = time.monotonic() + limit
        while not (result := condition()):
            assert time.monotonic() < end, f'{what} did not come within {limit:g} s'
            self.executor.spin_once(timeout_sec=0.02)
        return result

    def spin(self, seconds: float) -> None:
        """Listen for a while; never in place of a condition."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)


def _yaml(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
