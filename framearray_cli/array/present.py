"""Which files of a frame array are on disk: a render that was stopped, or that still runs, leaves it unfinished.

Images get their names when they are whole, so a file that is there can be read, unless it was damaged later.
"""

import os
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason
from framearray_cli.base.units import agree, counted

from .manifest import Manifest
from .names import file_name
from .ranges import brief_frames_text

REMEDY = "`framearray render JOB` goes on with the rest"


@dataclass(frozen=True, slots=True, kw_only=True)
class PresentFiles:
    """The files of an array that exist.

    Attributes:
        names: relative to the folder, "/" between folders.
    """

    manifest: Manifest
    names: frozenset[str]

    def has(self, files: Iterable[Path]) -> bool:
        """Return whether all of some files of the array exist."""
        folder = self.manifest.directory
        return all(file.relative_to(folder).as_posix() in self.names for file in files)

    def count(self) -> int:
        """Return the number of files of the array that exist."""
        manifest = self.manifest
        return sum(name in self.names for c in range(manifest.n_cameras) for name in camera_files(manifest, c))

    def incomplete(self) -> list[int]:
        """Return the cameras that lack a file."""
        manifest = self.manifest
        return [c for c in range(manifest.n_cameras) if not self.names.issuperset(camera_files(manifest, c))]


def list_present(manifest: Manifest) -> PresentFiles:
    """List the files of an array that exist, at the cost of reading its folders, without a look at each file.

    Raises:
        OutputError: a folder cannot be read.
    """
    found: set[str] = set()
    for folder in {name.rpartition("/")[0] for name in _patterns(manifest)}:
        try:
            with os.scandir(manifest.directory / folder) as entries:
                found.update(f"{folder}/{entry.name}" if folder else entry.name for entry in entries)
        except FileNotFoundError:
            continue
        except OSError as error:
            raise OutputError(f"{manifest.directory / folder}: cannot be read: {reason(error)}") from error
    return PresentFiles(manifest=manifest, names=frozenset(found))


def camera_files(manifest: Manifest, c: int) -> Iterator[str]:
    """Yield the names of all files of camera c, relative to the folder."""
    for pattern in (manifest.layers, manifest.ambient_images, manifest.background_images):
        if pattern:
            yield file_name(pattern, c)
    for group in manifest.groups or (None,):
        pattern, n = (group.images, len(group.lights)) if group else (manifest.images, manifest.n_lights)
        for l in range(n):
            yield file_name(pattern, c, l)


def _patterns(manifest: Manifest) -> list[str]:
    unlit = (manifest.images, manifest.layers, manifest.ambient_images, manifest.background_images)
    return [pattern for pattern in (*unlit, *(group.images for group in manifest.groups)) if pattern]


def missing_text(cameras: Collection[int], n: int) -> str:
    """Word which camera positions lack images, and the remedy: "12 of 32 camera positions lack images: 20-31; ..."."""
    some = f"{len(cameras):,} of {counted(n, 'camera position')} {agree(len(cameras), 'lacks', 'lack')} images"
    return f"{some}: {brief_frames_text(cameras)}; {REMEDY}"
