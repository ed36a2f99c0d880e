"""Job, with the tables of its scene, output and render. Each key is typed, bounded and described once.

Attributes follow the keys of the file: `job.camera.keys[0].eye` is `keys = [{ eye = ... }]` under `[camera]`.
Validation fills in what a file leaves out, so that a Job is complete.
"""

import math
import re
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, Field, PrivateAttr, ValidationInfo, field_validator, model_validator

from framearray_cli.base.files import absolute
from framearray_cli.base.forms.schema import Schema, published_schema
from framearray_cli.base.forms.table import Float3, Problems, Table, fail, fill, optional
from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import ORTHOGRAPHIC
from framearray_cli.base.sundays import SunDay, short_days, sun_days
from framearray_cli.base.units import LEAST_FPS, MOST_FPS, MOST_STOPS, MOST_THREADS

from .camera import CameraTable
from .light import LightTable
from .method import (
    DEFAULT_HITS,
    DEFAULT_N_R,
    AmbientTable,
    IndirectTable,
    ObscuranceTable,
    ReuseTable,
    SamplesTable,
    SpecularTable,
)
from .sensors import SensorTable
from .sources import SunSource
from .values import MOST_HITS, Auto, Emission, FileName, MemorySize, Reflectivity

Z_UP_FORMATS = (".stl", ".ply", ".3mf", ".ifc", ".ifczip")  # of prints, scans and houses; in all others y is up
NAME = "[A-Za-z0-9_][A-Za-z0-9._-]{0,99}"  # what can start a file name on every system

STEEPEST = 100.0  # a normal map whose slopes are multiplied by more is a map of cliffs
MOST_TIME = 1e6  # seconds; frame numbers of a longer animation would lose their fractions
HIGHEST_IOR = 3.0  # diamond has 2.4
KEYS_BY_FILE = ("roughness", "metallic", "transmission", "ior", "normal_strength", "emission")
Share = Annotated[float, Field(ge=0, le=1)]


class MaterialTable(Table):
    """Replaces parts of one material of the scene, by its name.

    Attributes:
        reflectivity: Diffuse reflectivity, linear, Rec. 709. Replaces the material's colour, texture and vertex
            colours.
        specular: Mirror reflectivity, linear. Above 0 the material reflects like a mirror. Diffuse plus mirror
            reflectivity is at most 1 in each channel.
        roughness: Roughness of the gloss, as glTF defines it, instead of the file's value and texture. Below 0.1 it
            counts as 0.1, and metals up to it are mirrors. Only with `surfaces = "file"`.
        metallic: Share of metal, instead of the file's value and texture; `reflectivity` is then the base colour. Only
            with `surfaces = "file"`.
        transmission: Share of light that passes straight through; above 0.75 the surface is thin glass of the
            material's colour, below it covers a part of what is behind it. Only with `surfaces = "file"`.
        ior: Refractive index of thin glass, which determines its reflection. Only with `surfaces = "file"`.
        normal_strength: Multiplies the slopes of the material's normal map; 0: no map. Only with `surfaces = "file"`.
        emission: Radiance that the surface emits, linear, W/(m2 sr), instead of the file's value and texture. It is
            seen; a source of type "mesh" lets it light. Only with `surfaces = "file"`.
    """

    reflectivity: Reflectivity | None = optional("as in the scene")
    specular: Reflectivity | None = optional("as in the scene")
    roughness: Share | None = optional("as in the scene")
    metallic: Share | None = optional("as in the scene")
    transmission: Share | None = optional("as in the scene")
    ior: float | None = optional("as in the scene", ge=1, le=HIGHEST_IOR)
    normal_strength: float | None = optional("1", ge=0, le=STEEPEST)
    emission: Emission | None = optional("as in the scene")

    @field_validator("specular")
    @classmethod
    def _conserves_energy(cls, specular: Float3 | None, info: ValidationInfo) -> Float3 | None:
        diffuse = info.data.get("reflectivity")
        for channel, a, b in zip(("red", "green", "blue"), diffuse or (), specular or (), strict=False):
            if a + b > 1 + 1e-9:  # 0.1 + 0.9 may round to just above 1
                fail([((), f"expected reflectivity + specular of at most 1, got {a + b:g} in {channel}")])
        return specular

    def problems(self) -> Problems:
        """Check that a mirror is nothing else."""
        for key in ("roughness", "metallic", "transmission") if self.specular is not None else ():
            if getattr(self, key) is not None:
                yield (key,), "expected none next to `specular`, which makes the material a mirror"


