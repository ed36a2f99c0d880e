"""docs/quality/readers.md, from the results of a run."""

from bench.core.markdown import grid
from bench.core.results import ROOT, Table

from .readers import READERS

PAGE = ROOT / "docs" / "quality" / "readers.md"
HEAD = """
# Readers, led by coverage

`make fuzz-readers` feeds files to each reader in one process: [Atheris](https://github.com/google/atheris) sees which
branches of the program a file reaches, and goes on from files that reach new ones, half of the time with mutations of
its own, half with those of [Broken input](fuzzing.md). A reader may return or refuse, with an error that names the
file; any other exception, a warning of a library, a crash, more than 20 s or 4 GB is a finding.

*Seeds*: whole files that the project makes, and the corpus of earlier runs. *Files*: what reached something new, before
the least ones are kept in `tests/fuzz/corpus/`, which `make test` reads. *Coverage*: branches and functions of the
program that seeds reach, and those that all files reach. *Stops*: processes that a finding or a limit ended.
"""
FOUND = """
## What was found

- An EXR that is damaged in a name: OpenImageIO quotes the name in its message, which is no text then, and reading the
  message raised an exception, in two places. A message says what is damaged.
- An array of light positions with a header as of Python 2, or with values that are no numbers: numpy warned. Headers
  are read without a word, and rows without numbers are refused with their number.
- A quaternion of COLMAP with numbers near the end of the range of floats: numpy warned of an overflow. Quaternions and
  matrices of any length are poses.
- A USD file whose camera has a transform of a wrong type: it was read well, and its animation raised an exception of
  the library. It is one error that names the file. The six minutes in which it was found count in no row.
- Binary USD files that claim more than they hold: usd-core took up to 8 GB for 6 kB, and half a minute. Counts of
  sections are compared with their lengths before the library sees the file.

The files are in the corpus or in tests, but for those that stop a process. Stops of the kinds without USD were of the
fuzzer itself: a mutation of its own ran out of memory or too deep. Those of `usdc` and `usdz` are of usd-core 26.11: by
counts of sections before that check, after it by counts of single arrays, for which the library takes gigabytes before
it refuses them, and in some files by an end of the process inside the library. A service that reads files of strangers
should read USD in a process that may end.

Images, textures, Draco and 3MF are unpacked by OpenImageIO, Pillow, DracoPy, lxml and networkx; the coverage counts
only what is ours around them. Files of 3MF are fuzzed as the XML in their archive. In `texture tiff` files of a hundred
bytes claim 8 x 3,014,657 pixels: Pillow reads what is missing as black, within the memory that the scene may take. One
took 25 s, as smaller copies of textures with an odd number of rows were made row by row; it takes 5 s now, and such
files leave time for few runs.

Another 7,161,734 runs of all 40 kinds in November 2026, which started from the corpus, found that file, and a material
library that repeats a texture 3.5e38 times: numpy printed a warning, as float32 does not hold the coordinates. They
are held within 1e30 now. The last 2,510,466 of these runs, in 53 minutes, found nothing. The table does not count them.
"""


def write(table: Table) -> None:
    """Write the page from the figures of all kinds."""
    names = ("runs", "seeds", "files", "first", "last", "found", "stops")
    rows = [
        (kind, f"{found['seconds'] / 60:.1f}", *(f"{found[name]:,}" for name in names))
        for kind, found in ((kind, table[kind]) for kind in READERS if kind in table)
    ]
    sums = [sum(found[name] for found in table.values()) for name in ("runs", "files", "found")]
    minutes = sum(found["seconds"] for found in table.values()) / 60
    text = (
        f"{minutes:.0f} minutes: {sums[0]:,} runs, {sums[1]:,} files that reached something new, {sums[2]:,} findings."
    )
    head = ("", "min", "runs", "seeds", "files", "coverage of seeds", "of all", "findings", "stops")
    PAGE.write_text("\n\n".join([HEAD.strip(), text, grid(head, rows), FOUND.strip()]) + "\n", encoding="utf-8")
