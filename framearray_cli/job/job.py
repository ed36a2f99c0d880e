"""Job, and those of its tables that have no module of their own. Each key is typed, bounded and described once.

Attributes follow the keys of the file: `job.camera.keys[0].eye` is `keys = [{ eye = ... }]` under `[camera]`.
Validation fills in what a file leaves out, so that a Job is complete.
"""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeVar

from pydantic import AfterValidator, Field, PrivateAttr, ValidationInfo, model_validator

from framearray_cli.base.forms.table import Place, Table, default_text, fail, fill
from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import ORTHOGRAPHIC
from framearray_cli.base.sundays import SunDay
from framearray_cli.base.units import MOST_THREADS

from .camera import CameraTable
from .light import LightTable
from .material import KEYS_BY_FILE, MaterialTable
from .method import (
    DEFAULT_HITS,
    DEFAULT_N_R,
    AmbientTable,
    DenoiseTable,
    IndirectTable,
    ObscuranceTable,
    ReuseTable,
    SamplesTable,
    SpecularTable,
)
from .output import OutputTable
from .study import study_days, study_problems
from .values import MOST_HITS, Auto, Emission, FileName, MemorySize, absolute

Z_UP_FORMATS = (".stl", ".ply", ".3mf")  # print and scan formats; in every other format y is up
NAME = "[A-Za-z0-9_][A-Za-z0-9._-]{0,99}"  # what can start a file name on every system


class SceneTable(Table):
    """The model."""

    file: FileName = Field(description="Scene file: GLB, glTF, OBJ, PLY, STL or anything else trimesh reads.")
    up: Literal["y", "z"] = Field(
        default="y",
        description="Axis that points up. It is the up direction of cameras without `up`; the model is not turned.",
        json_schema_extra=default_text('"z" for STL, PLY and 3MF, else "y"'),
    )
    background: Emission = Field(
        default=(0.0, 0.0, 0.0),
        description="Radiance of what lies outside the scene, W/(m2 sr); one number means grey.",
    )
    folders: tuple[FileName, ...] = Field(
        default=(),
        strict=False,
        max_length=100,
        description="Further folders, with all below them, for files that the scene names, such as textures. "
        "Without them a scene may only name files in its own folder or below.",
        json_schema_extra={"x-words": "a list of folders"},
    )
    surfaces: Literal["diffuse", "file"] = Field(
        default="diffuse",
        description='What surfaces follow: "diffuse" makes all of them diffuse or mirrors; "file" also uses the metal, '
        "roughness, normal maps, glass and emission of the scene file, and blurs textures by what an eye ray stands "
        "for.",
    )
    materials: dict[str, MaterialTable] = Field(
        default_factory=dict, description="Materials to override, by their names in the scene file."
    )

    @model_validator(mode="after")
    def _check_surfaces(self) -> "SceneTable":
        given = [
            ("materials", name, key)
            for name, table in self.materials.items()
            for key in KEYS_BY_FILE
            if getattr(table, key) is not None
        ]
        if given and self.surfaces != "file":
            problem = 'expected none with scene.surfaces = "diffuse"; it acts with "file"'
            fail([(place, problem) for place in given])
        return self

    @model_validator(mode="after")
    def _fill_up(self) -> "SceneTable":
        if "up" not in self.model_fields_set:
            fill(self, "up", "z" if self.file.suffix.lower() in Z_UP_FORMATS else "y")
        return self


class RenderTable(Table):
    """How the machine is used; no image depends on it."""

    memory: MemorySize | None = Field(
        default=None,
        description='Maximum memory of the program, such as "8 GiB". A job that needs more is rendered in blocks of '
        "light positions, one after the other; the images are the same, the time is longer.",
        json_schema_extra=default_text("two thirds of what is free"),
    )
    threads: int | None = Field(
        default=None,
        ge=1,
        le=MOST_THREADS,
        description="Number of threads that render.",
        json_schema_extra=default_text("one for each core"),
    )


