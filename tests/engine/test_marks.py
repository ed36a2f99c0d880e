"""Alpha, positions, texture coordinates and mattes against a slow twin: sums over all hits of a frame."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from support import oracle_lens, tiny
from support import oracle_random as rnd
from support.area_twin import area_weights
from support.oracle import Oracle
from support.tiny import WALK

from framearray_cli.engine.features.aov import AOVS, RANKS
from framearray_cli.engine.images.compose import Composed
from framearray_cli.render.prepare import Prepared
from framearray_cli.scene.files import Material
from framearray_cli.scene.files.model import PaneGlass


# alpha = sum of w over hits on surfaces / sum of w        coverage of a name = sum of its w / sum of w
# position = sum of w P over hits on surfaces / sum of w over these
# uv: those of the hit on a surface with the largest w
@dataclass
class MarksTwin:
    """By pixel: alpha (n,), position (n, 3), uv (n, 2), and shares of objects and materials, (n, names) each."""

    alpha: Any
    position: Any
    uv: Any
    shares: dict[str, Any]


def marks_twin(oracle: Oracle, c: int) -> MarksTwin:
    """The layers of frame c."""
    scene, n = oracle.inputs.scene, oracle.n_pixels
    pixel, weight, surface, position, triangle, place = _weighed(oracle, c)
    total = np.bincount(pixel, weight, n)
    on, of = pixel[surface], weight[surface]
    covered = np.bincount(on, of, n)
    known = np.where(covered > 0, covered, 1)[:, None]
    mean = np.stack([np.bincount(on, of * position[surface, axis], n) for axis in range(3)], axis=1) / known
    uv = np.zeros((n, 2))
    first = np.lexsort((-of, on))  # by pixel; the largest weights first, of equal ones the first
    shown, at = np.unique(on[first], return_index=True)
    chosen = np.flatnonzero(surface)[first[at]]
    uv[shown] = oracle.model.mix(scene.uvs, triangle[chosen], place[chosen])
    shares = {}
    for kind, names, numbers in (
        ("object", scene.object_names, scene.object),
        ("material", scene.material_names, scene.material),
    ):
        table = np.zeros((n, len(names)))
        np.add.at(table, (on, numbers[triangle[surface]]), of)
        shares[kind] = table / total[:, None]
    position = np.where(covered[:, None] > 0, mean + scene.centre, 0)
    return MarksTwin(alpha=covered / total, position=position, uv=uv, shares=shares)


def _weighed(oracle: Oracle, c: int) -> Any:
    """Pixel, weight, whether on a surface, position, triangle and place of all hits that frame c shows."""
    found = []
    for k in oracle.window(c):
        hits = oracle.native(k)
        pixel, weight = oracle.use(c, k, hits)
        used = np.flatnonzero(pixel >= 0)
        found.append((pixel[used], weight[used], hits[used]))
    pixel, weight = (np.concatenate([part[i] for part in found]) for i in range(2))
    several = [part[2] for part in found]
    if oracle.job.reuse.weights == "area":
        parts = [oracle.parts(c, hits, p) for p, _, hits in found]
        column, row = (np.concatenate([part[i] for part in parts]) for i in range(2))
        by_pixel = list(area_weights(column, row, weight, (oracle.width, oracle.height)))
        entry = np.concatenate([near for _, near, _ in by_pixel])
        pixel = np.concatenate([np.full(len(near), p) for p, near, _ in by_pixel])
        weight = np.concatenate([of for _, _, of in by_pixel])
    else:
        entry = np.arange(len(pixel))
    arrays = [
        np.concatenate([getattr(hits, name) for hits in several])[entry]
        for name in ("surface", "position", "triangle", "place")
    ]
    missed = np.flatnonzero(np.bincount(pixel, minlength=oracle.n_pixels) == 0)
    holes = oracle.samples(c, missed, rnd.HOLE)
    more = [holes.surface, holes.position, holes.triangle, holes.place]
    joined = [np.concatenate(pair) for pair in zip(arrays, more, strict=True)]
    return np.concatenate([pixel, missed]), np.concatenate([weight, np.ones(len(missed))]), *joined


# Tolerances are those of `test_oracle.py`: rounding, and a few pixels with a hit on the other side of an edge.
ROUNDING = 128 * 2.0**-24
FLIPS, PARTS_FLIPS = 2, 8
SKY = {"background": [0.3, 0.4, 0.5]}
ALL = {"alpha": True, "position": True, "uv": True, "cryptomatte": True}


def marked(**changes: Any) -> tiny.Job:
    return tiny.job(**({"camera": WALK, "scene": SKY, "output": ALL} | changes))


def shares_of(frame: Composed, kind: str) -> Any:
    """Coverage by name, (n_pixels, n_names)."""
    matte = frame.layers[kind]
    table = np.zeros((frame.alpha.size, len(matte.names) + 1))
    number, coverage = matte.number.reshape(-1, RANKS), matte.coverage.reshape(-1, RANKS)
    np.add.at(table, (np.arange(len(table))[:, None], number), coverage)
    assert (np.diff(matte.coverage, axis=-1) <= 0).all(), "the largest first"
    assert ((matte.number >= 0) == (matte.coverage > 0)).all()
    return table[:, :-1]


CASES: dict[str, tuple[dict[str, Any], int]] = {
    "no reuse": ({"reuse": {"n_r": 0}}, FLIPS),
    "balance": ({"reuse": {"n_r": 2, "weights": "balance"}}, FLIPS),
    "average, a hit in every eighth pixel": (
        {"reuse": {"n_r": 1, "weights": "average"}, "samples": {"hits": 0.125}},
        FLIPS,
    ),
    "area": ({"reuse": {"n_r": 2, "weights": "area"}}, PARTS_FLIPS),
}

CAMERAS: dict[str, dict[str, Any]] = {
    "shifted": {"fov": 75.0, "shift": [0.1, -0.2], "pixel_aspect": 1.3},
    "orthographic": {"type": "orthographic", "height": 5.0},
    "panorama": {"type": "panorama", "resolution": [36, 18]},
}


@pytest.mark.parametrize("name", CASES)
def test_marks_are_those_of_the_twin(name: str) -> None:
    changes, flips = CASES[name]
    compare_marks(tiny.prepared(marked(**changes)), flips)


@pytest.mark.slow  # they compile kernels that few tests need
@pytest.mark.parametrize("weights", ["balance", "area"])
@pytest.mark.parametrize("name", CAMERAS)
def test_marks_of_other_cameras_are_those_of_the_twin(name: str, weights: str) -> None:
    inputs = tiny.prepared(with_camera(name, reuse={"n_r": 2, "weights": weights}))
    compare_marks(inputs, FLIPS if weights == "balance" else PARTS_FLIPS)


def with_camera(name: str, **changes: Any) -> tiny.Job:
    table = tiny.table(scene={**SKY, **changes.pop("scene", {})}, output=ALL, **changes)
    return tiny.Job.model_validate(table | {"camera": {"resolution": [24, 18], **WALK, **CAMERAS[name]}})


def compare_marks(inputs: Prepared, flips: int) -> None:
    rendered = tiny.render_frames(inputs, threads=2)
    frame, twin = rendered.composed[3], marks_twin(Oracle(inputs, rendered.ambient), 3)
    layers, n = frame.layers, frame.alpha.size
    assert twin.alpha.min() == 0 < twin.alpha.mean() < 1 and twin.alpha.max() == pytest.approx(1)
    found = {
        "alpha": (frame.alpha.reshape(n, 1), twin.alpha[:, None]),
        "position": (layers["position"].reshape(n, 3), twin.position),
        "uv": (layers["uv"].reshape(n, 2), twin.uv),
        **{kind: (shares_of(frame, kind), shares) for kind, shares in twin.shares.items()},
    }
    for what, (values, expected) in found.items():
        size = max(abs(expected).max(), 1.0)
        differ = (abs(values - expected) > ROUNDING * size).any(axis=1).sum()
        assert differ <= (2 * flips if what == "uv" else flips), f"{what}: {differ} pixels"
    np.testing.assert_allclose(shares_of(frame, "object").sum(axis=1), frame.alpha.reshape(-1), atol=1e-6)


@pytest.mark.parametrize("weights", ["balance", "area"])
def test_over_the_background_an_image_is_that_without_alpha(weights: str) -> None:
    reuse = {"n_r": 1, "weights": weights}
    plain = tiny.render_frames(tiny.prepared(tiny.job(camera=WALK, scene=SKY, reuse=reuse))).composed[2]
    with_alpha = tiny.render_frames(tiny.prepared(marked(reuse=reuse, output={"alpha": True}))).composed[2]
    assert plain.alpha is None and not with_alpha.layers.keys() & AOVS
    clear = 1 - with_alpha.alpha[..., None]
    over = with_alpha.images + clear * np.array(SKY["background"], np.float32)
    np.testing.assert_allclose(over, plain.images, rtol=0, atol=ROUNDING * plain.images.max())
    escaped = with_alpha.alpha == 0
    assert escaped.any() and not with_alpha.images[:, escaped].any()
    solid = with_alpha.alpha == 1
    assert (with_alpha.images[:, solid] == plain.images[:, solid]).all(), "mirrors still show the background"


def test_marks_change_no_image() -> None:
    reuse = {"n_r": 1, "weights": "area"}
    plain = tiny.render_frames(tiny.prepared(tiny.job(camera=WALK, scene=SKY, reuse=reuse)))
    more = {key: True for key in ALL if key != "alpha"}
    found = tiny.render_frames(tiny.prepared(marked(reuse=reuse, output=more)), threads=2)
    assert (plain.images == found.images).all()


def test_only_the_wanted_layers() -> None:
    for key, layers in (("position", {"position"}), ("uv", {"uv"}), ("cryptomatte", {"object", "material"})):
        frame = tiny.render_frames(tiny.prepared(marked(output={key: True}, reuse={"n_r": 0}))).composed[0]
        assert frame.alpha is None
        assert frame.layers.keys() & AOVS == layers


def glazed() -> Any:
    """A floor; before the sky a pane of glass and a veil that covers 0.4."""
    floor = tiny.quad((-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3))
    pane = tiny.quad((-1, 0, 0), (0, 0, 0), (0, 2, 0), (-1, 2, 0))
    veil = tiny.quad((0.2, 0, 0), (1, 0, 0), (1, 2, 0), (0.2, 2, 0))
    glass = PaneGlass(colour=(0.9, 0.9, 0.9)), PaneGlass(colour=(0.6, 0.6, 0.6), ior=1.0, covers=True)
    return tiny.scene_with(
        (Material(name="Floor"), {"corners": floor, "objects": ("floor",)}),
        (Material(name="Glass", glass=glass[0]), {"corners": pane, "objects": ("pane",)}),
        (Material(name="Veil", glass=glass[1]), {"corners": veil, "objects": ("veil",)}),
        as_file=True,
    )


def test_glass_is_a_matte_of_its_own_and_a_veil_is_one_in_part() -> None:
    """Behind glass nothing has a matte, behind a veil what it does not cover; alpha is what does not pass."""
    job = marked(scene={"surfaces": "file", **SKY}, reuse={"n_r": 0}, output=ALL, samples={"hits": 4})
    frame = tiny.render_frames(tiny.prepared(job, glazed())).composed[2]
    floor, pane, veil = shares_of(frame, "object").T
    assert (pane == 1).sum() > 40, "glass hides floor and sky"
    alpha = frame.alpha.reshape(-1)
    reflected = 2 * 0.04 / 1.04  # face on, of an index of 1.5
    assert alpha[pane == 1].min() == pytest.approx(1 - 0.9 * (1 - reflected), abs=0.005)
    of_veil = veil > 0.399
    assert of_veil.sum() > 20
    np.testing.assert_allclose(veil[of_veil], 0.4, rtol=1e-6)
    seen = of_veil & (floor > 0)
    np.testing.assert_allclose(floor[seen & (alpha == 1)], 0.6, rtol=1e-6)
    before_sky = of_veil & (floor == 0)
    np.testing.assert_allclose(alpha[before_sky], 0.4, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", CAMERAS)
def test_panes_stand_where_other_cameras_see_them(name: str) -> None:
    """A pixel whose corners all look through the pane has its matte, in frames that show hits of others, too."""
    job = with_camera(name, scene={"surfaces": "file"}, reuse={"n_r": 2, "weights": "balance"}, samples={"hits": 4})
    inputs = tiny.prepared(job, glazed())
    for c in (0, 3):
        frame = tiny.render_frames(inputs).composed[c]
        pane = shares_of(frame, "object")[:, 1]
        through = looks_through(inputs, c)
        assert (~through.any(axis=1)).sum() > 100 and through.all(axis=1).sum() >= 4
        np.testing.assert_allclose(pane[through.all(axis=1)], 1, rtol=1e-6)
        assert (pane[~through.any(axis=1)] > 0).sum() <= 4, "only pixels that a corner of the pane pokes into"


def looks_through(inputs: Prepared, c: int) -> Any:
    """Whether the rays through the corners of each pixel of eye c pass the pane of `glazed`, (n_pixels, 4)."""
    width, height = inputs.job.camera.resolution
    y, x = np.mgrid[:height, :width].reshape(2, -1, 1)
    corners = np.stack([x + np.array([0.0, 1, 0, 1]), y + np.array([0.0, 0, 1, 1])], axis=-1).reshape(-1, 2)
    pose, lens = inputs.eyes.world_from_camera[c], inputs.eyes.lenses[c]
    axes = (pose[:3, 3], pose[:3, 0], pose[:3, 1], -pose[:3, 2])
    start, ray = oracle_lens.rays(lens, (width, height), axes, corners)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = -start[:, 2] / ray[:, 2]
        x, y = (start + distance[:, None] * ray).T[:2]
    return ((distance > 0) & (x > -1) & (x < 0) & (y > 0) & (y < 2)).reshape(-1, 4)
