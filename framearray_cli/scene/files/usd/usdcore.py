"""The door to usd-core: opens a stage whose layers all lie where a scene may read, and keeps the library quiet."""

import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import SceneError
from framearray_cli.base.extras import install_command

from ..assets import AssetError, Assets, is_url, shorten
from ..model import POSED, Notes
from ..textures import UDIM
from .materialx import SUFFIX, layer_of

SUFFIXES = ("usd", "usda", "usdc", "usdz")
MOST_TEXT = 160  # characters of a message of the library that a note or error repeats
MOST_MESSAGES = 5
ADDRESS = re.compile(r" ?\((recomposing|instantiating) stage.*|anon:0x[0-9a-f]+:|<?0x[0-9a-f]+>?")
NOTED = re.compile("Could not (load sublayer|open asset) @")  # messages on layers that have a note already


@cache
def usd() -> Any:
    """Import usd-core; its modules are attributes of what is returned.

    Raises:
        SceneError: it is not installed.
    """
    try:
        import pxr
        from pxr import Ar, Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel, UsdUtils  # noqa: F401  (now attributes)
    except ImportError as error:
        remedy = f"export the scene as GLB, or install it with: {install_command('[usd]')}"
        raise SceneError(f"reading USD files needs usd-core; {remedy}") from error
    return pxr


@contextmanager
def opened(file: Path, assets: Assets, notes: Notes) -> Iterator[Any]:
    """Open a stage with all of its payloads; it may be used as long as the block runs, and while something keeps it.

    Args:
        assets: every layer must lie in its folders.
        notes: gets what the library reports.

    Raises:
        SceneError: a layer lies elsewhere, or the file itself is broken; other layers that are broken are left out.
    """
    library = usd()
    delegate = library.UsdUtils.CoalescingDiagnosticDelegate()  # while it lives, the library prints nothing
    try:
        root = _open_layer(os.path.abspath(file))
        kept = _open_inside(root, assets, notes)
        try:
            stage = library.Usd.Stage.Open(root, library.Usd.Stage.LoadAll)
        except library.Tf.ErrorException as error:
            raise ValueError(_plain(error)) from error
        _check_used(stage, assets, notes)
        del kept
        yield stage
    finally:
        found = [_one_line(message.commentary) for message in delegate.TakeUncoalescedDiagnostics()]
        for text in [text for text in dict.fromkeys(found) if not NOTED.search(text)][:MOST_MESSAGES]:
            notes.add(f"USD says: {text}")


@contextmanager
def read_later(file: Path) -> Iterator[None]:
    """Read values of a stage that was opened before; the library prints nothing.

    Raises:
        SceneError: a value is broken.
    """
    delegate = usd().UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    except SceneError:
        raise
    except Exception as error:  # broken files make readers raise anything
        raise SceneError(f"{file}: broken, or not USD ({_plain(error)}); export it anew") from error
    finally:
        delegate.TakeUncoalescedDiagnostics()


def _open_layer(identifier: str) -> Any:
    """Open a layer, or raise a ValueError if it is broken."""
    library = usd()
    try:
        layer = library.Sdf.Layer.FindOrOpen(identifier)
    except library.Tf.ErrorException as error:
        raise ValueError(_plain(error)) from error
    if layer is None:
        raise ValueError("no layer of USD")
    return layer


def _one_line(text: str) -> str:
    """A message of the library without the addresses of its objects."""
    return ADDRESS.sub("", " ".join(text.split()))[:MOST_TEXT].rstrip(" :")


def _plain(error: Exception) -> str:
    """The message of an error of the library, without its place in the library's source."""
    text = re.sub(r"pxrInternal\w*::\S* ?", "", " ".join(str(error).split()))
    return text.rpartition(" : ")[2].strip("'\" ")[:MOST_TEXT] or "it cannot be opened"


