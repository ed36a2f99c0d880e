"""Jobs that are allowed, at the ends of what is allowed: as a person may write them by mistake, or out of curiosity."""

import copy
from collections.abc import Callable, Mapping
from random import Random
from typing import Any, TypeAlias

Table: TypeAlias = dict[str, Any]

FAR = (1e12, -1e12, 1e11, 1e9, 1e6, 1e-6, 1e-12, 1e-300, 5e-324, -0.0, 0.0)
BRIGHT = (1e20, 1e19, 1e6, 1e-20, 1e-45, 5e-324, 0.0, -0.0)
DATES = ("1000-01-01", "3000-12-31", "2026-06-21", "2026-12-21", "2024-02-29", "2026-03-29", "1582-10-10")
EYE, TARGET = [0.2, 1.3, 1.7], [-0.1, 0.9, -1.0]
# Of the room in support/tiny.py: in floor, wall, corner and mirror, on an edge of the box, in it and in the ball.
PLACES = (
    [0.0, 0.0, 0.0], [-2.0, 1.0, 0.0], [-2.0, 0.0, -2.0], [-1.9, 1.0, 0.0], [0.8, 0.9, -0.7], [0.8, 0.45, -0.7],
    [-0.6, 0.5, -0.7], EYE, TARGET, [0.0, 1.2, 0.0],
)  # fmt: skip


def _point(rng: Random) -> list[float]:
    if rng.random() < 0.5:
        return list(rng.choice(PLACES))
    return [rng.choice(FAR) for _ in range(3)]


def _colour(rng: Random) -> Any:
    return rng.choice(([rng.choice(BRIGHT) for _ in range(3)], rng.choice(BRIGHT)))


def _point_source(rng: Random, frame: int = 0) -> Table:
    return {"type": "point", "keys": [{"frame": frame, "position": _point(rng), "intensity": _colour(rng)}]}


def _lens(rng: Random, job: Table) -> None:
    job["camera"]["fov"] = rng.choice((0.001, 0.0010001, 1e-2, 179.9, 179.8999, 170.0, 90.0))


def _camera_anywhere(rng: Random, job: Table) -> None:
    eye, target = _point(rng), _point(rng)
    job["camera"] |= {"frames": 1, "keys": [{"frame": 0, "eye": eye, "target": target}]}


def _along_up(rng: Random, job: Table) -> None:
    """Straight up or down, or nearly."""
    tilt = rng.choice((0.0, 1e-15, 1e-9, 1e-6, 1e-3))
    key: Table = {"frame": 0, "eye": [0.0, 1.2, 0.0], "target": [tilt, rng.choice((0.0, 3.0)), 0.0]}
    if rng.random() < 0.5:
        key["up"] = [0.0, rng.choice((1.0, -1.0, 1e-12, 1e12)), 0.0]
    job["camera"] |= {"frames": 1, "keys": [key]}


def _through_target(rng: Random, job: Table) -> None:
    """The eye reaches its target, or passes close to it."""
    off = rng.choice((0.0, 1e-17, 1e-12, 1e-7, 1e-3))
    a, b = {"frame": 0, "eye": [0, 1, 1], "target": [0, 1, off]}, {"frame": 4, "eye": [0, 1, -1], "target": [0, 1, off]}
    job["camera"] |= {"frames": 5, "keys": [a, b]}


def _same_eyes(rng: Random, job: Table) -> None:
    """A path without length, or nearly."""
    step = rng.choice((0.0, 5e-324, 1e-300, 1e-16, 1e-9))
    keys = [{"frame": k, "eye": [0.2 + step * k, 1.3, 1.7], "target": TARGET} for k in range(4)]
    job["camera"] |= {"frames": rng.choice((4, 6)), "keys": keys}


def _far_apart(rng: Random, job: Table) -> None:
    """Keys that lie as far apart as they may."""
    n = rng.choice((2, 3, 5))
    keys = [{"frame": k, "eye": [rng.choice(FAR) + k for _ in range(3)], "target": TARGET} for k in range(n)]
    job["camera"] |= {"frames": n + 1, "keys": keys}


def _one_row(rng: Random, job: Table) -> None:
    job["camera"]["resolution"] = rng.choice(
        ([1, 1], [1, 2], [2, 1], [1, 3000], [3000, 1], [1, 16384], [16384, 1], [3, 3])
    )


def _huge(rng: Random, job: Table) -> None:
    """Far more pixels, frames or lights than there is memory or time for."""
    job["camera"]["resolution"] = rng.choice(([16384, 16384], [16384, 1], [1920, 1080], [4096, 4096]))
    if rng.random() < 0.5:
        job["light"] = {"frames": rng.choice((1000, 100_000)), "sources": [_point_source(rng)]}
    if rng.random() < 0.3:
        job["reuse"] = {"n_r": rng.choice((0, 64))}


