"""`framearray schema`."""

from ..screen import print_result


def schema() -> None:
    """Print the JSON Schema of job files, for editors that complete and check them."""
    import json

    from framearray_cli.job.schema import job_schema

    print_result(json.dumps(job_schema(), indent=2).splitlines())
