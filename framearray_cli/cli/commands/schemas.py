"""`framearray schema`."""

from typing import Annotated, Any

import typer

from .. import options as opt
from ..screen import print_result

KINDS = ("job", "path", "manifest", "results")


def schema(
    kind: Annotated[
        str,
        typer.Argument(
            help="Kind of file: job, path (of `assemble`), manifest, or results (of `--json`).", **opt.choice(*KINDS)
        ),
    ] = "job",
) -> None:
    """Print a JSON Schema, for editors that complete and check files, and for programs that read them."""
    import json

    print_result(json.dumps(make_schema(kind), indent=2, ensure_ascii=False).splitlines())


def make_schema(kind: str) -> dict[str, Any]:
    """Make one of the published schemas; `kind` is one of `KINDS`."""
    if kind == "results":
        from ..document import results_schema

        return results_schema()
    if kind == "manifest":
        from framearray_cli.array.manifest_toml import manifest_schema

        return manifest_schema()
    if kind == "path":
        from framearray_cli.base.forms.schema import published_schema
        from framearray_cli.tools.movie.pathfile import MoviePath

        return published_schema(MoviePath, "framearray movie path")
    from framearray_cli.job.job import job_schema

    return job_schema()