def _many_frames(rng: Random, job: Table) -> None:
    job["camera"]["frames"] = rng.choice((99_999, 100_000, 1000))
    if rng.random() < 0.5:
        job["camera"]["keys"] = [
            {"frame": 0, "eye": EYE, "target": TARGET},
            {"frame": 999, "eye": EYE, "target": [0, 0, 0]},
        ]


def _many_lights(rng: Random, job: Table) -> None:
    n = rng.choice((100, 2000, 20_000, 100_000))
    job["light"] = {"frames": n, "sources": [_point_source(rng)]}


def _many_sources(rng: Random, job: Table) -> None:
    grouped = rng.random() < 0.3
    sources = [{**_point_source(rng), **({"group": f"g{k}"} if grouped else {})} for k in range(rng.choice((50, 300)))]
    job["light"] = {"frames": 1, "sources": sources}
    if grouped:
        job["output"] = {**job.get("output", {}), "format": "exr"}


def _many_hits(rng: Random, job: Table) -> None:
    job["samples"] = {"hits": rng.choice((65000, 1000, 9285, 0.125, 1 / 3)), "obscurance": rng.choice((1, 5, 65535))}


def _reuse_beyond(rng: Random, job: Table) -> None:
    """N_r beyond the frames that there are."""
    job["reuse"] = {"n_r": rng.choice((0, 1, 3, 64)), "weights": rng.choice(("average", "balance", "area"))}


def _light_anywhere(rng: Random, job: Table) -> None:
    """A lamp in a wall, at the eye, in the middle of a thing, or farther than any scene."""
    job["light"] = {"frames": 1, "sources": [_point_source(rng)]}


def _lamp_path(rng: Random, job: Table) -> None:
    """A lamp that moves far, not at all, or through walls."""
    keys = [{"frame": k, "position": _point(rng), "intensity": _colour(rng)} for k in (0, 1, 3)]
    job["light"] = {"frames": rng.choice((4, 5)), "sources": [{"type": "point", "keys": keys}]}


def _sunlight(rng: Random, job: Table) -> None:
    """Parallel light from an odd direction."""
    directions = [[rng.choice((0.0, 1.0, -1.0, 1e12, 1e-12, 1e-6)) for _ in range(3)] for _ in range(3)]
    keys = [{"frame": 2 * k, "direction": d, "irradiance": _colour(rng)} for k, d in enumerate(directions)]
    job["light"] = {"frames": 5, "sources": [{"type": "directional", "keys": keys[: rng.choice((1, 2, 3))]}]}


def _black(rng: Random, job: Table) -> None:
    """Nothing shines."""
    job["light"] = {
        "frames": 2,
        "sources": [{"type": "point", "keys": [{"frame": 0, "position": EYE, "intensity": 0}]}],
    }
    job["scene"]["background"] = rng.choice((0.0, [0.0, 0.0, 0.0]))


def _sky(rng: Random, job: Table) -> None:
    job["scene"]["background"] = _colour(rng)
    job["obscurance"] = {"range": 1.0, "outside": "background"}


def _range(rng: Random, job: Table) -> None:
    job["obscurance"] = {
        "range": rng.choice((5e-324, 1e-300, 1e-45, 1e-12, 1e-3, 1e6, 1e12)),
        "falloff": rng.choice(("sqrt", "linear", "cbrt", "exponential", "constant")),
        "tau": rng.choice((1e-3, 3.0, 100.0)),
        "outside": rng.choice(("average", "background")),
    }


def _ambient(rng: Random, job: Table) -> None:
    fixed = {"intensity": _colour(rng)}
    job["ambient"] = rng.choice(
        (fixed, {"method": rng.choice(("eye", "fit")), "paths": rng.choice((1, 2, 3, 1000, 2**24))})
    )


def _materials(rng: Random, job: Table) -> None:
    names = ("Plain", "Mirror", "Floor", "Smooth", "Nobody", "")
    both = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), ([1, 0, 0], [0, 1, 1]), (5e-324, 5e-324), (0.5, 0.5), (1.0, 1.0))
    chosen = [rng.choice(both) for _ in names]
    tables = {name: {"reflectivity": r, "specular": s} for name, (r, s) in zip(names, chosen, strict=True)}
    job["scene"]["materials"] = {name: tables[name] for name in rng.sample(names, rng.choice((1, 3)))}


