"""The two programs of `smoke.py`, Windows' and Linux', and how it runs, watches and asks them."""

import fcntl
import glob
import http.client
import json
import os
import pty
import socket
import struct
import subprocess
import termios
import threading
import time
import urllib.error
import urllib.request

PAGE = "127.0.0.1:8710"
VMC_PORT = 39539


class Program:
    """A corybant. It works in a folder of its own, beside the folder with the song and the motions."""

    def __init__(self, name: str, folder: str, command: list[str]) -> None:
        self.name = name
        self.folder = folder
        self.command = command
        os.makedirs(folder, exist_ok=True)

    def run(self, *arguments: str, seconds: float = 600) -> tuple[int, str, str, float]:
        """Runs the program to its end. Returns its exit code, output, errors and duration in seconds."""
        start = time.monotonic()
        done = subprocess.run(
            [*self.command, *arguments], cwd=self.folder, capture_output=True, timeout=seconds, stdin=subprocess.DEVNULL
        )
        out, err = (text.decode("utf-8", "replace").replace("\r\n", "\n") for text in (done.stdout, done.stderr))
        return done.returncode, out, err, time.monotonic() - start

    def file(self, name: str) -> str:
        """The path of a file that the program reads or writes."""
        return os.path.join(self.folder, name)

    def own_path(self, name: str) -> str:
        """The full path of a file in the folder of the program, as the program writes it."""
        path = os.path.abspath(self.file(name))
        return "Z:" + path.replace("/", "\\") if self.command[0] == "wine" else path

    def write(self, name: str, text: str) -> None:
        """Writes a file for the program."""
        with open(self.file(name), "w") as file:
            file.write(text)

    def processes(self) -> list[int]:
        """The ids of the processes that run the program."""
        ending = os.path.basename(self.command[-1]).encode()
        found = []
        for path in glob.glob("/proc/[0-9]*/cmdline"):
            try:
                program = open(path, "rb").read().split(b"\0")[0]
            except OSError:  # the process has ended
                continue
            if program.replace(b"\\", b"/").lower().split(b"/")[-1] == ending:
                found.append(int(path.split("/")[2]))
        return found


class Running:
    """A program that runs on a terminal of its own, and what it has printed."""

    def __init__(self, program: Program, *arguments: str) -> None:
        self.program = program
        self.master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, b"\x32\0\xf4\x01\0\0\0\0")  # 50 lines of 500 characters
        self.printed = b""
        self.start = time.monotonic()
        self.child = subprocess.Popen(
            [*program.command, *arguments],
            cwd=program.folder,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(slave)
        threading.Thread(target=self.read, daemon=True).start()

    def read(self) -> None:
        """Reads what the program prints."""
        try:
            while chunk := os.read(self.master, 4096):
                self.printed += chunk
        except OSError:  # the program has ended
            pass

    def text(self) -> str:
        """Everything that the program has printed."""
        return self.printed.decode("utf-8", "replace")

    def until(self, what, seconds: float = 30):
        """Waits for a result of `what()` that counts as true and returns it; after `seconds`, returns the last result."""
        end = time.monotonic() + seconds
        while not (result := what()) and time.monotonic() < end and self.child.poll() is None:
            time.sleep(0.05)
        return result

    def press_ctrl_c(self) -> None:
        os.write(self.master, b"\x03")

    def wait(self, seconds: float) -> int | None:
        """Waits for the end and returns the exit code; kills the program after `seconds` and returns None."""
        try:
            return self.child.wait(seconds)
        except subprocess.TimeoutExpired:
            for process in self.program.processes():
                os.kill(process, 9)
            self.child.kill()
            return None


class Receiver(threading.Thread):
    """Receives VMC poses and stores when each has come."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.times: list[float] = []
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", VMC_PORT))
        self.start()

    def run(self) -> None:
        while True:
            if b"/VMC/Ext/T\0" in self.socket.recv(65536):
                self.times.append(time.monotonic())

    def gaps_ms(self) -> list[float]:
        """The intervals between poses in milliseconds, the shortest first."""
        return sorted((b - a) * 1e3 for a, b in zip(self.times, self.times[1:]))

    def rate(self) -> float:
        """Poses per second."""
        return (len(self.times) - 1) / (self.times[-1] - self.times[0]) if len(self.times) > 1 else 0.0

    def summary(self) -> str:
        gaps = self.gaps_ms()
        if len(gaps) < 10:
            return f"{len(self.times)} poses"
        p50, p99 = share(gaps, 0.5), share(gaps, 0.99)
        return f"{len(self.times)} poses, {self.rate():.1f}/s, intervals p50 {p50:.1f} p99 {p99:.1f} max {gaps[-1]:.1f} ms"


def share(values: list[float], part: float) -> float:
    """The value below which `part` of the sorted values lie."""
    return values[int((len(values) - 1) * part)]


class Browser:
    """A browser on the page of a show: it keeps cookies, as the setup needs them."""

    def __init__(self) -> None:
        self.opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())

    def ask(self, path: str, body: object = None, method: str | None = None) -> tuple[int, str]:
        """Sends a request, with `body` as bytes or as JSON. Returns the status and the text of the answer or of the failure."""
        data = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
        url = path if path.startswith("http") else f"http://{PAGE}{path}"
        try:
            with self.opener.open(urllib.request.Request(url, data, method=method), timeout=60) as answer:
                return answer.status, answer.read().decode("utf-8", "replace")
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode("utf-8", "replace")
        except (OSError, http.client.HTTPException) as error:
            return 0, str(error)

    def until(self, path: str, wanted, seconds: float = 60) -> dict | None:
        """Asks for JSON until `wanted(answer)` is true. Returns the answer, or None after `seconds`."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            status, text = self.ask(path)
            if status == 200 and wanted(answer := json.loads(text)):
                return answer
            time.sleep(0.1)
        return None


def send_osc(address: str, *arguments: float | int | str, port: int = 9000) -> None:
    """Sends an OSC message to a show."""

    def padded(text: str) -> bytes:
        return text.encode() + b"\0" * (4 - len(text.encode()) % 4)

    def encoded(argument: float | int | str) -> bytes:
        if isinstance(argument, str):
            return padded(argument)
        return struct.pack(">i" if isinstance(argument, int) else ">f", argument)

    kinds = "".join({str: "s", int: "i", float: "f"}[type(argument)] for argument in arguments)
    message = padded(address) + padded("," + kinds) + b"".join(map(encoded, arguments))
    socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(message, ("127.0.0.1", port))


def on_page(kind: str, wanted, seconds: float = 30) -> dict | None:
    """Reads the live messages of the page until one of this kind for which `wanted(message)` is true. Returns it, or None
    after `seconds` or if there is no page."""
    import websocket  # of Debian's python3-websocket

    end = time.monotonic() + seconds
    try:
        live = websocket.create_connection(f"ws://{PAGE}/live", timeout=20)
    except OSError:
        return None
    try:
        while time.monotonic() < end:
            message = live.recv()
            if not isinstance(message, str):  # a pose
                continue
            message = json.loads(message)
            if message.get("type") == kind and wanted(message):
                return message
    finally:
        live.close()
    return None
