"""An OpenTimelineIO file beside a sequence of images, so that editing programs take it as one clip."""

import os
from pathlib import Path

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.errors import OutputError
from framearray_cli.base.extras import extra
from framearray_cli.base.files import require_new, whole_file

from .look import shot_label
from .timeline import Timeline


def otio_file(pattern: Path) -> Path:
    """Return the file beside a sequence: walk.otio beside walk.####.exr, frames/frames.otio beside frames/####.exr."""
    name = pattern.name.partition("#")[0].rstrip("._- ")
    return pattern.with_name(f"{name or os.path.basename(os.path.realpath(pattern.parent))}.otio")


def check_otio(target: Path, *, is_movie: bool, force: bool) -> None:
    """Refuse what cannot be described, or is there already.

    Args:
        target: pattern of the sequence, or a movie.

    Raises:
        OutputError: the target is a movie, or the file is there.
        MissingExtraError: OpenTimelineIO is not installed.
    """
    if is_movie:
        raise OutputError(f"{target}: --otio describes numbered images; expected a name such as frame.####.exr")
    with extra("--otio needs OpenTimelineIO", "[otio]"):
        import opentimelineio  # noqa: F401
    require_new(otio_file(target), force=force)


def write_otio(pattern: Path, line: Timeline, manifest: Manifest) -> None:
    """Write the file: one clip at the rate of the sequence; its metadata name the place of each frame in the array.

    Raises:
        OutputError: the system refuses to write.
    """
    import opentimelineio as otio

    before, _, after = pattern.name.partition("#")
    digits = pattern.name.count("#")
    rate, count = float(line.fps), len(line.shots)
    images = otio.schema.ImageSequenceReference(
        target_url_base="",  # beside this file
        name_prefix=before,
        name_suffix=after.lstrip("#"),
        start_frame=0,
        frame_step=1,
        rate=rate,
        frame_zero_padding=digits,
        available_range=otio.opentime.TimeRange(
            otio.opentime.RationalTime(0, rate), otio.opentime.RationalTime(count, rate)
        ),
    )
    target = otio_file(pattern)
    places = [shot_label(manifest, shot) for shot in line.shots]
    metadata = {"framearray": {"version": manifest.version, "array": manifest.name, "places": places}}
    clip = otio.schema.Clip(target.stem, media_reference=images, metadata=metadata)
    track = otio.schema.Track("pictures", children=[clip], kind=otio.schema.TrackKind.Video)
    timeline = otio.schema.Timeline(target.stem)
    timeline.tracks.append(track)
    text = otio.adapters.write_to_string(timeline, "otio_json")
    with whole_file(target) as part:
        part.write_text(text, encoding="utf-8")
