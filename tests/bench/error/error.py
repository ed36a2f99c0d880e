"""The distance of each variant's images from the reference: docs/quality/error.csv.

Errors are relative to the mean of the reference, which has reuse off and other seeds, averaged over light positions.
*Edges* are where irradiance jumps, but neither normal nor depth does. *Bias* is the root of the squared bias, from two
runs and the two halves of the reference. *Flicker* is the RMSE of the change of the error from one frame to the next,
over sqrt 2.
"""

import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

import numpy as np
from support.tables import Section, number, percent, write_csv

from bench.core.cases import (
    CAMERA_REUSE,
    FRAME_ARRAY,
    JOBS,
    SCRATCH,
    VARIANTS,
    Case,
    Variant,
    job_named,
    open_case,
    with_lights,
    with_settings,
)
from bench.core.frames import frame
from bench.core.machine import busy
from bench.core.results import Table, folder, load_some, site_for
from bench.core.steady import mean
from bench.speed.speed import log
from framearray_cli.array.images import ImageFormat, read_image, write_image
from framearray_cli.base.arrays import Images
from framearray_cli.report.metrics import errors, rmse, shadow_edges, squared_bias
from framearray_cli.report.reference import PASSES, Reference, make_reference, reference_noise

PLACE = 0.4  # of the camera path, where two frames in a row are measured
LIGHTS = (1 / 8, 3 / 8, 5 / 8, 7 / 8)  # of the light path
SEEDS = (101, 202)  # of the two runs that are compared with the two halves
# Containers for images: file format, and the bits per channel.
FORMATS = {
    "EXR half, none": ImageFormat(compression="none", half="always"),
    "EXR half, zip:1": ImageFormat(compression="zip:1", half="always"),
    "EXR half, zip": ImageFormat(compression="zip", half="always"),
    "EXR half, zip:9": ImageFormat(compression="zip:9", half="always"),
    "EXR half, piz": ImageFormat(compression="piz", half="always"),
    "EXR half, pxr24": ImageFormat(compression="pxr24", half="always"),
    "EXR half, b44a": ImageFormat(compression="b44a", half="always"),
    "EXR half, dwaa:45": ImageFormat(compression="dwaa:45", half="always"),
    "EXR float, none": ImageFormat(compression="none", half="never"),
    "EXR float, zip": ImageFormat(compression="zip", half="never"),
    "TIFF float": ImageFormat(format="tif"),
    "PNG 8 bit": ImageFormat(format="png"),
    "JPEG 95": ImageFormat(format="jpg"),
}


def measure(name: str, quick: bool, references_in: Path, variants: Sequence[Variant] = VARIANTS) -> Table:
    """Compare every variant of a job with references; `references_in` keeps these."""
    with open_case(job_named(name, quick)) as case:
        n_lights = case.setup.lights.n_lights
        l = [min(int(share * n_lights), n_lights - 1) for share in LIGHTS]
        frames = [round(PLACE * case.setup.n_frames) + step for step in (0, 1)]
        references = []
        for c in frames:
            started = time.perf_counter()
            references.append(make_reference(case, c, l, references_in, 4 if quick else PASSES))
            log(f"{name}: reference of camera {c}: {time.perf_counter() - started:.0f} s")
        found: dict[str, Table] = {}
        for variant in variants:
            if variant in (SCRATCH, CAMERA_REUSE):  # the same pictures as light reuse only and the frame array
                continue
            pairs = [(images(case, variant, c, l, SEEDS[0]), images(case, variant, c, l, SEEDS[1])) for c in frames]
            found[variant.name] = compare(case, l, pairs, references)
            found[variant.name]["flicker"] = flicker(case, l, pairs, references)
            log(f"{name}: {variant.name}: RMSE {found[variant.name]['rmse']:.2%}")
        return {
            "epsilon": 0.01,
            "cameras": frames,
            "lights": l,
            "hits": 2 * references[0].hits,
            "noise": reference_noise(references, case, l),
            "variants": found,
            "formats": containers(case, frames[0], l),
            "busy": busy(),
        }


def images(case: Case, variant: Variant, c: int, l: Sequence[int], seed: int) -> Images:
    """Frame c made by a variant, under light positions l."""
    changed = (
        with_settings(case, variant.settings)
        if not variant.settings.one_light
        else with_lights(with_settings(case, variant.settings), l)
    )
    out = frame(changed, c, seed).images
    return out if variant.settings.one_light else np.ascontiguousarray(out[list(l)])


