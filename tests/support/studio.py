"""A studio's configuration of OpenColorIO, with tables of one and of three dimensions."""

from pathlib import Path

import numpy as np

CONFIG = """ocio_profile_version: 2
search_path: .
roles:
  default: lin
  scene_linear: lin
displays:
  Screen:
    - !<View> {name: Film, colorspace: film}
    - !<View> {name: Sharp, colorspace: sharp}
colorspaces:
  - !<ColorSpace>
    name: lin
    aliases: [lin_rec709]
  - !<ColorSpace>
    name: film
    from_scene_reference: !<GroupTransform>
      children:
        - !<FileTransform> {src: shaper.spi1d, interpolation: linear}
        - !<FileTransform> {src: film.cube, interpolation: linear}
  - !<ColorSpace>
    name: sharp
    from_scene_reference: !<GroupTransform>
      children:
        - !<FileTransform> {src: shaper.spi1d, interpolation: linear}
        - !<FileTransform> {src: film.cube, interpolation: tetrahedral}
"""
LARGEST, SHAPER, NODES = 8.0, 1024, 17  # radiance; entries of the tables


def write_studio(folder: Path) -> Path:
    """Write the configuration and its tables: a logarithm, and a film that mixes channels; "Sharp" in tetrahedra."""
    shaper = np.log2(1 + 50 * np.linspace(0, LARGEST, SHAPER)) / np.log2(1 + 50 * LARGEST)
    head = f"Version 1\nFrom 0.0 {LARGEST}\nLength {SHAPER}\nComponents 1\n{{\n"
    (folder / "shaper.spi1d").write_text(head + "".join(f"{value:.6f}\n" for value in shaper) + "}\n")
    nodes = np.linspace(0, 1, NODES)
    blue, green, red = np.meshgrid(nodes, nodes, nodes, indexing="ij")  # red changes first
    colours = np.stack([red, green, blue], axis=-1).reshape(-1, 3)
    mixed = (colours * [0.9, 0.8, 0.7] + 0.1 * colours.mean(axis=1, keepdims=True)) ** 1.3
    rows = "".join("{:.6f} {:.6f} {:.6f}\n".format(*row) for row in mixed)
    (folder / "film.cube").write_text(f"LUT_3D_SIZE {NODES}\n{rows}")
    config = folder / "studio.ocio"
    config.write_text(CONFIG, encoding="utf-8")
    return config