def _open_inside(root: Any, assets: Assets, notes: Notes) -> list[Any]:
    """Open all layers that a layer names, each once, before anything is composed; read nothing that lies elsewhere.

    A layer that is missing, broken or of another format is noted; the stage then has all others. Documents of MaterialX
    are converted.

    Returns:
        Layers to keep until the stage is open.
    """
    waiting, seen, converted = [root], {root.identifier}, dict[str, Any]()
    while waiting:
        layer = waiting.pop()
        for name in sorted(layer.GetCompositionAssetDependencies()):
            path = layer.ComputeAbsolutePath(name)
            if path in converted:
                layer.UpdateCompositionAssetDependency(name, converted[path].identifier)
            if path in seen or not name or usd().Sdf.Layer.IsAnonymousLayerIdentifier(name):
                continue
            seen.add(path)
            outer = _outer(path)
            here = not is_url(name) and assets.holds(Path(outer))
            if not here and assets.refuses(name, outer):
                continue
            if not here:
                layer.UpdateCompositionAssetDependency(name, "")  # USD would try it
            if not here or not os.path.isfile(outer):
                notes.add("files that it names are missing", shorten(name))
            elif path.lower().endswith(SUFFIX):
                if found := _converted(outer, assets, notes):
                    converted[path] = found
                    layer.UpdateCompositionAssetDependency(name, found.identifier)
            elif usd().Sdf.FileFormat.FindByExtension(path) is None:
                notes.add("files of other formats than USD are left out", shorten(name))
            else:
                assets.limit.take("files", os.path.getsize(outer))
                try:
                    waiting.append(_open_layer(path))
                except ValueError as error:
                    notes.add("layers that are broken are left out", f"{shorten(name)} ({error})")
        assets.require_inside()
    return list(converted.values())


def _converted(file: str, assets: Assets, notes: Notes) -> Any:
    """The layer of a document of MaterialX; None, with a note, if it cannot be read."""
    assets.limit.take("files", os.path.getsize(file))
    name = os.path.basename(file)
    try:
        return layer_of(file, usd())
    except ImportError:
        notes.add(f"materials of MaterialX need {install_command('[usd]')}", name)
    except Exception as error:  # broken documents make both libraries raise anything
        notes.add("layers that are broken are left out", f"{name} ({_plain(error)})")
    return None


def _outer(path: str) -> str:
    """The file on the disk behind the path of a layer or image: the outermost package, if it lies in one."""
    return path.partition("[")[0] if path.endswith("]") else path


def _check_used(stage: Any, assets: Assets, notes: Notes) -> None:
    """Refuse a stage of layers from elsewhere, which expressions may name; leave out value clips, which name more."""
    for layer in stage.GetUsedLayers():
        if not layer.anonymous and not assets.holds(Path(_outer(layer.realPath or layer.identifier))):
            assets.refuse(layer.identifier, _outer(layer.realPath or layer.identifier))
    assets.require_inside()
    stage.SetEditTarget(stage.GetSessionLayer())
    for prim in [prim for prim in stage.TraverseAll() if prim.HasAuthoredMetadata("clips")]:
        prim.SetMetadata("clipSets", usd().Sdf.StringListOp.CreateExplicit([]))
        notes.add("value clips are left out; usdcat --flatten joins them", prim.GetName())


def value_of(attribute: Any, time: Any) -> Any:
    """The value of an attribute; the library itself resolves no names of textures in tiles."""
    found = attribute.Get(time)
    if UDIM not in getattr(found, "path", ""):
        return found
    layer = attribute.GetPropertyStack(time)[0].layer
    return usd().Sdf.AssetPath(found.path, usd().UsdShade.UdimUtils.ResolveUdimPath(found.path, layer))


def read_asset(asset: Any, assets: Assets) -> tuple[str, Any]:
    """Find a file that an attribute names: a key of it, and a function that reads its bytes.

    Args:
        asset: Sdf.AssetPath.
    """
    # a missing file of a layer in another folder: its name is not relative to the scene's
    path = str(asset.resolvedPath) or re.sub(r"^(\.\.?/)+", "", str(asset.path))
    outer = _outer(path)
    if outer != path:
        return path, lambda: _read_packed(path, outer, assets)
    return path, lambda: assets.read(path)


