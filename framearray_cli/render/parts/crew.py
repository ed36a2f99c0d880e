"""Who renders the chunks of a render: processes of this machine, or the workers of a Dask scheduler."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeAlias

Message: TypeAlias = dict[str, Any]


class ChunkDiedError(Exception):
    """The workers that rendered a chunk died; the text says what to do, as the end of a message."""


class Handed(Protocol):
    """A chunk that was handed to a worker: a future, Python's own or Dask's."""

    def done(self) -> bool:
        """Whether it has ended, in whatever way."""

    def add_done_callback(self, call: Callable[[Any], object], /) -> object:
        """Have something called when it ends."""


class Crew(Protocol):
    """Workers."""

    def count(self) -> int:
        """Return the number of workers.

        Raises:
            WorkerError: none can be reached any more.
        """

    def require_fit(self, common: dict[str, Any]) -> None:
        """Check that all workers can render the job.

        Raises:
            WorkerError: one cannot.
        """

    def listen(self, topic: str, receive: Callable[[Message], None]) -> None:
        """Have the messages of all workers about a render handed to a function, in threads of the crew."""

    def submit(self, common: dict[str, Any], cameras: tuple[int, ...]) -> Handed:
        """Hand a chunk to a worker that has none."""

    def result(self, handed: Handed) -> dict[str, Any]:
        """Return what `chunk.render_chunk` returned for a chunk that has ended.

        Raises:
            ChunkDiedError: workers died on it.
            WorkerError: the worker cannot render, or can no longer be reached.
        """

    def cancel(self, handed: Sequence[Handed]) -> None:
        """Stop chunks at their next images; do not wait."""
