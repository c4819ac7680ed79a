# SPDX-License-Identifier: GPL-3.0-or-later
"""A headless Chromium, driven over its DevTools pipe: no port, no driver program."""

from __future__ import annotations

import base64
import fcntl
import json
import os
import re
import select
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

TIMEOUT = 300  # seconds for any one answer: machines are busy
FLAGS = (
    "--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--disable-dev-shm-usage",
    "--no-first-run", "--disable-extensions", "--disable-background-networking",
)  # fmt: skip
NO_GPU = ("--disable-gpu",)
FRAMES = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done))))"


class Page:
    """One page, and everything that its console said.

    Args:
        drawing: flags that say how it draws; NO_GPU, if there are none.

    Attributes:
        messages: the texts of console messages, uncaught errors and log entries, in their order.
    """

    def __init__(self, program: str, *drawing: str) -> None:
        self._profile = tempfile.TemporaryDirectory(prefix="fmqm-chromium-")
        ours_in, theirs_out = _pipe()
        theirs_in, ours_out = _pipe()
        # Chromium reads commands from 3 and answers on 4.
        redirect = f'exec "$0" "$@" 3<&{theirs_in} 4>&{theirs_out}'
        self._process = subprocess.Popen(
            [
                "bash",
                "-c",
                redirect,
                program,
                *FLAGS,
                *(drawing or NO_GPU),
                f"--user-data-dir={self._profile.name}",
                "about:blank",
            ],
            pass_fds=(theirs_in, theirs_out),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._in, self._out = ours_in, ours_out
        self._buffer = b""
        self._number = 0
        self._session: str | None = None
        self._events: list[str] = []
        self.messages: list[str] = []
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._call(f"{domain}.enable")
        self._call("Performance.enable", timeDomain="threadTicks")

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._out)  # ends it
        try:
            self._process.wait(TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._in)
        self._profile.cleanup()

    def open(self, path: Path, width: int, height: int = 900, dark: bool = False) -> None:
        """A file, by its path; returns when it is drawn: before its first frame no observer is told, no mouse heard."""
        self._call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._call("Emulation.setEmulatedMedia", media="", features=[scheme])
        self._events.clear()
        answer = self._call("Page.navigate", url=path.resolve().as_uri())
        assert "errorText" not in answer, f"{path}: {answer['errorText']}"
        while "Page.loadEventFired" not in self._events:
            self._read()
        self.draw()

    def draw(self) -> None:
        """Until what was done so far is on the screen, and what watches sizes and scrolling has been told."""
        self.run(FRAMES)

    def run(self, script: str) -> Any:
        """The value of an expression, awaited if it is a promise."""
        answer = self._call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def seconds(self, script: str) -> float:
        """Processor time of the page's main thread until what an expression does is on the screen."""
        before = self._task_seconds()
        self.run(f"(async () => {{ {script}; await {FRAMES} }})()")
        return self._task_seconds() - before

    def _task_seconds(self) -> float:
        metrics = self._call("Performance.getMetrics")["metrics"]
        return next(float(each["value"]) for each in metrics if each["name"] == "TaskDuration")

    def press(self, key: str) -> None:
        code = {"Enter": 13, "Tab": 9, "Escape": 27, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39}[key]
        text = {"text": "\r"} if key == "Enter" else {}
        for kind in ("keyDown", "keyUp"):
            self._call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code, **text)

    def click(self, selector: str) -> None:
        """With the mouse, in the middle of the element."""
        x, y = self.run(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)});"
            "e.scrollIntoView({block: 'center', inline: 'center'});"
            "const r = e.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2] })()"
        )
        for kind in ("mousePressed", "mouseReleased"):
            self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def drag(self, selector: str, right: int, down: int) -> None:
        """With the mouse, from the middle of the element, in steps."""
        x, y = self._middle(selector)
        self._call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)
        for k in (1, 2, 3):
            at = {"x": x + right * k / 3, "y": y + down * k / 3}
            self._call("Input.dispatchMouseEvent", type="mouseMoved", **at, button="left", buttons=1)
        self._call("Input.dispatchMouseEvent", type="mouseReleased", **at, button="left", clickCount=1)

    def swipe(self, selector: str, right: int, down: int) -> None:
        """With a finger, from the middle of the element, in steps."""
        x, y = self._middle(selector)
        for kind, share in (("touchStart", 0.0), ("touchMove", 0.5), ("touchMove", 1.0)):
            points = [{"x": x + right * share, "y": y + down * share}]
            self._call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        self._call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def wheel(self, selector: str, down: int) -> None:
        """Over the middle of the element."""
        x, y = self._middle(selector)
        self._call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=down)

    def _middle(self, selector: str) -> tuple[float, float]:
        x, y = self.run(
            f"(() => {{ const r = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
            "return [r.x + r.width / 2, r.y + r.height / 2] })()"
        )
        return x, y

    def picture_of(self, selector: str) -> bytes:
        """A PNG of an element that is in view."""
        clip = self.run(
            f"(() => {{ const r = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
            "return {x: r.x + scrollX, y: r.y + scrollY, width: r.width, height: r.height, scale: 1} })()"
        )
        return base64.b64decode(self._call("Page.captureScreenshot", clip=clip)["data"])

    def as_on_paper(self, dark: bool = False) -> None:
        """The styles of paper, for who else prefers light or dark."""
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._call("Emulation.setEmulatedMedia", media="print", features=[scheme])

    def sheets(self) -> int:
        """How many pages of A4 it takes in print."""
        pdf = base64.b64decode(self._call("Page.printToPDF", paperWidth=8.27, paperHeight=11.69)["data"])
        return len(re.findall(rb"/Type /Page\b", pdf))

    def picture(self, path: Path) -> None:
        """A PNG of the whole page."""
        data = self._call("Page.captureScreenshot", captureBeyondViewport=True)["data"]
        path.write_bytes(base64.b64decode(data))

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]  # type: ignore[no-any-return]

    def _read(self) -> dict[str, Any]:
        """The next message; what it tells of the console is noted."""
        end = time.monotonic() + TIMEOUT
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._in], [], [], max(end - time.monotonic(), 0))
            assert ready, f"Chromium has not answered for {TIMEOUT} s"
            received = os.read(self._in, 1 << 16)
            assert received, "Chromium has ended"
            self._buffer += received
        line, _, self._buffer = self._buffer.partition(b"\0")
        message: dict[str, Any] = json.loads(line)
        method, parameters = message.get("method", ""), message.get("params", {})
        self._events.append(method)
        if method == "Runtime.consoleAPICalled":
            self.messages.append(str([part.get("value") for part in parameters["args"]]))
        elif method == "Runtime.exceptionThrown":
            self.messages.append(parameters["exceptionDetails"]["text"])
        elif method == "Log.entryAdded":
            self.messages.append(parameters["entry"]["text"])
        return message


def _pipe() -> tuple[int, int]:
    """Both ends of a pipe, above the numbers that Chromium wants."""
    ends = []
    for end in os.pipe():
        ends.append(fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10))
        os.close(end)
    return ends[0], ends[1]
