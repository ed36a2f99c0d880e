"""Makes the pictures of README and docs/ with the program itself.

    PYTHONPATH=tests python tests/pictures/make_pictures.py                  # all of them
    PYTHONPATH=tests python tests/pictures/make_pictures.py environment sums  # these

Each picture comes from a job of this project, cut down to the eyes and light positions in the picture. An eye keeps
the N_r eyes before and after it, so that it has the same samples as in the whole array.
"""

import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import usdroom
from PIL import Image
from support import ROOT
from support.making import assemble_movie, make_sheet

import framearray
from framearray import FrameArray
from framearray_cli.base.arrays import Float32
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_table, read_job
from framearray_cli.scene.paths.paths import eyes, lights
from framearray_cli.tools.mixing import SumOptions, open_pictures
from framearray_cli.tools.movie.look import Look

PICTURES, JOBS = ROOT / "docs" / "pictures", ROOT / "jobs"
GAP = 4  # pixels between the images of a sheet
QUALITY = 80  # of JPEG: a sheet of twelve stays below 150 kB
PLACES = {"point": ("position", "intensity"), "directional": ("direction", "irradiance")}


def cut(job: Job, cameras: Sequence[int], light_positions: Sequence[int], folder: Path, n_r: int = 3) -> Job:
    """Cut a job down to some eyes, each with the n_r before and after it, and to some light positions."""
    all_eyes, all_lights = eyes(job), lights(job)
    around = [k for c in cameras for k in range(c - n_r, c + n_r + 1)]
    table = job_table(job)
    table["camera"] |= {
        "frames": len(around),
        "keys": [
            {"frame": i, "eye": matrix[:3, 3].tolist(), "target": (matrix[:3, 3] - matrix[:3, 2]).tolist()}
            for i, matrix in enumerate(all_eyes.world_from_camera[around])
        ],
    }
    table["light"]["frames"] = len(light_positions)
    for source, path in zip(table["light"]["sources"], all_lights.sources, strict=True):
        place, power = PLACES[path.kind]
        source["keys"] = [
            {"frame": i, place: path.vector[l].tolist(), power: path.intensity[l].tolist()}
            for i, l in enumerate(light_positions)
        ]
    table["reuse"]["n_r"] = n_r
    table["specular"].pop("hits", None)  # follows n_r
    table["output"] |= {"directory": str(folder), "format": "exr"}
    return Job.model_validate(table)


def shown_eye(i: int, n_r: int = 3) -> int:
    """The place in the cut job of eye i of those given to `cut`."""
    return i * (2 * n_r + 1) + n_r


def array(name: str, cameras: Sequence[int], light_positions: Sequence[int], folder: Path, n_r: int = 3) -> FrameArray:
    """Render jobs/NAME.toml, cut down."""
    return framearray.render(cut(read_job(JOBS / f"{name}.toml"), cameras, light_positions, folder, n_r))


def picture(radiance: Float32, width: int) -> Image.Image:
    """Show radiance (h, w, 3) as the program's PNG would, scaled to a width."""
    full = Image.fromarray(srgb8_from_linear(radiance))
    return full.resize((width, round(full.height * width / full.width)), Image.Resampling.LANCZOS)


def sheet(rows: Sequence[Sequence[Image.Image]]) -> Image.Image:
    """Paste pictures of one size side by side, row below row."""
    width, height = rows[0][0].size
    size = len(rows[0]) * (width + GAP) - GAP, len(rows) * (height + GAP) - GAP
    pasted = Image.new("RGB", size, "white")
    for y, row in enumerate(rows):
        for x, image in enumerate(row):
            pasted.paste(image, (x * (width + GAP), y * (height + GAP)))
    return pasted


def array_sheet(
    name: str, cameras: Sequence[int], light_positions: Sequence[int], width: int, folder: Path
) -> Image.Image:
    """Eyes from left to right, light positions from top to bottom."""
    rendered = array(name, cameras, light_positions, folder)
    return sheet(
        [
            [picture(rendered.picture(shown_eye(i), l), width) for i in range(len(cameras))]
            for l in range(len(light_positions))
        ]
    )


def terms(width: int, folder: Path) -> Image.Image:
    """The terms of an image: reflectivity, obscurance W, indirect light I_A R W, and the image."""
    rendered = array("kitchen", [150], [14], folder)
    c = shown_eye(0)
    layers = rendered.layers(c)
    indirect = layers["indirect"] * np.array(rendered.lights[0].ambient, np.float32)
    parts = layers["reflectivity"], layers["obscurance"], indirect, rendered.picture(c, 0)
    return sheet([[picture(part, width) for part in parts]])


