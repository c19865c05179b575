"""The live page's server: whom it lets in, what each browser gets, and what the command refuses."""

import asyncio
import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import pytest
from aiohttp import ClientSession, CookieJar, WSServerHandshakeError

from dcdrw.cli import main
from dcdrw.page.live_page import PAGE, PageServer, listen_at
from dcdrw.page.live_state import read_command
from tests import ROOT
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

TOKEN = 'a-token-of-tests'
KEPT = 5


class Served:
    """A server on a free port, and what it was told."""

    def __init__(self, token: str) -> None:
        self.commands: list[Any] = []
        self.listener = listen_at('127.0.0.1', 0)
        self.server = PageServer(self.listener, token, KEPT, lambda text: self.commands.append(read_command(text)))
        self.port = self.listener.getsockname()[1]
        self.address = f'http://127.0.0.1:{self.port}'

    def close(self) -> None:
        self.server.close()
        self.listener.close()


@pytest.fixture
def served() -> Iterator[Served]:
    served = Served('')
    yield served
    served.close()


@pytest.fixture
def guarded() -> Iterator[Served]:
    served = Served(TOKEN)
    yield served
    served.close()


def browse(visit: Callable[[ClientSession], Awaitable[Any]]) -> Any:
    async def session() -> Any:
        async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as client:  # which keeps cookies of addresses
            return await asyncio.wait_for(visit(client), PATIENCE)

    return asyncio.run(session())


def status(address: str, **headers: str) -> int:
    async def visit(client: ClientSession) -> int:
        async with client.get(address, headers=headers) as answer:
            return answer.status

    return int(browse(visit))


def handshake(address: str, **headers: str) -> int:
    """101 where the WebSocket opens; else the status with which it is refused."""

    async def visit(client: ClientSession) -> int:
        try:
            async with client.ws_connect(address, headers=headers):
                return 101
        except WSServerHandshakeError as error:
            return error.status

    return int(browse(visit))


def test_page_is_whole_and_asks_nothing_of_other_machines(served):
    names = {file.name for file in PAGE.iterdir() if file.suffix in ('.html', '.css', '.js')}

    async def visit(client: ClientSession) -> list[tuple[str, str, Any]]:
        pages = []
        for path in ('/', *(f'/{name}' for name in names - {'index.html'})):
            async with client.get(served.address + path) as answer:
                assert answer.status == 200, path
                pages.append((path, await answer.text(), answer.headers))
        return pages

    pages = browse(visit)
    assert len(pages) == len(names) > 1
    for path, text, headers in pages:
        assert 'https://' not in text, path
        assert "default-src 'none'" in headers['Content-Security-Policy']
        assert "frame-ancestors 'none'" in headers['Content-Security-Policy']


def test_without_token_only_names_of_this_machine_are_served(served):
    for host, expected in (
        (f'localhost:{served.port}', 200),
        (f'[::1]:{served.port}', 200),
        ('127.0.0.9', 200),
        (f'rebound.example:{served.port}', 403),
        ('10.0.0.7', 403),
        ('[', 403),
    ):
        assert status(served.address, Host=host) == expected, host
        assert handshake(f'{served.address}/ws', Host=host) == (101 if expected == 200 else 403), host


def test_other_sites_cannot_open_the_socket(served, guarded):
    for one, query in ((served, ''), (guarded, f'?token={TOKEN}')):
        socket_address = f'{one.address}/ws{query}'
        assert handshake(socket_address, Origin=one.address) == 101
        for origin in (
            'http://evil.example',
            f'http://evil.example:{one.port}',
            'null',
            'file://',
            f'http://127.0.0.1:{one.port}.evil.example',
            'http://127.0.0.1:1',
            'http://[',
            '',
        ):
            assert handshake(socket_address, Origin=origin) == 403, origin


