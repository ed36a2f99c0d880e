"""Write docs/quality/closed-forms.csv: closed forms, the program's answers, and their differences.

PYTHONPATH=tests python tests/stat/report.py docs/quality/closed-forms.csv

Formulas and their derivations: `tests/support/closed_forms.py`; the measurements come from the tests in
`tests/stat/`. Standard errors come from independent pixels or seeds. z is the difference in standard errors: of
independent right values, 1 in 20 is beyond 2 and 1 in 370 beyond 3.
"""

import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import test_ambient as ambient
import test_closed_forms as closed
import test_furnace as furnace
import test_obscurance_forms as obscurance
import test_reuse_bias as reuse
from support import closed_forms as forms
from support.stages import write_scene, write_stage
from support.tables import Section, write_csv
from support.ztests import Estimate, difference, differing, estimate

from framearray_cli.engine.terms.obscurance import FALLOFFS

HEAD = ("right", "found", "standard error", "z")
Folder = Callable[[], Path]


def row(name: str, right: float, found: Estimate) -> list[str]:
    """One line of a table: what, right, found, standard error, z."""
    z = f"{found.z(right):+.1f}" if found.error > 1e-6 * abs(right) else "exact"
    return [name, f"{right:.6f}", f"{found.mean:.6f}", f"{found.error:.6f}", z]


def obscurance_sections(folder: Folder) -> Iterator[Section]:
    """Radiance R (I_A W + S) of one point, with I_A = 1: 1024 independent pixels that see the same spot."""
    rows = []
    for falloff in FALLOFFS:
        for k in (0.4, 1.0, 3.0):
            found, right = obscurance.sphere(folder(), falloff, k)
            rows.append(row(f"{falloff}, 2 r / d_max = {k:g}", right, found))
    yield Section("Obscurance", ("inside a sphere, R = 0.7", *HEAD), rows)
    corner, parasol = (
        write_scene(folder(), parts) for parts in (obscurance.corner_parts(), obscurance.parasol_parts())
    )
    for scene, measure, title in (
        (corner, obscurance.beside_wall, "beside a high wall at d_max / 2, R = 0.6"),
        (parasol, obscurance.under_disc, "under a disc of radius 0.8 at height 0.5, R = 0.6, d_max = 1.2"),
    ):
        answers = {falloff: measure(scene, folder(), falloff) for falloff in FALLOFFS}
        rows = [row(falloff, right, found) for falloff, (found, right) in answers.items()]
        if scene is parasol:
            found, right = obscurance.under_disc_and_sky(parasol, folder())
            rows.append(row(f'sqrt, outside = "background", a sky of {obscurance.SKY}', right, found))
        yield Section("Obscurance", (title, *HEAD), rows)


def direct_sections(folder: Folder) -> Iterator[Section]:
    """Irradiance at each hit of a view of a floor, a slope and a table that shades the floor."""
    scene, rows = write_scene(folder(), closed.table_parts()), []
    for kind in ("point", "directional"):
        got, right, clear, dark = closed.compared(kind, scene, folder())
        clear &= right > 0
        error = np.abs(got[clear] / right[clear] - 1).max()
        rows.append([kind, str(clear.sum()), f"{error:.1e}", str(dark.sum()), f"{got[dark].max():g}"])
    head = ("source", "hits in the light", "largest relative error", "hits in the shadow", "largest irradiance")
    yield Section("Direct light", head, rows)


def furnace_sections(folder: Folder) -> Iterator[Section]:
    """Mean radiance of all pixels inside a sphere; the light in the middle (l = 0) and off it (l = 2)."""
    rows = []
    for reflectivity in (0.2, 0.5, 0.8):
        lit = furnace.expected_direct(reflectivity).mean(axis=(0, 2, 3))
        found, _ = furnace.measured(reflectivity, folder())
        for l in (0, 2):
            right = float(lit[l]) + forms.furnace_indirect(reflectivity)
            rows.append(row(f"{reflectivity}, l = {l}", right, estimate(found[:, l] + lit[l])))
    yield Section("Furnace", ("R", *HEAD), rows)


def ambient_sections(folder: Folder) -> Iterator[Section]:
    """Mean irradiance of a sunlit room of 5 x 3 x 4 m against an independent path tracer."""
    traced, rows = ambient.traced()["eye"], []
    for name, n in (("12 triangles per shell", 1), ("roof and walls 576 times as many", 24)):
        found = ambient.irradiance(ambient.ambient_of(ambient.house_job(folder(), n=n)))
        both = difference(found, traced)
        rows.append(row(name, traced.mean, Estimate(mean=traced.mean + both.mean, error=both.error)))
    yield Section("Ambient light of a room with a window", ("scene", *HEAD), rows)


def mirror_sections(folder: Folder) -> Iterator[Section]:
    """Two tinted mirrors face each other; the ray meets them n times before it leaves."""
    facing, rows = write_scene(folder(), closed.facing_parts()), []
    for bounces in closed.BOUNCES:
        found, right = closed.facing_image(facing, folder(), bounces, bounces)
        rows.append([str(bounces), f"{np.abs(found / right - 1).max():.1e}"])
    yield Section("Mirrors: largest relative error of a channel after n bounces", ("n", "error"), rows)


def reuse_sections(folder: Folder) -> Iterator[Section]:
    """The mean of 60 seeds with N_r = 3 against the mean without reuse: pixels that differ by more than chance."""
    stage, rows = write_stage(folder()), []
    right = reuse.without_reuse(stage, folder())
    for weights in ("balance", "average"):
        for hits in (4, 0.5):
            job = reuse.job_of(stage, folder(), hits, reuse.N_R, weights)
            found = reuse.middle_frames(job, range(reuse.SEEDS))
            off = differing(found, right).reshape(-1, 3).max(axis=1)
            noise = found.var(axis=0, ddof=1) / len(found) + right.var(axis=0, ddof=1) / len(right)
            bias = ((found.mean(axis=0) - right.mean(axis=0)) ** 2 - noise).mean()
            rows.append([f"{weights}, {hits:g}", f"{(off > 1).sum()} of {len(off)}", f"{np.sqrt(max(bias, 0)):.4f}"])
    yield Section("Reuse", ("weights, hits", "pixels that differ", "bias"), rows)


SECTIONS = (obscurance_sections, direct_sections, furnace_sections, ambient_sections, mirror_sections, reuse_sections)

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as root:

        def new() -> Path:
            return Path(tempfile.mkdtemp(dir=root))

        write_csv(Path(sys.argv[1]), [section for sections in SECTIONS for section in sections(new)])
