"""Limit the memory for reading a scene, counted before it is allocated: a small file can hold a huge scene."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from framearray_cli.base.errors import SceneError
from framearray_cli.base.memory import free_memory
from framearray_cli.base.units import amount


@dataclass(slots=True, kw_only=True)
class Limit:
    """The number of bytes that may be taken, and what they were taken for.

    Attributes:
        most: bytes; by default all free memory.
        taken: kind of data -> bytes.
    """

    most: int = field(default_factory=free_memory)
    taken: dict[str, int] = field(default_factory=dict)

    def take(self, kind: str, size: int) -> None:
        """Count bytes that are about to be taken.

        Raises:
            SceneError: there are fewer left.
        """
        self.taken[kind] = self.taken.get(kind, 0) + size
        if sum(self.taken.values()) > self.most:
            kinds = ", ".join(f"{kind} {amount(size)}" for kind, size in self.taken.items())
            raise SceneError(
                f"reading it takes {amount(sum(self.taken.values()))} of memory or more ({kinds}), {amount(self.most)} "
                "may be used; make the scene smaller, or allow more with render.memory"
            )

    @contextmanager
    def lend(self, kind: str, size: int) -> Iterator[None]:
        """Count bytes that are returned at the end."""
        self.take(kind, size)
        try:
            yield
        finally:
            self.taken[kind] -= size
