"""Build the manifest of a render, with everything that other programs need."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from framearray_cli import __version__
from framearray_cli.array.folder import Identity
from framearray_cli.array.manifest import (
    BACKGROUND,
    Manifest,
    ManifestGroup,
    ManifestLight,
    manifest_camera,
    matrix_rows,
)
from framearray_cli.base.arrays import Float64
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import Plane

from .automatic import AutoSettings
from .errortarget import Target
from .prepare import Prepared
from .writer import AMBIENT, ArrayNames, array_names


def initial_manifest(
    prepared: Prepared,
    ambient: Ambient,
    identity: Identity,
    settings: AutoSettings | None,
    target: Target | None,
    warnings: Sequence[str] = (),
) -> Manifest:
    """Return the manifest of a render that has not begun."""
    job, report = prepared.job, prepared.scene.report
    files = array_names(job, prepared.n_cameras, prepared.lights)
    summary: dict[str, Any] = {"finished": False, "images": 0, "ambient_paths": ambient.paths}
    summary |= {"notes": list(ambient.notes)}
    summary |= {"indirect": ambient.accuracy.table()} if ambient.accuracy else {}
    summary |= {"automatic": settings.table()} if settings else {}
    summary |= {"target": target.table()} if target else {}
    summary |= {"warnings": list(warnings)} if warnings else {}
    return Manifest(
        version=__version__,
        name=job.name,
        fingerprint=identity.fingerprint,
        layers=files.layers if job.output.layers else "",
        resolution=job.camera.resolution,
        fps=job.output.fps,
        cameras=tuple(
            manifest_camera(matrix_rows(matrix), lens)
            for matrix, lens in zip(prepared.eyes.world_from_camera, prepared.eyes.lenses, strict=True)
        ),
        job=identity.job,
        scene={
            "triangles": report.triangles,
            "materials": report.materials,
            "textures": report.textures,
            "dropped": report.dropped,
            "notes": [*report.notes, *prepared.lights.notes],
            "fingerprint": identity.scene,
        },
        summary=summary,
        directory=job.output.directory,
        **_images(prepared, ambient, files),
    )


def _images(prepared: Prepared, ambient: Ambient, files: ArrayNames) -> dict[str, Any]:
    """Return the file patterns of the images, and their lights."""
    lights = prepared.lights
    if prepared.job.indirect.method != "obscurance":  # all light is in the images
        ambient = replace(
            ambient,
            intensity=np.zeros_like(ambient.intensity),
            standard_error=np.zeros_like(ambient.standard_error),
        )
    i_a = ambient.intensity.astype(np.float64)
    if not lights.groups:
        return {"images": files.pattern(""), "lights": _lights(range(lights.n), lights.sources, i_a, ambient)}
    dark = i_a[lights.planes.index(Plane.INDIRECT)]  # no source shines there: the background only
    groups = tuple(
        ManifestGroup(
            name=group.name,
            axis=group.axis,
            images=files.pattern(group.name),
            lights=_lights(group.positions, [lights.sources[i] for i in group.sources], i_a - dark, ambient),
        )
        for group in lights.groups
    )
    return {
        "groups": groups,
        "ambient_images": files.pattern(AMBIENT),
        "background_images": files.pattern(BACKGROUND),
        "background_ambient": tuple(dark.tolist()),
    }


def _lights(
    positions: range, sources: Sequence[LightPath], i_a: Float64, ambient: Ambient
) -> tuple[ManifestLight, ...]:
    """Return sources and I_A, (n_lights, 3), at some light positions."""
    return tuple(
        ManifestLight(
            ambient=tuple(i_a[l].tolist()),
            ambient_error=tuple((i_a[l] * float(ambient.standard_error[l])).tolist()),
            sources=tuple(source.table(l) for source in sources if source.part_of is None),
        )
        for l in positions
    )
