"""Normal maps against the geometry that they stand for: caps of a sphere on a plane.

The map of a cap holds the normals of a sphere of radius r, which meets the plane at a circle of radius a. The
irradiance by a sun of direction d is E max(0, -d . n), without the shadows of the cap, as the plane has none.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support import tiny
from support.irradiance import seen
from support.scenes import Glb, png
from support.stages import look, point, sun

from framearray_cli.job.job import Job

Array = NDArray[np.float64]

SIZE = 512  # texels along the map, which covers the plane from -1 to 1 in x and z
A, HEIGHT = 0.8, 0.4
R = (A * A + HEIGHT * HEIGHT) / (2 * HEIGHT)
# An 8-bit normal is off by half a code value in each direction, 0.002; at E = 1 so is the irradiance. Between texels
# blending cuts the curve by 1 / (8 SIZE^2 r^2), nothing.
ROUNDING = 3**0.5 / 255
IRRADIANCE = 2.0


def cap_normal(x: Any, y: Any) -> Any:
    """Normals of the cap over a plane of up direction z, (..., 3)."""
    inside = x * x + y * y < A * A
    nx, ny = np.where(inside, x / R, 0), np.where(inside, y / R, 0)
    return np.stack([nx, ny, np.sqrt(1 - nx * nx - ny * ny)], axis=-1)


def cap_texels() -> Any:
    at = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    x, y = np.meshgrid(at, -at)  # row 0 on top
    return np.rint((cap_normal(x, y) + 1) / 2 * 255).astype(np.uint8)


def write_plane(
    folder: Path, *, texels: Any = None, scale: float = 1.0, turn: Any = ((1, 0), (0, 1)), tangents: bool = False,
    back: bool = False,
) -> Path:  # fmt: skip
    """A plane at y = 0 with a normal map.

    Args:
        texels: None: those of the cap.
        turn: matrix that takes x and -z to u and v, as the texture coordinates have them; the cap is round.
        tangents: whether the file has them.
        back: whether the corners run the other way, so that one sees the back from above.
    """
    glb = Glb()
    corner = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], np.float32)
    uv = (corner[:, [0, 2]] * [1, -1]) @ np.array(turn, np.float64).T / 2 + 0.5
    more = {"TEXCOORD_0": glb.accessor((uv * [1, -1] + [0, 1]).astype(np.float32))}
    if tangents:
        along = np.linalg.inv(np.array(turn, np.float64))[:, 0]
        sign = np.sign(np.linalg.det(np.array(turn, np.float64)))
        row = [along[0], 0, -along[1], sign]
        more["TANGENT"] = glb.accessor(np.array([row] * 4, np.float32))
        more["NORMAL"] = glb.accessor(np.array([[0, 1, 0]] * 4, np.float32))
    faces = np.array([0, 1, 2, 0, 2, 3], np.uint16)
    image = {"index": glb.texture(png(cap_texels() if texels is None else texels)), "scale": scale}
    material = glb.material("Plane", normalTexture=image)
    glb.node(glb.mesh(material, positions=corner, faces=faces[::-1].copy() if back else faces, **more))
    return glb.save(folder / "plane.glb")


def job_of(scene: Path, *lights: dict[str, Any], eye: Any = (0.3, 4.0, 0.2)) -> Job:
    camera = {**look(list(eye), [0, 0, 0], fov=35.0, up=[0, 0, -1]), "resolution": [32, 32]}
    return tiny.job(
        scene={"file": str(scene), "surfaces": "file"}, camera=camera, light={"frames": 1, "sources": list(lights)},
        samples={"hits": 1}, ambient={"paths": 512},
    )  # fmt: skip


def expected_normal(position: Array) -> Array:
    """Of the cap at points of the plane y = 0."""
    x, y, z = cap_normal(position[:, 0], -position[:, 2]).T
    return np.stack([x, z, -y], axis=1)


def off_the_rim(position: Array) -> Any:
    """Points whose four texels lie on one side of the rim, where the normal jumps."""
    return abs(np.hypot(position[:, 0], position[:, 2]) - A) > 3 * 2 / SIZE


TURNS = {
    "as it is": ((1, 0), (0, 1)),
    "mirrored": ((-1, 0), (0, 1)),
    "upside down": ((1, 0), (0, -1)),
    "turned": ((0, 1), (-1, 0)),
    "turned and mirrored": ((0, 1), (1, 0)),
}


@pytest.mark.parametrize("tangents", [False, True])
@pytest.mark.parametrize("name", TURNS)
def test_the_normals_of_a_cap(tmp_path: Path, name: str, tangents: bool) -> None:
    """The map holds directions of its own u and v. However the plane shows it, tangents turn them to be what was asked:
    the normals of a cap in that map's u and v."""
    turn = np.array(TURNS[name], np.float64)
    sunlight = sun([0.8, -0.5, 0.33], IRRADIANCE)
    position, hits, light = seen(job_of(write_plane(tmp_path, turn=turn, tangents=tangents), sunlight))
    normal, kept = expected_normal(position), off_the_rim(position)
    assert kept.sum() > 500
    assert abs(hits.shading - normal)[kept].max() < ROUNDING
    way = -np.array([0.8, -0.5, 0.33]) / np.linalg.norm([0.8, -0.5, 0.33])
    right = IRRADIANCE * np.maximum(normal @ way, 0)
    assert abs(light[:, 0, 0] - right)[kept].max() < IRRADIANCE * ROUNDING
    assert (right[kept] == 0).sum() > 20  # behind the cap


