"""A scene file for all tests of renders."""

from pathlib import Path

import pytest
from support import tiny


@pytest.fixture(scope="session")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tiny.save_glb(tiny.room_meshes(), tmp_path_factory.mktemp("scene") / "room.glb")
