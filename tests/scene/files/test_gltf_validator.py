"""Our own glTF files by the Khronos glTF-Validator, where it is installed.

npm install --prefix FOLDER gltf-validator;  NODE_PATH=FOLDER/node_modules make test
"""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from fuzz.sceneseeds import rich_glb
from support import ROOT, tiny

NODE = shutil.which("node")
SCRIPT = """
const validator = require("gltf-validator"), fs = require("fs");
async function main() {
  const found = {};
  for (const file of process.argv.slice(1)) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), { maxIssues: 0 });
    found[file] = report.issues.messages.filter((issue) => issue.severity === 0);
  }
  console.log(JSON.stringify(found));
}
main();
"""
# What the seed of fuzzing has wrong on purpose, since readers meet it: attributes that are not aligned, numbers of
# texture coordinates with a gap, bounds that a sparse corner leaves, morph targets and skins without their data,
# extensions that are not declared.
ON_PURPOSE = {
    "ACCESSOR_ELEMENT_OUT_OF_MAX_BOUND",
    "ACCESSOR_MAX_MISMATCH",
    "ANIMATION_SAMPLER_INPUT_ACCESSOR_WITHOUT_BOUNDS",
    "MESH_PRIMITIVE_ACCESSOR_UNALIGNED",
    "MESH_PRIMITIVE_ACCESSOR_WITHOUT_BYTESTRIDE",
    "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT",
    "MESH_PRIMITIVE_INDEXED_SEMANTIC_CONTINUITY",
    "MESH_PRIMITIVE_POSITION_ACCESSOR_WITHOUT_BOUNDS",
    "NODE_SKIN_WITH_NON_SKINNED_MESH",
    "UNDECLARED_EXTENSION",
}


def errors(*files: Path) -> dict[str, list[dict[str, Any]]]:
    """Return the errors of files by their names; skip where the validator is missing."""
    if NODE is None:
        pytest.skip("node is not installed")
    command = [NODE, "-e", SCRIPT, *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if "Cannot find module" in done.stderr:
        pytest.skip("gltf-validator is not installed (npm install --prefix FOLDER gltf-validator, with NODE_PATH)")
    assert done.returncode == 0, done.stderr
    found: dict[str, list[dict[str, Any]]] = json.loads(done.stdout)
    return {Path(file).name: issues for file, issues in found.items()}


def test_scenes_of_jobs_are_valid() -> None:
    found = errors(*sorted((ROOT / "jobs/scenes").glob("*.glb")))
    assert len(found) == 4 and not any(found.values()), found


def test_files_of_tests_are_valid_but_for_what_is_wrong_on_purpose(tmp_path: Path) -> None:
    room, rich = tiny.save_glb(tiny.room_meshes(), tmp_path / "room.glb"), tmp_path / "rich.glb"
    rich_glb(tmp_path)
    found = errors(room, rich)
    assert found["room.glb"] == []
    assert {issue["code"] for issue in found["rich.glb"]} == ON_PURPOSE


def test_faults_are_seen(tmp_path: Path) -> None:
    room = tiny.save_glb(tiny.room_meshes(), tmp_path / "room.glb")
    room.write_bytes(room.read_bytes().replace(b'"VEC3"', b'"VEC9"', 1))
    assert errors(room)["room.glb"]
