"""The slow twin with light from cells: which cell a ray reads, and all bounces between cells, as plain as possible."""

from typing import Any

import numpy as np

from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.render.prepare import Prepared
from support import oracle_random as rnd
from support.kept import short as rounded
from support.oracle import Oracle, reflect
from support.oracle_scene import Model, Points, dot

LEVELS, COARSEST, SHARE = 7, 4, 0.15  # levels, the coarsest that rays read, edge of cells per length of a ray
BITS = 19  # of a key per axis
CONTINUED = 16  # the dimension of the random numbers of where ray 0 ends
MIRRORED = 1 << 17  # the dimension of what ray 0 chooses at mirrors
STEPS = 4  # rays that follow one that was too short, at most
DIMMEST = 1e-20  # in place of the mean light of a dark cell, where light of short rays is found
NEAR = 1.0  # rays shorter than this many edges of the finest cells go on
GUARD_END = 1 - 1e-3  # a ray to a guard ends this share of its length before it


def side_of(normal: Any) -> Any:
    """Axis and sign of the largest component of each normal, 0 to 5."""
    axis = np.abs(normal).argmax(axis=1)
    return 2 * axis + (np.take_along_axis(normal, axis[:, None], 1)[:, 0] <= 0)


class CellMap:
    """Cells by level, side and place; cell 0 is that of all surfaces together."""

    def __init__(self, cells: Any, model: Model) -> None:
        self.grid, self.other, self.guard, self.model = cells.grid, cells.other, cells.guard.astype(np.float64), model
        self.number = {}
        for key, cell in cells.slots.reshape(-1, 2):
            if key >= 0:
                high, place = int(key) >> 3 * BITS, [int(key) >> BITS * axis & 2**BITS - 1 for axis in (2, 1, 0)]
                self.number[high >> 3, high & 7, *place] = int(cell)

    def keys(self, level: int, position: Any, side: Any) -> list[Any]:
        """The cell of a level that holds each point."""
        edge = self.grid.edge * 2**level
        place = np.floor(position.astype(np.float64) / edge + self.grid.jitter[level]).astype(int) % 2**BITS
        return [(level, int(s), *map(int, row)) for s, row in zip(side, place, strict=True)]

    def numbers(self, level: int, position: Any, side: Any) -> Any:
        """The cells of a level, 0 where there is none."""
        return np.array([self.number.get(key, 0) for key in self.keys(level, position, side)])

    def level(self, length: Any) -> Any:
        """The level of the cell that rays of some lengths read."""
        edges = np.maximum(SHARE * length / self.grid.edge, 1e-9)
        return np.clip(np.round(np.log2(edges)), 0, COARSEST).astype(int)

    def sees(self, position: Any, normal: Any, cell: Any) -> Any:
        """Whether points see the guards of cells, from as high above their surfaces."""
        guard = self.guard[cell]
        start = position + guard[:, 3:4] * normal
        return ~self.model.blocked(start, guard[:, :3] - start, GUARD_END)

    def find(self, position: Any, normal: Any, length: Any) -> Any:
        """The cells that rays read where they end."""
        found = self.first(position, normal, length)
        doubtful = np.flatnonzero(self.other[found] >= 0)
        aside = doubtful[~self.sees(position[doubtful], normal[doubtful], found[doubtful])]
        found[aside] = self.other[found[aside]]
        return found

    def first(self, position: Any, normal: Any, length: Any) -> Any:
        """The first slots of these cells."""
        side, wanted, found = side_of(normal), self.level(length), np.zeros(len(length), int)
        for level in range(LEVELS):
            here = self.numbers(level, position, side)
            found = np.where((wanted <= level) & (found == 0), here, found)
        return found

    def short(self, length: Any) -> Any:
        """Whether rays are too short for the finest cells."""
        return length < NEAR * self.grid.edge


def weights_of(members: list[Any], level: Any, wanted: Any) -> list[Any]:
    """The weight of each sample in the mean of each cell: halved by each level between the cell's and the sample's.

    Args:
        level: of each cell; `wanted`: of each sample, log2 of the edge that a ray such as found it would read.
    """
    found = []
    for k, rows in enumerate(members):
        off = np.clip(wanted[rows], 0, COARSEST) - min(level[k], COARSEST)
        weight = 0.5 ** abs(off)
        found.append(weight / weight.sum() if len(rows) else weight)
    return found