def _read_packed(path: str, outer: str, assets: Assets) -> bytes:
    found = usd().Ar.GetResolver().OpenAsset(usd().Ar.ResolvedPath(path))
    where = assets.locate(outer)
    if found is None:
        raise AssetError(f"{shorten(path)}: no such file in {where.name}")
    assets.limit.take("files", found.GetSize())
    return bytes(found.GetBuffer())


def scene_time(stage: Any, seconds: float | None = None) -> Any:
    """The time at which surfaces are read: in seconds, else the first frame of the stage, or of what moves."""
    library = usd()
    if seconds is not None:
        return library.Usd.TimeCode(seconds * time_rate(stage))
    if stage.HasAuthoredTimeCodeRange():
        return library.Usd.TimeCode(stage.GetStartTimeCode())
    return library.Usd.TimeCode.EarliestTime()


def time_rate(stage: Any) -> float:
    """Time codes per second."""
    rate = float(stage.GetTimeCodesPerSecond())
    return rate if 0 < rate < math.inf else 24.0


def bake_skins(stage: Any, time: Any, notes: Notes) -> None:
    """Move the points of meshes with skeletons and blend shapes to their pose at a time, in the session layer.

    The library bakes a pose where there is a sample; so the values at the time become constant first.
    """
    library = usd()
    proxies, is_skinned = library.Usd.TraverseInstanceProxies(), library.UsdSkel.Root
    while instances := {
        _instance_of(prim).GetPath()
        for prim in library.Usd.PrimRange.Stage(stage, proxies)
        if prim.IsA(is_skinned) and prim.IsInstanceProxy()
    }:  # a pose can be written where a prim is no copy; instances may be nested
        for path in instances:
            stage.GetPrimAtPath(path).SetInstanceable(False)
    for root in [prim for prim in stage.Traverse() if prim.IsA(is_skinned)]:
        above, moves = [root.GetParent()], False
        while above[-1]:
            above.append(above[-1].GetParent())
        below = list(library.Usd.PrimRange(root))
        bones = [library.UsdSkel.BindingAPI(prim) for prim in below if prim.IsA(library.UsdSkel.Skeleton)]
        sources = filter(None, (one.GetInheritedAnimationSource() for one in bones))  # may lie elsewhere
        for prim in [*above[:-1], *below, *sources]:
            for attribute in prim.GetAttributes():
                if attribute.ValueMightBeTimeVarying():
                    attribute.Set(attribute.Get(time))
                    moves = True
        try:
            library.UsdSkel.BakeSkinning(is_skinned(root), library.Gf.Interval(0.0))
        except library.Tf.ErrorException as error:
            notes.add("skins that are broken are left out", f"{root.GetName()} ({_plain(error)})")
        if moves:
            notes.add(POSED.format(pose_time(stage, time)), root.GetName())


def _instance_of(prim: Any) -> Any:
    """Return the outermost instance that a prim is a part of."""
    while prim.IsInstanceProxy():
        prim = prim.GetParent()
    return prim


def pose_time(stage: Any, time: Any) -> str:
    """The time of a pose in words, with the range of the stage."""
    shown = "the first frame" if time.IsEarliestTime() else f"{time.GetValue() / time_rate(stage):.4g} s"
    if not stage.HasAuthoredTimeCodeRange():
        return shown
    first, last = (code / time_rate(stage) for code in (stage.GetStartTimeCode(), stage.GetEndTimeCode()))
    return f"{shown} of {first:.4g} to {last:.4g} s"


def matrix(gf_matrix: Any) -> Float64:
    """(4, 4) for columns, of a matrix of USD, which is for rows."""
    return np.array(gf_matrix, np.float64).T


def numbers(values: Any, width: int) -> Float64:
    """(n, width) of an array of USD; empty for none."""
    found = np.array([] if values is None else values, np.float64)
    return found.reshape(-1, width) if found.size % width == 0 else np.zeros((0, width))
