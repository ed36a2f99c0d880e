"""The coarse array of a render that goes on: small pictures that the page shows where there is no fine one yet."""

from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Self

from framearray_cli.array.coarsearray import COARSE_FOLDER, CoarseArray, read_coarse
from framearray_cli.array.manifest import FILE_NAME, Manifest
from framearray_cli.base.errors import OutputError

from .stamps import Source, source_of
from .tiles import Tiles

COARSE_URL = "coarse/"  # before the addresses of its tiles


class CoarseTiles:
    """Follows the coarse array in the folder of an array, which comes and goes; its tiles lie in a temporary folder."""

    def __init__(self, threads: int) -> None:
        self._threads, self._stack = threads, ExitStack()
        self._array: CoarseArray | None = None
        self._seen: tuple[Source | None, str] = (None, "")  # file of the manifest, and what it has to belong to
        self.tiles: Tiles | None = None

    def look(self, manifest: Manifest) -> None:
        """Look whether there is a coarse array of this array now."""
        seen = source_of(manifest.directory / COARSE_FOLDER / FILE_NAME), manifest.fingerprint
        if seen == self._seen:
            with suppress(OutputError):  # it was removed just now
                self.tiles = self.tiles and self.tiles.renewed()
            return
        self.close()
        self._seen, self._array = seen, read_coarse(manifest.directory, manifest.fingerprint) if seen[0] else None
        if self._array is not None:
            with suppress(OSError, OutputError):  # without room for its tiles the page does without
                folder = Path(self._stack.enter_context(TemporaryDirectory(ignore_cleanup_errors=True)))
                self.tiles = Tiles(self._array.manifest, folder, self._threads)

    def table(self) -> dict[str, Any] | None:
        """Return what the page needs to know of it; None if there is none."""
        if self.tiles is None or self._array is None:
            return None
        contents = self.tiles.contents(live=True)
        return {"index": self.tiles.index, "contents": contents, "places": self._array.places}

    def largest(self) -> Mapping[str, float]:
        """Return the largest value of each kind of picture, as far as known."""
        return self.tiles.largest if self.tiles else {}

    def close(self) -> None:
        """Forget it."""
        self.tiles, self._array, self._seen = None, None, (None, "")
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
