"""An array as if it had only one of its groups of sources: one light at a time, on the axis of that group."""

from dataclasses import replace

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.errors import JobError

OPTION = "--group"


def only_group(manifest: Manifest, name: str | None) -> Manifest:
    """Return the manifest with the sources, the light axis and the ambient light of one group, and no background.

    Args:
        name: of the group; None leaves the manifest as it is.

    Raises:
        JobError: the array has no such group.
    """
    if name is None:
        return manifest
    names = [group.name for group in manifest.groups]
    if name not in names:
        known = ", ".join(names) if names else "none, as the array has no groups"
        raise JobError(OPTION, [f"expected {known}, got {name!r}"])
    own = tuple(group for group in manifest.groups if group.name == name)
    sources = manifest.job.get("light", {}).get("sources") or []
    light = manifest.job.get("light", {}) | {"sources": [source for source in sources if source.get("group") == name]}
    return replace(
        manifest,
        groups=own,
        background_images="",
        background_ambient=(0.0, 0.0, 0.0),
        job=manifest.job | {"light": light},
    )


def group_hint(manifest: Manifest) -> str:
    """Return how to export one group where the array has several; "" where it has not."""
    names = [group.name for group in manifest.groups]
    return f"; {OPTION} {' or '.join(names)} exports the light of one group" if len(names) > 1 else ""
