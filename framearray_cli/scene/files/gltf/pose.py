"""Vertices of a glTF mesh at one time: morph targets first, then the skin, by linear blending.

Notation of glTF 2.0, sections 3.7.2.2 and 3.7.3: the matrix of a joint is the joint's place in the world times its
inverse bind matrix, and a vertex is moved by the mean of its joints' matrices, with its weights.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64

from ..assets import Limit
from ..geometry import cofactors
from ..model import Notes
from .container import Gltf, Tree
from .stage import Motion, sample_channel

Attributes = dict[str, NDArray[Any]]  # name -> (v, width)
POSE_BYTES = 400  # memory per vertex while its pose is computed: a matrix, and its factors


class Shape(NamedTuple):
    """A mesh as some nodes show it: its number, the number of its skin or -1, and the weights of its morph targets."""

    mesh: int
    skin: int = -1
    weights: tuple[float, ...] = ()


def shape_of(gltf: Gltf, motion: Motion, node: int, time: float) -> Shape:
    """Return the shape of a node with a mesh; weights are from an animation, else from the node, else from the mesh."""
    entry: Tree = motion.nodes[node]
    mesh = gltf.items("meshes")[entry["mesh"]]
    if not any(primitive.get("targets") for primitive in mesh["primitives"]):
        return Shape(entry["mesh"], entry.get("skin", -1))
    weights: Sequence[float] = entry.get("weights") or mesh.get("weights") or ()
    if (channel := motion.channels.get((node, "weights"))) is not None:
        weights = sample_channel(channel, np.array([time]), False)[0].tolist()
    return Shape(entry["mesh"], entry.get("skin", -1), tuple(weights))


def joint_matrices(gltf: Gltf, motion: Motion, skin: int, time: float) -> Float64 | None:
    """(j, 4, 4) matrices of the joints of a skin; None for no skin, -1."""
    if skin < 0:
        return None
    entry = gltf.items("skins")[skin]
    found = np.array([motion.world_from_node(joint, [time])[0] for joint in entry["joints"]]).reshape(-1, 4, 4)
    if (number := entry.get("inverseBindMatrices")) is not None:  # column by column
        inverse = gltf.read_accessor(number).astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)[: len(found)]
        found[: len(inverse)] = found[: len(inverse)] @ inverse
    return found


def morphed(
    gltf: Gltf, found: Attributes, targets: Sequence[Mapping[str, int]], weights: Sequence[float]
) -> Attributes:
    """Add the morph targets of a primitive to its positions and normals."""
    moved = dict(found)
    for weight, target in zip(weights, targets, strict=False):
        for name in ("POSITION", "NORMAL") if weight else ():
            if name in target and name in found:
                change = gltf.read_accessor(target[name])
                if change.shape != found[name].shape:
                    raise ValueError(
                        f"{name} of a morph target: expected {found[name].shape}, got {change.shape} numbers"
                    )
                moved[name] = moved[name] + weight * change.astype(np.float64)
    return moved


def skinned(found: Attributes, joints: Float64, limit: Limit, notes: Notes) -> Attributes:
    """Move the vertices of a primitive with the joints of its skin.

    Args:
        found: also has JOINTS_0 and WEIGHTS_0, or nothing moves, and perhaps further ones.
        joints: (j, 4, 4).
    """
    sets = [n for n in range(len(found)) if f"JOINTS_{n}" in found and f"WEIGHTS_{n}" in found]
    if not sets or not len(joints):
        notes.add("skins of meshes without joints are left out")
        return found
    numbers = np.concatenate([found[f"JOINTS_{n}"] for n in sets], axis=1).astype(np.int64)  # (v, k)
    weights = np.concatenate([found[f"WEIGHTS_{n}"] for n in sets], axis=1).astype(np.float64)
    if (outside := numbers >= len(joints)).any():
        notes.add("joints that a skin lacks are left out")
        weights, numbers = np.where(outside, 0.0, weights), np.where(outside, 0, numbers)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.divide(weights, total, out=np.eye(1, weights.shape[1]).repeat(len(weights), 0), where=total > 0)
    with limit.lend("poses", POSE_BYTES * len(numbers)):
        matrices = np.zeros((len(numbers), 4, 4))
        for k in range(numbers.shape[1]):
            matrices += weights[:, k, None, None] * joints[numbers[:, k]]
        linear, moved = matrices[:, :3, :3], dict(found)
        moved["POSITION"] = (linear @ found["POSITION"].astype(np.float64)[..., None])[..., 0] + matrices[:, :3, 3]
        if "NORMAL" in found:  # the cofactors of a mirror would turn it around
            sign = np.where(np.linalg.det(linear) < 0, -1.0, 1.0)[:, None, None]
            moved["NORMAL"] = (cofactors(linear) * sign @ found["NORMAL"].astype(np.float64)[..., None])[..., 0]
        if "TANGENT" in found:
            along = (linear @ found["TANGENT"][:, :3].astype(np.float64)[..., None])[..., 0]
            moved["TANGENT"] = np.concatenate([along, found["TANGENT"][:, 3:]], axis=1)
    return moved