def compare(
    case: Case, l: Sequence[int], pairs: Sequence[tuple[Images, Images]], references: Sequence[Reference]
) -> Table:
    """Errors of the first run, and the squared bias from both, over the mean of the reference; means over images."""
    tables = []
    for pair, wanted in zip(pairs, references, strict=True):
        for k in range(len(l)):
            ambient = case.ambient.intensity[l[k]]
            right = wanted.image(k, ambient)
            edges = shadow_edges(wanted.irradiance(k), wanted.normal, wanted.depth)
            table = asdict(errors(pair[0][k], right, edges))
            halves = wanted.half(0, k, ambient), wanted.half(1, k, ambient)
            square, spread = squared_bias((pair[0][k], pair[1][k]), halves)
            scale = float(right.mean(dtype=np.float64)) ** 2
            table["squared_bias"], table["squared_bias_error"] = square / scale, spread / scale
            tables.append(table)
    found = mean(tables)
    found["squared_bias_error"] /= np.sqrt(len(tables))
    return found


def flicker(
    case: Case, l: Sequence[int], pairs: Sequence[tuple[Images, Images]], references: Sequence[Reference]
) -> float:
    """RMSE of what changes of the error from one frame to the next, over sqrt 2 and the mean of the reference.

    It equals the RMSE where the errors of two frames in a row are independent, and 0 where they are the same.
    """
    shares = []
    for k in range(len(l)):
        first, second = (wanted.image(k, case.ambient.intensity[l[k]]) for wanted in references)
        change = (pairs[1][0][k] - second) - (pairs[0][0][k] - first)
        shares.append(rmse(change, np.zeros_like(change)) / 2**0.5 / float(first.mean(dtype=np.float64)))
    return sum(shares) / len(shares)


def containers(case: Case, c: int, l: Sequence[int]) -> dict[str, Table]:
    """Time, size and error of writing images, by container; 8 bit formats are left without an error."""
    made = images(case, FRAME_ARRAY, c, l, SEEDS[0])
    found: dict[str, Table] = {}
    with tempfile.TemporaryDirectory() as place:
        for name, image_format in FORMATS.items():
            path = Path(place) / f"image.{image_format.format}"
            write_image(path, made[0], image_format)
            spent = []
            for image in (*made, *made):
                started = time.thread_time()
                write_image(path, image, image_format)
                spent.append(time.thread_time() - started)
            table: Table = {"cpu_ms": 1e3 * float(np.median(spent)), "bytes": path.stat().st_size}
            table["wall_ms"] = 1e3 * _wall(made, image_format, Path(place), case.threads)
            if image_format.format in ("exr", "tif"):
                back = np.asarray(read_image(path), np.float32)
                table["rmse"] = rmse(back, made[-1]) / float(made[-1].mean(dtype=np.float64))
            found[name] = table
    return found


def _wall(made: Images, image_format: ImageFormat, folder: Path, threads: int) -> float:
    """Seconds per image where all threads write at once."""
    n = 4 * len(made)
    with ThreadPoolExecutor(threads) as pool:
        started = time.perf_counter()
        for _ in pool.map(
            lambda i: write_image(folder / f"{i}.{image_format.format}", made[i % len(made)], image_format), range(n)
        ):
            pass
        return (time.perf_counter() - started) / n


def write(quick: bool) -> None:
    """Write the tables of all results."""
    found = load_some(folder(quick), {name: f"error-{name}" for name in JOBS})
    head = ("", "RMSE", "relMSE", "mean error", "edges, RMSE", "edges, most", "bias", "flicker")
    sections = [
        Section(name, head, [_row(*item) for item in table["variants"].items()]) for name, table in found.items()
    ]
    stored = next(iter(found.values()))["formats"] if found else {}
    rows = [
        (
            name,
            number(t["cpu_ms"]),
            number(t["wall_ms"]),
            number(t["bytes"] / 1024),
            percent(t["rmse"], 2) if "rmse" in t else "",
        )
        for name, t in stored.items()
    ]
    head = ("", "one thread, processor ms", "all threads, ms per image", "KiB", "RMSE added")
    write_csv(site_for(quick).tables / "error.csv", [*sections, Section("Containers", head, rows)])


def _row(variant: str, t: Table) -> list[str]:
    errors = [percent(t["rmse"]), number(t["relmse"]), percent(t["bias"], 2), percent(t["edge_rmse"])]
    square, spread = t["squared_bias"], t["squared_bias_error"]
    bias = (
        f"below {percent((max(square, 0) + 2 * spread) ** 0.5, 2)}" if square < 2 * spread else percent(square**0.5, 2)
    )
    return [variant, *errors, percent(t["edge_max"]), bias, percent(t["flicker"])]
