"""Points exactly on borders of pixels and of the image, behind an eye or in its plane; very many hits in one pixel."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.kept import keep

from framearray_cli.base.arrays import with_room
from framearray_cli.engine.frames.records import HitsByPixel
from framearray_cli.engine.hits.row import INDIRECT, LIT, REFLECTIVITY, WEIGHT
from framearray_cli.engine.images.accumulate import accumulate
from framearray_cli.engine.images.band import HITS_AT_ONCE, empty_band
from framearray_cli.engine.images.sourcelists import HitSource, SourceList
from framearray_cli.engine.inputs.cameras import OUTSIDE, Cameras, project_to_pixel
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.scene.files import Material


@kernel
def _project(cams: Cameras, vectors: Any, pixels: Any) -> None:
    for i in range(vectors.shape[0]):
        pixels[i], _ = project_to_pixel(cams, 0, vectors[i, 0], vectors[i, 1], vectors[i, 2])


def eye(width: int = 8, height: int = 4, focal: float = 4.0) -> Cameras:
    """An eye along -z whose numbers are all powers of two: what follows is exact in float32."""
    axes = np.eye(3, dtype=np.float32)
    return Cameras(
        position=np.zeros((1, 3), np.float32), right=axes[:1], up=axes[1:2], forward=-axes[2:],
        focal=focal, width=width, height=height, near=0.0,
    )  # fmt: skip


def pixels(cams: Cameras, vectors: Any) -> Any:
    found = np.empty(len(vectors), np.int32)
    _project(cams, np.asarray(vectors, np.float32), found)
    return found


def at(column: Any, row: Any, depth: float) -> Any:
    """The vectors that project onto image positions: exact for positions in eighths and depths in powers of two."""
    column, row = np.broadcast_arrays(np.asarray(column, np.float64), np.asarray(row, np.float64))
    return np.stack([(column - 4) * depth / 4, (2 - row) * depth / 4, np.full(column.shape, -depth)], axis=-1)


@pytest.mark.parametrize("depth", [2.0**-20, 0.5, 1.0, 2.0**20])
def test_a_point_on_a_border_belongs_to_the_pixel_right_of_it_or_below(depth: float) -> None:
    """Pixels are half-open boxes: each point of the image falls into exactly one, at any depth."""
    column, row = (grid.ravel() for grid in np.meshgrid(np.arange(0, 8, 0.125), np.arange(0, 4, 0.125)))
    found = pixels(eye(), at(column, row, depth))
    np.testing.assert_array_equal(found, np.floor(row) * 8 + np.floor(column))
    assert (np.bincount(found, minlength=32) == 64).all()


def test_the_image_has_its_left_and_upper_edges_and_not_the_others() -> None:
    """So images side by side would share no point and miss none."""
    assert pixels(eye(), at([0, 0, 7.875], [0, 3.875, 0], 1.0)).tolist() == [0, 24, 7]
    assert (pixels(eye(), at([8, 8, 0, 4, 8], [0, 2, 4, 4, 4], 1.0)) == OUTSIDE).all()
    beyond = [np.nextafter(np.float32(v), np.float32(s)) for v, s in ((-1, -2), (1, 0))]
    assert pixels(eye(), [[beyond[0], 0, -1], [beyond[1], 0, -1]]).tolist() == [OUTSIDE, 23]


def test_points_behind_the_eye_in_its_plane_and_at_it_are_outside() -> None:
    """A point behind the eye would project too, mirrored: its depth decides."""
    inside = at([4.5, 1.25, 7.5], [2.5, 1.5, 3.5], 1.0)
    assert (pixels(eye(), inside) != OUTSIDE).all()
    assert (pixels(eye(), -inside) == OUTSIDE).all()
    assert (pixels(eye(), [[0, 0, 0], [1, 0, 0], [0, -1, 0], [-1, 1, 0], [1e30, 0, 0]]) == OUTSIDE).all()


WHITE = Material(name="White", reflectivity=(0.5, 0.5, 0.5))
SUN = {"type": "directional", "keys": [{"frame": 0, "direction": [0, 0, -1], "irradiance": [2.0, 2.0, 2.0]}]}
RIGHT = 0.5 / np.pi * 2.0


def wall_job(first: Any, last: Any, **changes: Any) -> Any:
    """Two eyes before a wall that a sun lights evenly: every pixel of every picture is R / pi E."""
    keys = [{"frame": i, "eye": eye[0], "target": eye[1]} for i, eye in enumerate((first, last))]
    changes = {"samples": {"hits": 2, "obscurance": 1}, "reuse": {"n_r": 1}} | changes
    camera = {"frames": 2, "keys": keys, "fov": 90.0, "resolution": [17, 17]} | changes.pop("camera", {})
    light = {"frames": 1, "sources": [SUN]}
    return tiny.job(camera=camera, light=light, output={"layers": True}, ambient=tiny.DARK, **changes)


def rounding(hits: float, weights: str = "average") -> float:
    """The most that float32 may lose of a sum of equal hits: one rounding per hit among `HITS_AT_ONCE`, one for each of
    those sums, and some dozen roundings of each hit. Weights that are not whole are summed hit by hit."""
    return (hits / HITS_AT_ONCE + HITS_AT_ONCE + 24 + (hits if weights == "balance" else 0)) * 2.0**-24


def wall(half: float) -> Any:
    return tiny.scene_of(tiny.quad((-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)), WHITE)


@pytest.mark.parametrize("weights", ["average", "balance"])
@pytest.mark.parametrize(
    ("first", "last"),
    [
        (([0, 0, 4], [0, 0, 0]), ([0.470588235294117647, 0, 4], [0.470588235294117647, 0, 0])),
        (([0, 0, 4], [0, 0, 0]), ([8, 0, 4], [8, 0, 0])),
        (([0, 0, 4], [0, 0, 0]), ([0, 0, 4], [0, 0, 8])),
        (([0, 0, 4], [0, 0, 0]), ([0, 0, -4], [0, 0, -8])),
        (([0, 0, 4], [0, 0, 0]), ([0, 0, 1e-3], [0, 0, 0])),
    ],
    ids=["a pixel aside", "an image aside", "turned round", "behind the wall", "close to the wall"],
)
def test_whole_renders_of_points_at_borders_and_behind(first: Any, last: Any, weights: str) -> None:
    """Eyes that move by exactly one pixel or image, that turn round, that pass the wall: only what is seen counts."""
    job = wall_job(first, last, reuse={"n_r": 1, "weights": weights})
    one, other = tiny.render_frames(tiny.prepared(job, wall(60.0))).composed
    turned = last[1][2] > last[0][2] or last[0][2] < 0
    assert one.bad == other.bad == 0
    np.testing.assert_allclose(one.images, RIGHT, rtol=rounding(17 * 17 * 4, weights))
    np.testing.assert_allclose(other.images, 0.0 if turned else RIGHT, rtol=rounding(17 * 17 * 4, weights))


def million_hits() -> tuple[float, Any]:
    """A near eye's 1.1 million hits, all in the middle pixel of an eye a hundred times as far: its hits, its value."""
    job = wall_job(
        ([0, 0, 1], [0, 0, 0]), ([0, 0, 100], [0, 0, 0]),
        samples={"hits": 3700, "obscurance": 1}, reuse={"n_r": 1, "weights": "average"},
    )  # fmt: skip
    far = tiny.render_frames(tiny.prepared(job, wall(150.0))).composed[1]
    return float(far.layers["samples"][8, 8]), far.images[0, 8, 8].astype(np.float64)


