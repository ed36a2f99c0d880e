"""Two browsers and two served arrays for all tests of the page."""

from collections.abc import Iterator
from typing import Any

import pytest
from support import browsers, handmade

from framearray_cli.tools.view.server import PageServer
from framearray_cli.tools.view.show import open_server, open_tiles, prepare_all


@pytest.fixture(scope="session")
def driver() -> Iterator[Any]:
    with browsers.driver() as running:
        yield running


@pytest.fixture(scope="session")
def browser(driver: Any) -> Iterator[Any]:
    with browsers.started(driver) as running:
        yield running


@pytest.fixture(scope="session")
def firefox(driver: Any) -> Iterator[Any]:
    with browsers.started(driver, "firefox") as running:
        yield running


@pytest.fixture(params=["chromium", "firefox"])
def either(request: pytest.FixtureRequest) -> Any:
    """Each of the browsers, one after the other."""
    return _named(request)


def _named(request: pytest.FixtureRequest) -> Any:
    return request.getfixturevalue("browser" if request.param == "chromium" else request.param)


@pytest.fixture(params=["chromium", pytest.param("firefox", marks=pytest.mark.slow)])
def any_browser(request: pytest.FixtureRequest) -> Any:
    """Chromium, and in the slow tests Firefox."""
    return _named(request)


@pytest.fixture(scope="session")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    """Seven cameras, five lights, layers."""
    manifest = handmade.plain(tmp_path_factory.mktemp("plain"))
    with open_server(open_tiles(manifest.directory, None, 2)) as server:
        yield server


@pytest.fixture(scope="session")
def grouped(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    """Groups of sources with two light axes."""
    manifest = handmade.grouped(tmp_path_factory.mktemp("grouped"))
    tiles = open_tiles(manifest.directory, None, 2)
    prepare_all(tiles, 2, lambda n: None)
    with open_server(tiles) as server:
        yield server