def _mirrors(rng: Random, job: Table) -> None:
    job["specular"] = {"depth": rng.choice((0, 1, 64)), "hits": rng.choice((1, 2, 65000))}


def _output(rng: Random, job: Table) -> None:
    compressions = ("none", "rle", "zip", "zips", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab")
    job["output"] = {
        **job.get("output", {}),
        "format": rng.choice(("exr", "png", "tif", "jpg")),
        "compression": rng.choice(compressions),
        "half": rng.choice(("auto", "always", "never")),
        "fps": rng.choice((0.01, 23.976, 1000.0)),
        "exposure": rng.choice((-64, 64, 0.0)),
        "quality": rng.choice((1, 100)),
        "layers": rng.random() < 0.5,
    }


def _folder(rng: Random, job: Table) -> None:
    """A folder that is none, is somebody else's, or is the scene's."""
    names = (
        ".",
        "..",
        "/",
        "",
        "job.toml",
        "job.toml/x",
        "/dev/null",
        "/dev/null/x",
        "../..",
        "../../../../../../..",
        "~",
        "$HOME",
    )
    more = ("x" * 300, "a/" * 1500, "a\nb", "out/../out", "/proc/self", "/sys/x", "\u202eout", "{camera}", "//")
    job["output"] = {**job.get("output", {}), "directory": rng.choice(names + more)}


def _name(rng: Random, job: Table) -> None:
    job["name"] = rng.choice(
        ("a" * 100, "a" * 101, "0", "a.b", "CON", "a/b", "..", ".hidden", "-x", "{camera}", "manifest", "a\n")
    )


def _memory(rng: Random, job: Table) -> None:
    """Less memory than anything takes, or more than there is."""
    job["render"] = {
        "memory": rng.choice((1, "1 B", "1 MiB", "100 MiB", "1 GiB", "900 TiB", 2**62)),
        "threads": rng.choice((1, 2, 64, 1024)),
    }


def _wanted_error(rng: Random, job: Table) -> None:
    job["samples"] = {"error": rng.choice((5e-324, 1e-9, 1e-3, 0.1, 10.0)), "most_hits": rng.choice((1, 2, 8, 1024))}
    job["output"] = {**job.get("output", {}), "format": "exr"}


def _sun(rng: Random, job: Table) -> None:
    """The sun at the ends of the Earth, of the year and of the day."""
    job["light"] = {
        "frames": rng.choice((1, 2, 5)),
        "sources": [
            {
                "type": "sun",
                "latitude": rng.choice((-90.0, 90.0, 0.0, 89.9999999, 66.56)),
                "longitude": rng.choice((-180.0, 180.0, 0.0, 12.5)),
                "date": rng.choice(DATES),
                "timezone": rng.choice(("UTC", -14, 14, 0.25, "Europe/Rome", "Pacific/Kiritimati", "Etc/GMT+12")),
                "start": rng.choice(("00:00", "02:30", "12:00")),
                "stop": rng.choice(("12:01", "23:59:59", "23:59")),
                "irradiance": _colour(rng),
                **({"north": [rng.choice((0.0, 1.0, 1e12, 1e-12)) for _ in range(3)]} if rng.random() < 0.5 else {}),
            }
        ],
    }  # fmt: skip


EXTREMES: Mapping[str, Callable[[Random, Table], None]] = {
    "lens": _lens,
    "camera anywhere": _camera_anywhere,
    "look along up": _along_up,
    "eye meets target": _through_target,
    "path without length": _same_eyes,
    "keys far apart": _far_apart,
    "one pixel or row": _one_row,
    "too many pixels": _huge,
    "many frames": _many_frames,
    "many light positions": _many_lights,
    "many sources": _many_sources,
    "many hits": _many_hits,
    "reuse": _reuse_beyond,
    "lamp anywhere": _light_anywhere,
    "path of a lamp": _lamp_path,
    "direction of light": _sunlight,
    "no light": _black,
    "background": _sky,
    "obscurance": _range,
    "ambient light": _ambient,
    "materials": _materials,
    "mirrors": _mirrors,
    "formats": _output,
    "output folder": _folder,
    "name": _name,
    "memory": _memory,
    "wanted error": _wanted_error,
    "the sun": _sun,
}


def extreme(rng: Random, tables: Mapping[str, Table]) -> tuple[str, Table]:
    """One of the small jobs with one or two of these changes; named by the first."""
    job = copy.deepcopy(rng.choice(list(tables.values())))
    names = rng.sample(list(EXTREMES), rng.choice((1, 1, 2)))
    for name in names:
        EXTREMES[name](rng, job)
    return names[0], job