def test_from_below_a_bump_is_a_dent(tmp_path: Path) -> None:
    _, above, _ = seen(job_of(write_plane(tmp_path), sun([0.3, -1, 0.1])))
    position, below, _ = seen(job_of(write_plane(tmp_path), sun([0.3, 1, 0.1]), eye=(0.3, -4.0, 0.2)))
    assert (above.geometric[:, 1] > 0).all() and (below.geometric[:, 1] < 0).all()
    assert abs(below.shading + expected_normal(position))[off_the_rim(position)].max() < ROUNDING


def test_corners_that_run_the_other_way_show_the_same_from_above(tmp_path: Path) -> None:
    position, hits, _ = seen(job_of(write_plane(tmp_path, tangents=True, back=True), sun([0.8, -0.5, 0.33])))
    assert abs(hits.shading - expected_normal(position))[off_the_rim(position)].max() < ROUNDING


def test_no_light_comes_from_below_the_surface(tmp_path: Path) -> None:
    """A lamp just below the plane: some normals of the cap look at it, and yet it lights nothing."""
    lamp = np.array([3.0, -0.2, 0.1])
    position, hits, light = seen(job_of(write_plane(tmp_path), point(lamp.tolist(), 5.0)))
    towards = ((lamp - position) * hits.shading).sum(axis=1)
    assert (towards > 0).sum() > 50
    assert not light.any()


def test_normals_never_point_below_the_surface(tmp_path: Path) -> None:
    """A scale of 30 leans the cap's normals down to the plane, and a map of negative z below it."""
    texels = np.random.default_rng(1).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    _, hits, _ = seen(job_of(write_plane(tmp_path, texels=texels, scale=30.0), sun([0.8, -0.5, 0.33])))
    shading = hits.shading.astype(float)
    height = (shading * hits.geometric).sum(axis=1)
    assert height.min() > -1e-6
    assert (height < 1e-6).sum() > 100
    assert np.linalg.norm(shading, axis=1) == pytest.approx(np.ones(len(height)), abs=1e-6)


def test_a_map_of_no_bumps_changes_nothing(tmp_path: Path) -> None:
    """The code value 127.5 would be flat; 128 leans by 1 / 255 to both sides."""
    _, hits, _ = seen(job_of(write_plane(tmp_path, texels=[[[128, 128, 255]]]), sun([0.8, -0.5, 0.33])))
    lean = np.array([1, 255, -1]) / np.linalg.norm([1, 255, 1])
    assert hits.shading == pytest.approx(np.broadcast_to(lean, hits.shading.shape), abs=1e-6)
