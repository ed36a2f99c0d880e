"""The page of `framearray view` on an array of the paper's size: `python -m bench view`, from the folder `tests`.

Prints: time and size of the prepared files, time to the first picture, times of drag steps and keys, memory; and the
share of the cores that other programs took just before and after.
"""

import random
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from support.chromium import Shown, browser, shown
from support.tables import percent

from bench.core.machine import quiet
from bench.core.results import ROOT
from framearray_cli.array.images import ImageFormat, write_image
from framearray_cli.array.manifest import Manifest, ManifestCamera, ManifestLight, image_path, matrix_rows
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.tools.view.show import open_server, open_tiles, prepare_all
from framearray_cli.tools.view.tiles import TILES_FOLDER, Tiles

N_C, N_L, SIZE = 192, 48, (400, 300)
OPENINGS = 5  # of the page, for the time to the first picture
STEPS = 150  # of each kind of drag
THREADS = psutil.cpu_count() or 1
PACE_S = 0.016  # between two moves of the pointer, as a screen of 60 Hz gives them


def synthesised(folder: Path, n_c: int = N_C, n_l: int = N_L) -> Path:
    """Write an array whose images have noise as rendered ones do; nothing if it is there already."""
    light = ManifestLight(ambient=(0.1,) * 3, ambient_error=(0.0,) * 3, sources=({"type": "point"},))
    manifest = Manifest(
        version="0",
        name="noise",
        fingerprint="sha256:3",
        images="noise.c{camera:04d}.l{light:03d}.jpg",
        resolution=SIZE,
        fps=24.0,
        cameras=(ManifestCamera(world_from_camera=matrix_rows(np.eye(4)), fov=60.0),) * n_c,
        lights=(light,) * n_l,
        directory=folder,
    )
    if not image_path(manifest, n_c - 1, n_l - 1).is_file():
        rng = np.random.default_rng(7)
        width, height = SIZE
        y, x = np.mgrid[0:height, 0:width].astype(np.float32)
        for c in range(n_c):
            detail = rng.normal(1.0, 0.06, (height, width, 3)).astype(np.float32)  # about that of 14 hits per pixel
            stripes = 0.35 + 0.25 * np.sin((x + 5 * c) / 9) * np.cos(y / 13)
            for l in range(n_l):
                lamp = 1 / (1 + ((x - 8 * l) ** 2 + (y - 150) ** 2) / 8000)
                write_image(image_path(manifest, c, l), (stripes * lamp)[..., None] * detail, ImageFormat(format="jpg"))
        write_manifest(folder, manifest)
    return folder


def run(places: Sequence[str], patience: float, quick: bool) -> None:
    """Measure the page on the arrays in some folders; without one, on a synthesised array.

    Args:
        patience: seconds to wait for a busy machine, before each measurement.
        quick: take tiles that are beside the images, and measure only the page.
    """
    for out in [Path(place) for place in places] or [synthesised(ROOT / "out" / "bench" / "page-array")]:
        print(f"\n{out}\n")
        print("what: median, 95 %, most, share of others")
        for name, *figures in _page(out, patience) if quick else _all(out, patience):
            print(f"{name}: {', '.join(figures)}", flush=True)


def _all(out: Path, patience: float) -> Iterator[list[str]]:
    """Measure preparation, in a folder that is empty at first, and the page."""
    with tempfile.TemporaryDirectory() as cache:
        tiles = open_tiles(out, Path(cache), THREADS)
        with browser() as chromium, _others(patience) as share:
            first = _first_picture(chromium, tiles)
        yield [*_row("first picture, nothing prepared, ms", [first]), share()]
        with _others(patience) as share:
            started = time.perf_counter()
            problems = prepare_all(tiles, THREADS, lambda n: None)
            seconds = time.perf_counter() - started
        assert not problems, problems[0]
        yield [*_one(f"preparing {tiles.n_pictures:,} pictures, {THREADS} threads, s", f"{seconds:.0f}"), share()]
        for kind, pattern in (("pictures", "*.l*.jpg"), ("sheets", "c????.jpg")):
            size = sum(file.stat().st_size for file in (tiles.folder / TILES_FOLDER).rglob(pattern))
            yield [*_one(f"{kind} on the disk, MB", f"{size / 1e6:.0f}"), ""]
        yield from _shown(tiles, patience)


def _page(out: Path, patience: float) -> Iterator[list[str]]:
    tiles = open_tiles(out, None, THREADS)
    prepare_all(tiles, THREADS, lambda n: None)
    return _shown(tiles, patience)


def _shown(tiles: Tiles, patience: float) -> Iterator[list[str]]:
    """Measure the page on prepared tiles."""
    with browser() as chromium:
        with _others(patience) as share:
            first_pictures = [_first_picture(chromium, tiles) for _ in range(OPENINGS)]
        yield [*_row(f"first picture, {OPENINGS} times, ms", first_pictures), share()]
        with _opened(chromium, tiles) as page:
            started = time.perf_counter()
            page.all_loaded()
            yield [*_one("loading all that fits, s", f"{time.perf_counter() - started:.1f}"), ""]
            page.get("framearray.measures = true")
            yield from _steps(page, patience, "slow drag", _dragged(page, _walk(tiles.manifest, 1)))
            yield from _steps(page, patience, "fast drag", _dragged(page, _walk(tiles.manifest, 9)))
            yield from _steps(page, patience, "drag to anywhere", _dragged(page, _walk(tiles.manifest, 10**6)))
            yield from _steps(page, patience, "arrow key", lambda: _keys(page))
            _dragged(page, _everywhere(tiles.manifest))()
            page.all_loaded()
            yield from _memory(page)
            # What waiting for each drawing is worth to the driver is a warning.
            page.errors = [error for error in page.errors if "ReadPixels" not in error]
            page.check(page.page.url.split("#")[0])


