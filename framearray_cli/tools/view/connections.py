"""Connections of a server that does not trust its clients: each has a time limit at every stage, and there is room for
new ones: when there are too many, the one that has waited longest for its client is closed.
"""

import socket
import threading
import time
from contextlib import suppress
from dataclasses import dataclass

MOST_CONNECTIONS = 512  # each has a thread
IDLE_S = 60.0  # until the first line of the next request has come
HEAD_S = 10.0  # for the other lines of a request
ANSWER_S = 120.0  # for making and sending an answer


@dataclass(slots=True)
class _Stage:
    """What a connection is at: when it must be over, and whether it waits for its client."""

    deadline: float
    waits: bool


class Connections:
    """The open connections of a server. Threads may share it."""

    def __init__(self, most: int = MOST_CONNECTIONS) -> None:
        self._most, self._lock = most, threading.Lock()
        self._stages: dict[socket.socket, _Stage] = {}  # in the order of the last change of stage

    def begin(self, connection: socket.socket, seconds: float, *, waits: bool) -> None:
        """Begin a stage of a connection, which may last that long; a new connection may take the place of another."""
        with self._lock:
            self._stages.pop(connection, None)
            if len(self._stages) >= self._most:
                waiting = (other for other, stage in self._stages.items() if stage.waits)
                self._close(next(waiting, next(iter(self._stages))))
            self._stages[connection] = _Stage(time.monotonic() + seconds, waits)

    def end(self, connection: socket.socket) -> None:
        """Forget a connection that is closed."""
        with self._lock:
            self._stages.pop(connection, None)

    def close_late(self) -> None:
        """Close the connections that are over their time."""
        now = time.monotonic()
        with self._lock:
            for connection in [one for one, stage in self._stages.items() if stage.deadline < now]:
                self._close(connection)

    def _close(self, connection: socket.socket) -> None:
        """End a connection under its thread, which then finds it at its end."""
        del self._stages[connection]
        with suppress(OSError):  # its client was faster
            connection.shutdown(socket.SHUT_RDWR)
