"""Two runs, one folder: they may work side by side on different cameras, and only then.

Each run holds a lock of its own, `records/0-47.lock`, which the system lets go however the run ends. A guard, held for
a moment, keeps runs from looking at the locks, or writing the manifest, at the same time.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from framearray_cli.base.errors import BusyError, OutputError
from framearray_cli.base.files import make_folder, reason

from .ranges import parse_frames
from .record import FOLDER, MOST, record_file

# Seconds that a run waits for another one to leave the guard, which it holds for milliseconds.
PATIENCE = 60.0


class ArrayFolder:
    """An output folder in which some cameras are this run's."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep all other runs waiting for a moment.

        Raises:
            OutputError: the folder cannot be written to, or another run does not let go.
        """
        make_folder(self._folder.parent)  # what is in its way is told first
        make_folder(self._folder)
        guard = self._folder / ".guard"
        try:
            with FileLock(guard, timeout=PATIENCE):
                yield
        except Timeout as error:
            raise OutputError(f"{guard}: another run has held it for {PATIENCE:.0f} s; end that run") from error
        except (OSError, NotImplementedError) as error:
            what = reason(error) if isinstance(error, OSError) else str(error)
            raise OutputError(f"{guard}: cannot be locked: {what}") from error

    @contextmanager
    def reserved(self, cameras: Sequence[int], text: str) -> Iterator[None]:
        """Keep other runs off some cameras; to be begun within `alone`.

        Args:
            text: their range.

        Raises:
            BusyError: another run works on some of them.
        """
        own = record_file(self._folder.parent, text).with_suffix(".lock")
        for other in self.others():
            if not set(cameras).isdisjoint(_cameras_of(other)):
                raise BusyError(
                    f"{self._folder.parent}: another run is rendering cameras {other.stem} into this folder; "
                    "wait for it, or give both runs other cameras with --cameras"
                )
        lock = FileLock(own)
        lock.acquire(timeout=0)
        try:
            yield
        finally:
            with suppress(OSError):  # before it is let go: afterwards it might be that of another run
                own.unlink()
            lock.release()

    def require_no_other(self) -> None:
        """Refuse to go on where any other run works.

        Raises:
            OutputError: one does.
        """
        if held := self.others():
            cameras = ", ".join(file.stem for file in held)
            raise OutputError(f"{self._folder.parent}: another run is rendering cameras {cameras} into this folder")

    def others(self) -> list[Path]:
        """Locks that other runs hold; those that nobody holds are removed."""
        held = []
        for file in sorted(self._folder.glob("*.lock")):
            lock = FileLock(file)
            try:
                lock.acquire(timeout=0)
            except Timeout:
                held.append(file)
                continue
            with suppress(OSError):
                file.unlink()
            lock.release()
        return held


def _cameras_of(lock: Path) -> range | tuple[int, ...]:
    """The cameras of another run; of a range that is too long for a file name, all."""
    try:
        return parse_frames(lock.stem, MOST)
    except ValueError:
        return range(MOST)
