"""Lamps with a file of their measured light."""

from dataclasses import replace

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import JobError
from framearray_cli.job.job import Job
from framearray_cli.job.rowfile import RowFileError
from framearray_cli.job.sources import PointSource, SpotSource

from .lightpath import LightPath
from .panels import across_under, carry_across
from .profiles import Profile, read_web
from .units import LUMENS_PER_WATT


def add_profile(
    path: LightPath, source: PointSource | SpotSource, way: tuple[Float64, Float64], job: Job, name: str
) -> LightPath:
    """Give a lamp the profile of its file and, where its keys have no intensity, the file's.

    Args:
        way: (n, 3) unit direction of vertical angle 0, and that of horizontal angle 0 or (0, 3).
        name: of the source, for messages.

    Raises:
        JobError: its `up` points along its axis, or its file is broken by now.
    """
    assert source.ies is not None
    try:
        web = read_web(source.ies)
    except RowFileError as error:
        raise JobError(job.file or job.name, [f"{name}.ies: {source.ies.name}: {error.args[0]}"]) from error
    up_dir = np.array([0.0, 0.0, 1.0] if job.scene.up == "z" else [0.0, 1.0, 0.0])
    axis, ups = way
    across = across_under(axis, ups) if len(ups) else carry_across(axis, up_dir)
    if (flat := np.flatnonzero((across == 0).all(axis=1))).size:
        problem = f"{name}: expected an `up` across the direction of the lamp, got one along it at frame {flat[0]}"
        raise JobError(job.file or job.name, [problem])
    zero = np.cross(axis, across) if len(ups) or web.sideways else across
    intensity = path.intensity
    if source.keys[0].intensity is None:
        tilt_deg = np.degrees(np.arccos(np.clip(-axis @ up_dir, -1, 1)))
        intensity = intensity * web.candela / LUMENS_PER_WATT * web.tilt_factors(tilt_deg)[:, None]
    return replace(
        path,
        intensity=intensity,
        profile=Profile(file=source.ies.name, web=web, axis=axis, zero=zero),
    )
