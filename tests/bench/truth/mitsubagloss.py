"""The surface of glTF 2.0, appendix B, for Mitsuba 3: a second reading of the text, for rays one by one."""

from functools import cache
from typing import Any

import numpy as np

from framearray_cli.scene.scene import Scene

NAME = "gltf_gloss"
F0, SMOOTHEST = 0.04, 0.1  # of dielectrics; roughness that nothing goes below


@cache
def register(mi: Any, _variant: str) -> str:
    """Make Mitsuba know the surface in its current variant; return its name."""
    import drjit as dr

    class Gloss(mi.BSDF):  # type: ignore[misc]  # of a package without types
        """Textures: `base`, the base colour, and `gloss`, roughness in green and metal in blue."""

        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.base, self.gloss = props["base"], props["gloss"]
            sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [mi.BSDFFlags.DiffuseReflection | sides, mi.BSDFFlags.GlossyReflection | sides]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def surface(self, si: Any, active: Any) -> Any:
            gloss = self.gloss.eval(si, active)
            rough = dr.maximum(gloss.y, SMOOTHEST)
            return self.base.eval(si, active), rough * rough, gloss.z

        def density(self, alpha: Any, wi: Any, wo: Any) -> Any:
            half = dr.normalize(wi + wo)
            facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True)
            shiny = facets.pdf(wi, half) / (4 * dr.dot(wi, half))
            return 0.5 * (shiny + mi.warp.square_to_cosine_hemisphere_pdf(wo))

        def value(self, base: Any, alpha: Any, metal: Any, wi: Any, wo: Any) -> Any:
            half = dr.normalize(wi + wo)
            x = 1 - dr.dot(wi, half)
            schlick = x * x * x * x * x
            f0 = F0 * (1 - metal) + metal * base
            fresnel = f0 + (1 - f0) * schlick
            a2 = alpha * alpha
            spread = half.z * half.z * (a2 - 1) + 1
            d = a2 / (dr.pi * spread * spread)
            hidden = wo.z * dr.sqrt(a2 + (1 - a2) * wi.z * wi.z) + wi.z * dr.sqrt(a2 + (1 - a2) * wo.z * wo.z)
            return (fresnel * (0.5 * d / hidden) + (1 - fresnel) * (1 - metal) * base * dr.inv_pi) * wo.z

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            base, alpha, metal = self.surface(si, active)
            side = dr.sign(si.wi.z)
            wi = si.wi * side
            facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True)
            half, _ = facets.sample(wi, sample2)
            wo = dr.select(sample1 < 0.5, mi.reflect(wi, half), mi.warp.square_to_cosine_hemisphere(sample2))
            active &= (wi.z > 0) & (wo.z > 0)
            found = mi.BSDFSample3f()
            found.wo, found.eta, found.sampled_component = wo * side, 1.0, mi.UInt32(1)
            found.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            found.pdf = dr.select(active, self.density(alpha, wi, wo), 0)
            weight = self.value(base, alpha, metal, wi, wo) / found.pdf
            return found, dr.select(active & (found.pdf > 0), weight, 0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            base, alpha, metal = self.surface(si, active)
            side = dr.sign(si.wi.z)
            wi, to = si.wi * side, wo * side
            return dr.select(active & (wi.z > 0) & (to.z > 0), self.value(base, alpha, metal, wi, to), 0)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            _, alpha, _ = self.surface(si, active)
            side = dr.sign(si.wi.z)
            wi, to = si.wi * side, wo * side
            return dr.select(active & (wi.z > 0) & (to.z > 0), self.density(alpha, wi, to), 0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def traverse(self, callback: Any) -> None:
            callback.put_object("base", self.base, mi.ParamFlags.Differentiable)
            callback.put_object("gloss", self.gloss, mi.ParamFlags.Differentiable)

    mi.register_bsdf(NAME, lambda props: Gloss(props))
    return NAME


def is_glossy(scene: Scene, m: int) -> bool:
    """Whether a material is glossy."""
    return len(scene.roughness) > 0 and bool(scene.roughness[m] > 0)


def gloss_texture(mi: Any, scene: Scene, m: int) -> dict[str, Any]:
    """Roughness in green and metal in blue."""
    factor, texture = np.array([0.0, scene.roughness[m], scene.metallic[m]]), int(scene.gloss_texture[m])
    values = np.ones((1, 1, 3))
    if texture >= 0:
        first, width, height = scene.textures[texture]
        values = scene.texels[first : first + width * height, :3].reshape(height, width, 3) / 255.0
    return bitmap(mi, values * factor)


def bitmap(mi: Any, values: Any) -> dict[str, Any]:
    """A texture of linear values, (h, w, 3); also where they are one colour, which Mitsuba would make no texture."""
    data = mi.TensorXf(np.ascontiguousarray(values, np.float32))
    return {"type": "bitmap", "data": data, "raw": True, "filter_type": "bilinear", "wrap_mode": "repeat"}
