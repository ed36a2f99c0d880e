"""All quantities at a hit on a triangle, one point at a time; compiled once for all tests."""

from typing import Any

from framearray_cli.engine.inputs.surfaces import (
    Surfaces,
    geometric_normal,
    position_at,
    reflectivity_at,
    shading_normal,
    specular_at,
)
from framearray_cli.engine.kernels.kernel import inlined, kernel

QUANTITIES = ("position", "geometric", "shading", "diffuse", "mirror")


@inlined
def everything(s: Surfaces, triangle: Any, u: Any, v: Any, dx: Any, dy: Any, dz: Any) -> Any:
    gx, gy, gz = geometric_normal(s, triangle, dx, dy, dz)
    shading = shading_normal(s, triangle, u, v, gx, gy, gz)
    return (
        position_at(s, triangle, u, v),
        (gx, gy, gz),
        shading,
        reflectivity_at(s, triangle, u, v),
        specular_at(s, triangle, u, v),
    )


@kernel
def find_numbers(s: Surfaces, triangle: Any, uv: Any, way: Any, out: Any) -> None:
    """All QUANTITIES at points (2, n) of triangles (n,), seen along ways (3, n); (5, 3, n)."""
    for i in range(uv.shape[1]):
        found = everything(s, triangle[i], uv[0, i], uv[1, i], way[0, i], way[1, i], way[2, i])
        for k in range(5):
            for axis in range(3):
                out[k, axis, i] = found[k][axis]