@contextmanager
def _opened(chromium: Any, tiles: Tiles) -> Iterator[Shown]:
    with open_server(tiles) as server, shown(chromium, server.url) as page:
        yield page


def _first_picture(chromium: Any, tiles: Tiles) -> float:
    """From the start of the navigation to the full picture, ms; each time in a context without a cache."""
    with _opened(chromium, tiles) as page:
        return float(page.get("framearray.steps[0].at + framearray.steps[0].full"))


def _walk(manifest: Manifest, most: int) -> list[tuple[int, int]]:
    """A wandering drag with steps of at most a given number of places."""
    rng = random.Random(5)
    n_c, n_l = manifest.n_cameras, manifest.n_lights
    places = [(n_c // 2, n_l // 2)]
    while len(places) < STEPS:
        c, l = places[-1]
        c, l = c + rng.randint(-most, most), l + rng.randint(-most, most)
        place = (c % n_c, l % n_l) if most > n_c else (min(n_c - 1, max(0, c)), min(n_l - 1, max(0, l)))
        if place != places[-1]:
            places.append(place)
    return places


def _everywhere(manifest: Manifest) -> list[tuple[int, int]]:
    """To and fro over all cameras, for every twelfth light."""
    rows = range(0, manifest.n_lights, 12)
    return [(c, l) for l in rows for c in range(manifest.n_cameras)[:: 1 if l % 24 == 0 else -1]]


def _dragged(page: Shown, places: Sequence[tuple[int, int]]) -> Callable[[], None]:
    def drag() -> None:
        mouse = page.page.mouse
        points = [page.on_pad(*place) for place in places]
        mouse.move(*points[0])
        mouse.down()
        for point in points[1:]:
            due = time.monotonic() + PACE_S
            mouse.move(*point)
            time.sleep(max(0.0, due - time.monotonic()))
        mouse.up()

    return drag


def _keys(page: Shown) -> None:
    page.page.keyboard.press("Home")
    for _ in range(STEPS // 4):
        for key in ("ArrowRight", "ArrowDown", "ArrowRight", "ArrowUp"):
            page.page.keyboard.press(key)
            time.sleep(PACE_S)


def _steps(page: Shown, patience: float, name: str, move: Callable[[], None]) -> Iterator[list[str]]:
    """Time from the event to the picture of its place, drawn: as small or full picture, and in full size."""
    page.settle()
    page.get("framearray.steps.length = 0")
    with _others(patience) as share:
        spent = -_processor_ms()
        move()
        spent += _processor_ms()
    steps = page.get("framearray.steps")
    page.settle()
    drawn = [step["first"] for step in steps if step["first"] is not None]
    full = [step["full"] for step in steps if step["full"] is not None]
    overtaken = len(steps) - len(drawn)
    yield [*_row(f"{name}, {len(steps)} steps, {overtaken} overtaken before they were drawn, ms", drawn), share()]
    yield [*_row(f"{name}, in full size ({len(full)} of them), ms", full), ""]
    yield [*_one(f"{name}, processor time of Chromium per step, ms", f"{spent / len(steps):.0f}"), ""]


def _memory(page: Shown) -> Iterator[list[str]]:
    """After dragging over everything."""
    session = page.page.context.new_cdp_session(page.page)
    session.send("HeapProfiler.collectGarbage")
    session.send("Performance.enable")
    metrics = {one["name"]: one["value"] for one in session.send("Performance.getMetrics")["metrics"]}
    most, budget, textures = page.get("[framearray.store.most, framearray.store.budget, framearray.picture.bytes]")
    assert most <= budget
    renderers = [
        process.memory_info().rss for process in _chromium() if "--type=renderer" in " ".join(process.cmdline())
    ]
    yield [*_one("JavaScript heap, MB", f"{metrics['JSHeapUsedSize'] / 1e6:.1f}"), ""]
    yield [f"decoded pictures, of {budget / 1e6:.0f} MB", "", "", f"{most / 1e6:.0f}", ""]
    yield [*_one("textures, MB", f"{textures / 1e6:.0f}"), ""]
    yield [*_one("process of the page, MB", f"{max(renderers) / 1e6:.0f}"), ""]


def _chromium() -> list[psutil.Process]:
    """Its running processes."""
    found = []
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            if "chrom" in process.name():
                found.append(process)
    return found


def _processor_ms() -> float:
    """Processor time of all processes of Chromium, ms; unlike wall time, it does not depend on other programs."""
    times = [process.cpu_times() for process in _chromium()]
    return 1e3 * sum(one.user + one.system for one in times)


@contextmanager
def _others(patience: float) -> Iterator[Callable[[], str]]:
    """Wait for a quiet machine; afterwards the function returns the share of other programs before and after."""
    shares = [quiet(patience)]
    yield lambda: percent(max(shares), 2)
    shares.append(quiet(0.0))


def _one(name: str, value: str) -> list[str]:
    return [name, value, "", ""]


def _row(name: str, values: Sequence[float]) -> list[str]:
    ordered = sorted(values)
    if not ordered:
        return [name, "", "", ""]
    high = ordered[min(len(ordered) - 1, int(0.95 * len(ordered)))]
    return [name, f"{statistics.median(ordered):.0f}", f"{high:.0f}", f"{ordered[-1]:.0f}"]