class SceneTable(Table):
    """The model.

    Attributes:
        file: Scene file: GLB, glTF, OBJ, PLY, STL or anything else trimesh reads.
        up: Axis that points up. It is the up direction of cameras without `up`; the model is not turned.
        background: Radiance outside the scene, W/(m2 sr); one number means grey.
        folders: Further folders, with all below them, for files that the scene names, such as textures. Without them a
            scene may only name files in its own folder or below.
        time: Time of the scene file's animation at which surfaces stand, s: moved nodes, skins and morph targets of
            glTF and USD. Cameras and lights of the job have their own paths.
        surfaces: Model of the surfaces: "diffuse" makes all of them diffuse or mirrors; "file" also uses the metal,
            roughness, normal maps, glass and emission of the scene file, and filters textures over the footprint of an
            eye ray.
        back_faces: "hide": cameras and mirrors look through the back faces of materials that a glTF file calls
            single-sided, as viewers of such files do; light and shadows stay.
        materials: Materials to override, by their names in the scene file.
    """

    file: FileName
    up: Literal["y", "z"] = optional('"z" for STL, PLY and 3MF, else "y"', "y")
    background: Emission = (0.0, 0.0, 0.0)
    folders: tuple[FileName, ...] = Field(
        default=(), strict=False, max_length=100, json_schema_extra={"x-words": "a list of folders"}
    )
    time: float | None = optional("the start of the animation", ge=-MOST_TIME, le=MOST_TIME)
    surfaces: Literal["diffuse", "file"] = "diffuse"
    back_faces: Literal["show", "hide"] = "show"
    materials: dict[str, MaterialTable] = Field(default_factory=dict)

    def problems(self) -> Problems:
        """Check that diffuse surfaces have no other properties."""
        for name, table in self.materials.items() if self.surfaces != "file" else ():
            for key in KEYS_BY_FILE:
                if getattr(table, key) is not None:
                    problem = 'expected none with scene.surfaces = "diffuse"; it acts with "file"'
                    yield ("materials", name, key), problem

    @model_validator(mode="after")
    def _fill_up(self) -> "SceneTable":
        if "up" not in self.model_fields_set:
            fill(self, "up", "z" if self.file.suffix.lower() in Z_UP_FORMATS else "y")
        return self


