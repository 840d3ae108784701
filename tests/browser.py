"""Page in headless Chromium, controlled through the DevTools protocol."""

import asyncio
import base64
import itertools
import json
import shutil
import subprocess
import time
from contextlib import asynccontextmanager
from urllib.request import urlopen

from tornado.websocket import websocket_connect

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

# Timeout for windows and answers. [s]
_PATIENCE = 60.0


class Page:
    """Open page; its errors are collected in ``errors``."""

    def __init__(self, socket):
        self._socket, self._numbers, self.errors, self.addresses = socket, itertools.count(1), [], []

    async def call(self, method, **parameters):
        number = next(self._numbers)
        await self._socket.write_message(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            text = await asyncio.wait_for(self._socket.read_message(), _PATIENCE)
            message = json.loads(text)
            self._note(message)
            if message.get("id") == number:
                assert "error" not in message, message
                return message["result"]

    def _note(self, message):
        method, said = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.errors.append(said["exceptionDetails"])
        if method == "Runtime.consoleAPICalled" and said["type"] in ("error", "warning", "assert"):
            self.errors.append(said["args"])
        if method == "Log.entryAdded" and said["entry"]["level"] in ("error", "warning"):
            self.errors.append(said["entry"])
        if method == "Network.requestWillBeSent":
            self.addresses.append(said["request"]["url"])

    async def evaluate(self, expression):
        answer = await self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    async def text(self, name):
        return await self.evaluate(f"document.getElementById('{name}').textContent")

    async def until(self, expression):
        end = time.monotonic() + _PATIENCE
        while not await self.evaluate(expression):
            assert time.monotonic() < end, f"never came: {expression}"
            await asyncio.sleep(0.02)

    async def press(self, key):
        code = {"ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "Tab": 9, "Home": 36, "End": 35}[key]
        for kind in ("keyDown", "keyUp"):
            await self.call(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                code=key,
                windowsVirtualKeyCode=code,
                nativeVirtualKeyCode=code,
            )

    async def picture(self, path):
        answer = await self.call("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(answer["data"]))


@asynccontextmanager
async def opened(path, folder):
    """
    Open a file in a new browser, which is closed at the end of the context.

    Parameters
    ----------
    path : pathlib.Path
    folder : pathlib.Path
        Empty folder for the browser profile.
    """
    # Chromium needs --no-sandbox for root in a container.
    flags = ["--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0", "--no-first-run"]
    command = [CHROMIUM, *flags, f"--user-data-dir={folder}", "about:blank"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as browser:
        try:
            port = await _port(folder / "DevToolsActivePort")
            with urlopen(f"http://127.0.0.1:{port}/json") as answer:
                (target,) = (each for each in json.load(answer) if each["type"] == "page")
            socket = await websocket_connect(target["webSocketDebuggerUrl"], max_message_size=200_000_000)
            page = Page(socket)
            for part in ("Runtime", "Log", "Network", "Page"):
                await page.call(f"{part}.enable")
            await page.call("Page.navigate", url=path.absolute().as_uri())
            yield page
            socket.close()
        finally:
            browser.terminate()


async def _port(file):
    end = time.monotonic() + _PATIENCE
    while not file.exists() or not file.read_text().strip():
        assert time.monotonic() < end, "Chromium does not start"
        await asyncio.sleep(0.05)
    return file.read_text().split()[0]
