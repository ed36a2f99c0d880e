"""Image planes: what each image of a frame holds, as composing, names and the manifest see it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.array.manifest import array_files
from framearray_cli.engine.terms.ambient.estimate import Ambient
from framearray_cli.render.ambient_groups import image_ambient
from framearray_cli.render.identity import identity_of
from framearray_cli.render.manifest import initial_manifest
from framearray_cli.render.names import array_names
from framearray_cli.render.writer import array_target
from framearray_cli.scene.paths.paths import Plane, first_with_background, group_planes, lights, picture_planes

LAMP = {**tiny.TABLE["light"]["sources"][0], "group": "lamps", "axis": "lamps"}
SKY, NIGHT = [0.3, 0.4, 0.5], [0.0, 0.0, 0.0]
GROUPS = (Plane.LIGHT,) * 4


def job(background: Any, sources: Any = (LAMP, tiny.RED)) -> Any:
    table = tiny.table(scene={"background": background})
    table["light"] = {"sources": list(sources)}
    return tiny.Job.model_validate(table)


def test_without_groups_each_light_position_has_a_picture() -> None:
    found = lights(tiny.job(scene={"background": SKY}))
    assert found.planes == (Plane.PICTURE,) * 3 == picture_planes(3)
    assert found.unlit == () and found.n == 3


@pytest.mark.parametrize(
    ("background", "unlit"), [(SKY, (Plane.INDIRECT, Plane.BACKGROUND)), (NIGHT, (Plane.INDIRECT,))]
)
def test_group_planes_end_with_those_that_no_source_lights(background: Any, unlit: Any) -> None:
    found = lights(job(background))
    assert found.planes == GROUPS + unlit == group_planes(4, background=any(background))
    assert (found.unlit, found.n) == (unlit, 4 + len(unlit))
    for source in found.sources:
        assert len(source.vector) == len(source.intensity) == found.n
    shines = np.any([source.intensity.any(axis=1) for source in found.sources], axis=0)
    assert shines.tolist() == [plane.lit for plane in found.planes]


def test_names_follow_the_planes() -> None:
    at = job(SKY)
    names = array_names(at, 1, lights(at))
    assert [(image.group, image.light) for image in names.images] == [
        ("lamps", 0), ("lamps", 1), ("lamps", 2), ("main", 0), ("ambient", None), ("background", None),
    ]  # fmt: skip
    assert [image.file(0) for image in names.images[3:]] == [
        "tiny.main.c0000.l000.exr", "tiny.ambient.c0000.exr", "tiny.background.c0000.exr",
    ]  # fmt: skip
    night = job(NIGHT)
    assert [image.group for image in array_names(night, 1, lights(night)).images][-2:] == ["main", "ambient"]


def test_ambient_light_multiplies_the_plane_of_its_own_and_no_other() -> None:
    found = lights(job(SKY))
    estimate = Ambient(
        intensity=np.full((found.n, 3), 7.0, np.float32),
        standard_error=np.zeros(found.n),
        reflectivity=np.ones(3, np.float32),
        paths=1,
        rays=1,
        notes=(),
    )
    given = image_ambient(estimate, found).intensity
    assert given[:, 0].tolist() == [0, 0, 0, 0, 1, 0]
    assert image_ambient(estimate, lights(tiny.job())) is estimate


@pytest.mark.parametrize(
    ("planes", "first"),
    [
        (picture_planes(3), 0),
        (group_planes(4, background=True), 5),
        (group_planes(4, background=False), 5),
        (group_planes(4, background=True)[2:4], 2),
        (group_planes(4, background=True)[4:], 1),
        (group_planes(4, background=True)[5:], 0),
    ],
)
def test_the_background_is_in_all_planes_from_one_on(planes: Any, first: int) -> None:
    assert first_with_background(planes) == first
    assert all(plane.holds_background for plane in planes[first:])
    assert not any(plane.holds_background for plane in planes[:first])


def test_a_block_of_light_positions_has_the_planes_of_its_own() -> None:
    with tiny.planned(tiny.prepared(job(SKY))) as (setup, _):
        assert setup.planes == (*GROUPS, Plane.INDIRECT, Plane.BACKGROUND) and setup.light_independent_from == 5
        for block, first in ((range(0, 2), 2), (range(3, 5), 2), (range(3, 6), 2), (range(5, 6), 0)):
            part = setup.for_block(block)
            assert part.planes == setup.planes[block.start : block.stop]
            assert len(part.planes) == part.lights.n_lights
            assert part.light_independent_from == first


@pytest.mark.parametrize("sources", [(LAMP, tiny.RED), (tiny.RED, tiny.SUN)])
@pytest.mark.parametrize("background", [SKY, NIGHT])
def test_files_that_are_written_are_those_that_a_manifest_lists(sources: Any, background: Any, tmp_path: Path) -> None:
    at = job(background, sources)
    at = at.model_copy(
        update={
            "camera": at.camera.model_copy(update={"frames": 3}),
            "output": at.output.model_copy(update={"directory": tmp_path, "layers": True}),
        }
    )
    prepared = tiny.prepared(at)
    n = prepared.lights.n
    estimate = Ambient(
        intensity=np.ones((n, 3), np.float32),
        standard_error=np.zeros(n),
        reflectivity=np.ones(3, np.float32),
        paths=1,
        rays=1,
    )
    target = array_target(prepared)
    written = {target.directory / image.file(c) for image in target.names.images for c in range(3)}
    written |= {target.directory / target.names.layers_file(c) for c in range(3)}
    assert len(written) == 3 * (n + 1)
    assert written == set(array_files(initial_manifest(prepared, estimate, identity_of(prepared), None, None)))
