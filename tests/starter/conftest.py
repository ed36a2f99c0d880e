"""What tests of first jobs share."""

from collections.abc import Container, Sequence
from pathlib import Path

import pytest

from framearray_cli.scene.scene import Scene, load_scene


@pytest.fixture
def obscurances(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expose with obscurances and without gloss, whose kernels would be compiled anew for every kind of light."""
    monkeypatch.setattr("framearray_cli.starter.draft.INDIRECT", "obscurance")

    def load(file: Path, *, folders: Sequence[Path], shining: Container[str], as_file: bool) -> Scene:
        return load_scene(file, folders=folders, shining=shining)

    monkeypatch.setattr("framearray_cli.starter.load_scene", load)