class OutputTable(Table):
    """Images, layers and their folder.

    Attributes:
        directory: Folder for images and manifest.
        format: Image format. EXR and TIFF hold linear radiance; PNG and JPEG are sRGB, clipped to 0..1.
        fps: Frames per second, stored in the images and used for movies.
        compression: Compression of EXR. none, rle, zip, zips and piz keep every bit. dwaa and dwab add an error of a
            tenth of the noise or less and need a fifth of the space; images of 32-bit floats, with alpha or with their
            error have zip instead. pxr24, b44 and b44a lose precision. Layers always have zip.
        half: EXR with 16 bits per channel. "auto": 32 bits for an image with values above 65504, which 16 bits cannot
            hold. "always": clip such values to 65504. "never": always 32 bits.
        quality: Quality of JPEG.
        exposure: Brightens PNG and JPEG by 2 to this power (stops). EXR and TIFF stay as they are.
        layers: Also write one multi-channel EXR per camera: obscurance, indirect, reflectivity, normal, depth, sample
            count.
        sun_hours: Also write hours of direct sun into the layers: a channel per day of the only source of type "sun",
            and one for all days.
        alpha: Images with an alpha channel: surroundings that the camera sees are left out, and alpha is the share of
            the pixel that the scene covers. Premultiplied in EXR and TIFF, not in PNG.
        position: Also write positions of surfaces into the layers, in the scene file's own coordinates.
        uv: Also write texture coordinates into the layers.
        cryptomatte: Also write mattes of all objects and materials into the layers, as Cryptomatte.
    """

    directory: FileName = optional('"../out/" and the job\'s name', Path())
    format: Literal["exr", "png", "tif", "jpg"] = "exr"
    fps: float = Field(default=24.0, ge=LEAST_FPS, le=MOST_FPS)
    compression: Literal["none", "rle", "zip", "zips", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"] = "dwaa"
    half: Literal["auto", "always", "never"] = "auto"
    quality: int = Field(default=95, ge=1, le=100)
    exposure: float = Field(default=0.0, ge=-MOST_STOPS, le=MOST_STOPS)
    layers: bool = True
    sun_hours: bool | None = optional("false")
    alpha: bool | None = optional("false")
    position: bool | None = optional("false")
    uv: bool | None = optional("false")
    cryptomatte: bool | None = optional("false")

    @property
    def aov(self) -> dict[str, bool]:
        """The AOVs that the job requests beyond the layers of every job: mattes, position, uv."""
        wanted = {"mattes": self.cryptomatte, "position": self.position, "uv": self.uv}
        return {name: bool(value) and self.layers for name, value in wanted.items()}

    def problems(self) -> Problems:
        """Check that there is room for alpha and each layer."""
        if self.alpha and self.format == "jpg":
            yield ("alpha",), 'expected format = "exr", "png" or "tif": JPEG has no alpha channel'
        for key in ("position", "uv", "cryptomatte"):
            if getattr(self, key) and not self.layers:
                yield (key,), "expected layers = true next to it, as it is a layer"


class RenderTable(Table):
    """Use of the machine; no image depends on it.

    Attributes:
        memory: Maximum memory of the program, such as "8 GiB". A job that needs more is rendered in strips of rows, one
            after the other; the images are the same, the time is longer.
        threads: Number of threads that render.
    """

    memory: MemorySize | None = optional("two thirds of what is free, and less once others need it")
    threads: int | None = optional("one for each core", ge=1, le=MOST_THREADS)


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


class Job(Table):
    """All values of a job file, with all defaults filled in and all file names absolute.

    Attributes:
        name: Starts every file name. Letters, digits, ".", "_" and "-".
        seed: Seed of all random numbers.
        sensors: Points at which illuminance is measured, into `sensors.csv`.
    """

    name: Annotated[str, AfterValidator(_file_stem)] = Field(
        json_schema_extra={"pattern": f"^{NAME}$", "x-words": "a name"}
    )
    seed: int = Field(default=0, ge=0, le=2**32 - 1)
    scene: SceneTable
    camera: CameraTable
    light: LightTable
    samples: SamplesTable = Field(default_factory=SamplesTable)
    reuse: ReuseTable = Field(default_factory=ReuseTable)
    obscurance: ObscuranceTable = Field(default_factory=ObscuranceTable)
    indirect: IndirectTable = Field(default_factory=IndirectTable)
    ambient: AmbientTable = Field(default_factory=AmbientTable)
    specular: SpecularTable = Field(default_factory=SpecularTable)
    output: OutputTable = Field(default_factory=OutputTable)
    render: RenderTable = Field(default_factory=RenderTable)
    sensors: tuple[SensorTable, ...] = Field(default=(), strict=False)

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
    def d_max(self) -> float:
        """`obscurance.range` as a number, scene units.

        Raises:
            ValueError: the job leaves it to the scene; `with_range` replaces that by a number.
        """
        if self.obscurance.range is None:
            raise ValueError("obscurance.range is not resolved")
        return self.obscurance.range

    @property
    def sun_days(self) -> tuple[SunDay, ...]:
        """Days with hours of sun as layers; none without `output.sun_hours`."""
        if not (self.output.sun_hours and self.output.layers):
            return ()
        (moments,) = self.light.moments.values()
        return sun_days(moments)

    @property
    def _window_frames(self) -> int:
        """Number of frames in a full window, 2 N_r + 1; with the default N_r for "auto"."""
        n_r = DEFAULT_N_R if self.reuse.n_r == "auto" else self.reuse.n_r
        return 2 * n_r + 1

    @property
    def _window_hits(self) -> float:
        """Native hits of a pixel in a full window; default numbers if `samples.hits` is "auto"."""
        if self.samples.hits == "auto":
            return (2 * DEFAULT_N_R + 1) * DEFAULT_HITS
        return self._window_frames * self.samples.hits

    def __eq__(self, other: object) -> bool:
        """Two jobs are equal if they have the same keys and values; their files do not count."""
        return isinstance(other, Job) and self.__dict__ == other.__dict__

    def problems(self) -> Problems:
        """Check the tables against each other."""
        most, samples, camera = MOST_HITS // self._window_frames, self.samples, self.camera
        if self._window_hits > MOST_HITS and samples.hits != "auto":
            yield ("samples", "hits"), f"expected at most {most} with this n_r, got {samples.hits:g}"
        if samples.error is not None and samples.most_hits > most:
            yield ("samples", "most_hits"), f"expected at most {most} with this n_r, got {samples.most_hits}"
        if samples.halves and self.output.format != "exr":
            yield ("samples", "halves"), 'expected output.format = "exr": no other format has room for more channels'
        if self.light.groups and self.output.format not in ("exr", "tif"):
            wanted = 'expected "exr" or "tif", as groups of sources are added up afterwards'
            yield ("output", "format"), f'{wanted}, got "{self.output.format}"'
        if self.light.groups and samples.error is not None:
            wanted = "expected none, as the mean radiance that it is measured by depends on how groups are added up"
            yield ("samples", "error"), wanted
        # Such weights favour surfaces: eyes that look elsewhere never see the sky of parallel rays.
        if camera.type == ORTHOGRAPHIC and self.reuse.weights == "average":
            problem = f'expected "area" or "balance" with camera.type = "{ORTHOGRAPHIC}", whose sky no other eye sees'
            yield ("reuse", "weights"), problem
        if self.output.sun_hours and (problem := self._sun_problem()):
            yield ("output", "sun_hours"), problem
        names = [table.name for table in self.sensors]
        if len(set(names)) < len(names):
            yield ("sensors",), f"expected different names, got {', '.join(names)}"
        if samples.halves and self._window_hits < 2:
            yield ("samples", "halves"), "expected at least two hits for each pixel of an image"

    def _sun_problem(self) -> str:
        """Describe why hours of sun cannot be counted; "" if they can."""
        if not self.output.layers:
            return "expected layers = true next to it, as hours are a layer"
        suns = sum(isinstance(source, SunSource) for source in self.light.sources)
        if suns != 1:
            return f'expected one source of type "sun", whose hours are counted, got {suns or "none"}'
        short = short_days(self.sun_days)
        return f"expected {short}; a position counts for the time to the next" if short else ""

    @model_validator(mode="after")
    def _fill_in(self, info: ValidationInfo) -> "Job":
        job_file = (info.context or {}).get("job_file")
        self._file = job_file
        if "hits" not in self.specular.model_fields_set:
            hits = min(math.ceil(self._window_hits), MOST_HITS)
            fill(self, "specular", self.specular.model_copy(update={"hits": hits}))
        if "directory" not in self.output.model_fields_set:
            directory = absolute(Path("..") / "out" / self.name, job_file)
            fill(self, "output", self.output.model_copy(update={"directory": directory}))
        return self


def job_schema() -> Schema:
    """Make the JSON Schema (2020-12) of the job file, for editors."""
    return published_schema(Job, "framearray job")
