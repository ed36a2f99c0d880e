"""The size of an array from its job file only: no scene is read, and no ray cast."""

from framearray_cli.job.job import Job

# Bytes per pixel of an image, about. Those that compress vary by half: noise and textures take more.
BYTES = {"exr": 6.0, "png": 1.7, "tif": 12.0, "jpg": 0.4}
COMPRESSED = 0.6  # of an EXR
LAYER_BYTES = 18.0  # of the layers of a camera position
SUN_BYTES = 2.0  # of the hours of sun of a day
# Of an alpha channel by format, of positions, texture coordinates, and mattes.
ALPHA_BYTES = {"exr": 2.0, "png": 0.2, "tif": 4.0, "jpg": 0.0}
MARK_BYTES = {"position": 8.0, "uv": 5.0, "mattes": 6.0}


def images_per_camera(job: Job) -> int:
    """Return the number of images of a camera position: light positions, and with groups the light besides them."""
    if not job.light.groups:
        return job.light.frames
    return sum(group.n for group in job.light.groups) + unlit_images(job)


def unlit_images(job: Job) -> int:
    """Return the number of images of a camera position, in an array with groups, at which no source shines."""
    return 1 + any(job.scene.background)


def rough_bytes(job: Job) -> float:
    """Return the size of all files, to a factor of 2 or so."""
    output, (width, height) = job.output, job.camera.resolution
    each = BYTES[output.format]
    if output.format == "exr":
        each *= (COMPRESSED if output.compression != "none" else 1.0) * (2.0 if output.half == "never" else 1.0)
    each += ALPHA_BYTES[output.format] * bool(output.alpha)
    marks = sum(MARK_BYTES[name] for name, wanted in output.aov.items() if wanted)
    days = len(job.sun_days)
    frame = each * images_per_camera(job) + LAYER_BYTES * output.layers + marks + SUN_BYTES * (days + bool(days))
    return width * height * frame * job.camera.frames
