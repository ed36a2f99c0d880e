"""Illuminance at sensors: points that are lit as hits of eyes are, by the same shadow and gather rays, and by paths.

Paths, as `indirect.exact` has them, serve all jobs: cells are placed for what cameras see, and sensors are elsewhere.

A sensor is a hit without a surface that reflects all light, so its irradiance is all that it receives. Each sample of a
sensor has random numbers of its own; samples are added until their spread gives the wanted standard error.
"""

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from framearray_cli.array.manifest import BACKGROUND, MAIN_AXIS, SENSORS
from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import LUMINANCE
from framearray_cli.base.files import write_bytes
from framearray_cli.base.forms.table import changed
from framearray_cli.base.units import LUMENS_PER_WATT, counted, digits
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.features.indirect import irradiance_of
from framearray_cli.engine.frames.pool import BATCH, TracePool
from framearray_cli.engine.frames.setup import Batch, FrameSetup, Scratch
from framearray_cli.engine.frames.shading import shade
from framearray_cli.engine.hits.hits import SURFACE
from framearray_cli.engine.hits.row import LIGHT_INDEPENDENT
from framearray_cli.engine.inputs.surfaces import near_depth
from framearray_cli.job.method import IndirectTable
from framearray_cli.scene.paths.curves import unit
from framearray_cli.scene.paths.paths import Plane
from framearray_cli.scene.paths.placing import up_axis

from .events import Report, Working
from .plan import plan_work
from .prepare import Prepared, prepared_from
from .session import RenderSession

MOST_BATCHES = 64  # of samples of a sensor
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


def write_sensors(session: RenderSession, report: Report) -> int:
    """Write the table of all sensors, unless it is there or another run has the first camera.

    Returns:
        number of rays.

    Raises:
        OutputError: the file cannot be written.
    """
    prepared, file = session.prepared, session.prepared.job.output.directory / SENSORS
    if not prepared.job.sensors or 0 not in session.chosen or file.is_file():
        return 0
    sensors = sensors_of(prepared)
    report(Working(text=f"measuring {counted(len(sensors), 'sensor')}"))
    values, rays = measure(prepared, session.embree, sensors)
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(_rows(prepared, sensors, values))
    write_bytes(file, text.getvalue().encode())
    return rays


def measure(prepared: Prepared, embree: EmbreeScene, sensors: Sequence[Sensor]) -> tuple[Float64, int]:
    """Measure direct and indirect light and the standard error of their sum, (n_sensors, 3, n_planes), lux.

    Returns:
        the same and the number of rays.
    """
    job = changed(prepared.job, indirect=IndirectTable(method="cells", exact=True))
    exact = prepared_from(job, prepared.scene, prepared.eyes, prepared.lights)
    setup, _ = plan_work(exact, embree, compare=False)
    alone = replace(setup, features=(), n_r=0, weights="average", per_pixel=np.ones(setup.n_frames), allotment=None)
    outside = np.array([plane.holds_background for plane in setup.planes])
    look = _Look(alone, prepared.scene.centre, near_depth(prepared.surfaces), outside)
    with TracePool(alone, prepared.threads) as pool:
        values = np.stack(pool.run(look.at, enumerate(sensors)))
    return values * LUMENS_PER_WATT, pool.rays().total()


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """Arguments of sensors; any thread may call `at`."""

    setup: FrameSetup
    centre: Float64
    offset: float
    outside: Float64  # (n_planes,) 1 where images contain the background

    def at(self, task: tuple[int, Sensor], scratch: Scratch) -> Float64:
        """Return direct and indirect light and the standard error of their sum, (3, n_planes)."""
        sensor, hits, sums = task[1], scratch.hits, np.zeros((3, len(self.outside)))
        hits.kind[:], hits.pixel[:], hits.half[:], hits.offset[:] = SURFACE, 0, 0, self.offset
        hits.position[:], hits.reflectivity[:], hits.specular[:] = sensor.position - self.centre, 1.0, 0.0
        hits.geometric[:], hits.shading[:], hits.incoming[:] = sensor.normal, sensor.normal, -sensor.normal
        for k in range(1, MOST_BATCHES + 1):
            hits.key[:BATCH] = np.random.default_rng([self.setup.seed, task[0], k]).integers(0, 2**64, BATCH, np.uint64)
            direct, indirect = self._shade(scratch)
            sums += [direct.sum(axis=0), indirect.sum(axis=0), ((direct + indirect) ** 2).sum(axis=0)]
            n, mean = k * BATCH, sums[:2].sum(axis=0) / (k * BATCH)
            error = np.sqrt(np.maximum(sums[2] / n - mean**2, 0) / (n - 1))
            if np.linalg.norm(error) <= sensor.error * np.linalg.norm(mean):
                break
        return np.stack([*(sums[:2] / n), error])

    def _shade(self, scratch: Scratch) -> tuple[Float64, Float64]:
        """Return direct and indirect light of a batch of samples, (BATCH, n_planes) each, W/m2 of luminance."""
        setup, records = self.setup, self.setup.empty_records(BATCH)
        shade(Batch(setup=setup, c=0, hits=scratch.hits, n=BATCH, scratch=scratch, records=records, pilot=True))
        lit = np.swapaxes(records.irradiance, 1, 2), irradiance_of(records)
        direct, light = (irradiance * setup.lights.colour @ LUMINANCE for irradiance in lit)
        same = records.row[:, LIGHT_INDEPENDENT : LIGHT_INDEPENDENT + 3] @ LUMINANCE
        return direct, light - direct + np.pi * same[:, None] * self.outside


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
