"""A small real disk: a tmpfs with a file that takes the rest of its space; and a limit that acts like a full one."""

import os
import resource
import shutil
import signal
import subprocess
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

PAGE = 4096  # bytes; a tmpfs gives whole ones


class SmallDisk:
    """A mounted disk of 64 MB."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._ballast = folder, folder / "ballast"

    def leave(self, n_bytes: int) -> None:
        """Fill it up except for some bytes."""
        self._ballast.unlink(missing_ok=True)
        disk = os.statvfs(self.folder)
        fill = disk.f_bavail * disk.f_frsize // PAGE - -(-n_bytes // PAGE)
        with self._ballast.open("wb") as file:
            for _ in range(fill):
                file.write(bytes(PAGE))

    def free(self) -> None:
        """Remove the ballast."""
        self._ballast.unlink()

    def remount(self, options: str) -> None:
        subprocess.run(["mount", "-o", f"remount,{options}", str(self.folder)], check=True)


def mounted(folder: Path, options: str = "size=64m") -> Generator[SmallDisk]:
    """Mount one while a test runs; skip the test where this user may not."""
    folder.mkdir()
    mount = shutil.which("mount")
    command = [str(mount), "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    if mount is None or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("this user may not mount a small disk")
    try:
        yield SmallDisk(folder)
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


@contextmanager
def largest_file(n_bytes: int) -> Iterator[None]:
    """A limit on the size of a file stands for the full disk: the same calls fail, with EFBIG instead of ENOSPC."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
