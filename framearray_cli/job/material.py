"""`[scene.materials."NAME"]`: what a job says of a material of the scene."""

from typing import Annotated

from pydantic import Field, ValidationInfo, field_validator, model_validator

from framearray_cli.base.forms.table import Float3, Table, default_text, fail

from .values import Emission, Reflectivity

STEEPEST = 100.0  # a normal map whose slopes are multiplied by more is a map of cliffs
HIGHEST_IOR = 3.0  # diamond has 2.4
KEYS_BY_FILE = ("roughness", "metallic", "transmission", "ior", "normal_strength", "emission")
BY_FILE = ' Only with `surfaces = "file"`.'
Share = Annotated[float, Field(ge=0, le=1)]


class MaterialTable(Table):
    """Replaces parts of one material of the scene, by its name."""

    reflectivity: Reflectivity | None = Field(
        default=None,
        description="Diffuse reflectivity, linear, Rec. 709. Replaces the material's colour, "
        "texture and vertex colours.",
        json_schema_extra=default_text("as in the scene"),
    )
    specular: Reflectivity | None = Field(
        default=None,
        description="Mirror reflectivity, linear. Above 0 the material reflects like a mirror. "
        "Diffuse plus mirror reflectivity is at most 1 in each channel.",
        json_schema_extra=default_text("as in the scene"),
    )
    roughness: Share | None = Field(
        default=None,
        description="Roughness of the gloss, as glTF defines it, in place of the file's and its texture. Below 0.1 it "
        "counts as 0.1, and metals up to it are mirrors." + BY_FILE,
        json_schema_extra=default_text("as in the scene"),
    )
    metallic: Share | None = Field(
        default=None,
        description="Share of metal, in place of the file's and its texture; `reflectivity` is then the base colour."
        + BY_FILE,
        json_schema_extra=default_text("as in the scene"),
    )
    transmission: Share | None = Field(
        default=None,
        description="Share of light that passes straight through; above 0.75 the surface is thin glass of the "
        "material's colour, below it covers a part of what is behind it." + BY_FILE,
        json_schema_extra=default_text("as in the scene"),
    )
    ior: float | None = Field(
        default=None,
        ge=1,
        le=HIGHEST_IOR,
        description="Refractive index of thin glass, which says how much it mirrors." + BY_FILE,
        json_schema_extra=default_text("as in the scene"),
    )
    normal_strength: float | None = Field(
        default=None,
        ge=0,
        le=STEEPEST,
        description="Multiplies the slopes of the material's normal map; 0: no map." + BY_FILE,
        json_schema_extra=default_text("1"),
    )
    emission: Emission | None = Field(
        default=None,
        description="Radiance that the surface emits, linear, W/(m2 sr), in place of the file's and its texture. It is "
        'seen; a source of type "mesh" lets it light.' + BY_FILE,
        json_schema_extra=default_text("as in the scene"),
    )

    @field_validator("specular")
    @classmethod
    def _conserves_energy(cls, specular: Float3 | None, info: ValidationInfo) -> Float3 | None:
        diffuse = info.data.get("reflectivity")
        for channel, a, b in zip(("red", "green", "blue"), diffuse or (), specular or (), strict=False):
            if a + b > 1 + 1e-9:  # 0.1 + 0.9 may round to just above 1
                fail([((), f"expected reflectivity + specular of at most 1, got {a + b:g} in {channel}")])
        return specular

    @model_validator(mode="after")
    def _check_mirrors(self) -> "MaterialTable":
        given = [key for key in ("roughness", "metallic", "transmission") if getattr(self, key) is not None]
        if self.specular is not None and given:
            fail([((key,), "expected none beside `specular`, which makes the material a mirror") for key in given])
        return self