def _file_stem(name: str) -> str:
    """Check that a name can start a file name on every system."""
    if not re.fullmatch(NAME, name):
        wanted = 'at most 100 letters, digits, ".", "_" or "-", the first a letter, digit or "_"'
        fail([((), f"expected {wanted}, got {shown(name)}")])
    return name


_Number = TypeVar("_Number", int, float)


def _resolved(key: str, value: _Number | Auto) -> _Number:
    """A number of the job file, or the one that has replaced "auto"."""
    if isinstance(value, str):
        raise ValueError(f'{key} is "auto": call resolve_auto() before what depends on it')
    return value


# Keys and values that were removed, or that people write by habit: the replacement, as an order without a full stop.
HINTS: Mapping[str, str] = {
    "ambient.samples": "write ambient.paths",
    'ambient.method = "light"': 'write "eye", or "fit" for the level that path tracing gives',
    "denoise": "remove the table; less noise comes from more samples.hits or, with cells, from indirect.filter",
    "denoise.obscurance": "remove it; less noise comes from more samples.hits or, with cells, from indirect.filter",
    'indirect.method = "local"': 'write "cells", which uses the same solution of all bounces',
    "light.sources[].almanac": "remove it; there is one almanac",
    "light.sources[].strength": "write intensity, irradiance, power or radiance, by the type of the source",
    "output.denoise": "remove it; less noise comes from more samples.hits or, with cells, from indirect.filter",
    "samples.shadow_step": "remove it; every light position gets its own shadow rays",
    "samples.shadow_unbiased": "remove it; every light position gets its own shadow rays",
    "specular.bounces": "write specular.depth",
}


