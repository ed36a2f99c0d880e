"""Illuminance at sensors: points that are lit as hits of eyes are, by shadow rays, gather rays and paths.

A sensor is a hit without a surface that reflects all light, so its irradiance is all that it receives. Each sample of a
sensor has random numbers and a path of its own; samples are added until their spread gives the wanted standard error.
There are few sensors: paths, which have no bias, take seconds, whereas cells may be off by some percent in a corner.
"""

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import NamedTuple

import numpy as np

from framearray_cli.array.manifest import BACKGROUND, MAIN_AXIS, SENSORS
from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import LUMINANCE
from framearray_cli.base.files import write_bytes
from framearray_cli.base.units import LUMENS_PER_WATT, counted, digits
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.features.indirect import PathLight, irradiance_of
from framearray_cli.engine.frames.pool import BATCH, TracePool
from framearray_cli.engine.frames.setup import Batch, FrameSetup, Scratch
from framearray_cli.engine.frames.shading import shade
from framearray_cli.engine.hits.hits import SURFACE
from framearray_cli.engine.hits.row import LIGHT_INDEPENDENT
from framearray_cli.engine.inputs.random import lattice_steps
from framearray_cli.engine.inputs.surfaces import near_depth
from framearray_cli.engine.terms.cells.exact import coloured
from framearray_cli.scene.paths.curves import unit
from framearray_cli.scene.paths.paths import Plane
from framearray_cli.scene.paths.placing import up_axis

from .events import Report, Working
from .plan import frame_setup
from .prepare import Prepared
from .session import RenderSession

FEWEST_BATCHES, MOST_BATCHES = 4, 256  # of samples of a sensor; of fewer the spread is not known
TOGETHER = 1024  # light positions at most, as each sample needs memory for all of them
COLUMNS = ("sensor", "point", "x", "y", "z", "group", "light", "time", "direct", "indirect", "total", "error")
FACTOR = "daylight_factor"


class Sensor(NamedTuple):
    """A point with its unit normal, in the coordinates of the scene file, and its number in the list of that name."""

    name: str
    k: int
    position: Float64
    normal: Float64
    error: float


def sensors_of(prepared: Prepared) -> list[Sensor]:
    """List the sensors of a job."""
    up = up_axis(prepared.job)
    return [
        Sensor(table.name, k, np.array(point), unit(np.array(table.normal or up)), table.error)
        for table in prepared.job.sensors
        for k, point in enumerate(table.positions(prepared.job.scene.up))
    ]


def write_sensors(session: RenderSession, report: Report) -> None:
    """Write the table of all sensors of a job, unless it is there or another run has the first camera.

    Raises:
        OutputError: the file cannot be written.
    """
    prepared, file = session.prepared, session.prepared.job.output.directory / SENSORS
    if not prepared.job.sensors or 0 not in session.chosen or file.is_file():
        return
    sensors = sensors_of(prepared)
    report(Working(text=f"measuring {counted(len(sensors), 'sensor')}"))
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(
        _rows(prepared, sensors, measure(prepared, session.embree, sensors))
    )
    write_bytes(file, text.getvalue().encode())


