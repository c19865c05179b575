"""Debian's Chromium without a screen, driven by the Chrome DevTools protocol."""

import asyncio
import base64
import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from tests.patience import PATIENCE

NAMES = ('chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable')


def executable() -> str:
    """The browser; where none is installed the test is skipped, but not where every test must run."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found:
        return found
    if os.environ.get('CI'):
        pytest.fail('Chromium is missing: apt-get install chromium')
    pytest.skip('Chromium is missing: apt-get install chromium')


class Chromium:
    """A browser process; `tab` opens a page."""

    def __init__(self, folder: Path) -> None:
        flags = [
            '--headless=new',
            '--no-sandbox',
            '--disable-gpu',
            '--disable-dev-shm-usage',
            '--no-first-run',
            '--disable-background-networking',
            '--disable-breakpad',
            '--remote-debugging-port=0',
            f'--user-data-dir={folder}',
        ]
        self._process = subprocess.Popen(
            [executable(), *flags, 'about:blank'],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self.loop = asyncio.new_event_loop()
        self._tabs: list[Tab] = []
        self.session = self.loop.run_until_complete(_session())
        told = folder / 'DevToolsActivePort'
        end = time.monotonic() + PATIENCE
        while not (told.exists() and told.read_text().count('\n')):
            assert time.monotonic() < end, 'Chromium did not start'
            assert self._process.poll() is None, 'Chromium ended'
            time.sleep(0.05)
        self._port = told.read_text().splitlines()[0]

    def tab(self, address: str, width: int = 1440, height: int = 900, dark: bool = False) -> 'Tab':
        tab = Tab(self, self.loop.run_until_complete(self._open()))
        self._tabs.append(tab)
        tab.look(width, height, dark)
        tab.open(address)
        return tab

    async def _open(self) -> aiohttp.ClientWebSocketResponse:
        async with self.session.put(f'http://127.0.0.1:{self._port}/json/new?about:blank') as answer:
            target = await answer.json(content_type=None)
        return await self.session.ws_connect(target['webSocketDebuggerUrl'], max_msg_size=0)

    def close(self) -> None:
        for tab in self._tabs:
            self.loop.run_until_complete(tab.socket.close())
        self.loop.run_until_complete(self.session.close())
        self.loop.close()
        self._process.terminate()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


async def _session() -> aiohttp.ClientSession:
    return aiohttp.ClientSession()


class Tab:
    """A page: evaluates expressions, presses keys, and keeps every complaint of its console."""

    def __init__(self, browser: Chromium, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._browser, self.socket, self._id = browser, socket, 0
        self.complaints: list[str] = []
        for domain in ('Runtime', 'Log', 'Page', 'Network'):
            self.send(f'{domain}.enable')

    def send(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol and return its result."""
        return self._browser.loop.run_until_complete(self._send(method, parameters))

    async def _send(self, method: str, parameters: dict[str, Any]) -> Any:
        self._id += 1
        await self.socket.send_json({'id': self._id, 'method': method, 'params': parameters})
        while True:
            message = json.loads((await asyncio.wait_for(self.socket.receive(), PATIENCE)).data)
            if message.get('id') == self._id:
                assert 'error' not in message, message
                return message['result']
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        kind, content = message.get('method'), message.get('params', {})
        if kind == 'Runtime.exceptionThrown':
            self.complaints.append(json.dumps(content['exceptionDetails']))
        elif kind == 'Runtime.consoleAPICalled' and content['type'] in ('error', 'warning', 'assert'):
            self.complaints.append(json.dumps(content['args']))
        elif kind == 'Log.entryAdded' and content['entry']['level'] in ('error', 'warning'):
            self.complaints.append(f'{content["entry"]["text"]} {content["entry"].get("url", "")}')

    def open(self, address: str) -> None:
        """Go to an address, and wait until it has loaded."""
        self.send('Page.navigate', url=address)
        self.wait('document.readyState === "complete"')

    def look(self, width: int, height: int, dark: bool = False) -> None:
        self.send(
            'Emulation.setDeviceMetricsOverride', width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        self.send(
            'Emulation.setEmulatedMedia',
            features=[{'name': 'prefers-color-scheme', 'value': 'dark' if dark else 'light'}],
        )

    def value(self, expression: str) -> Any:
        """What a JavaScript expression comes to."""
        result = self.send('Runtime.evaluate', expression=expression, returnByValue=True)
        assert 'exceptionDetails' not in result, result
        return result['result'].get('value')

    def wait(self, expression: str, until: Callable[[Any], Any] = bool, limit: float = PATIENCE) -> Any:
        """Wait until an expression's value is as wanted, and return it."""
        end = time.monotonic() + limit
        while not until(value := self.value(expression)):
            assert time.monotonic() < end, f'{expression} is still {value!r} after {limit:g} s'
            time.sleep(0.03)
        return value

    def press(self, key: str, code: int) -> None:
        for kind in ('rawKeyDown', 'keyUp'):
            self.send('Input.dispatchKeyEvent', type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    def picture(self, path: Path, whole: bool = False) -> None:
        data = self.send('Page.captureScreenshot', captureBeyondViewport=whole)['data']
        path.write_bytes(base64.b64decode(data))
