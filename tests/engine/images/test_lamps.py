"""Visible lamps, and weights by area."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.area_twin import PARTS, area_weights

from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.records import HitsByPixel, StoredLight, empty_records, light_columns
from framearray_cli.engine.hits.outer import sort_by_pixel
from framearray_cli.engine.hits.row import BY_SAMPLE, HALF
from framearray_cli.engine.images.area import WHOLE, AreaWeights, WeighedHits
from framearray_cli.engine.images.lamps import SAMPLES
from framearray_cli.engine.images.sourcelists import OF, ORDER, SHARES, START, HitSource, SourceList
from framearray_cli.engine.kernels.kernel import integer_at, kernel, real_at
from framearray_cli.job.job import Job
from framearray_cli.render.frames import visible_lamps
from framearray_cli.render.plan import frame_setup
from framearray_cli.render.prepare import open_embree
from framearray_cli.scene.files import Material
from framearray_cli.scene.files.model import PaneGlass
from framearray_cli.scene.scene import Scene

# A closed form gives the area that a shape covers in the picture. Each of the pixels at its edge has the mean of
# SAMPLES rays that hit or miss, a variance of at most 1 / 4 / SAMPLES.
SIZE = (64, 48)
FOCAL = 24 / np.tan(np.radians(20))
MIRROR = Material(name="Mirror", reflectivity=(0.0, 0.0, 0.0), specular=(0.5, 0.25, 1.0))
DOWN = {"direction": [0, 0, 1], "power": np.pi}  # towards the eye, of intensity 1 along the normal


def wall(z: float, material: Material | None = None, side: float = 9.0) -> Scene:
    return tiny.scene_of(tiny.quad((-side, -side, z), (side, -side, z), (side, side, z), (-side, side, z)), material)


def drawn(
    source: dict[str, Any], scene: Scene, *beside: dict[str, Any], dtype: Any = np.float32, lens: Any = None
) -> tuple[Any, int]:
    """What the eye at the origin sees of a lamp, looking along -z: an image per light position; and what is beyond.

    Args:
        beside: sources that eyes do not see.
    """
    keys = [{"frame": 0, "eye": [0, 0, 0], "target": [0, 0, -1]}]
    camera = {"resolution": list(SIZE), "keys": keys, **(lens or {"fov": 40.0})}
    light = {"sources": [source | {"visible": True}, *beside]}
    job = Job.model_validate(tiny.table() | {"camera": camera, "light": light})
    inputs = tiny.prepared(job, scene)
    width, height = job.camera.resolution
    with open_embree(inputs) as embree:
        setup = frame_setup(inputs, embree, np.zeros(3, np.float32))  # no other light, whose kernels take a minute
        images = np.zeros((inputs.n_lights, height, width, 3), dtype)
        with TracePool(setup, 2) as pool:
            lamps = visible_lamps(inputs, setup, 0, range(inputs.n_lights), pool)
            assert lamps is not None
            return images, lamps.draw(images, setup.rows)


def lamp(kind: str, **key: Any) -> dict[str, Any]:
    return {"type": kind, "keys": [{"frame": 0} | key]}


def check_area(image: Any, radiance: float, expected: float, edge: float) -> None:
    """Compare the covered area with a closed form, pixels, to 3 standard errors at most.

    Args:
        edge: length of the outline, pixels; it crosses at most 4 / pi pixels per pixel of length, on average.
    """
    covered = image / radiance
    assert covered.max() <= 1 + 1e-5
    assert abs(covered.sum() - expected) < 3 * np.sqrt(4 / np.pi * edge / 4 / SAMPLES)


def test_a_sphere_covers_its_outline_with_its_radiance() -> None:
    image = drawn(lamp("point", position=[0, 0, -2], radius=0.4, intensity=[1, 2, 3]), wall(-3))[0][0]
    radius = FOCAL * np.tan(np.arcsin(0.2))
    for channel, intensity in enumerate((1, 2, 3)):
        check_area(image[..., channel], intensity / (np.pi * 0.4**2), np.pi * radius**2, 2 * np.pi * radius)
    assert image[0, 0].max() == 0


def test_a_sun_is_seen_where_nothing_hides_it() -> None:
    sun = lamp("directional", direction=[0, 0, 1], irradiance=2, angle=10)
    radius, radiance = FOCAL * np.tan(np.radians(5)), 2 / (np.pi * np.sin(np.radians(5)) ** 2)
    check_area(drawn(sun, wall(3))[0][0, ..., 0], radiance, np.pi * radius**2, 2 * np.pi * radius)
    assert drawn(sun, wall(-3))[0].max() == 0


@pytest.mark.parametrize("flush", [False, True])
def test_panels_cover_their_projection(flush: bool) -> None:
    """A panel may lie on a wall, and is then seen."""
    scene = wall(-2 if flush else -3)
    image = drawn(lamp("rect", position=[0.1, 0, -2], width=0.5, height=0.3, **DOWN), scene)[0][0, ..., 1]
    scale = FOCAL / 2
    check_area(image, 1 / 0.15, 0.15 * scale**2, 1.6 * scale)
    disc = drawn(lamp("disc", position=[0.1, 0, -2], radius=0.25, **DOWN), scene)[0][0, ..., 1]
    check_area(disc, 1 / (np.pi * 0.25**2), np.pi * (0.25 * scale) ** 2, 0.5 * np.pi * scale)


def test_a_panel_is_seen_from_its_bright_sides() -> None:
    away = {"position": [0, 0, -2], "width": 0.5, "height": 0.3, "direction": [0, 0, -1], "power": np.pi}
    assert drawn(lamp("rect", **away), wall(-3))[0].max() == 0
    both = drawn(lamp("rect", **away) | {"two_sided": True}, wall(-3))[0]
    assert both.max() == pytest.approx(0.5 / 0.15)


def test_a_wall_hides_a_lamp_and_a_lamp_stays_where_it_is() -> None:
    """Behind a wall nothing is drawn; along its path the lamp moves to the right, and stops shining."""
    keys = [{"frame": k, "position": [0.3 * k, 0, -2], "intensity": 2 - k, "radius": 0.1} for k in (0, 1, 2)]
    assert drawn({"type": "point", "keys": keys}, wall(-1))[0].max() == 0
    images, _ = drawn({"type": "point", "keys": keys}, wall(-3))
    columns = [(image[..., 0].sum(axis=0) @ np.arange(64)) / image[..., 0].sum() for image in images[:2]]
    np.testing.assert_allclose(columns, [31.5, 31.5 + FOCAL * 0.3 / 2], atol=0.2)
    assert images[0].sum() == pytest.approx(2 * images[1].sum(), rel=0.03) and images[2].max() == 0


@pytest.mark.parametrize(("z", "passes"), [(-1.0, True), (-2.5, False)])
def test_glass_before_a_lamp_dims_it(z: float, passes: bool) -> None:
    """A pane behind the lamp does not."""
    colour, side = (0.5, 0.25, 0.8), 4.0
    pane = tiny.quad((-side, -side, z), (side, -side, z), (side, side, z), (-side, side, z))
    back = tiny.quad((-9, -9, -3), (9, -9, -3), (9, 9, -3), (-9, 9, -3))
    glass = Material(name="Pane", glass=PaneGlass(colour=colour, ior=1.0, covers=True))
    scene = tiny.scene_with((Material(name="Back"), back), (glass, pane))
    source = lamp("point", position=[0, 0, -2], radius=0.4, intensity=[1, 1, 1])
    behind, bare = drawn(source, scene)[0][0], drawn(source, wall(-3))[0][0]
    np.testing.assert_allclose(behind, bare * (colour if passes else 1.0), rtol=1e-5)


def test_a_mirror_shows_the_lamp_behind_the_eye_in_its_tint() -> None:
    image = drawn(lamp("point", position=[0, 0, 1], radius=0.5, intensity=1), wall(-2, MIRROR))[0][0]
    radius, radiance = FOCAL * np.tan(np.arcsin(0.5 / 5)), 1 / (np.pi * 0.5**2)
    for channel, tint in enumerate(MIRROR.specular):
        check_area(image[..., channel], tint * radiance, np.pi * radius**2, 2 * np.pi * radius)


def test_a_spot_is_as_bright_as_its_cone_towards_the_eye() -> None:
    """Half way between the cones, in cosines, a spot has a quarter of its intensity."""
    angle = np.degrees(np.arccos((np.cos(np.radians(10)) + np.cos(np.radians(30))) / 2))
    way = [np.sin(np.radians(angle)), 0, np.cos(np.radians(angle))]
    spot = lamp("spot", position=[0, 0, -2], direction=way, inner=10, outer=30, radius=0.2, intensity=1)
    middle = drawn(spot, wall(-3))[0][0, 23:25, 31:33]  # a degree on each side, which cancels
    assert middle.mean() == pytest.approx(0.25 / (np.pi * 0.2**2), rel=0.01)


def test_halves_are_cut_and_counted() -> None:
    bright = lamp("point", position=[0, 0, -2], radius=0.05, intensity=1000)
    images, beyond = drawn(bright, wall(-3), dtype=np.float16)
    assert images.max() == 65504 and beyond == (images == 65504).sum() > 0
    assert drawn(bright, wall(-3))[1] == 0


@pytest.mark.slow  # other cameras have kernels of their own
def test_parallel_rays_see_a_lamp_in_its_own_size_at_any_distance() -> None:
    """A sphere beside the axis, a panel before a wall, and a mirror behind which the sphere is seen once more."""
    lens = {"type": "orthographic", "height": 2.4}
    pixels = SIZE[1] / 2.4
    sphere = lamp("point", position=[0.7, 0.3, -2], radius=0.4, intensity=1)
    for scene in (wall(-3), tiny.scene_of(tiny.box((9, 9, 9), (10, 10, 10)))):  # the sky behind it
        image = drawn(sphere, scene, lens=lens)[0][0, ..., 0]
        radius = 0.4 * pixels
        check_area(image, 1 / (np.pi * 0.4**2), np.pi * radius**2, 2 * np.pi * radius)
        rows, columns = np.nonzero(image)
        assert columns.mean() + 0.5 == pytest.approx(SIZE[0] / 2 + 0.7 * pixels, abs=0.2)
        assert rows.mean() + 0.5 == pytest.approx(SIZE[1] / 2 - 0.3 * pixels, abs=0.2)
    panel = lamp("rect", position=[0, 0, -2], width=1.0, height=0.5, **DOWN)
    check_area(drawn(panel, wall(-3), lens=lens)[0][0, ..., 0], 1 / 0.5, 0.5 * pixels**2, 3 * pixels)
    behind = lamp("point", position=[0.2, 0, 1], radius=0.3, intensity=1)
    shown = drawn(behind, wall(-3, MIRROR), lens=lens)[0][0] / (1 / (np.pi * 0.3**2)) / [0.5, 0.25, 1.0]
    for channel in range(3):
        check_area(shown[..., channel], 1.0, np.pi * (0.3 * pixels) ** 2, 2 * np.pi * 0.3 * pixels)
    sun = {"type": "directional", "keys": [{"frame": 0, "direction": [0.01, 0, 1], "irradiance": 1.0, "angle": 2.0}]}
    sky = drawn(sun, tiny.scene_of(tiny.box((-0.5, -9, -4), (9, 9, -3))), lens=lens)[0][0, ..., 0]
    assert sky[:, :21].min() > 0 and sky[:, 23:].max() == 0, "the sun fills all of the sky that parallel rays see"


@pytest.mark.slow  # other cameras have kernels of their own
@pytest.mark.parametrize("position", [(0, 0, -2), (1.9, 0.3, 0.2), (0.1, -0.2, 2.0), (0.3, 1.9, -0.2)])
def test_a_panorama_sees_lamps_on_all_sides(position: tuple[float, float, float]) -> None:
    lens = {"type": "panorama", "resolution": [96, 48]}
    image = drawn(lamp("point", position=position, radius=0.4, intensity=1), wall(-3), lens=lens)[0][0, ..., 0]
    # the cone of the sphere, in the picture
    n = 16
    x, y = (np.arange(n * 96) + 0.5) / n / 96, (np.arange(n * 48) + 0.5) / n / 48
    around, lift = 2 * np.pi * (x[None] - 0.5), np.pi * (0.5 - y[:, None])
    ways = np.stack(
        np.broadcast_arrays(np.cos(lift) * np.sin(around), np.sin(lift), -np.cos(lift) * np.cos(around)), -1
    )
    distance = np.linalg.norm(position)
    inside = ways @ position / distance > np.sqrt(1 - (0.4 / distance) ** 2)
    covered = inside.reshape(48, n, 96, n).mean(axis=(1, 3))
    edge = np.pi / 4 * ((covered > 0) & (covered < 1)).sum()
    check_area(image, 1 / (np.pi * 0.4**2), covered.sum(), edge)
    assert np.abs(image * np.pi * 0.4**2 - covered).max() < 6 * np.sqrt(0.25 / SAMPLES)


AREA_SIZE = WIDTH, HEIGHT = 7, 5
N_PIXELS = WIDTH * HEIGHT


@kernel
def read_hits(listed: Any, pixel: int, of: Any, order: Any, share: Any) -> int:
    """Copy the hits of a pixel, their sources and their weights; return their number."""
    first, end = integer_at(listed[START], pixel), integer_at(listed[START], pixel + 1)
    for entry in range(first, end):
        of[entry - first], order[entry - first] = integer_at(listed[OF], entry), integer_at(listed[ORDER], entry)
        share[entry - first] = real_at(listed[SHARES], entry)
    return int(end - first)


class Hits:
    """Random hits of some eyes, that all fall into a frame."""

    def __init__(self, counts: Any = (90, 60, 1, 0, 150), ratio: float = 1.4, seed: int = 1, top: int = HEIGHT) -> None:
        rng = np.random.default_rng(seed)
        self.column = [rng.integers(0, WIDTH * PARTS, n) for n in counts]
        self.row = [rng.integers(0, top * PARTS, n) for n in counts]
        self.balance = [rng.uniform(1, ratio, n).astype(np.float32) / 14 for n in counts]
        self.half = [rng.integers(0, 2, n) for n in counts]

    def listed(self) -> SourceList:
        sources = []
        for column, row, balance, half in zip(self.column, self.row, self.balance, self.half, strict=True):
            n = len(column)
            pixel = (row // PARTS * WIDTH + column // PARTS).astype(np.int32)
            start, order = np.empty(N_PIXELS + 1, np.int32), np.empty(n, np.int32)
            sort_by_pixel(pixel, 0, N_PIXELS, start, order)
            records = empty_records(light_columns(StoredLight(1, 1, 1)), n)
            records.row[:, HALF] = half
            subpixel = (row % PARTS * PARTS + column % PARTS).astype(np.uint8)
            sources.append(
                HitSource(
                    HitsByPixel(start=start, order=order), {**records.arrays, "weight": balance, "subpixel": subpixel}
                )
            )
        return SourceList(sources)

    def twin(self, chosen: Any = None) -> dict[int, dict[tuple[int, int], float]]:
        """The weights of hits (source, number) by pixel; `chosen`: of these hits only, by source."""
        kept = [
            np.flatnonzero(np.ones(len(c), bool) if chosen is None else chosen[s]) for s, c in enumerate(self.column)
        ]
        names = [(s, int(hit)) for s, hits in enumerate(kept) for hit in hits]
        column, row, balance = (
            np.concatenate([values[s][hits] for s, hits in enumerate(kept)])
            for values in (self.column, self.row, self.balance)
        )
        weighed = area_weights(column, row, balance.astype(np.float64), AREA_SIZE)
        return {
            pixel: {names[i]: float(w) for i, w in zip(near, weight, strict=True)} for pixel, near, weight in weighed
        }


def found_in(weighed: WeighedHits, pixels: range) -> dict[int, dict[tuple[int, int], float]]:
    """The weights of hits (source, number) by pixel."""
    of, order, share = np.empty(999, np.int32), np.empty(999, np.int32), np.empty(999, np.float32)
    found: dict[int, dict[tuple[int, int], float]] = {}
    for pixel in pixels:
        n = read_hits(weighed.addresses[0], pixel, of, order, share)
        if n:
            hits = zip(of[:n], order[:n], share[:n], strict=True)
            found[pixel] = {(int(s) - 1, int(hit)): float(w) for s, hit, w in hits}
            assert len(found[pixel]) == n
    return found


def assert_same(found: Any, expected: Any) -> None:
    """Up to rounding; a hit at the limit may be dropped, which changes the others by its share."""
    assert found.keys() == expected.keys()
    for pixel, weights in expected.items():
        either = found[pixel].keys() ^ weights.keys()
        assert all(found[pixel].get(hit, 0) + weights.get(hit, 0) < 1 / 16 / len(weights) for hit in either)
        assert len(either) <= 1
        for hit in found[pixel].keys() & weights.keys():
            assert found[pixel][hit] == pytest.approx(weights[hit], rel=1e-5 if not either else 0.05)


@pytest.mark.parametrize("ratio", [1.0, 2.4, 2.7, 6.0])
@pytest.mark.parametrize("task", [N_PIXELS, 9, 1])
def test_weights_are_those_of_the_twin(ratio: float, task: int) -> None:
    """Whatever the pixels of a task are."""
    hits, area, found = Hits(ratio=ratio), AreaWeights(AREA_SIZE), {}
    listed = hits.listed()
    for first in range(0, N_PIXELS, task):
        n = min(task, N_PIXELS - first)
        with area.weighed(listed, first, n) as weighed:
            found |= found_in(weighed, range(first, first + n))
    assert_same(found, hits.twin())
    assert len(found) == N_PIXELS


@pytest.mark.parametrize("half", [0, 1])
def test_of_a_half_only_its_hits_count(half: int) -> None:
    """The other hits neither weigh anything nor stand in the way."""
    hits, halves = Hits(), np.array([1, BY_SAMPLE, 0, 0, BY_SAMPLE], np.int32)
    of_half = [hits.half[s] == half if its == BY_SAMPLE else np.full(len(hits.half[s]), its == half)
               for s, its in enumerate(halves)]  # fmt: skip
    with AreaWeights(AREA_SIZE).weighed(hits.listed(), 0, N_PIXELS, halves, half) as weighed:
        found = found_in(weighed, range(N_PIXELS))
    assert_same(found, hits.twin(of_half))


def test_numbers_of_hits_and_squares_of_weights() -> None:
    hits = Hits(top=HEIGHT - 1)
    with AreaWeights(AREA_SIZE).weighed(hits.listed(), 0, N_PIXELS) as weighed:
        found, own, squares = found_in(weighed, range(N_PIXELS)), weighed.own.copy(), weighed.squares.copy()
    pixels = np.concatenate([r // PARTS * WIDTH + c // PARTS for r, c in zip(hits.row, hits.column, strict=True)])
    np.testing.assert_array_equal(own, np.bincount(pixels, minlength=N_PIXELS))
    assert (own[-WIDTH:] == 0).all() and set(found) == set(np.flatnonzero(own))
    expected = [sum(w * w for w in found.get(pixel, {}).values()) for pixel in range(N_PIXELS)]
    np.testing.assert_allclose(squares, expected, rtol=1e-5)


def test_a_hit_weighs_as_much_as_the_part_of_the_pixel_that_it_stands_for() -> None:
    """Nine hits at one place left of the middle, one as far to the right of it; a cell is 0.12 pixels wide."""
    hits = Hits(counts=(10,))
    hits.column[0], hits.row[0] = 2 * PARTS + np.array([4] * 9 + [11]), np.full(10, 2 * PARTS + 8)
    hits.balance[0][:] = 1
    pixel = 2 * WIDTH + 2
    with AreaWeights(AREA_SIZE).weighed(hits.listed(), pixel, 1) as weighed:
        assert found_in(weighed, range(pixel, pixel + 1))[pixel][0, 9] == pytest.approx(0.5, abs=0.06)


def test_where_balance_weights_differ_they_stay() -> None:
    hits = Hits(counts=(10,))
    hits.column[0], hits.row[0] = np.arange(32, 42), np.arange(32, 42)
    hits.balance[0][:] = [1] * 9 + [3]
    pixel = 2 * WIDTH + 2
    with AreaWeights(AREA_SIZE).weighed(hits.listed(), pixel, 1) as weighed:
        found = found_in(weighed, range(pixel, pixel + 1))[pixel]
    assert list(found.values()) == pytest.approx([1 / 12] * 9 + [3 / 12])


def test_a_hit_that_fills_a_hole_is_alone_in_its_pixel() -> None:
    """It has no place, and counts in no other pixel."""
    hits = Hits(counts=(150, 1))
    hole = 2 * WIDTH + 3
    column, row = hits.column[0], hits.row[0]
    inside = row // PARTS * WIDTH + column // PARTS == hole
    hits.column[0], hits.row[0], hits.balance[0] = column[~inside], row[~inside], hits.balance[0][~inside]
    hits.half[0] = hits.half[0][~inside]
    hits.column[1][:], hits.row[1][:] = 3 * PARTS, 2 * PARTS
    others, filling = hits.listed().sources
    listed = SourceList([others, HitSource(filling.by_pixel, {"row": filling.columns["row"]})])
    with AreaWeights(AREA_SIZE).weighed(listed, 0, N_PIXELS) as weighed:
        found = found_in(weighed, range(N_PIXELS))
    assert found[hole] == {(1, 0): 1.0}
    assert not any((1, 0) in weights for pixel, weights in found.items() if pixel != hole)


def test_room_is_used_again_and_by_several_tasks() -> None:
    hits, area = Hits(), AreaWeights(AREA_SIZE)
    listed = hits.listed()
    with area.weighed(listed, 0, 9) as one, area.weighed(listed, 9, 9) as other:
        found = found_in(one, range(9)) | found_in(other, range(9, 18))
    with area.weighed(listed, 0, 18) as whole:
        assert found_in(whole, range(18)) == found
    with pytest.raises(MemoryError), area.weighed(listed, 0, 18):
        raise MemoryError
    with area.weighed(listed, 0, 18, half=WHOLE) as again:
        assert found_in(again, range(18)) == found