def reuse(width: int, folder: Path) -> Image.Image:
    """The same two native hits per pixel without and with the hits of the neighbours; a detail, enlarged."""
    parts = []
    for n_r in (0, 3):
        rendered = array("kitchen", [150], [14], folder / str(n_r), n_r)
        radiance = rendered.picture(shown_eye(0, n_r), 0)
        detail = Image.fromarray(srgb8_from_linear(radiance)).crop((120, 110, 280, 230))
        parts.append(detail.resize((width, width * 3 // 4), Image.Resampling.NEAREST))
    return sheet([parts])


def contact_sheet(width: int, folder: Path) -> Image.Image:
    """The sheet that `framearray sheet` draws of the whole small kitchen."""
    framearray.render(JOBS / "kitchen-small.toml", output=folder / "array")
    make_sheet(folder / "array", folder / "sheet.png", columns=6, rows=4, width=width)
    with Image.open(folder / "sheet.png") as image:
        return image.convert("RGB")


def whole(name: str, folder: Path, **source: str) -> FrameArray:
    """Render jobs/NAME.toml, whole, as EXR; `source` replaces keys of its first source."""
    table = job_table(read_job(JOBS / f"{name}.toml"))
    table["light"]["sources"][0] |= source
    table["output"] |= {"directory": str(folder), "format": "exr"}
    return framearray.render(Job.model_validate(table))


def shown(rendered: FrameArray, c: int, l: float, width: int, sums: SumOptions | None = None) -> Image.Image:
    """One place of an array as a sheet shows it, as a sum if `sums` says so."""
    pictures, _ = open_pictures(rendered.manifest, sums or SumOptions())
    return picture(pictures.picture(c, (l,)), width)


def environment(width: int, folder: Path) -> Image.Image:
    """Above four turns of jobs/kitchen-sky.toml, below the same by sums of jobs/kitchen-dome.toml."""
    c, turns = 2, {0: 15.0, 5: 40.0, 10: 65.0, 15: 90.0}
    sky, dome = whole("kitchen-sky", folder / "sky"), whole("kitchen-dome", folder / "dome")
    panorama = JOBS / "scenes" / "sky.exr"
    turned = [SumOptions(environment=panorama, rotate=(degrees, degrees)) for degrees in turns.values()]
    return sheet([[shown(sky, c, l, width) for l in turns], [shown(dome, c, 0, width, sums) for sums in turned]])


def sums(width: int, folder: Path) -> Image.Image:
    """Above the mean of 1, 3, 7 and 15 positions of the sun, below three positions of a lamp, and a sum of two."""
    around = 40
    suns = array("kitchen", [280], range(around - 7, around + 8), folder / "suns")
    soft = [shown(suns, shown_eye(0), 7, width, SumOptions(soft=n)) for n in (1, 3, 7, 15)]
    lamps = whole("cabin-small", folder / "lamps", group="lamp")
    both = lamps.relight(weights={4: (0.25, 0.4, 0.8), 7: (0.6, 0.3, 0.1)})
    mixed = [shown(lamps, 8, l, width) for l in (2, 4, 7)]
    return sheet([soft, [*mixed, picture(both.picture(8), width)]])


def relit(width: int, folder: Path) -> Image.Image:
    """Every thirtieth frame of jobs/relight-movie.toml, of jobs/kitchen-evening.toml, whole."""
    rendered = framearray.render(JOBS / "kitchen-evening.toml", output=folder / "evening").folder
    assemble_movie(rendered, JOBS / "relight-movie.toml", folder / "f.###.png", look=Look(label=True))
    frames = [Image.open(folder / f"f.{k:03d}.png") for k in range(15, 240, 30)]
    size = width, round(frames[0].height * width / frames[0].width)
    small = [frame.resize(size, Image.Resampling.LANCZOS) for frame in frames]
    return sheet([small[:4], small[4:]])


def gloss(width: int, folder: Path) -> Image.Image:
    """Two eyes of jobs/kitchen-gloss.toml under two positions of the sun."""
    rendered = whole("kitchen-gloss", folder)
    return sheet([[shown(rendered, c, l, width) for c in (2, 21) for l in (2, 8)]])


def usd(width: int, folder: Path) -> Image.Image:
    """A room in USD as `init` and `render` make it, a camera position per column."""
    folder.mkdir()
    return sheet([[picture(image, width) for image in usdroom.images(folder)]])


def main() -> None:
    """Make all pictures again, or those that the command line names."""
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        makers: dict[str, Callable[[], Image.Image]] = {
            "kitchen": lambda: array_sheet("kitchen", [20, 90, 170, 280], [4, 20, 40], 280, out / "kitchen"),
            "cabin": lambda: array_sheet("cabin", [20, 80, 150], [6, 24, 40], 280, out / "cabin"),
            "stairs": lambda: array_sheet("stairs", [10, 70, 130], [6, 24, 40], 280, out / "stairs"),
            "terms": lambda: terms(280, out / "terms"),
            "reuse": lambda: reuse(420, out / "reuse"),
            "sheet": lambda: contact_sheet(900, out / "sheet"),
            "gloss": lambda: gloss(230, out / "gloss"),
            "usd": lambda: usd(280, out / "usd"),
            "environment": lambda: environment(280, out / "environment"),
            "sums": lambda: sums(280, out / "sums"),
            "relight": lambda: relit(280, out / "relight"),
        }
        for name in sys.argv[1:] or makers:
            image, file = makers[name](), PICTURES / f"{name}.jpg"
            image.save(file, "JPEG", quality=QUALITY, optimize=True, progressive=True)
            print(f"{file}: {image.width} x {image.height}, {file.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
