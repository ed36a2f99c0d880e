"""Limits of the system: invented control groups of both versions, and real limits of address space."""

import subprocess
import sys
from pathlib import Path

import pytest

from framearray_cli.base import memory
from framearray_cli.base.errors import LimitError
from framearray_cli.base.memory import available_cores, group_memory, require_address_space

resource = pytest.importorskip("resource")

HUGE = 9223372036854771712  # "no limit" in version 1


def group(folder: Path, limit: object, used: int, cached: int, *, version: int) -> None:
    names = ("memory.max", "memory.current", "") if version == 2 else (
        "memory.limit_in_bytes", "memory.usage_in_bytes", "total_"
    )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    (folder / names[0]).write_text(f"{limit}\n")
    (folder / names[1]).write_text(f"{used}\n")
    (folder / "memory.stat").write_text(f"anon 5\n{names[2]}inactive_file {cached}\ninactive_file 1\n")


def own(tmp_path: Path, *lines: str) -> Path:
    file = tmp_path / "self"
    file.write_text("".join(f"{line}\n" for line in lines))
    return file


def test_the_tightest_of_nested_groups_counts(tmp_path):
    (tmp_path / "cgroup.controllers").write_text("memory cpu")
    group(tmp_path / "pods/job", "max", 300, 10, version=2)
    group(tmp_path / "pods", 1000, 700, 50, version=2)
    assert group_memory(tmp_path, own(tmp_path, "0::/pods/job")) == 1000 - 700 + 50
    group(tmp_path / "pods/job", 320, 300, 10, version=2)
    assert group_memory(tmp_path, own(tmp_path, "0::/pods/job")) == 30
    group(tmp_path / "pods/job", 250, 300, 10, version=2)
    assert group_memory(tmp_path, own(tmp_path, "0::/pods/job")) == 0, "it may exceed its limit for a moment"


def test_in_a_container_the_group_is_the_root(tmp_path):
    (tmp_path / "cgroup.controllers").write_text("memory")
    group(tmp_path, 1000, 400, 0, version=2)
    assert group_memory(tmp_path, own(tmp_path, "0::/")) == 600


def test_groups_of_version_1(tmp_path):
    """Among groups of other controllers; and in a container, whose group has the name that it has on the host."""
    group(tmp_path / "memory", HUGE, 10**9, 0, version=1)
    group(tmp_path / "memory/docker/abc", 1000, 600, 100, version=1)
    lines = ("9:name=systemd:/x", "5:cpu,memory:/docker/abc", "3:cpuset:/", "0::/")
    assert group_memory(tmp_path, own(tmp_path, *lines)) == 500
    group(tmp_path / "memory", 2000, 1900, 0, version=1)
    assert group_memory(tmp_path, own(tmp_path, "5:memory:/elsewhere/abc")) == 100


def quota(folder: Path, *values: object) -> None:
    """Write a quota: one value as in version 2, two as in version 1."""
    folder.mkdir(parents=True, exist_ok=True)
    names = ("cpu.max",) if len(values) == 1 else ("cpu.cfs_quota_us", "cpu.cfs_period_us")
    for name, value in zip(names, values, strict=True):
        (folder / name).write_text(f"{value}\n")


@pytest.fixture
def many_cores(monkeypatch):
    monkeypatch.setattr(memory.os, "sched_getaffinity", lambda process: set(range(16)), raising=False)


@pytest.mark.parametrize(
    ("text", "cores"),
    [
        ("max 100000", 16),
        ("200000 100000", 2),
        ("200001 100000", 3),
        ("250000 100000", 3),
        ("1000 100000", 1),
        ("9900000 100000", 16),
        ("100000 0", 16),
        ("", 16),
    ],
)
def test_a_quota_of_cores_is_rounded_up(tmp_path, many_cores, text, cores):
    (tmp_path / "cgroup.controllers").write_text("memory cpu")
    quota(tmp_path / "job", text)
    assert available_cores(tmp_path, own(tmp_path, "0::/job")) == cores


def test_the_tightest_quota_of_nested_groups_counts(tmp_path, many_cores):
    (tmp_path / "cgroup.controllers").write_text("memory cpu")
    quota(tmp_path / "pods/job", "700000 100000")
    quota(tmp_path / "pods", "150000 50000")
    assert available_cores(tmp_path, own(tmp_path, "0::/pods/job")) == 3
    quota(tmp_path / "pods", "max 100000")
    assert available_cores(tmp_path, own(tmp_path, "0::/pods/job")) == 7
    quota(tmp_path, "400000 100000")
    assert available_cores(tmp_path, own(tmp_path, "0::/pods/job")) == 4


