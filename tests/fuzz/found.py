"""Defects that broken input revealed, for the page: the old behaviour, the present one, and its test."""

FOUND: tuple[tuple[str, str, str], ...] = (
    (
        "A name of more than 255 letters, in a job or on the command line: a traceback while looking it up",
        "a message; names in a job have at most 1000 letters",
        "cli/test_long_names.py",
    ),
    ("`samples.hits = inf`, or of 400 digits: a traceback", "a message", "job/test_read.py"),
    ("Numbers of more than 308 digits in a manifest or a path: a traceback", "a message", "array/test_manifest.py"),
    (
        "4 MB of unknown keys: a minute and more",
        "3 s: a message lists 50 problems and counts the rest",
        "job/test_read.py",
    ),
    ("A key of 100,000 parts, `x.a.a.a...`: all memory of the machine", "a message", "job/test_read.py"),
    ("A key of 5000 letters: a message of the same length", "a key in a message has at most 100", "job/test_read.py"),
    ("Likewise the name of a material", "likewise", "cli/test_messages.py"),
    (
        "A manifest with such a key: 13 s; one with a key of 100,000 letters: a message of the same length",
        "as in a job",
        "array/test_manifest.py",
    ),
    ("A rate near 0 in a manifest: a division by zero", "a message", "array/test_manifest.py"),
    (
        "A file of zeros in place of an EXR: every reader of OpenImageIO tried it, for 10 s and more",
        "a message at once: a file must begin as its name says",
        "array/images/test_images.py",
    ),
    (
        "A PNG beyond 179 million pixels, which a job may ask for: a traceback",
        "it is read",
        "array/images/test_images.py",
    ),
    ("A PNG of 2 KB that claims 60,000 x 60,000 pixels: a traceback", "a message", "array/images/test_images.py"),
    (
        "A pipe or a device in place of an image, a manifest or a record: no end",
        "a message",
        "scene/files/test_untrusted.py",
    ),
    (
        "Records whose checksums are right and whose content is not: tracebacks; 10^12 light positions: no end; files "
        "elsewhere were read",
        "such a line does not count",
        "scene/files/test_untrusted.py",
    ),
    (
        "`--restart` with a link in the folder, and a manifest that names files through it: those files were removed",
        "a message, and nothing is removed",
        "cli/test_render.py",
    ),
    ("Standard errors of images beyond 1e19: an overflow, with a warning", "right", "scene/files/test_untrusted.py"),
    (
        'An obscurance range of 1e-45 with `ambient.method = "fit"`: an overflow, with a warning',
        "right",
        "cli/test_render.py",
    ),
    (
        "Escape sequences in the names of files and materials: the terminal obeyed them",
        "they are shown",
        "cli/test_messages.py",
    ),
    ('"51 problems" where there were 3000', "3,000 problems", "cli/test_messages.py"),
    ("A million instances of a mesh: a minute, one after the other", "1 s", "scene/files/test_gltf_triangles.py"),
    (
        "Half of a letter (`\\ud800`) in the name of a material: a traceback when the manifest was written",
        "it is replaced",
        "scene/files/test_gltf_triangles.py",
    ),
    (
        "Values of options, and keys of movie paths, of 5000 letters: messages of the same length",
        "at most 100 of them",
        "cli/test_navigation.py",
    ),
)