def test_a_million_hits_of_one_eye_in_one_pixel_of_another() -> None:
    """Each brings R / pi E: the hardest sum there is in float32, because all roundings go the same way."""
    hits, value = million_hits()
    assert hits > 1_000_000
    assert rounding(hits) < 0.002
    np.testing.assert_allclose(value, RIGHT, rtol=rounding(hits))


def mean_of_many(n: int) -> tuple[Any, Any]:
    """Direct and indirect light of a pixel with n hits of uneven brightness: as the program sums it, and in float64."""
    rng = np.random.default_rng(8)
    row, irradiance = with_room((n, LANES), np.float32, fill=0), with_room((n, 1, 3), np.float32)
    irradiance[:] = rng.exponential(size=(n, 1, 3))
    row[:, WEIGHT], row[:, LIT] = 1, 1
    row[:, REFLECTIVITY : REFLECTIVITY + 3] = rng.random((n, 3))
    row[:, INDIRECT : INDIRECT + 3] = rng.random((n, 3))
    by_pixel = HitsByPixel(start=np.array([0, n], np.int32), order=np.arange(n, dtype=np.int32))
    band = empty_band(1, 3)
    address, _store = keep(row, irradiance)
    parts = SourceList([HitSource(by_pixel, {"row": row, "light": address})])
    accumulate(band, 0, 1, parts.addresses, 1, 3, True)
    light = row[:, REFLECTIVITY : REFLECTIVITY + 3, None].astype(np.float64) / np.pi * irradiance
    exact = [light.mean(axis=0).ravel(), row[:, INDIRECT : INDIRECT + 3].mean(axis=0, dtype=np.float64)]
    found = [band.direct[0, :, :3].ravel(), band.sums[0, INDIRECT : INDIRECT + 3]]
    return np.concatenate(found).astype(np.float64), np.concatenate(exact)


@pytest.mark.parametrize("n", [1, 64, 65, 10_000, 1_000_000])
def test_a_million_hits_in_one_pixel(n: int) -> None:
    """Sums in float32 lose one rounding per hit; even over a million of them that stays below a ten-thousandth."""
    found, exact = mean_of_many(n)
    assert np.abs(found / exact - 1).max() < 1e-4
