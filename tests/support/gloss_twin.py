"""The surface of glTF's appendix B in float64, as its text has it, and integrals of it by plain quadrature."""

from typing import Any

import numpy as np


def brdf(base: Any, metal: float, alpha: float, n: Any, v: Any, d: Any) -> Any:
    """f(v, d) of unit vectors, (..., 3); 0 for d below the surface."""
    h = v + d
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    nl, nv, nh, vh = ((a * b).sum(-1) for a, b in ((n, d), (n, v), (n, h), (v, h)))
    lobe = distribution(alpha, nh) * smith(alpha, nv, nl) / (4 * np.abs(nl) * np.abs(nv))
    f0 = 0.04 * (1 - metal) + np.asarray(base, np.float64) * metal
    fresnel = f0 + (1 - f0) * (1 - np.abs(vh))[..., None] ** 5
    found = (1 - fresnel) * (1 - metal) * np.asarray(base) / np.pi + fresnel * lobe[..., None]
    return np.where((nl > 0)[..., None], found, 0.0)


def distribution(alpha: float, nh: Any) -> Any:
    """D of Trowbridge and Reitz."""
    return alpha**2 / (np.pi * (nh**2 * (alpha**2 - 1) + 1) ** 2)


def smith(alpha: float, nv: Any, nl: Any) -> Any:
    """G of Smith with height correlation."""
    root_v = np.sqrt(alpha**2 + (1 - alpha**2) * nv**2)
    root_l = np.sqrt(alpha**2 + (1 - alpha**2) * nl**2)
    return 2 * np.abs(nl) * np.abs(nv) / (np.abs(nv) * root_l + np.abs(nl) * root_v)


def visible_density(alpha: float, n: Any, v: Any, d: Any) -> Any:
    """Density, per steradian, of v mirrored at a normal that v sees: G1(v) D(h) / (4 n . v)."""
    h = v + d
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    nv, nh = (n * v).sum(-1), (n * h).sum(-1)
    g1 = 2 * nv / (nv + np.sqrt(alpha**2 + (1 - alpha**2) * nv**2))
    return np.where(nh > 0, g1 * distribution(alpha, nh) / (4 * nv), 0.0)


def albedo(base: Any, metal: float, alpha: float, mu: float, steps: int = 1500) -> Any:
    """The share of even light that a surface sends to a viewer at the cosine mu, (3,): the integral of f cos.

    Directions are those that mirror v at normals h. Steps of tan^2 over tan^2 + alpha^2 of the angle of h are even, as
    D cos is then.
    """
    v = np.array([np.sqrt(1 - mu * mu), 0.0, mu])
    p, q = (np.arange(steps) + 0.5) / steps, (np.arange(steps // 4) + 0.5) / (steps // 4) * np.pi
    tan2 = alpha**2 * p / (1 - p)
    cosine = (1 / np.sqrt(1 + tan2))[:, None]
    sine, azimuth = np.sqrt(1 - cosine**2), q[None, :]
    h = np.stack(np.broadcast_arrays(sine * np.cos(azimuth), sine * np.sin(azimuth), cosine), axis=-1)
    vh = h @ v
    d = 2 * vh[..., None] * h - v
    nl = d[..., 2]
    lit = (vh > 0) & (nl > 0)
    f0 = 0.04 * (1 - metal) + np.asarray(base, np.float64) * metal
    fresnel = f0 + (1 - f0) * (1 - np.clip(vh, 0, 1))[..., None] ** 5
    # F G / (4 nl nv) nl, over the density of d: D cos(h) / (4 vh)
    shadowing = smith(alpha, mu, np.where(lit, nl, 1.0))
    specular = np.where(lit, shadowing * vh / (mu * np.broadcast_to(cosine, vh.shape)), 0.0)[..., None] * fresnel
    return specular.mean(axis=(0, 1)) + diffuse_albedo(base, metal, mu, steps // 2)


def diffuse_albedo(base: Any, metal: float, mu: float, steps: int = 700) -> Any:
    """The diffuse part of `albedo`."""
    v = np.array([np.sqrt(1 - mu * mu), 0.0, mu])
    u, azimuth = (np.arange(steps) + 0.5)[:, None] / steps, (np.arange(steps) + 0.5)[None, :] / steps * np.pi
    sine, cosine = np.sqrt(u), np.sqrt(1 - u)
    vd = sine * np.cos(azimuth) * v[0] + cosine * v[2]
    x = (1 - np.sqrt(np.clip((1 + vd) / 2, 0, 1))) ** 5
    f0 = 0.04 * (1 - metal) + np.asarray(base, np.float64) * metal
    return (1 - metal) * np.asarray(base) * (1 - (f0 + (1 - f0) * x.mean()))
