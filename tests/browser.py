"""A headless Chromium for tests, driven through a pipe by its own protocol."""

import contextlib
import json
import os
import shutil
import subprocess
import tempfile
import time

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
PATIENCE = 30.0  # seconds


def found():
    """Return where Chromium is, or None."""
    return next((p for p in map(shutil.which, NAMES) if p), None)


class Browser:
    """One page of a browser, and what went wrong in it."""

    def __init__(self):
        self.folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        theirs, self.out = os.pipe()
        self.into, ours = os.pipe()
        # Chromium reads its orders from descriptor 3 and answers on 4.
        command = [
            found(),
            *FLAGS,
            f"--user-data-dir={self.folder.name}",
            "--remote-debugging-pipe",
        ]
        self.process = subprocess.Popen(
            ["sh", "-c", f'exec "$0" "$@" 3</dev/fd/{theirs} 4>/dev/fd/{ours}', *command],
            pass_fds=(theirs, ours),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs)
        os.close(ours)
        self.buffer, self.count, self.session = b"", 0, None
        self.errors, self.requests, self.events = [], [], set()
        target = self.order("Target.createTarget", url="about:blank")["targetId"]
        found_ = self.order("Target.attachToTarget", targetId=target, flatten=True)
        self.session = found_["sessionId"]
        for room in ("Page", "Runtime", "Network", "Log"):
            self.order(f"{room}.enable")

    def close(self):
        with contextlib.suppress(OSError):
            os.close(self.out)
        self.process.terminate()
        self.process.wait()
        os.close(self.into)
        self.folder.cleanup()

    def order(self, method, **parameters):
        """Send an order and return the answer."""
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.read()
            if answer.get("id") == self.count:
                assert "error" not in answer, answer
                return answer["result"]

    def read(self):
        while b"\0" not in self.buffer:
            chunk = os.read(self.into, 1 << 16)
            assert chunk, "the browser has gone"
            self.buffer += chunk
        message, _, self.buffer = self.buffer.partition(b"\0")
        event = json.loads(message)
        method, what = event.get("method", ""), event.get("params", {})
        self.events.add(method)
        if method == "Network.requestWillBeSent":
            self.requests.append(what["request"]["url"])
        if method == "Network.loadingFailed" and not what.get("canceled"):
            self.errors.append(what["errorText"])
        if method == "Runtime.exceptionThrown":
            self.errors.append(what["exceptionDetails"]["exception"].get("description", "?"))
        if method == "Runtime.consoleAPICalled" and what["type"] in ("error", "warning", "assert"):
            self.errors.append(str([a.get("value") for a in what["args"]]))
        if method == "Log.entryAdded" and what["entry"]["level"] in ("error", "warning"):
            self.errors.append(what["entry"]["text"])
        return event

    def resize(self, width, height):
        self.order(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 500,
        )

    def open(self, file, width=1280, height=900, dark=False, still=False):
        """Load a file in a window of this size and wait until all of it is there."""
        self.resize(width, height)
        features = [
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"},
            {"name": "prefers-reduced-motion", "value": "reduce" if still else "no-preference"},
        ]
        self.order("Emulation.setEmulatedMedia", features=features)
        self.load(file.as_uri())

    def load(self, address):
        """Load an address and wait until all of it is there."""
        self.events.clear()
        self.order("Page.navigate", url=address)
        while "Page.loadEventFired" not in self.events:
            self.read()

    def run(self, script):
        """Return the value of a JavaScript expression, awaited if it is a promise."""
        answer = self.order(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def until(self, script):
        """Wait until an expression is true."""
        end = time.monotonic() + PATIENCE
        while not self.run(script):
            assert time.monotonic() < end, f"waited in vain for {script}"
            time.sleep(0.05)

    def mouse(self, kind, x, y):
        """Let the mouse be "Pressed", "Moved" or "Released" at a place, its left button down."""
        self.order(
            "Input.dispatchMouseEvent",
            type=f"mouse{kind}",
            x=x,
            y=y,
            button="left",
            buttons=1,
            clickCount=1,
        )

    def drag(self, x, y, to_x, to_y):
        """Drag the mouse from one place to another."""
        self.mouse("Pressed", x, y)
        self.mouse("Moved", (x + to_x) / 2, (y + to_y) / 2)
        self.mouse("Moved", to_x, to_y)
        self.mouse("Released", to_x, to_y)

    def touch(self, x, y, across, down, moves=8):
        """Drag a finger from a place by so many pixels, in so many moves."""
        places = [(x + across * k / moves, y + down * k / moves) for k in range(moves + 1)]
        for kind, (at_x, at_y) in zip(["touchStart"] + moves * ["touchMove"], places, strict=True):
            point = {"x": at_x, "y": at_y}
            self.order("Input.dispatchTouchEvent", type=kind, touchPoints=[point])
        self.order("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def key(self, name):
        """Press a key."""
        for kind in ("keyDown", "keyUp"):
            code = {"Tab": 9, "ArrowRight": 39, "ArrowUp": 38}[name]
            self.order(
                "Input.dispatchKeyEvent",
                type=kind,
                key=name,
                code=name,
                windowsVirtualKeyCode=code,
            )
