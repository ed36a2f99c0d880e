"""Identity of a frame array: all that determines the bytes of its files, as hashes and as a table."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from framearray_cli.array.folder import FREE, Identity, metadata_of
from framearray_cli.array.manifest_toml import plain
from framearray_cli.base.files import fingerprint
from framearray_cli.base.forms.table import Table
from framearray_cli.engine.inputs.emitters import glows
from framearray_cli.job.method import ObscuranceTable, SamplesTable
from framearray_cli.job.read import job_table
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.scene import Scene

from .prepare import Prepared

_DEFAULTS: dict[str, type[Table]] = {"obscurance": ObscuranceTable, "samples": SamplesTable}


def identity_of(prepared: Prepared, scene: str | None = None) -> Identity:
    """Return the identity of the array that a job renders.

    Args:
        scene: fingerprint of the scene, if known.
    """
    scene = scene or scene_fingerprint(prepared)
    return Identity(
        name=prepared.job.name,
        fingerprint=job_fingerprint(prepared, scene),
        scene=scene,
        job=plain(job_table(prepared.job)),
    )


def scene_fingerprint(prepared: Prepared) -> str:
    """Hash the scene as it was read: its triangles, materials and textures; its path is ignored."""
    scene = prepared.scene
    glass = (scene.pane_corners, scene.pane_optics, scene.pane_uvs, scene.pane_texture) if scene.has_glass else ()
    gloss = (prepared.glossy.factor, prepared.glossy.texture) if scene.is_glossy else ()
    coat = (prepared.glossy.coat,) if len(prepared.glossy.coat) else ()
    shining = prepared.light_arrays.emitters.span.size > 0 or glows(prepared.glow)
    backs = (scene.one_sided,) if prepared.job.scene.back_faces == "hide" else ()
    emission = (scene.emission, scene.emission_texture, scene.one_sided) if shining else ()
    tables = (*prepared.surfaces, *prepared.relief[:-1], *glass, *gloss, *coat, *emission, *backs)
    arrays = (np.ascontiguousarray(array).reshape(-1).view(np.uint8).data for array in tables)
    return fingerprint(scene.centre.tobytes(), *arrays)


def job_fingerprint(prepared: Prepared, scene: str | None = None) -> str:
    """Hash all that pixels depend on: the job without `output` and `render`, and the scene as it was read.

    Args:
        scene: fingerprint of the scene, if known.
    """
    table = {key: value for key, value in job_table(prepared.job).items() if key not in ("output", *FREE)}
    table["scene"] = {key: value for key, value in table["scene"].items() if key not in ("file", "folders")}
    for section, key in metadata_of(table):
        table[section] = {**table[section], key: _DEFAULTS[section].model_fields[key].default}
    paths = [path for path in prepared.lights.sources if path.part_of is None]
    files = [_file_digests(path, source) for path, source in zip(paths, table["light"]["sources"], strict=True)]
    if any(files):  # what a file of a lamp, an environment or the weather says, not its name
        sources = [source | digests for source, digests in zip(table["light"]["sources"], files, strict=True)]
        table["light"] = table["light"] | {"sources": sources}
    scene = scene or scene_fingerprint(prepared)
    mattes = _matte_names(prepared.scene) if prepared.job.output.aov["mattes"] else ()
    return fingerprint(json.dumps(table, sort_keys=True, default=str).encode(), scene.encode(), *mattes)


def _matte_names(scene: Scene) -> Iterator[Any]:
    """Yield what mattes depend on, besides the scene in the form that kernels read."""
    yield json.dumps([scene.object_names, scene.material_names]).encode()
    for array in (scene.object, scene.pane_object, scene.pane_material):
        yield np.ascontiguousarray(array).data


def _file_digests(path: LightPath, source: Mapping[str, Any]) -> dict[str, str]:
    """The keys of a source that name files, with a hash of what these say."""
    found = {"ies": path.profile.web.digest} if path.profile else {}
    if source.get("weather"):  # the light that it gives
        maps = path.environment.maps if path.environment else None
        found["weather"] = fingerprint((path.intensity if maps is None else maps).tobytes())
    return found | ({"file": path.environment.panorama.digest} if path.environment else {})