def test_token_opens_everything_and_nothing_opens_without_it(guarded):
    for path in ('/', '/live.js', '/ws', '/nowhere'):
        for query in ('', '?token=', '?token=wrong', f'?token={TOKEN[:-1]}', f'?token={TOKEN}%C3%A9', '?token=%ff'):
            assert status(guarded.address + path + query) == 403, path + query
    assert handshake(f'{guarded.address}/ws') == 403
    assert handshake(f'{guarded.address}/ws?token={TOKEN}') == 101
    assert status(f'{guarded.address}/?token={TOKEN}', Host='rig.example') == 200

    async def visit(client: ClientSession) -> str:
        async with client.get(f'{guarded.address}/?token={TOKEN}') as answer:
            cookie = answer.headers['Set-Cookie']
        async with client.get(guarded.address) as answer:  # the cookie is enough now
            assert answer.status == 200
        async with client.ws_connect(f'{guarded.address}/ws', headers={'Origin': guarded.address}):
            return cookie

    cookie = browse(visit)
    assert 'HttpOnly' in cookie
    assert 'SameSite=Strict' in cookie


def test_cookie_belongs_to_one_port(guarded):
    """Cookies know no ports: two servers of one machine do not take each other's."""

    async def visit(client: ClientSession) -> str:
        async with client.get(guarded.address, params={'token': TOKEN}) as answer:
            return answer.headers['Set-Cookie']

    assert browse(visit).startswith(f'dcdrw_live_token_{guarded.port}=')


@pytest.mark.parametrize('given', [b'\xff\xfe', b'\xc3\xa9', b'\xed\xa0\x80', b'"', b'a=b; ;='])
def test_cookie_of_odd_bytes_is_forbidden(guarded, given):
    with socket.create_connection(('127.0.0.1', guarded.port), timeout=PATIENCE) as connection:
        cookie = b'dcdrw_live_token_%d=' % guarded.port + given
        connection.sendall(b'GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nCookie: %s\r\n\r\n' % cookie)
        assert connection.recv(64).startswith(b'HTTP/1.1 403 ')


@pytest.mark.parametrize('begun', [b'', b'GET / HTTP/1.1\r\nHost: loc'])
def test_half_open_request_is_hung_up_on(served, begun):
    with socket.create_connection(('127.0.0.1', served.port), timeout=PATIENCE) as connection:
        connection.sendall(begun)
        assert connection.recv(64) == b''  # the end, before the limit of this test


def test_browser_that_comes_late_gets_what_is_kept_then_each_frame(served):
    for i in range(8):
        served.server.show({'i': i})

    async def visit(client: ClientSession) -> None:
        async with client.ws_connect(f'{served.address}/ws') as browser:
            frames: list[dict[str, int]] = []
            while not frames or frames[-1]['i'] < 7:
                frames += (await browser.receive_json())['frames']
            assert frames == [{'i': i} for i in range(3, 8)]
            served.server.show({'i': 8})
            assert (await browser.receive_json())['frames'] == [{'i': 8}]

    browse(visit)


def test_what_is_replayed_tells_how_old_it_is(served):
    served.server.show({'i': 0})

    async def first(client: ClientSession) -> dict[str, Any]:
        async with client.ws_connect(f'{served.address}/ws') as browser:
            return dict(await browser.receive_json())

    begun = time.monotonic()
    young = browse(first)
    time.sleep(0.3)  # the node hangs
    old = browse(first)
    assert young['frames'] == old['frames'] == [{'i': 0}]
    assert 0.3 <= old['age'] - young['age'] + 0.01 <= time.monotonic() - begun + 0.02


def test_all_browsers_get_the_same(served):
    async def visit(client: ClientSession) -> None:
        browsers = [await client.ws_connect(f'{served.address}/ws') for _ in range(5)]
        for i in range(20):
            served.server.show({'i': i})
            await asyncio.sleep(0.001)
        for browser in browsers:
            seen: list[int] = []
            while not seen or seen[-1] < 19:
                seen += [frame['i'] for frame in (await browser.receive_json())['frames']]
            assert seen == list(range(seen[0], 20))
            await browser.close()

    browse(visit)


