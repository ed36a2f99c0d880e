"""Export a frame array to other tools: nerfstudio, COLMAP, RTI, and sets for learning."""

# Each format, in the order of help and messages: the module next to this file that writes it, and its `Format` there.
FORMATS = {
    "nerfstudio": "nerf.NERFSTUDIO",
    "colmap": "colmap.COLMAP",
    "rti": "onelight.RTI",
    "blender": "nerf.BLENDER",
    "olat": "onelight.OLAT",
    "huggingface": "datasets.HUGGING_FACE",
}
EXPORT_KINDS = tuple(FORMATS)
