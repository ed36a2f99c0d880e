"""Write docs/quality/closed-forms.csv: closed forms, the program's answers, and their differences.

python tests/stat/report.py docs/quality/closed-forms.csv
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import test_ambient as ambient
import test_direct_forms as direct
import test_furnace as furnace
import test_mirror_forms as mirrors
import test_obscurance_forms as obscurance
import test_reuse_bias as reuse
from support import closed_forms as forms
from support.stages import write_scene
from support.tables import publish
from support.ztests import Estimate, chi2_bounds, difference, differing, estimate

from framearray_cli.engine.terms.obscurance import FALLOFFS

HEAD = """# Accuracy

Written by `python tests/stat/report.py docs/quality/closed-forms.csv`, from the same measurements as the tests in
`tests/stat/`. Formulas and their derivations: `tests/support/closed_forms.py`.

Standard errors come from independent pixels or independent seeds. z is the difference in standard errors: of
independent right values, 1 in 20 is beyond 2 and 1 in 370 beyond 3. Rows of one table share random numbers, so their
z are similar.
"""


class Folders:
    """A new empty folder at each call."""

    def __init__(self, root: Path) -> None:
        self._root, self._n = root, 0

    def __call__(self) -> Path:
        self._n += 1
        folder = self._root / str(self._n)
        folder.mkdir()
        return folder


def row(name: str, right: float, found: Estimate) -> str:
    """One line of a table: what, right, found, standard error, z."""
    z = f"{found.z(right):+.1f}" if found.error > 1e-6 * abs(right) else "exact"
    return f"| {name} | {right:.6f} | {found.mean:.6f} | {found.error:.6f} | {z} |"


def table(what: str) -> list[str]:
    """The head of a table."""
    return ["", f"| {what} | right | found | standard error | z |", "|---|---|---|---|---|"]


def obscurance_section(folder: Folders) -> Iterator[str]:
    """W and sky light at one point."""
    yield "\n## Obscurance\n"
    yield "Radiance R (I_A W + S) of one point, with I_A = 1: 1024 independent pixels that see the same spot."
    yield from table("inside a sphere, R = 0.7")
    for falloff in FALLOFFS:
        for k in (0.4, 1.0, 3.0):
            found, right = obscurance.sphere(folder(), falloff, k)
            yield row(f"{falloff}, 2 r / d_max = {k:g}", right, found)
    corner, parasol = (
        write_scene(folder(), obscurance.corner_parts()),
        write_scene(folder(), obscurance.parasol_parts()),
    )
    yield from table("beside a high wall at d_max / 2, R = 0.6")
    for falloff in FALLOFFS:
        found, right = obscurance.beside_wall(corner, folder(), falloff)
        yield row(falloff, right, found)
    yield from table("under a disc of radius 0.8 at height 0.5, R = 0.6, d_max = 1.2")
    for falloff in FALLOFFS:
        found, right = obscurance.under_disc(parasol, folder(), falloff)
        yield row(falloff, right, found)
    found, right = obscurance.under_disc_and_sky(parasol, folder())
    yield row(f'sqrt, `outside = "background"`, a sky of {obscurance.SKY}', right, found)


def direct_section(folder: Folders) -> Iterator[str]:
    """Direct light at each hit."""
    yield "\n## Direct light\n"
    yield "Irradiance at each hit of a view of a floor, a slope and a table that shades the floor."
    yield "\n| source | hits in the light | largest relative error | hits in the shadow | largest irradiance |"
    yield "|---|---|---|---|---|"
    scene = write_scene(folder(), direct.table_parts())
    for kind in ("point", "directional"):
        lit, right, clear, dark = direct.compared(kind, scene, folder())
        clear &= right > 0
        got = lit.irradiance[:, 0]
        error = np.abs(got[clear] / right[clear] - 1).max()
        yield f"| {kind} | {clear.sum()} | {error:.1e} | {dark.sum()} | {got[dark].max():g} |"


def furnace_section(folder: Folders) -> Iterator[str]:
    """Direct plus indirect light inside a sphere."""
    yield "\n## Furnace\n"
    yield f"The furnaces of `jobs/`, {furnace.SEEDS} seeds: mean radiance of all pixels, direct plus indirect;"
    yield "the light in the middle (l = 0) and off it (l = 2)."
    yield from table("R, method")
    for reflectivity in (0.2, 0.5, 0.8):
        lit = furnace.expected_direct(reflectivity).mean(axis=(0, 2, 3))
        for method in ("eye", "fit"):
            found, _ = furnace.measured(reflectivity, method, folder())
            for l in (0, 2):
                right = float(lit[l]) + forms.furnace_indirect(reflectivity)
                yield row(f"{reflectivity}, {method}, l = {l}", right, estimate(found[:, l] + lit[l]))


def ambient_section(folder: Folders) -> Iterator[str]:
    """I_A of a room with a window against a path tracer."""
    yield "\n## Ambient light of a room with a window\n"
    yield "The sun shines into a room of 5 x 3 x 4 m by one window. Mean irradiance against an independent path tracer"
    yield "(`tests/support/pathtracer.py`), whose own error is in the standard error: over the surfaces that light on"
    yield "its way to the eye comes from (`eye`), and by the level of the indirect light of the picture (`fit`)."
    yield from table("method, scene")
    traced = ambient.traced()
    for method in ("eye", "fit"):
        for name, n in (("12 triangles per shell", 1), ("roof and walls 576 times as many", 24)):
            found = ambient.irradiance(ambient.ambient_of(ambient.house_job(folder(), method, n=n)))
            both = difference(found, traced[method])
            shown = Estimate(mean=traced[method].mean + both.mean, error=both.error)
            yield row(f"{method}, {name}", traced[method].mean, shown)
    low, high = chi2_bounds(19)
    yield "\nOver 20 seeds, the squared deviations of I_A in units of the reported standard error add up to"
    for method in ("eye", "fit"):
        first = ambient.house_job(folder(), method, paths=16384)
        spread, _, error = ambient.spread_of([first.model_copy(update={"seed": seed}) for seed in range(20)])
        yield f"{spread:.1f} (`{method}`, error {error / traced[method].mean:.2%}),"
    yield f"where honest errors give {low:.1f} to {high:.1f}."


def mirror_section(folder: Folders) -> Iterator[str]:
    """Mirrors."""
    yield "\n## Mirrors\n"
    yield "Two tinted mirrors face each other; the ray meets them n times before it leaves. Largest relative error of a"
    yield "channel:"
    yield ""
    yield "| n | error |"
    yield "|---|---|"
    facing = write_scene(folder(), mirrors.facing_parts())
    for bounces in mirrors.BOUNCES:
        found, right = mirrors.facing_image(facing, folder(), bounces, bounces)
        yield f"| {bounces} | {np.abs(found / right - 1).max():.1e} |"
    shown, scene = mirrors.shown_and_mirrored(folder())
    worst = differing(shown, mirrors.HALF * scene).max()
    yield "\nWhat a mirror shows against the mirrored scene, 576 values, 48 independent images each: the largest"
    yield f"difference is {worst:.2f} of what chance allows."


def reuse_section(folder: Folders) -> Iterator[str]:
    """The mean of frames with reuse against that without."""
    yield "\n## Reuse\n"
    stage = reuse.write_stage(folder())
    right = reuse.without_reuse(stage, folder())
    yield "The mean of 60 seeds with N_r = 3 against that without reuse, 24 x 16 pixels with silhouettes, a texture,"
    yield "the sky and a mirror: pixels that differ by more than chance allows for all of them together, and the bias:"
    yield f"root mean square over pixels, noise taken off, beside a mean radiance of {right.mean():.2f}."
    yield "\n| weights, hits | pixels that differ | bias |"
    yield "|---|---|---|"
    for weights in ("balance", "average"):
        for hits in (4, 0.5):
            job = reuse.job_of(stage, folder(), hits, reuse.N_R, weights)
            found = reuse.middle_frames(job, range(reuse.SEEDS))
            off = differing(found, right).reshape(-1, 3).max(axis=1)
            noise = found.var(axis=0, ddof=1) / len(found) + right.var(axis=0, ddof=1) / len(right)
            bias = ((found.mean(axis=0) - right.mean(axis=0)) ** 2 - noise).mean()
            yield f"| {weights}, {hits:g} | {(off > 1).sum()} of {len(off)} | {np.sqrt(max(bias, 0.0)):.4f} |"


SECTIONS = (obscurance_section, direct_section, furnace_section, ambient_section, mirror_section, reuse_section)


def main(page: Path) -> None:
    """Measure everything and write the page."""
    with tempfile.TemporaryDirectory() as root:
        folder = Folders(Path(root))
        lines = [line for section in SECTIONS for line in section(folder)]
    publish(page, HEAD + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
