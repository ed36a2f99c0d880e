"""The page of `framearray view` on an array of the paper's size: `python -m bench view`, from the folder `tests`.

Prints: time and size of the prepared files and of an export, time to the first picture, times of drag steps and keys,
memory; and the share of the cores that other programs took just before and after.
"""

import os
import random
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import psutil
from support.browsers import Shown, browser, file_server, shown
from support.movies import array_of
from support.tables import percent

from bench.core.machine import quiet
from bench.core.results import ROOT
from framearray_cli.array.images import ImageFormat, read_image, write_image
from framearray_cli.array.manifest import Manifest, ManifestLight, image_path, layers_path
from framearray_cli.array.manifest_toml import read_manifest, write_manifest
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.tools.view.clips import Clips
from framearray_cli.tools.view.pagefiles import write_page
from framearray_cli.tools.view.show import open_server, open_tiles, prepare_all
from framearray_cli.tools.view.tiles import TILES_FOLDER, Tiles

N_C, N_L, SIZE = 192, 48, (400, 300)
OPENINGS = 5  # of the page, for the time to the first picture
STEPS = 150  # of each kind of drag
THREADS = psutil.cpu_count() or 1
PLACES = 12  # whose pictures are compared
PLAYED_S = 5.0
Opener: TypeAlias = Callable[[Any], AbstractContextManager[Shown]]  # a browser -> the page
PACE_S = 0.016  # between two moves of the pointer, as a screen of 60 Hz gives them


def synthesised(folder: Path, n_c: int = N_C, n_l: int = N_L) -> Path:
    """Write an array whose images have noise as rendered ones do; nothing if it is there already."""
    light = ManifestLight(ambient=(0.1,) * 3, ambient_error=(0.0,) * 3, sources=({"type": "point"},))
    manifest = array_of(
        n_c, n_l, 24.0, name="noise", fingerprint="sha256:3", images="noise.c{camera:04d}.l{light:03d}.jpg",
        layers="", resolution=SIZE, lights=(light,) * n_l, directory=folder,
    )  # fmt: skip
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


def run(places: Sequence[str], patience: float, quick: bool, cameras: int | None) -> None:
    """Measure the page on the arrays in some folders; without one, on a synthesised array.

    Args:
        patience: seconds to wait for a busy machine, before each measurement.
        quick: take tiles that are beside the images, and measure only the page.
        cameras: repeat the cameras of each array to and fro up to this number.
    """
    for out in [Path(place) for place in places] or [synthesised(ROOT / "out" / "bench" / "page-array")]:
        if cameras:
            out = repeated(out, ROOT / "out" / "bench" / f"page-{out.name}", cameras)
        print(f"\n{out}\n")
        print("what: median, 95 %, most, share of others")
        for name, *figures in _page(out, patience) if quick else _all(out, patience):
            print(f"{name}: {', '.join(figures)}", flush=True)


def _all(out: Path, patience: float) -> Iterator[list[str]]:
    """Measure preparation, in a folder that is empty at first, and the page."""
    with tempfile.TemporaryDirectory() as cache:
        tiles = open_tiles(out, Path(cache), THREADS)
        with browser() as chromium, _others(patience) as share:
            first = _first_picture(chromium, partial(_opened, tiles=tiles))
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
        yield from _shown(partial(_opened, tiles=tiles), tiles.manifest, patience)
    yield from _exported(out, patience)


def _exported(out: Path, patience: float) -> Iterator[list[str]]:
    """Measure an export with clips: its bytes, its pictures, and its page on a plain server."""
    with tempfile.TemporaryDirectory() as folder:
        tiles = open_tiles(out, Path(folder, "cache"), THREADS)
        tiles.clips = Clips()
        page = Path(folder, "page")
        with _others(patience) as share:
            started = time.perf_counter()
            n_bytes, problems = write_page(tiles, page, threads=THREADS, progress=lambda n: None)
            seconds = time.perf_counter() - started
        assert not problems, problems[0]
        yield [*_one(f"export of {tiles.n_pictures:,} pictures, {THREADS} threads, s", f"{seconds:.0f}"), share()]
        yield [*_one("export, MB", f"{n_bytes / 1e6:.0f}"), ""]
        with file_server(page) as address:
            for name, script in (("export", ""), ("without WebCodecs", "delete globalThis.VideoDecoder")):
                opener = partial(shown, url=f"{address}index.html", script=script)
                with browser() as chromium, opener(chromium) as shown_page:
                    for stops in (0, 2):
                        found = list(_psnr(shown_page, tiles.manifest, stops))
                        yield [*_row(f"{name}, PSNR of the screen at +{stops} stops, dB", found), ""]
                for label, *figures in _shown(opener, tiles.manifest, patience):
                    yield [f"{name}, {label}", *figures]


