"""How the ambient light I_A depends on the number of walks, and whether its reported error is honest."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.core.results import Table
from bench.speed.speed import log
from framearray_cli.base.arrays import Float64
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.render.prepare import Prepared, open_embree, plan_work

from .scenes import FURNACE, FURNACE_LEVEL, Probe, under_one, with_ambient

METHODS = ("eye", "fit")
PATHS = (256, 1024, 4096, 16384, 65536)
SEEDS, QUICK_SEEDS = 16, 4
MANY = {"eye": 1 << 20, "fit": 1 << 20}  # for the limit of the estimates
MANY_SEED = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Runs:
    """Independent estimates of the mean of I_A's channels, (n,), and the standard errors that they report, (n,)."""

    found: Float64
    errors: Float64

    @property
    def spread(self) -> float:
        """Standard deviation of the estimates."""
        return float(self.found.std(ddof=1))

    @property
    def reported(self) -> float:
        """Root mean square of the reported errors."""
        return float(np.sqrt((self.errors**2).mean()))

    @property
    def squares(self) -> float:
        """Squared deviations from their mean in reported variances: chi-squared of n - 1 where these are right."""
        return float(((self.found - self.found.mean()) ** 2).sum() / self.reported**2)

    def table(self) -> Table:
        """As a plain table."""
        return {
            "mean": float(self.found.mean()),
            "spread": self.spread,
            "reported": self.reported,
            "squares": self.squares,
            "freedom": len(self.found) - 1,
        }


def measure(probe: Probe, quick: bool) -> Table:
    """Method -> rows of numbers of walks and their results; and the limit of the estimates."""
    prepared = under_one(probe.prepared(), probe.l)
    found: Table = {"words": probe.words, "light": probe.l, "methods": {}}
    if probe.name == FURNACE:
        found["right"] = FURNACE_LEVEL
    with open_embree(prepared) as embree:
        for method in METHODS:
            _estimate(prepared, embree, method, 256, MANY_SEED)  # compiles
            rows = [
                {"paths": paths, **_runs(prepared, embree, method, paths, QUICK_SEEDS if quick else SEEDS)}
                for paths in (PATHS[:3] if quick else PATHS)
            ]
            many = MANY[method] >> (6 if quick else 0)
            mean, error = _estimate(prepared, embree, method, many, MANY_SEED)
            found["methods"][method] = {"rows": rows, "many": {"paths": many, "mean": mean, "error": error}}
            log(f"{probe.name}: {method}: I_A = {mean:.5g} +- {error:.2g}")
    return found


def _runs(prepared: Prepared, embree: EmbreeScene, method: str, paths: int, seeds: int) -> Table:
    started = time.process_time()
    pairs = np.array([_estimate(prepared, embree, method, paths, _seed(method, paths, i)) for i in range(seeds)])
    spent = time.process_time() - started
    return {**Runs(found=pairs[:, 0], errors=pairs[:, 1]).table(), "cpu_s": spent / seeds}


def _seed(method: str, paths: int, i: int) -> int:
    """Another one for every run: no two rows share random numbers."""
    return 1 + i + 100 * (METHODS.index(method) + len(METHODS) * paths)


def _estimate(prepared: Prepared, embree: EmbreeScene, method: str, paths: int, seed: int) -> tuple[float, float]:
    """Mean of the channels of I_A of the one light position, and its reported standard error; radiance."""
    ambient: Any = plan_work(with_ambient(prepared, method, paths, seed), embree)[1]
    mean = float(ambient.intensity[0].mean())
    return mean, mean * float(ambient.standard_error[0])
