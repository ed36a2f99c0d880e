"""Make the scenes: `python -m jobs.generators [NAME [FILE]]`.

Without arguments it makes all four, and the sky; with a name one of them, in jobs/scenes/ or as FILE. Needs numpy and
Pillow, the sky OpenImageIO.
"""

import argparse
from importlib import import_module
from pathlib import Path

from .common.glb import write

NAMES = ("cabin", "furnace", "kitchen", "sky", "stairs")
SCENES = Path(__file__).resolve().parents[1] / "scenes"


def make(name: str, file: Path) -> None:
    """Build a scene, or the sky, and write it."""
    module = import_module(f".{name}", __package__)
    if name == "sky":
        module.write(file)
    else:
        write(module.build(), file)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m jobs.generators", description="Make the scenes of jobs/.")
    parser.add_argument("name", nargs="?", choices=NAMES, help="default: all")
    parser.add_argument("file", nargs="?", type=Path, help="default: jobs/scenes/NAME.glb, sky.exr")
    args = parser.parse_args()
    for name in [args.name] if args.name else NAMES:
        make(name, args.file or SCENES / (f"{name}.exr" if name == "sky" else f"{name}.glb"))


if __name__ == "__main__":
    main()
