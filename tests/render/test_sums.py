"""Sums of stored images against renders of all their sources at once."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.handmade import write_sky

from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.mixtures import check_mixture, constant_parts
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.errors import OutputError
from framearray_cli.render.render import render
from framearray_cli.tools.mixing import mixture_of

DOME = {"type": "dome", "positions": 4, "irradiance": [2.0, 1.5, 1.0]}
WEIGHTS = np.array([[0.5, 0.25, 2.0], [0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [3.0, 0.5, 0.125]])


def rendered(scene: Path, folder: Path, sources: Any, background: Any = 0.0, half: str = "never") -> Pictures:
    """Render a job of one camera position, and open its pictures."""
    tables = {"scene": {"background": background}, "light": {"frames": None, "sources": sources}}
    render(tiny.job_of_file(scene, folder, output={"compression": "none", "half": half}, **tables))
    return Pictures(read_manifest(folder))


@pytest.fixture(scope="module")
def dome(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Pictures:
    return rendered(scene, tmp_path_factory.mktemp("dome") / "out", [DOME])


def at_once(pictures: Pictures, weights: Any) -> list[dict[str, Any]]:
    """Return all positions of the dome as sources that shine together, each times its weight."""
    found = []
    for light, weight in zip(pictures.manifest.lights, weights, strict=True):
        (source,) = light.sources
        lit = (np.array(source["irradiance"]) * weight).tolist()
        key = {"frame": 0, "direction": list(source["direction"]), "irradiance": lit}
        found.append({"type": "directional", "keys": [key]})
    return found


def test_a_sum_equals_a_render_of_all_sources_at_once(scene: Path, tmp_path: Path, dome: Pictures) -> None:
    mixture = mixture_of(WEIGHTS)
    check_mixture(dome.manifest, mixture)
    whole = rendered(scene, tmp_path / "out", at_once(dome, WEIGHTS)).picture(0, (0,))
    made = dome.picture(0, (mixture,))
    np.testing.assert_allclose(made, whole, rtol=2e-5, atol=2e-6)
    other = dome.picture(0, (mixture_of(WEIGHTS[::-1]),))
    assert np.abs(other - whole).max() > 0.01, "the comparison can fail"


def test_a_sum_of_halves_is_within_one_step(scene: Path, tmp_path: Path, dome: Pictures) -> None:
    halves = rendered(scene, tmp_path / "out", [DOME], half="auto")
    mixture = mixture_of(WEIGHTS)
    np.testing.assert_allclose(halves.picture(0, (mixture,)), dome.picture(0, (mixture,)), rtol=2**-11, atol=1e-6)


def test_groups_add_what_stays_only_once(scene: Path, tmp_path: Path, dome: Pictures) -> None:
    sky, sun = [0.3, 0.4, 0.5], tiny.SUN | {"group": "sun"}
    groups = rendered(scene, tmp_path / "groups", [DOME | {"group": "dome"}, sun], background=sky)
    assert constant_parts(groups.manifest) == []
    mixture = mixture_of(WEIGHTS)
    check_mixture(groups.manifest, mixture)
    whole = rendered(scene, tmp_path / "whole", [*at_once(dome, WEIGHTS), tiny.SUN], background=sky).picture(0, (0,))
    np.testing.assert_allclose(groups.picture(0, (mixture,)), whole, rtol=2e-5, atol=2e-6)


STRENGTHS = np.array([[1.0, 0.5, 0.25], [0.0, 2.0, 1.0], [0.5, 0.0, 0.0], [2.0, 1.0, 0.5]])  # along the axis


def new_source(kind: str, strengths: Any, sky: Path) -> dict[str, Any]:
    """A lit surface, a map or a lamp with a size, in its place, of one strength per key."""
    panel = {"position": [0.2, 2.3, 0.0], "direction": [0.0, -1.0, 0.2], "width": 0.8, "height": 0.4}
    tables: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
        "mesh": ({"material": "Smooth"}, {}),
        "environment": ({"file": str(sky)}, {}),
        "rect": ({"visible": True}, panel),
        "point": ({"visible": True}, {"position": [-0.5, 1.8, 0.6], "radius": 0.1}),
    }
    of_source, of_key = tables[kind]
    strength = "intensity" if kind in ("environment", "point") else "radiance"
    keys = [{"frame": k, strength: list(map(float, value)), **of_key} for k, value in enumerate(strengths)]
    return {"type": kind, **of_source, "keys": keys}


@pytest.mark.parametrize(
    "kind", ["environment", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("mesh", "rect", "point"))]
)
def test_a_sum_knows_sources_with_a_size_and_those_that_eyes_see(
    scene: Path, tmp_path: Path, dome: Pictures, kind: str
) -> None:
    """They keep their place, so the render of all at once draws the same points of them."""
    sky = write_sky(tmp_path / "sky.exr", top=2.0)  # no texel is a sun, which would be a source behind all others
    mixture = mixture_of(WEIGHTS)
    for stays in (False, True):
        strengths = STRENGTHS[:1] if stays else STRENGTHS
        total = strengths[0] if stays else (WEIGHTS * STRENGTHS).sum(axis=0)
        sources = [new_source(kind, strengths, sky) | {"group": "new"}, DOME | {"group": "dome"}]
        groups = rendered(scene, tmp_path / f"groups{stays}", sources, background=[0.1, 0.2, 0.3])
        check_mixture(groups.manifest, mixture)
        at = [new_source(kind, [total], sky), *at_once(dome, WEIGHTS)]
        whole = rendered(scene, tmp_path / f"whole{stays}", at, background=[0.1, 0.2, 0.3]).picture(0, (0,))
        np.testing.assert_allclose(groups.picture(0, (mixture,)), whole, rtol=5e-5, atol=5e-6)


def dark(n: int) -> list[dict[str, Any]]:
    """Return sources that never shine."""
    return [{"type": "directional", "keys": [{"frame": 0, "direction": [0, -1, 0], "irradiance": 0.0}]}] * n


@pytest.mark.slow  # kernels of a map with suns and a direction, which no other test needs
@pytest.mark.parametrize("n_dark", [3, 0], ids=["as many sources", "fewer sources"])
def test_a_sum_knows_maps_with_suns(scene: Path, tmp_path: Path, dome: Pictures, n_dark: int) -> None:
    """The suns of a map are a source behind all others, whose number says which points of them hits draw.

    With as many sources as in the render of all at once, hits draw the same points, and pictures are equal. With fewer,
    they differ by the noise of the suns' light, whose mean over all pixels is 0.
    """
    sky = write_sky(tmp_path / "sky.exr", top=200.0)
    mixture, total = mixture_of(WEIGHTS), (WEIGHTS * STRENGTHS).sum(axis=0)
    sources = [new_source("environment", STRENGTHS, sky) | {"group": "new"}, DOME | {"group": "dome"}]
    groups = rendered(scene, tmp_path / "groups", sources + [source | {"group": "dark"} for source in dark(n_dark)])
    check_mixture(groups.manifest, mixture)
    at = [new_source("environment", [total], sky), *at_once(dome, WEIGHTS)]
    made, whole = groups.picture(0, (mixture,)), rendered(scene, tmp_path / "whole", at).picture(0, (0,))
    if n_dark:
        np.testing.assert_allclose(made, whole, rtol=5e-5, atol=5e-6)
        return
    difference = (made - whole).mean(axis=-1).ravel()
    assert np.abs(difference).max() > 1e-3 * whole.mean(), "else both should be compared as above"
    assert abs(difference.mean()) < 4 * difference.std() / np.sqrt(difference.size)


def test_what_stays_is_found_in_the_manifest(scene: Path, tmp_path: Path, dome: Pictures) -> None:
    mixed = rendered(scene, tmp_path / "out", [DOME, tiny.SUN], background=[0.0, 0.1, 0.0]).manifest
    assert constant_parts(mixed) == ["the background", "source 1, which stays"]
    with pytest.raises(OutputError) as caught:
        check_mixture(mixed, mixture_of(WEIGHTS))
    assert str(caught.value) == (
        f"{mixed.directory}: every image holds the background and source 1, which stays, which a sum may contain only "
        'once; expected weights of sum 1, got 4.5; render again with groups, which keep it apart (group = "..." in '
        "[[light.sources]])"
    )
    check_mixture(mixed, mixture_of(np.full((4, 3), 0.25)))
    assert constant_parts(dome.manifest) == []