def _psnr(page: Shown, manifest: Manifest, stops: int) -> Iterator[float]:
    """Compare the screen with images of an array of single images, dB."""
    exposure = manifest.job.get("output", {}).get("exposure", 0.0) if manifest.job else 0.0
    for k in range(PLACES):
        c, l = (k * manifest.n_cameras) // PLACES, (7 * k + 3) % manifest.n_lights
        page.get(
            f"framearray.change((view) => {{ view.c = {c}; view.places[framearray.array.main.name] = {l};"
            f" view.exposure = {stops}; }})"
        )
        image = read_image(image_path(manifest, c, l)) * 2.0 ** (stops + exposure)
        error = np.mean((srgb8_from_linear(image).astype(float) - page.pixels()) ** 2)
        yield 10 * np.log10(255**2 / max(error, 1e-9))


def repeated(out: Path, folder: Path, n_c: int) -> Path:
    """Link the files of a short array as a longer one, whose camera goes to and fro."""
    manifest = read_manifest(out)
    n = manifest.n_cameras
    order = [c if c < n else 2 * n - 1 - c for c in (k % (2 * n) for k in range(n_c))]
    longer = replace(manifest, cameras=tuple(manifest.cameras[c] for c in order), directory=folder)
    for k, c in enumerate(order):
        links = [(image_path(manifest, c, l), image_path(longer, k, l)) for l in range(manifest.n_lights)]
        if manifest.layers:
            links.append((layers_path(manifest, c), layers_path(longer, k)))
        for source, link in links:
            link.parent.mkdir(parents=True, exist_ok=True)
            if not link.exists():
                os.link(source, link)
    write_manifest(folder, longer)
    return folder


def _page(out: Path, patience: float) -> Iterator[list[str]]:
    tiles = open_tiles(out, None, THREADS)
    prepare_all(tiles, THREADS, lambda n: None)
    return _shown(partial(_opened, tiles=tiles), tiles.manifest, patience)


def _shown(opener: Opener, manifest: Manifest, patience: float) -> Iterator[list[str]]:
    """Measure the page on prepared tiles."""
    with browser() as chromium:
        with _others(patience) as share:
            first_pictures = [_first_picture(chromium, opener) for _ in range(OPENINGS)]
        yield [*_row(f"first picture, {OPENINGS} times, ms", first_pictures), share()]
        with opener(chromium) as page:
            started = time.perf_counter()
            page.all_loaded()
            yield [*_one("loading all that fits, s", f"{time.perf_counter() - started:.1f}"), ""]
            page.get("framearray.measures = true")
            yield from _steps(page, patience, "slow drag", _dragged(page, _walk(manifest, 1)))
            yield from _steps(page, patience, "fast drag", _dragged(page, _walk(manifest, 9)))
            yield from _steps(page, patience, "jump to anywhere", partial(_jumped, page, manifest))
            yield from _steps(page, patience, "arrow key", lambda: _keys(page))
            _dragged(page, _everywhere(manifest))()
            page.all_loaded()
            yield from _memory(page)
            yield from _played(page)
            # What waiting for each drawing is worth to the driver is a warning.
            page.errors = [error for error in page.errors if "ReadPixels" not in error]
            page.check(page.page.url.split("#")[0].rpartition("/")[0])


@contextmanager
def _opened(chromium: Any, tiles: Tiles) -> Iterator[Shown]:
    with open_server(tiles) as server, shown(chromium, server.url) as page:
        yield page


def _played(page: Shown) -> Iterator[list[str]]:
    """Play the camera at the array's frame rate for some seconds, and count its pictures."""
    page.page.keyboard.press("Home")
    page.all_loaded()
    page.get("framearray.steps.length = 0")
    page.page.keyboard.press("Space")
    time.sleep(PLAYED_S)
    page.page.keyboard.press("Space")
    steps = page.get("framearray.steps.map((step) => step.first !== null)")
    wanted = PLAYED_S * page.get("framearray.array.fps")
    yield [*_one(f"playing {PLAYED_S:.0f} s: pictures of {wanted:.0f}", f"{sum(steps)}"), ""]


def _first_picture(chromium: Any, opener: Opener) -> float:
    """From the start of the navigation to the full picture, ms; each time in a context without a cache."""
    with opener(chromium) as page:
        return float(page.get("framearray.steps[0].at + framearray.steps[0].full"))


def _walk(manifest: Manifest, most: int) -> list[tuple[int, int]]:
    """A wandering drag with steps of at most a given number of places."""
    rng = random.Random(5)
    n_c, n_l = manifest.n_cameras, manifest.n_lights
    places = [(n_c // 2, n_l // 2)]
    while len(places) < STEPS:
        c, l = places[-1]
        c, l = c + rng.randint(-most, most), l + rng.randint(-most, most)
        place = min(n_c - 1, max(0, c)), min(n_l - 1, max(0, l))
        if place != places[-1]:
            places.append(place)
    return places


def _jumped(page: Shown, manifest: Manifest) -> None:
    """Go to random places, each once the last one is sharp."""
    rng = random.Random(5)
    for _ in range(STEPS):
        c, l = rng.randrange(manifest.n_cameras), rng.randrange(manifest.n_lights)
        page.get(f"framearray.change((view) => {{ view.c = {c}; view.places[framearray.array.main.name] = {l}; }})")
        page.settle()
        time.sleep(PACE_S)


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