def test_browser_that_does_not_read_costs_no_more_than_what_is_kept(served):
    big = 'x' * 100_000

    async def visit(client: ClientSession) -> None:
        async with client.ws_connect(f'{served.address}/ws', max_msg_size=0) as slow:
            async with client.ws_connect(f'{served.address}/ws', max_msg_size=0) as quick:
                for i in range(400):  # 40 MB: far more than the sockets take
                    served.server.show({'i': i, 'big': big})
                    while (await quick.receive_json())['frames'][-1]['i'] < i:
                        pass
            seen: list[int] = []
            while not seen or seen[-1] < 399:
                frames = (await slow.receive_json())['frames']
                assert len(frames) <= KEPT
                seen += [frame['i'] for frame in frames]
            assert len(seen) < 300
            assert seen == sorted(seen)

    browse(visit)


def test_wrong_command_is_answered_and_a_right_one_handed_on(served):
    async def visit(client: ClientSession) -> None:
        async with client.ws_connect(f'{served.address}/ws') as browser:
            for text in ('{"do": "set", "name": "k", "value": -1}', '{', '[' * 500, '{"do": "set", "name": {}}'):
                await browser.send_str(text)
                (frame,) = (await browser.receive_json())['frames']
                assert frame['notices'][0]['ok'] is False
            await browser.send_str('{"do": "set", "name": "k", "value": 3}')
            while not served.commands:
                await asyncio.sleep(0.01)

    browse(visit)
    assert served.commands[0][:] == ('set', 'k', 3.0)


def test_browsers_that_leave_at_once_are_no_error(served, caplog):
    request = (
        f'GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
        'Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n'
    ).encode()
    wrong = b'\x81\x81\0\0\0\0{'  # a masked frame of text that is not a command
    for i in range(200):
        with socket.create_connection(('127.0.0.1', served.port)) as browser:
            browser.sendall(request + i % 2 * wrong)
            browser.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack('ii', 1, 0))  # a reset, no farewell
    assert handshake(f'{served.address}/ws') == 101
    assert caplog.records == []


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--host', '0.0.0.0'], '0.0.0.0 is open to others: give a --token, or --token auto'),
        (['--host', '192.0.2.7', '--token', ''], 'is open to others'),
        (['--token', 'short'], '--token must have at least 8 characters'),
        (['--host', '192.0.2.7', '--token', 'auto'], 'cannot serve at 192.0.2.7 port 8800'),
        (['--rig', 'nowhere.yaml'], 'nowhere.yaml'),
    ],
)
def test_wrong_input_is_told_in_one_line(capsys, arguments, message):
    pytest.importorskip('rclpy')
    assert main(['live', *arguments]) == 2
    errors = capsys.readouterr().err
    assert message in errors
    assert errors.count('\n') == 1


def test_port_in_use_is_told_in_one_line(capsys):
    pytest.importorskip('rclpy')
    with socket.create_server(('127.0.0.1', 0)) as other:
        assert main(['live', '--port', str(other.getsockname()[1])]) == 2
    errors = capsys.readouterr().err
    assert 'Address already in use; choose another --port' in errors
    assert errors.count('\n') == 1


@pytest.mark.parametrize(
    'arguments',
    [['--namespace', 'no space'], ['--namespace', 'a//b'], ['--port', '65536'], ['--port', 'x'], ['--domain', '-1']],
)
def test_impossible_option_is_refused(capsys, arguments):
    with pytest.raises(SystemExit):
        main(['live', *arguments])
    assert arguments[1] in capsys.readouterr().err


@pytest.mark.parametrize('module', ['rclpy', 'aiohttp'])
def test_what_is_missing_is_told_in_one_line(module):
    code = f'import sys; sys.modules[{module!r}] = None; from dcdrw.cli import main; sys.exit(main(["live"]))'
    done = subprocess.run(
        [sys.executable, '-c', code],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
    )
    assert done.returncode == 2
    assert done.stderr.startswith(f'dcdrw live: the live page needs {module}:')
    assert done.stderr.count('\n') == 1


def test_frames_are_json_without_nan(served):
    with pytest.raises(ValueError, match='not JSON compliant'):
        served.server.show({'x': float('nan')})