class Job(Table):
    """Everything a job file says, with all defaults filled in and all file names absolute."""

    hints: ClassVar[Mapping[str, str]] = HINTS

    name: Annotated[str, AfterValidator(_file_stem)] = Field(
        description='Starts every file name. Letters, digits, ".", "_" and "-".',
        json_schema_extra={"pattern": f"^{NAME}$", "x-words": "a name"},
    )
    seed: int = Field(default=0, ge=0, le=2**32 - 1, description="Seed of all random numbers.")
    scene: SceneTable
    camera: CameraTable
    light: LightTable
    samples: SamplesTable = Field(default_factory=SamplesTable)
    reuse: ReuseTable = Field(default_factory=ReuseTable)
    obscurance: ObscuranceTable
    indirect: IndirectTable = Field(default_factory=IndirectTable)
    ambient: AmbientTable = Field(default_factory=AmbientTable)
    specular: SpecularTable = Field(default_factory=SpecularTable)
    denoise: DenoiseTable = Field(default_factory=DenoiseTable)
    output: OutputTable = Field(default_factory=OutputTable)
    render: RenderTable = Field(default_factory=RenderTable)

    _file: Path | None = PrivateAttr(None)

    @property
    def file(self) -> Path | None:
        """The job file that this was read from, for messages."""
        return self._file

    @property
    def n_r(self) -> int:
        """N_r: `reuse.n_r` as a number.

        Raises:
            ValueError: it is "auto"; `resolve_auto` replaces that by a number.
        """
        return _resolved("reuse.n_r", self.reuse.n_r)

    @property
    def hits(self) -> float:
        """Native hits per pixel and frame: `samples.hits` as a number.

        Raises:
            ValueError: it is "auto"; `resolve_auto` replaces that by a number.
        """
        return _resolved("samples.hits", self.samples.hits)

    @property
    def sends_particles(self) -> bool:
        """Whether an ambient light is estimated by particles; images with light from cells have none."""
        ambient = self.ambient
        return self.indirect.method == "obscurance" and ambient.method == "light" and ambient.intensity is None

    @property
    def sun_days(self) -> tuple[SunDay, ...]:
        """The days whose hours of sun are layers; none unless `output.sun_hours` asks for them."""
        return study_days(self.light) if self.output.sun_hours and self.output.layers else ()

    @property
    def _window_frames(self) -> int:
        """Number of frames in a full window, 2 N_r + 1; with the default N_r for "auto"."""
        n_r = DEFAULT_N_R if self.reuse.n_r == "auto" else self.reuse.n_r
        return 2 * n_r + 1

    @property
    def _window_hits(self) -> float:
        """Native hits of a pixel in a full window; those of the defaults where `samples.hits` is "auto"."""
        if self.samples.hits == "auto":
            return (2 * DEFAULT_N_R + 1) * DEFAULT_HITS
        return self._window_frames * self.samples.hits

    def __eq__(self, other: object) -> bool:
        """Two jobs are equal if they have the same keys and values; their files do not count."""
        return isinstance(other, Job) and self.__dict__ == other.__dict__

    @model_validator(mode="after")
    def _fill_defaults(self, info: ValidationInfo) -> "Job":
        most = MOST_HITS // self._window_frames
        if self._window_hits > MOST_HITS and self.samples.hits != "auto":
            fail([(("samples", "hits"), f"expected at most {most} with this n_r, got {self.samples.hits:g}")])
        if self.samples.error is not None and self.samples.most_hits > most:
            fail([(("samples", "most_hits"), f"expected at most {most} with this n_r, got {self.samples.most_hits}")])
        if self.samples.halves and self.output.format != "exr":
            fail(
                [(("samples", "halves"), 'expected output.format = "exr": no other format has room for more channels')]
            )
        self._check_groups()
        self._check_cells()
        self._check_environments()
        self._check_cameras()
        if self.output.sun_hours and (problems := study_problems(self.light, layers=self.output.layers)):
            fail(problems)
        if self.samples.halves and self._window_hits < 2:
            fail([(("samples", "halves"), "expected at least two hits for each pixel of an image")])
        job_file = (info.context or {}).get("job_file")
        self._file = job_file
        if "hits" not in self.specular.model_fields_set:
            hits = min(math.ceil(self._window_hits), MOST_HITS)
            fill(self, "specular", self.specular.model_copy(update={"hits": hits}))
        if "directory" not in self.output.model_fields_set:
            directory = absolute(Path("..") / "out" / self.name, job_file)
            fill(self, "output", self.output.model_copy(update={"directory": directory}))
        return self

    def _check_cells(self) -> None:
        """Refuse what light from cells does not go together with."""
        if self.indirect.method == "obscurance" or not self.denoise.obscurance:
            return
        reason = (
            "whose images show no obscurance"
            if self.indirect.method == "cells"
            else "which multiplies the obscurance of each hit by the light of its cell, before there is a picture of it"
        )
        problem = f'expected false with indirect.method = "{self.indirect.method}", {reason}'
        fail([(("denoise", "obscurance"), problem)])

    def _check_cameras(self) -> None:
        """Refuse weights that favour surfaces: eyes that look elsewhere never see the sky of parallel rays."""
        if self.camera.type == ORTHOGRAPHIC and self.reuse.weights == "average":
            problem = f'expected "area" or "balance" with camera.type = "{ORTHOGRAPHIC}", whose sky no other eye sees'
            fail([(("reuse", "weights"), problem)])

    def _check_environments(self) -> None:
        """Refuse particles from environments."""
        if self.sends_particles and "environment" in {s.type for s in self.light.sources}:
            fail([(("ambient", "method"), 'expected "eye" or "fit": environments emit no particles')])

    def _check_groups(self) -> None:
        """Refuse settings that light stored by group does not allow."""
        if not self.light.groups:
            return
        problems: list[tuple[Place, str]] = []
        if self.output.format not in ("exr", "tif"):
            wanted = 'expected "exr" or "tif", as groups of sources are added up afterwards'
            problems.append((("output", "format"), f'{wanted}, got "{self.output.format}"'))
        if self.sends_particles:
            wanted = 'expected "eye" or "fit": with "light", the ambient light of groups does not add up to that of all'
            problems.append((("ambient", "method"), wanted))
        if self.samples.error is not None:
            wanted = "expected none, as the mean radiance that it is measured by depends on how groups are added up"
            problems.append((("samples", "error"), wanted))
        if problems:
            fail(problems)
