"""Locks of an output folder: several runs may render into it at once, as long as their cameras differ.

Each run holds a lock of its own, `records/0-47.lock`, which the system releases however the run ends. A guard, held for
milliseconds, ensures that only one run at a time reads the locks or writes the manifest.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from framearray_cli.base.errors import BusyError, OutputError
from framearray_cli.base.files import make_folder, reason

from .places import parse_places
from .record import FOLDER, MOST, record_file

# Seconds that a run waits for the guard.
PATIENCE = 60.0


class ArrayFolder:
    """An output folder, with locks on the cameras of this run."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER

    @contextmanager
    def exclusive(self) -> Iterator[None]:
        """Hold the guard of the folder; all other runs wait.

        Raises:
            OutputError: the folder cannot be written to, or another run does not release the guard.
        """
        make_folder(self._folder.parent)  # reports first what is in the way of the folder itself
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
    def reserve(self, cameras: Sequence[int], text: str) -> Iterator[None]:
        """Lock some cameras against other runs; enter it within `exclusive`.

        Args:
            text: the cameras as a range.

        Raises:
            BusyError: another run renders some of them.
        """
        own = record_file(self._folder.parent, text).with_suffix(".lock")
        for other in self.other_locks():
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
            with suppress(OSError):  # before the release: afterwards it might be the lock of another run
                own.unlink()
            lock.release()

    def require_no_other_run(self) -> None:
        """Refuse to go on while any other run renders into the folder.

        Raises:
            OutputError: another run does.
        """
        if held := self.other_locks():
            cameras = ", ".join(file.stem for file in held)
            raise OutputError(f"{self._folder.parent}: another run is rendering cameras {cameras} into this folder")

    def other_locks(self) -> list[Path]:
        """Return the locks that other runs hold, and remove those that no run holds."""
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


def _cameras_of(lock: Path) -> Sequence[float]:
    """Return the cameras of another run; all, if its range is too long for a file name."""
    try:
        return parse_places(lock.stem, MOST)
    except ValueError:
        return range(MOST)
