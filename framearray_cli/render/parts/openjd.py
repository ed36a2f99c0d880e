"""An Open Job Description template that renders a job in chunks on a farm.

Specification 2023-09 with the extension TASK_CHUNKING, which farms and openjd-cli understand. It is JSON, which YAML
readers read too.
"""

import json
from pathlib import Path
from typing import Any

from framearray_cli.array.places import frames_text
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import write_bytes
from framearray_cli.base.units import MOST_THREADS, counted
from framearray_cli.job.job import Job

SUFFIXES = (".json", ".yaml", ".yml")  # by which readers recognize the format

# Seconds after which a farm gives up: no chunk should take a day, and no verification four hours.
LONGEST_CHUNK, LONGEST_VERIFY = 24 * 3600, 4 * 3600
# Seconds from the signal that ends a chunk to the one that kills it. A render stops within about one second.
NOTICE = 30


def template(job: Job, job_file: Path, folder: Path, chunk: int, threads: int | None) -> dict[str, Any]:
    """Return a template of two steps: render the chunks, then verify every file.

    Args:
        folder: of the template; paths in it are relative to the template, so that both can be moved together.
        chunk: most frames per chunk.
        threads: per chunk; None: all of the machine.
    """
    memory = job.render.memory
    needs = [{"name": "amount.worker.vcpu", "min": threads}] if threads else []
    needs += [{"name": "amount.worker.memory", "min": -(-memory // 2**20)}] if memory else []
    render = ["render", "{{Param.JobFile}}", "--output", "{{Param.OutputFolder}}"]
    render += ["--cameras", "{{Task.Param.Cameras}}"]
    render += ["--threads", "{{Param.Threads}}"] if threads else []
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": job.name,
        "description": (
            f"The frame array {job.name}: {counted(job.camera.frames, 'camera position')}, rendered in chunks of the "
            "path. Each also traces the hits of its halo, N_r frames on either side. All machines must see the job "
            "file, the scene and the output folder. A chunk that was stopped goes on where it was when it is run again."
        ),
        "parameterDefinitions": _parameters(job, job_file, folder, chunk, threads),
        "jobEnvironments": [{"name": "Progress", "variables": {"FRAMEARRAY_PROGRESS": "openjd"}}],
        "steps": [
            {
                "name": "Render",
                "description": "Renders one chunk of the camera path.",
                "parameterSpace": {
                    "taskParameterDefinitions": [
                        {
                            "name": "Cameras",
                            "type": "CHUNK[INT]",
                            "range": frames_text(range(job.camera.frames)),
                            "chunks": {
                                "defaultTaskCount": "{{Param.ChunkSize}}",
                                "rangeConstraint": "CONTIGUOUS",
                            },
                        }
                    ]
                },
                **({"hostRequirements": {"amounts": needs}} if needs else {}),
                "script": {"actions": {"onRun": _action(render, LONGEST_CHUNK)}},
            },
            {
                "name": "Verify",
                "description": "Compares every file with its checksum; fails if one is missing or damaged.",
                "dependencies": [{"dependsOn": "Render"}],
                "script": {"actions": {"onRun": _action(["verify", "{{Param.OutputFolder}}"], LONGEST_VERIFY)}},
            },
        ],
    }


def _action(arguments: list[str], timeout: int) -> dict[str, Any]:
    return {
        "command": "framearray",
        "args": arguments,
        "timeout": timeout,
        "cancelation": {"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": NOTICE},
    }


def _parameters(job: Job, job_file: Path, folder: Path, chunk: int, threads: int | None) -> list[dict[str, Any]]:
    """Return the parameters that can be changed when the template is submitted."""

    def number(name: str, value: int, most: int, description: str) -> dict[str, Any]:
        bounds = {"default": value, "minValue": 1, "maxValue": most}
        return {"name": name, "type": "INT", **bounds, "description": description}

    def path(name: str, place: Path, description: str, **more: str) -> dict[str, Any]:
        place, base = place.absolute(), folder.absolute()
        default = place.relative_to(base).as_posix() if place.is_relative_to(base) else str(place)
        return {"name": name, "type": "PATH", **more, "default": default, "description": description}

    into = {"objectType": "FILE", "dataFlow": "IN"}
    return [
        path("JobFile", job_file, "What to render.", **into),
        path(
            "SceneFile", job.scene.file,
            "The scene that the job file names; here so that a farm which copies files takes it along.", **into,
        ),
        path(
            "OutputFolder", job.output.directory, "One folder for all chunks.",
            objectType="DIRECTORY", dataFlow="OUT",
        ),
        number("ChunkSize", chunk, job.camera.frames, "Camera positions per chunk."),
        *([number("Threads", threads, MOST_THREADS, "Threads of each chunk.")] if threads else []),
    ]  # fmt: skip


def write_template(target: Path, made: dict[str, Any]) -> None:
    """Write a template, whole or not at all.

    Raises:
        OutputError: the file has another suffix, or cannot be written.
    """
    if target.suffix.lower() not in SUFFIXES:
        raise OutputError(f"{target}: expected a name that ends in {', '.join(SUFFIXES)}")
    write_bytes(target, (json.dumps(made, indent=2, ensure_ascii=False) + "\n").encode())
