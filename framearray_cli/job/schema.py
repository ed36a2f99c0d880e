"""JSON Schema of the job file, for editors."""

from framearray_cli.base.forms.schema import Schema, published_schema

from .job import Job


def job_schema() -> Schema:
    """Make the JSON Schema (2020-12) of the job file, for editors."""
    return published_schema(Job, "framearray job")
