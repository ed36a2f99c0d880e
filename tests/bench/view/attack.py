"""`framearray view --host` under load and attack: `python -m bench attack`, from the folder `tests`.

The array has 24 x 12 images of 400 x 300, and its pictures are prepared; the server is a process of its own, and all
its clients share this one. Prints a table.
"""

import http.client
import socket
import statistics
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import psutil
from support.program import start

from bench.core.results import ROOT

from .page import synthesised

N_C, N_L = 24, 12
CLIENTS, REQUESTS = 200, 40  # each
PATIENCE_S = 60.0


@dataclass(frozen=True)
class Target:
    """A server that runs."""

    process: psutil.Process
    port: int
    token: str

    def memory(self) -> float:
        """Resident, MB."""
        return float(self.process.memory_info().rss / 1e6)


def run() -> None:
    """Measure all cases on one server, one after the other."""
    array = synthesised(ROOT / "out" / "bench" / "attacked-array", N_C, N_L)
    print("clients: requests, refused, per s, median ms, 99 % ms, worst ms, memory MB")
    with _served(array) as target:
        print(f"at first: {target.memory():.0f}")
        for name, times, refused, seconds in _cases(target):
            ordered = sorted(times)
            figures = (statistics.median(ordered), ordered[int(0.99 * (len(ordered) - 1))], ordered[-1])
            row = [len(ordered), refused, len(ordered) / seconds, *(1e3 * value for value in figures)]
            print(f"{name}: {', '.join(f'{value:.0f}' for value in (*row, target.memory()))}", flush=True)


@contextmanager
def _served(array: Path) -> Iterator[Target]:
    """Start the server, and wait until its pictures are prepared."""
    process = start("view", str(array), "--no-browser", "--host", "0.0.0.0", stderr=subprocess.PIPE)
    try:
        url = process.stdout.readline().split()[0] if process.stdout else ""
        address, _, token = url.partition("/?token=")
        for line in process.stderr or ():
            if "are prepared" in line:
                break
        threading.Thread(target=(process.stderr or open).read, daemon=True).start()
        yield Target(psutil.Process(process.pid), int(address.rpartition(":")[2]), token)
    finally:
        process.terminate()
        process.wait()


def _cases(target: Target) -> Iterator[tuple[str, list[float], int, float]]:
    """Name, seconds of each answered request, refused ones, and seconds in all."""
    token = f"?token={target.token}"
    paths = [f"/tiles/light/c{(7 * k) % N_C:04d}.l{(5 * k) % N_L:03d}.jpg{token}" for k in range(REQUESTS)]
    yield "one client, connection kept", *_timed(1, lambda _: _requests(target, paths * 25, 200))
    yield f"{CLIENTS} clients at once, connections kept", *_timed(CLIENTS, lambda _: _requests(target, paths, 200))
    fresh = paths[:10]
    yield (
        f"{CLIENTS} clients at once, a connection per request",
        *_timed(CLIENTS, lambda _: [s for path in fresh for s in _requests(target, [path], 200)]),
    )
    wrong = ["/", "/index.json", "/tiles/light/c0000.jpg?token=wrong", "/%2e%2e/secret"] * 10
    yield f"{CLIENTS} clients without the token", *_timed(CLIENTS, lambda _: _requests(target, wrong, 403))
    yield f"{CLIENTS} clients, garbage", *_timed(CLIENTS, lambda k: [_garbage(target, k) for _ in range(10)])
    yield "one client afterwards", *_timed(1, lambda _: _requests(target, paths * 25, 200))


def _timed(n: int, client: Callable[[int], list[float | None]]) -> tuple[list[float], int, float]:
    """Run n clients side by side; seconds of answered requests, number of others, seconds in all."""
    barrier = threading.Barrier(n + 1)

    def one(k: int) -> list[float | None]:
        barrier.wait(PATIENCE_S)
        return client(k)

    with ThreadPoolExecutor(n) as pool:
        tasks = [pool.submit(one, k) for k in range(n)]
        barrier.wait(PATIENCE_S)
        started = time.perf_counter()
        found = [value for task in tasks for value in task.result()]
        seconds = time.perf_counter() - started
    answered = [value for value in found if value is not None]
    return answered, len(found) - len(answered), seconds


def _requests(target: Target, paths: list[str], status: int) -> list[float | None]:
    """Seconds of each request on one connection, which is opened again if the server closes it; None: no answer."""
    found: list[float | None] = []
    connection = http.client.HTTPConnection("127.0.0.1", target.port, timeout=PATIENCE_S)
    for path in paths:
        started = time.perf_counter()
        try:
            connection.request("GET", path)
            answer = connection.getresponse()
            answer.read()
        except (OSError, http.client.HTTPException):
            connection.close()
            found.append(None)
            continue
        if answer.status != status:
            raise RuntimeError(f"{path}: expected {status}, got {answer.status}")
        found.append(time.perf_counter() - started)
    connection.close()
    return found


def _garbage(target: Target, k: int) -> float | None:
    """Send what is no request; seconds until the server has closed the connection."""
    kinds = (b"\x16\x03\x01" + bytes(300), b"GET /" + b"a" * 70_000, b"POST / HTTP/1.1\r\nContent-Length: 9\r\n\r\n")
    started = time.perf_counter()
    with suppress(OSError), socket.create_connection(("127.0.0.1", target.port), timeout=PATIENCE_S) as connection:
        with suppress(OSError):  # it closes in the middle of what it refuses
            connection.sendall(kinds[k % len(kinds)] + b"\r\n\r\n")
            connection.shutdown(socket.SHUT_WR)
            while connection.recv(65536):
                pass
        return time.perf_counter() - started
    return None
