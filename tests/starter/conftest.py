"""What tests of first jobs share."""

import pytest


@pytest.fixture
def obscurances(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expose with obscurances: cells would be compiled anew for every kind of light, which takes half a minute."""
    for module in ("model", "text"):
        monkeypatch.setattr(f"framearray_cli.starter.{module}.INDIRECT", "obscurance")
