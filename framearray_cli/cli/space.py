"""What an error says of the disk that could not be written to."""

from contextlib import suppress
from pathlib import Path

from framearray_cli.base.errors import OutputError
from framearray_cli.base.units import counted, size

LITTLE_SPACE = 64 * 1024 * 1024  # bytes; with less, a full disk is the likely cause of an error
FEW_FILES = 100  # fewer than a run has open, and leaves free when it fails


def add_space(error: OutputError, folder: Path) -> None:
    """Add to an error how little space is left on the disk that could not be written to."""
    from framearray_cli.array.folder import free_files, free_space

    with suppress(OSError):  # that disk may have gone
        if (free := free_space(folder)) < LITTLE_SPACE:
            error.add_note(f"{size(free)} are free on that disk")
        if (files := free_files(folder)) is not None and files < FEW_FILES:
            error.add_note(f"that disk takes {counted(files, 'more file')} (inodes)")