def solve(members: list[Any], weights: list[Any], direct: Any, target: Any, reflectivity: Any, sweeps: int) -> Any:
    """E of all cells, (n_cells, 3, n_lights), by plain sums in float64.

    Args:
        members: the samples of each cell, and their `weights` there; cell 0 is the mean of all samples.
        direct: (n_samples, channels, n_lights) E_direct; `target`: the cell that each sample's link meets, or -1.
    """

    def means(values: Any) -> Any:
        found = np.stack([np.tensordot(weight, values[rows], 1) for rows, weight in zip(members, weights, strict=True)])
        found[0] = values.mean(axis=0)
        return found

    own = means(np.broadcast_to(direct, (len(direct), 3, direct.shape[2])))
    met = target >= 0
    r = np.minimum(reflectivity[met].sum(axis=0) / len(met), 0.99)[:, None]
    light, last = own, own
    for _ in range(sweeps):
        brought = np.where(met[:, None, None], reflectivity[:, :, None] * light[target], 0.0)
        last, light = light, own + means(brought)
    return light + (light - last) * r / (1 - r)


class CellOracle(Oracle):
    """Renders single images of a job whose indirect light comes from cells."""

    def __init__(self, inputs: Prepared, ambient: Ambient, cells: Any) -> None:
        """Take the cells from the program."""
        super().__init__(inputs, ambient)
        self.cells, self.places, self.kept, self.mirrored = cells, CellMap(cells, self.model), 0, 0

    def radiance(self, hits: Points, l: int) -> Any:
        """(n, 3): R (E[l] + E_indirect[l]) / pi, or the background where a ray left the scene."""
        light, same = self.gathered(hits, l)
        seen = hits.reflectivity * ((self.irradiance(hits, l) + light) / np.pi + same)
        return np.where(hits.surface[:, None], seen, self.background)

    def landed(self, hits: Points, owner: Any, ray: Any, dirs: Any, last: bool = False) -> tuple[Points, Any, Any, Any]:
        """Where rays end: points with their keys, R there, the cells that they read, -1 for none, and the short ones.

        Of those the first slots; none is short among the last of a path.
        """
        start, keys = hits.start[owner], [hits.key[i] for i in owner]
        words = [rnd.bits([key], MIRRORED + int(r))[0] for key, r in zip(keys, ray, strict=True)]
        start, dirs, way, behind = self.passed(start, dirs, words)
        triangle, uv, distance = self.model.first(start, dirs, np.inf)
        distance = distance + way
        next_keys = [rnd.bits([key], CONTINUED + int(r))[0] for key, r in zip(keys, ray, strict=True)]
        points = self.model.look(start, dirs, next_keys, hits.pixel[owner])
        met = np.flatnonzero(triangle >= 0)
        where = points.position[met], points.geometric[met], distance[met]
        cell, short, r = np.full(len(dirs), -1), np.zeros(len(dirs), bool), np.zeros((len(dirs), 3))
        if len(met):
            cell[met], short[met] = self.places.find(*where), self.places.short(distance[met]) & (not last)
            cell[short] = self.places.first(*where)[short[met]]
        r[met] = self.model.total(triangle[met], uv[met])
        r[triangle < 0] = 1
        r = np.where(np.isnan(behind), r, behind)
        return points, r, cell, short

    def passed(self, start: Any, dirs: Any, words: Any) -> tuple[Any, Any, Any, Any]:
        """Rays behind the mirrors that they meet: start, direction, length of the way so far, and what mirrors and the
        surface at its end reflect; NaN for rays that meet no mirror first."""
        scene = self.inputs.scene
        depth = self.job.specular.depth if scene.has_mirrors else 0
        triangle, _, _ = self.model.first(start, dirs, np.inf)
        mirror = (triangle >= 0) & (scene.specular[scene.material[triangle]] > 0).any(axis=1)
        rows = np.flatnonzero(mirror) if depth else np.zeros(0, int)
        start, dirs, way, weight = start.copy(), dirs.copy(), np.zeros(len(dirs)), np.full((len(dirs), 3), np.nan)
        weight[rows], words = 1.0, list(words)
        self.mirrored += len(rows)
        for bounce in range(depth + 1):
            if not len(rows):
                break
            _, _, distance = self.model.first(start[rows], dirs[rows], np.inf)
            at = self.model.look(start[rows], dirs[rows], [0] * len(rows), rows)
            part, other = at.specular.max(axis=1), at.reflectivity.max(axis=1)
            chance = part / np.where(at.surface & (part > 0), part + other, 1)
            a = rnd.points([words[i] for i in rows], np.zeros(len(rows)), rnd.sequence())[:, 0]
            goes_on = (a < chance) & (bounce < depth)
            with np.errstate(divide="ignore", invalid="ignore"):
                stays = at.reflectivity / (1 - chance)[:, None]
                goes = at.specular / chance[:, None]
            stays = at.reflectivity + at.specular if bounce == depth else stays
            weight[rows] *= np.where(goes_on[:, None], goes, np.where(at.surface[:, None], stays, 1.0))
            away = reflect(at.incoming, at.shading)
            into = dot(away, at.geometric) <= 0
            away[into] = reflect(at.incoming, at.geometric)[into]
            way[rows[goes_on]] += distance[goes_on]
            start[rows[goes_on]], dirs[rows[goes_on]] = at.start[goes_on], away[goes_on]
            rows = rows[goes_on]
            for i in rows:
                words[i] = rnd.mix([words[i]])[0]
        return start, dirs, way, weight

    def followed(self, points: Points, l: int) -> tuple[Any, Any, Any]:
        """From points that short rays met, on to a long one: direct light of all points in units of the lights' colour,
        the product of all R, and the cell."""
        n = len(points)
        light, through, end = self.units_of_light(points, l), np.ones((n, 3)), np.full(n, -1)
        root = np.arange(n)
        for step in range(STEPS if n else 0):
            words = rnd.bits(points.key, rnd.HEMISPHERE)
            dirs = rnd.hemisphere(points.shading, rnd.points(words, np.zeros(len(points)), rnd.lattice(1)))
            dirs -= 2 * np.minimum(dot(dirs, points.geometric), 0)[:, None] * points.geometric
            own = np.arange(len(points))
            points, r, cell, short = self.landed(points, own, np.zeros(len(own), int), dirs, step == STEPS - 1)
            through[root] *= r
            light[root[short]] += through[root[short]] * self.units_of_light(points[short], l)
            end[root[~short]] = cell[~short]
            points, root = points[short], root[short]
            if not len(root):
                break
        return light, through, end

    def units_of_light(self, points: Points, l: int) -> Any:
        """E_direct, (n, 3), over the colour of the light; one number, three times, where cells have one channel."""
        unit = self.inputs.light_arrays.colour[l]
        at = [0, 1, 2] if self.cells.light.shape[1] == 3 else [unit.argmax()] * 3
        direct = self.irradiance(points, l)[:, at]
        return np.divide(direct, unit[at], out=0 * direct, where=unit[at] > 0)

    def gathered(self, hits: Points, l: int) -> tuple[Any, Any]:
        """E_indirect[l] by sources, and the radiance that is the same under every light, (n, 3) each."""
        n, cells, unit_of_light = self.job.samples.obscurance, self.cells, self.inputs.light_arrays.colour[l]
        v, channels = cells.weights.astype(np.float64), cells.light.shape[1]
        points, r, k, short = self.landed(hits, *self.gather_rays(hits))
        self.kept += short.sum()
        tint, missed = cells.tint.astype(np.float64), k < 0
        lit = np.where(tint[k, 3:4] > 0, tint[k, :3] * tint[k, 3:4], DIMMEST * short[:, None])
        hue = np.where(missed[:, None], 0.0, r * lit)
        through, end, own = np.ones((len(k), 3)), k.copy(), np.zeros((len(k), 3))
        own[short], through[short], end[short] = self.followed(points[short], l)
        same = r * through * np.where((end < 0)[:, None], self.background, tint[end, 4:7])
        read = np.where((end < 0)[:, None], 0.0, r * through * tint[end, :3])
        if channels == 3:
            g = own * r + np.where((end < 0)[:, None], 0.0, r * through) * cells.light[end, :, l]
        else:
            g = ((own * r) @ v + (read @ v) * cells.light[end, 0, l])[:, None]
        hue = hue.reshape(-1, n, 3).mean(axis=1)
        mean = (hue @ v)[:, None]
        hue = 1.0 if channels == 3 else np.divide(hue, mean, out=np.zeros_like(hue), where=mean > 0)
        light = hue * rounded(g.reshape(-1, n, g.shape[1]).mean(axis=1)) * unit_of_light
        return light, same.reshape(-1, n, 3).mean(axis=1)