def measure(prepared: Prepared, embree: EmbreeScene, sensors: Sequence[Sensor]) -> Float64:
    """Measure direct and indirect light and the standard error of their sum, (n_sensors, 3, n_planes), lux."""
    setup = frame_setup(prepared, embree, np.zeros(3, np.float32))
    step_x, step_y = lattice_steps(1)
    one_path = PathLight(setup.indirect.settings._replace(n_rays=1, step_x=step_x, step_y=step_y))
    alone = replace(
        setup, lights=coloured(setup.lights), indirect=one_path, features=(), n_r=0, weights="average",
        per_pixel=np.ones(setup.n_frames), halves=0,
    )  # fmt: skip
    found = []
    for block in np.array_split(np.arange(prepared.n_lights), -(-prepared.n_lights // TOGETHER)):
        some = alone.at(block.tolist())
        look = partial(_light_at, some, prepared.scene.centre, near_depth(prepared.surfaces))
        with TracePool(some, prepared.threads) as pool:
            found.append(np.stack(pool.run(look, enumerate(sensors))))
    return LUMENS_PER_WATT * np.concatenate(found, axis=2)


def _light_at(setup: FrameSetup, centre: Float64, offset: float, task: tuple[int, Sensor], scratch: Scratch) -> Float64:
    """Measure one sensor: direct and indirect light and the standard error of their sum, (3, n_planes), W/m2."""
    sensor, hits, sums = task[1], scratch.hits, np.zeros((3, len(setup.planes)))
    hits.kind[:], hits.pixel[:], hits.half[:], hits.offset[:] = SURFACE, 0, 0, offset
    hits.position[:], hits.reflectivity[:], hits.specular[:] = sensor.position - centre, 1.0, 0.0
    hits.geometric[:], hits.shading[:], hits.incoming[:] = sensor.normal, sensor.normal, -sensor.normal
    for k in range(1, MOST_BATCHES + 1):
        hits.key[:BATCH] = np.random.default_rng([setup.seed, task[0], k]).integers(0, 2**64, BATCH, np.uint64)
        direct, indirect = _shaded(setup, scratch)
        sums += [direct.sum(axis=0), indirect.sum(axis=0), ((direct + indirect) ** 2).sum(axis=0)]
        n, mean = k * BATCH, sums[:2].sum(axis=0) / (k * BATCH)
        error = np.sqrt(np.maximum(sums[2] / n - mean**2, 0) / (n - 1))
        if k >= FEWEST_BATCHES and np.linalg.norm(error) < sensor.error * np.linalg.norm(mean):
            break
    return np.stack([*(sums[:2] / n), error])


def _shaded(setup: FrameSetup, scratch: Scratch) -> tuple[Float64, Float64]:
    """Return direct and indirect light of a batch of samples, (BATCH, n_planes) each, luminance in W/m2."""
    records = setup.empty_records(BATCH)
    shade(Batch(setup=setup, c=0, hits=scratch.hits, n=BATCH, scratch=scratch, records=records, pilot=True))
    direct = np.swapaxes(records.irradiance, 1, 2) @ LUMINANCE
    same = np.pi * records.row[:, LIGHT_INDEPENDENT : LIGHT_INDEPENDENT + 3] @ LUMINANCE
    outside = [plane.holds_background for plane in setup.planes]
    return direct, irradiance_of(records) @ LUMINANCE - direct + same[:, None] * outside


def _rows(prepared: Prepared, sensors: Sequence[Sensor], values: Float64) -> Iterator[list[str]]:
    """Yield the rows of the table, the names of its columns first; lux with six digits."""
    lights, moments, free = prepared.lights, prepared.job.light.moments, _outdoors(prepared)
    groups = [(group.name, group.axis, group.positions) for group in lights.groups]
    groups += [(BACKGROUND, "", range(p, p + 1)) for p, plane in enumerate(lights.planes) if plane is Plane.BACKGROUND]
    left_out = {"group"} if lights.groups == () else set()
    left_out |= set() if moments else {"time"}
    yield [name for name in COLUMNS if name not in left_out] + [FACTOR] * (free is not None)
    for sensor, light in zip(sensors, values.swapaxes(1, 2), strict=True):
        for group, axis, positions in groups or [("", MAIN_AXIS, range(lights.n))]:
            times = [moment.isoformat() for moment in moments.get(axis, ())]
            for l, p in enumerate(positions):
                place = sensor.name, sensor.k, *sensor.position.tolist(), group, l, times[l] if times else ""
                direct, indirect, error = light[p].tolist()
                lux = [direct, indirect, direct + indirect, error]
                lux += [] if free is None else [100 * lux[2] / free[p] if free[p] else 0.0]
                cells = chain(map(str, place), (digits(number, 6) for number in lux))
                yield [cell for k, cell in enumerate(cells) if k >= len(COLUMNS) or COLUMNS[k] not in left_out]


def _outdoors(prepared: Prepared) -> Float64 | None:
    """Illuminance of an unobstructed horizontal surface, (n_lights,); None if the job has a lamp, or groups."""
    found = [source.horizontal(up_axis(prepared.job)) for source in prepared.lights.sources]
    known = [each for each in found if each is not None]
    whole = len(known) == len(found) and not prepared.lights.groups
    return LUMENS_PER_WATT * np.sum(known, axis=0) if whole else None
