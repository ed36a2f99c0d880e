"""Units of the strengths of lights, and files of measured lamps: their keys."""

from typing import Literal, TypeAlias

LampUnits: TypeAlias = Literal["W/sr", "cd", "lm"]
SkyUnits: TypeAlias = Literal["W/m2", "lux"]
PanelUnits: TypeAlias = Literal["W", "lm", "W/(m2 sr)", "cd/m2"]
RadianceUnits: TypeAlias = Literal["W/(m2 sr)", "cd/m2"]
DomeUnits: TypeAlias = Literal["W/sr", "cd", "lm", "W/m2", "lux"]
UNITS_OF_DOMES = {"intensity": ("W/sr", "cd", "lm"), "irradiance": ("W/m2", "lux")}
UNITS_OF_PANELS = {"power": ("W", "lm"), "radiance": ("W/(m2 sr)", "cd/m2")}

LAMP_UNITS = (
    "Unit of every `intensity` of the source: radiant intensity, candela, or lumens of all its light. A watt of light "
    "is 683 lumens."
)
SKY_UNITS = "Unit of every `irradiance` of the source. A watt of light is 683 lumens."
PANEL_UNITS = "Unit of every `power` or `radiance` of the source. A watt of light is 683 lumens."
IES = (
    "File of IES LM-63 with the light of a lamp by direction, of photometry type C or B. A `point` with a file hangs: "
    "its vertical angle 0 is straight down. A `spot` with one shines along its `direction`, and has no cone."
)
