"""Nodes as processes on a domain of their own."""

import socket
from contextlib import ExitStack
from pathlib import Path

import pytest

from dcdrw.suite import processes
from dcdrw.suite.processes import NodeProcess, free_domain

pytestmark = pytest.mark.processes


def test_two_trials_never_share_a_domain():
    with ExitStack() as stack:
        domains = {stack.enter_context(free_domain()) for _ in range(20)}
    assert len(domains) == 20


def test_domain_whose_port_is_in_use_is_not_chosen(monkeypatch):
    monkeypatch.setattr(processes, '_DOMAINS', range(90, 92))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(('', 7410 + 250 * 90))
        with free_domain() as domain:
            assert domain == 91
            with pytest.raises(OSError, match='no free ROS domain'), free_domain():
                pass
        with free_domain() as again:
            assert again == 91


def test_failure_names_the_node_and_its_last_words(tmp_path: Path):
    module = tmp_path / 'dying_node.py'
    module.write_text('import sys; print("on my way"); sys.exit("no such rig")')
    node = NodeProcess('dying', 'dying_node', [], {'PYTHONPATH': str(tmp_path)}, tmp_path / 'dying.log')
    node.wait()
    assert node.failure == f'dying ended with status 1: no such rig (its output: {tmp_path}/dying.log)'


def test_node_that_does_not_end_is_killed(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(processes, '_STOP_SECONDS', 0.2)
    (tmp_path / 'stubborn.py').write_text(
        'import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); time.sleep(60)'
    )
    node = NodeProcess('stubborn', 'stubborn', [], {'PYTHONPATH': str(tmp_path)}, tmp_path / 'log')
    node.interrupt()
    node.wait()
    assert node.failure is not None
