"""Job files for the real scenes, made from the `camera.json` beside each: a short walk under a sun and under a lamp.

    PYTHONPATH=tests python -m support.real_jobs SCENES FOLDER

writes FOLDER/NAME-sun.toml and FOLDER/NAME-lamp.toml for every scene in SCENES, and with surfaces and indirect light
as `framearray init` writes them FOLDER/NAME-sun-file.toml and FOLDER/NAME-lamp-file.toml.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

KINDS = ("sun", "lamp")
AS_FILE = "-file"  # behind the names of jobs whose surfaces follow the file
EYES, LIGHTS = 6, 4
RESOLUTION = (200, 150)


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """Levels of light that suit a screen, chosen from pictures.

    Attributes:
        sun: irradiance of the directional source, W/m2.
        lamp: intensity of the point source, W/sr.
        sky: radiance of the background.
        height: of a room, scene units, where the bounds of the file are wrong.
    """

    sun: float
    lamp: float
    sky: tuple[float, float, float] = (0.0, 0.0, 0.0)
    height: float = 0.0


SKY = (0.45, 0.6, 0.9)
LEVELS = {
    "cornell_box": Levels(sun=3.0, lamp=1.3),
    "country_kitchen": Levels(sun=30.0, lamp=8.0, sky=SKY),
    "grey_white_room": Levels(sun=24.0, lamp=8.0, sky=SKY),
    "iss_kibo_cabin": Levels(sun=30.0, lamp=6.0),
    "modern_hall": Levels(sun=2.5, lamp=25.0, sky=SKY, height=5.6),
    "modern_hall_obj": Levels(sun=2.5, lamp=25.0, sky=SKY, height=5.6),
    "utah_teapot": Levels(sun=3.0, lamp=1500.0, sky=SKY),
    "vr_gallery": Levels(sun=4.0, lamp=12.0, sky=SKY),
}


def scene_names(scenes: Path) -> list[str]:
    """Folders that hold a scene with its camera."""
    return sorted(file.parent.name for file in scenes.glob("*/camera.json"))


def job_table(scenes: Path, name: str, kind: str) -> dict[str, Any]:
    """The job of a scene as a table: `EYES` eyes by `LIGHTS` lights, or one of them where no more are noted."""
    notes = json.loads((scenes / name / "camera.json").read_text())
    levels = LEVELS[name]
    low, high = notes["bounds"]
    up = 2 if notes["up_axis"] == "+Z" else 1
    walk = notes.get("camera_path", {"keyframes": [notes["camera"]]})["keyframes"]
    frames = EYES if len(walk) > 1 else 1
    return {
        "name": f"{name}-{kind}",
        "scene": {
            "file": str(scenes / name / notes["scene_file"]),
            "up": "z" if up == 2 else "y",
            "background": list(levels.sky),
        },
        "camera": {
            "resolution": list(RESOLUTION),
            "fov": notes["camera"]["fov_y_deg"],
            "frames": frames,
            "keys": [
                {"frame": frame, "eye": key["eye"], "target": key["target"]}
                for frame, key in zip(_spread(len(walk), frames), walk, strict=True)
            ],
        },
        "light": {"sources": [_source(notes["lights"], kind, levels)]},
        "samples": {"hits": 2, "obscurance": 5},
        "reuse": {"n_r": 2, "weights": "balance"},
        "indirect": {"method": "obscurance"},
        "obscurance": {"range": (levels.height or high[up] - low[up]) / 5},
        "output": {"format": "exr", "compression": "zip"},  # black stays black
    }


def _source(lights: dict[str, Any], kind: str, levels: Levels) -> dict[str, Any]:
    """The sources that `camera.json` lists, as keys of one that moves from each to the next."""
    if kind == "sun":
        keys = [{"direction": [-x for x in sun["to_light"]]} for sun in lights["directional"][:LIGHTS]]
        power = {"irradiance": [levels.sun, levels.sun * 0.93, levels.sun * 0.8]}
    else:
        keys = [{"position": lamp["position"]} for lamp in lights["point"][:LIGHTS]]
        power = {"intensity": [levels.lamp, levels.lamp * 0.9, levels.lamp * 0.75]}
    spread = _spread(len(keys), LIGHTS if len(keys) > 1 else 1)
    return {
        "type": "directional" if kind == "sun" else "point",
        "keys": [{"frame": frame} | key | power for frame, key in zip(spread, keys, strict=True)],
    }


def _spread(keys: int, frames: int) -> list[int]:
    """Frames for that many keys, from the first to the last."""
    return [round(k * (frames - 1) / (keys - 1)) for k in range(keys)] if keys > 1 else [0]


def write_jobs(scenes: Path, folder: Path) -> list[Path]:
    """Write all job files; their images go into folders beside them."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name in scene_names(scenes):
        for kind in KINDS:
            table = job_table(scenes, name, kind)
            for more in ("", AS_FILE):
                if more:
                    table["scene"]["surfaces"] = "file"
                    table |= {"name": f"{name}-{kind}{more}", "indirect": {"method": "cells"}}
                table["output"]["directory"] = f"out/{name}-{kind}{more}"
                files.append(folder / f"{name}-{kind}{more}.toml")
                files[-1].write_text(tomli_w.dumps(table))
    return files


if __name__ == "__main__":
    for job_file in write_jobs(Path(sys.argv[1]).resolve(), Path(sys.argv[2])):
        print(job_file)
