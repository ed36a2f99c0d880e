"""A frame array on disk: its pictures, layers, cameras and lights."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.mixtures import check_linear, check_mixture
from framearray_cli.array.pictures import Relight
from framearray_cli.base.extras import extra
from framearray_cli.base.units import counted
from framearray_cli.tools.mixing import mixture_of

from .relighting import Environment, Factor, Lighting, Weights, environment_mixture, no_group, read_factor, read_weights
from .stored import StoredArray

if TYPE_CHECKING:
    import xarray

    from .sheets import Sheet


def open_array(folder: str | os.PathLike[str]) -> "FrameArray":
    """Open a frame array: read its manifest, and no image.

    An array that is still being rendered opens as well; images that are not there yet raise an error when they are
    read.

    Args:
        folder: that `render` wrote, or its manifest.

    Raises:
        OutputError: it holds no manifest, or one that is broken.
    """
    manifest = read_manifest(Path(folder))
    return FrameArray(manifest=manifest, lighting=Lighting(n=manifest.n_lights))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class FrameArray(StoredArray):
    """Every picture of a camera on a path under every position of a light on a path.

    Pictures are read on request, also by several threads at once; an array can be pickled.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(FrameArray, manifest=self.manifest, lighting=self.lighting), ()

    def __repr__(self) -> str:
        width, height = self.resolution
        counts = [str(n) if k == 0 else f"{n} of {axis}" for k, (axis, n) in enumerate(self.axes.items())]
        counts[0] += " of light" if len(counts) == 1 else f" of {next(iter(self.axes))}"
        changed = "" if self.lighting.changes_nothing else ", relit"
        size = " x ".join([counted(self.manifest.n_cameras, "camera position"), *counts])
        return f"<FrameArray {self.name!r}: {size}, {width} x {height} pixels{changed}>"

    def relight(
        self,
        *,
        groups: Mapping[str, Factor] | None = None,
        ambient: Factor | None = None,
        weights: Weights | None = None,
        environment: Environment | None = None,
        rotate: float = 0.0,
        soft: float | None = None,
    ) -> "FrameArray":
        """Return the array under other light: sums of what is on disk, without a ray.

        Args:
            groups: factor per name of a group, one number or RGB; 0 turns it off.
            ambient: factor of the ambient light.
            weights: of all light positions along the first axis: an array (n,) or (n, 3), or a mapping from positions
                to weights. They become one picture, at position 0.
            environment: panorama of radiance, (h, 2 h, 3), or its EXR or HDR file, whose light the positions along the
                first axis stand for. They become one picture.
            rotate: degrees that the environment turns clockwise, seen from above.
            soft: the number of light positions whose mean takes the place of one.

        At most one of `weights`, `environment` and `soft`; what is not named stays as it was.

        Raises:
            ValueError, IndexError: a factor or weights are none.
            KeyError: the array has no such group.
            OutputError: it has no groups at all, or its pictures may not be summed so.
        """
        manifest, lighting = self.manifest, self.lighting
        if sum(value is not None for value in (weights, environment, soft)) > 1:
            raise ValueError("expected only one of weights, environment and soft")
        unknown = [name for name in groups or () if name not in manifest.group_names]
        if unknown or (ambient is not None and not manifest.groups):
            raise no_group(manifest, unknown)
        factors = {name: read_factor(f"groups[{name!r}]", factor) for name, factor in (groups or {}).items()}
        level = lighting.relight.ambient if ambient is None else read_factor("ambient", ambient)
        changed = replace(lighting, relight=Relight(groups={**lighting.relight.groups, **factors}, ambient=level))
        if weights is not None or environment is not None or soft is not None:
            check_linear(manifest)
        if soft is not None:
            if not (isinstance(soft, int | float | np.number) and np.isfinite(soft) and soft >= 1):
                raise ValueError(f"soft: expected a number of light positions of at least 1, got {soft!r}")
            changed = replace(changed, soft=float(soft), mixture=None)
        elif environment is not None:
            changed = replace(changed, mixture=environment_mixture(manifest, environment, rotate), soft=None)
        elif weights is not None:
            mixture = mixture_of(read_weights(weights, lighting.n))
            check_mixture(manifest, mixture)
            changed = replace(changed, mixture=mixture, soft=None)
        return FrameArray(manifest=manifest, lighting=changed)

    def to_xarray(self, *, name: str = "radiance") -> "xarray.DataArray":
        """Return all pictures as one lazy array, which reads files when values are needed.

        Returns:
            float32 with dimensions camera, each light axis, y, x, channel; coordinates: indices along all axes but y
            and x, "R", "G", "B", and `time` where a sun moves. `.chunk()` makes it one of dask.

        Raises:
            MissingExtraError: xarray is not installed.
        """
        with extra("lazy arrays need xarray", "[xarray]"):
            from .labelled import data_array

        return data_array(self, name)

    def to_dataset(self) -> "xarray.Dataset":
        """Return all pictures as `radiance`, lazy as of `to_xarray`, with poses, lenses and lights next to it.

        Returns:
            The variables that stores of `to_zarr` have, by the same names; docs/guide/python.md lists them.

        Raises:
            MissingExtraError: xarray is not installed.
        """
        with extra("lazy arrays need xarray", "[xarray]"):
            from .labelled import labelled_set

        return labelled_set(self)

    def to_zarr(
        self, path: str | os.PathLike[str], *, dtype: str = "float32", overwrite: bool = False, threads: int = 2
    ) -> None:
        """Write all pictures into a zarr store of version 3, one chunk per picture, with poses, lenses and lights.

        Pictures are read, written and forgotten one by one. The store appears whole or not at all.

        Args:
            path: folder of the store.
            dtype: "float32", or "float16", which holds what most EXR files hold exactly.
            overwrite: replace what is there.
            threads: pictures that are read and compressed at the same time.

        Raises:
            MissingExtraError: zarr is not installed.
            OutputError: a picture is missing or damaged, or too bright for its type; something is at the path; or the
                system refuses to write.
        """
        with extra("stores need zarr", "[zarr]"):
            from .zarrstore import write_store

        write_store(self, Path(path), dtype, overwrite=overwrite, threads=threads)

    def sheet(
        self,
        cameras: str | None = None,
        light: str | None = None,
        *,
        at: Mapping[str, str] | None = None,
        side: str | None = None,
        columns: int = 6,
        rows: int = 4,
        width: int = 1200,
        exposure: float = 0.0,
        view: str = "srgb",
    ) -> "Sheet":
        """Draw a contact sheet: camera positions from left to right, light positions below; blanks where none are yet.

        Args:
            cameras, light: places, "0-47x3" or "first,50%,last", as of `framearray sheet`; None: a few, evenly spaced.
            at: places along further light axes.
            side: axis of light positions from top to bottom; None: the first.
            columns, rows, width: positions where they are not named, and pixels, at most.
            exposure: stops added.
            view: srgb, neutral, agx, aces, or a view of the configuration in $OCIO.

        Raises:
            JobError: an axis, a place or the view is unknown, or images would be too small at that width.
            OutputError: no image is there, or one is damaged.
        """
        from framearray_cli.base.views import find_view
        from framearray_cli.tools.contactsheet import SheetOptions

        from .sheets import draw

        options = SheetOptions(
            cameras=cameras, light=light, at=[f"{axis}={places}" for axis, places in (at or {}).items()], side=side,
            columns=columns, rows=rows, width=width, exposure=exposure, view=find_view(view, "view"),
        )  # fmt: skip
        return draw(self, options)

    def _repr_html_(self) -> str:
        from .sheets import html_of

        return html_of(self)