def test_quotas_of_version_1(tmp_path, many_cores):
    quota(tmp_path / "cpu", -1, 100000)
    quota(tmp_path / "cpu/docker/abc", 350000, 100000)
    lines = ("9:name=systemd:/x", "5:cpu,cpuacct:/docker/abc", "3:cpuset:/", "0::/")
    assert available_cores(tmp_path, own(tmp_path, *lines)) == 4
    quota(tmp_path / "cpu/docker/abc", -1, 100000)
    assert available_cores(tmp_path, own(tmp_path, *lines)) == 16
    quota(tmp_path / "cpu", 100000, 100000)
    assert available_cores(tmp_path, own(tmp_path, "5:cpu:/elsewhere/abc")) == 1


def test_cores_without_a_quota(tmp_path, monkeypatch, many_cores):
    assert available_cores(tmp_path, tmp_path / "missing") == 16
    monkeypatch.delattr(memory.os, "sched_getaffinity")
    for count, cores in ((8, 8), (None, 1)):
        monkeypatch.setattr(memory.os, "cpu_count", lambda count=count: count)
        assert available_cores(tmp_path, tmp_path / "missing") == cores


def test_view_and_verify_use_the_available_cores(tmp_path, monkeypatch):
    from framearray_cli.array import integrity as verifying
    from framearray_cli.cli.commands import verify, view
    from framearray_cli.tools.view import show as viewing

    seen = []

    def stop(*arguments):
        seen.append(arguments)
        raise LimitError("seen")

    monkeypatch.setattr(verify, "available_cores", lambda: 5)
    monkeypatch.setattr(view, "available_cores", lambda: 6)
    monkeypatch.setattr(verifying, "verify", stop)
    monkeypatch.setattr(viewing, "open_tiles", stop)
    for command in (verify.verify, view.view):
        with pytest.raises(LimitError, match="seen"):
            command(tmp_path)
    assert seen[0][1] == 5 and seen[1][2] == 6


def test_without_limits(tmp_path):
    assert group_memory(tmp_path, tmp_path / "missing") is None
    assert group_memory(tmp_path, own(tmp_path, "0::/")) is None
    assert group_memory(tmp_path, own(tmp_path, "3:cpuset:/")) is None


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not enforce limits of address space")
def test_free_memory_without_a_limit_is_that_of_the_machine(monkeypatch):
    monkeypatch.setattr(memory, "group_memory", lambda: None)
    monkeypatch.setattr(memory, "address_space", lambda: None)
    assert memory.free_memory() > 2**20
    monkeypatch.setattr(memory, "group_memory", lambda: 5)
    assert memory.free_memory() == 5


def test_free_memory_is_what_the_limit_of_address_space_leaves():
    code = (
        "import resource; from framearray_cli.base.memory import free_memory; a = free_memory();"
        "resource.setrlimit(resource.RLIMIT_AS, (3 << 30,) * 2); b = free_memory();"
        "kept = bytearray(1 << 30); print(a, b, b - free_memory())"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    without, with_limit, less = map(int, run.stdout.split())
    assert without > 3 << 30 > with_limit > 1 << 30
    assert less == pytest.approx(1 << 30, rel=0.01)


@pytest.mark.parametrize(("name", "flag"), [("RLIMIT_AS", "-v"), ("RLIMIT_DATA", "-d")])
def test_too_little_address_space_is_reported_beforehand(name, flag, monkeypatch):
    monkeypatch.setattr(memory.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(memory, "_limits", lambda: {name: 2**28 + 1})
    with pytest.raises(LimitError, match=rf"^`ulimit {flag}` lets this program have 0.25 GiB; it needs") as error:
        require_address_space({"RLIMIT_AS": 2**29, "RLIMIT_DATA": 2**29})
    assert error.value.exit_code == 2
    require_address_space({name: 2**28})
    monkeypatch.setattr(memory.os, "cpu_count", lambda: 4)
    with pytest.raises(LimitError, match=r"0\.41 GiB"):  # a quarter, and 2 * 80 MiB
        require_address_space({name: 2**28})


def test_infinite_limits_are_no_limits():
    soft = {name: resource.getrlimit(getattr(resource, name))[0] for name in memory.ULIMIT}
    assert set(memory._limits()) == {name for name, value in soft.items() if value != resource.RLIM_INFINITY}
