"""A worker process of `render --workers`: renders the chunks that come in at stdin, and answers on stdout.

Both carry pickles, for both ends are this program: requests are (fields of `Common`, cameras), or None to cancel the
chunk in progress; answers are ("message", ...) and at last ("result", ...). The process ends with its stdin, which
closes however its parent ends.
"""

import os
import pickle
import queue
import signal
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, BinaryIO

from framearray_cli.base.platform import ending_signals

from .chunk import render_chunk

PATIENCE = 5.0  # seconds that a chunk has to stop once nobody wants it; what compiles cannot be stopped


@dataclass(frozen=True, slots=True)
class _Request:
    common: dict[str, Any]
    cameras: tuple[int, ...]
    unwanted: threading.Event = field(default_factory=threading.Event)


def serve() -> None:
    """Render chunks until nobody sends any."""
    _ignore_signals()
    answers = _own_stdout()
    sending = threading.Lock()

    def answer(kind: str, content: dict[str, Any]) -> None:
        with suppress(OSError), sending:  # the parent is gone, which the other thread notices
            pickle.dump((kind, content), answers)
            answers.flush()

    requests: queue.SimpleQueue[_Request | None] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(sys.stdin.buffer, requests), name="requests", daemon=True).start()
    while (request := requests.get()) is not None:
        result = render_chunk(
            request.common, request.cameras, 1, lambda message: answer("message", message), request.unwanted
        )
        answer("result", result)
    os._exit(0)  # nothing is open any more, and modules take long to unload


def _receive(stream: BinaryIO, requests: "queue.SimpleQueue[_Request | None]") -> None:
    """Queue requests as they come; cancel the last one when asked, or when the stream ends."""
    last: _Request | None = None
    with suppress(EOFError, OSError, pickle.UnpicklingError):  # the parent ended, perhaps within a request
        while True:
            content = pickle.load(stream)
            if content is not None:
                last = _Request(*content)
                requests.put(last)
            elif last:
                last.unwanted.set()
    if last:
        last.unwanted.set()
    requests.put(None)
    timer = threading.Timer(PATIENCE, os._exit, [1])
    timer.daemon = True
    timer.start()


def _own_stdout() -> BinaryIO:
    """Keep stdout for answers; what libraries print goes to stderr."""
    stream = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return stream


def _ignore_signals() -> None:
    """Ignore signals: a terminal sends Ctrl-C to this process too, but its parent ends it."""
    for number in ending_signals():
        signal.signal(number, signal.SIG_IGN)
