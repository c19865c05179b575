"""The server of the live page: static files and one WebSocket per browser, in a thread of its own.

Every frame is serialized once, whoever watches. The frames of the last seconds are kept: a browser that comes, or
comes back, gets those that it missed in one message; one that is slow gets several at a time. No browser has a
queue of its own, so none can make the process grow.
"""

import asyncio
import hmac
import ipaddress
import json
import math
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Awaitable, Callable, Iterable, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import SplitResult, urlsplit

from aiohttp import WSMsgType, web

PAGE = Path(__file__).parent
_FILES = {
    '/': ('index.html', 'text/html'),
    '/live.css': ('live.css', 'text/css'),
    **{f'/{name}.js': (f'{name}.js', 'text/javascript') for name in ('live', 'controls', 'charts', 'rig', 'canvas')},
}
_COOKIE = 'dcdrw_live_token_{port}'
"""Cookies go to every port of a host: the name tells which server's it is."""
_REQUEST_SECONDS = 5.0
"""So long a connection may take to ask for something [s]."""
_IDLE_SECONDS = 15.0
"""So long one stays open between two requests [s]."""
LONGEST_AGE = 1e6
"""What no frame has ever come for is this old [s]."""
_BROWSERS = 32
"""Browsers at a time."""
_HEADERS = {
    'Content-Security-Policy': "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; "
    "connect-src 'self' ws://{host}; base-uri 'none'; frame-ancestors 'none'",
    'X-Content-Type-Options': 'nosniff',
    'Referrer-Policy': 'no-referrer',
    'Cache-Control': 'no-store',
}


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach an address."""
    if host == 'localhost':
        return True
    with suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return False


def listen_at(host: str, port: int) -> socket.socket:
    """A listening socket.

    Raises:
        OSError: the port is in use, or the address is not this machine's: told with the mend.

    """
    family = socket.AF_INET6 if ':' in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno and error.errno > 0 else error.strerror
        raise OSError(f'cannot serve at {host} port {port}: {reason}; choose another --port or --host') from None


class PageServer:
    """Shows frames to any number of browsers, and hands on what they ask for.

    Args:
        listener: the socket to serve.
        token: what a browser must know; empty: nothing, but it must be on this machine.
        kept: frames kept for browsers that come.
        on_command: told each message of a browser, in the server's thread; raises ValueError where it is none.
        over: earlier trials, one of which is drawn beneath the live one, as `dcdrw.trials.overlay` makes them.

    """

    def __init__(
        self,
        listener: socket.socket,
        token: str,
        kept: int,
        on_command: Callable[[str], None],
        over: Sequence[dict[str, Any]] = (),
    ) -> None:
        self._listener, self._token, self._on_command = listener, token, on_command
        self._cookie = _COOKIE.format(port=listener.getsockname()[1])
        self._known: set[Any] = set()
        """Connections over which a whole request has come."""
        self._files = {path: ((PAGE / name).read_bytes(), kind) for path, (name, kind) in _FILES.items()}
        self._files['/over.json'] = (_json(list(over)).encode(), 'application/json')
        self._frames: deque[str] = deque(maxlen=kept)
        self._fresh_at = -math.inf
        self._count = 0
        self._browsers: set[web.WebSocketResponse] = set()
        self._loop = asyncio.new_event_loop()
        self._fresh, self._end = asyncio.Event(), asyncio.Event()
        self._thread = threading.Thread(target=self._loop.run_until_complete, args=(self._serve(),), daemon=True)
        self._thread.start()

    def show(self, frame: dict[str, Any]) -> None:
        """Show a frame to all; from any thread."""
        self._loop.call_soon_threadsafe(self._append, _json(frame))

    def close(self) -> None:
        """Send everybody away, and end the thread."""
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()
        self._loop.close()

    def _append(self, text: str) -> None:
        self._frames.append(text)
        self._fresh_at = time.monotonic()
        self._count += 1
        self._fresh.set()
        self._fresh.clear()

    async def _serve(self) -> None:
        app = web.Application(middlewares=[self._guard])
        app.on_response_prepare.append(_add_headers)
        app.on_shutdown.append(self._dismiss)
        app.router.add_get('/ws', self._watch)
        for path in self._files:
            app.router.add_get(path, self._file)
        runner = web.AppRunner(
            app, access_log=None, handle_signals=False, shutdown_timeout=1.0, keepalive_timeout=_IDLE_SECONDS
        )
        await runner.setup()
        await web.SockSite(runner, self._listener).start()
        janitor = asyncio.create_task(self._hang_up(runner))
        await self._end.wait()
        janitor.cancel()
        await runner.cleanup()

    async def _hang_up(self, runner: web.AppRunner) -> None:
        """Close connections that are open for a while without a whole request."""
        since: dict[Any, float] = {}
        while runner.server:
            now, there = self._loop.time(), set(runner.server.connections)
            self._known &= there
            since = {connection: since.get(connection, now) for connection in there - self._known}
            for connection, begun in since.items():
                if now - begun > _REQUEST_SECONDS:
                    connection.force_close()
            await asyncio.sleep(_REQUEST_SECONDS / 5.0)

    async def _dismiss(self, _: web.Application) -> None:
        await asyncio.gather(*(browser.close(code=1001) for browser in tuple(self._browsers)))

    @web.middleware
    async def _guard(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        """Let in who knows the token or, where there is none, who came to this machine by its own name.

        The Host check keeps out pages whose name was made to point here (DNS rebinding), the Origin check pages of
        others that open our WebSocket with the visitor's cookie.
        """
        self._known.add(request.protocol)
        given = request.query.get('token') or request.cookies.get(self._cookie, '')
        if self._token and not hmac.compare_digest(given.encode(errors='surrogateescape'), self._token.encode()):
            raise web.HTTPForbidden(text='The address needs the token that `dcdrw live` printed: /?token=...')
        if not self._token and not is_loopback(_parts(f'//{request.host}').hostname or ''):
            raise web.HTTPForbidden(text='Without a token this page is for 127.0.0.1 and localhost only.')
        origin = request.headers.get('Origin')
        if origin is not None and _parts(origin).netloc != request.host:
            raise web.HTTPForbidden(text='Another site may not use this page.')
        return await handler(request)

    async def _file(self, request: web.Request) -> web.StreamResponse:
        body, kind = self._files[request.path]
        response = web.Response(body=body, content_type=kind, charset='utf-8')
        if self._token and 'token' in request.query:  # so that the address need not keep it
            response.set_cookie(self._cookie, self._token, httponly=True, samesite='Strict')
        return response

    async def _watch(self, request: web.Request) -> web.StreamResponse:
        if len(self._browsers) >= _BROWSERS:
            raise web.HTTPServiceUnavailable(text=f'{_BROWSERS} browsers watch already.')
        browser = web.WebSocketResponse(heartbeat=5.0, max_msg_size=512, compress=False)
        try:
            await browser.prepare(request)
        except ConnectionError:  # it has left during the handshake: nobody to answer
            return web.Response()
        self._browsers.add(browser)
        feed = asyncio.create_task(self._feed(browser))
        try:
            async for message in browser:
                if message.type is WSMsgType.TEXT:
                    try:
                        self._on_command(message.data)
                    except ValueError as error:
                        notice = {'text': str(error), 'ok': False}
                        with suppress(ConnectionError):
                            await browser.send_str(self._message([json.dumps({'notices': [notice]})]))
        finally:
            self._browsers.discard(browser)
            feed.cancel()
        return browser

    async def _feed(self, browser: web.WebSocketResponse) -> None:
        seen = self._count - len(self._frames)
        with suppress(ConnectionError):
            while not browser.closed:
                missed = min(self._count - seen, len(self._frames))
                if not missed:
                    await self._fresh.wait()
                    continue
                seen = self._count
                frames = islice(self._frames, len(self._frames) - missed, None)
                await browser.send_str(self._message(frames))

    def _message(self, frames: Iterable[str]) -> str:
        """Frames as browsers get them, with how long ago the newest of all was made [s]: it may be a replay."""
        age = min(time.monotonic() - self._fresh_at, LONGEST_AGE)
        return f'{{"age":{age:.3f},"frames":[{",".join(frames)}]}}'


def _json(content: object) -> str:
    return json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(',', ':'))


async def _add_headers(request: web.Request, response: web.StreamResponse) -> None:
    for name, value in _HEADERS.items():
        response.headers[name] = value.format(host=request.host)


def _parts(address: str) -> SplitResult:
    """An address in parts; empty where it is none."""
    try:
        return urlsplit(address)
    except ValueError:
        return urlsplit('')
