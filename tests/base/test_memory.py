"""Limits of the system: invented control groups of both versions."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from framearray_cli.base import memory
from framearray_cli.base.errors import OutputError
from framearray_cli.base.memory import available_cores, group_memory

HUGE = 9223372036854771712  # "no limit" in version 1


def group(folder: Path, limit: object, used: int, cached: int, *, version: int) -> None:
    names = ("memory.max", "memory.current", "") if version == 2 else (
        "memory.limit_in_bytes", "memory.usage_in_bytes", "total_"
    )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    (folder / names[0]).write_text(f"{limit}\n")
    (folder / names[1]).write_text(f"{used}\n")
    (folder / "memory.stat").write_text(f"anon 5\n{names[2]}inactive_file {cached}\ninactive_file 1\n")


@pytest.fixture(autouse=True)
def _groups_of_a_test(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "ROOT", tmp_path)
    monkeypatch.setattr(memory, "OWN", tmp_path / "self")


def memory_in(*lines: str) -> int | None:
    """Bytes that are left in groups of these names."""
    memory.OWN.write_text("".join(f"{line}\n" for line in lines))
    return group_memory()


def cores_in(*lines: str) -> int:
    memory.OWN.write_text("".join(f"{line}\n" for line in lines))
    return available_cores()


def test_the_tightest_of_nested_groups_counts(tmp_path):
    (tmp_path / "cgroup.controllers").write_text("memory cpu")
    group(tmp_path / "pods/job", "max", 300, 10, version=2)
    group(tmp_path / "pods", 1000, 700, 50, version=2)
    assert memory_in("0::/pods/job") == 1000 - 700 + 50
    group(tmp_path / "pods/job", 320, 300, 10, version=2)
    assert memory_in("0::/pods/job") == 30
    group(tmp_path / "pods/job", 250, 300, 10, version=2)
    assert memory_in("0::/pods/job") == 0, "it may exceed its limit for a moment"


def test_in_a_container_the_group_is_the_root(tmp_path):
    (tmp_path / "cgroup.controllers").write_text("memory")
    group(tmp_path, 1000, 400, 0, version=2)
    assert memory_in("0::/") == 600


def test_groups_of_version_1(tmp_path):
    """Among groups of other controllers; and in a container, whose group has the name that it has on the host."""
    group(tmp_path / "memory", HUGE, 10**9, 0, version=1)
    group(tmp_path / "memory/docker/abc", 1000, 600, 100, version=1)
    lines = ("9:name=systemd:/x", "5:cpu,memory:/docker/abc", "3:cpuset:/", "0::/")
    assert memory_in(*lines) == 500
    group(tmp_path / "memory", 2000, 1900, 0, version=1)
    assert memory_in("5:memory:/elsewhere/abc") == 100


def quota(folder: Path, *values: object) -> None:
    """Write a quota: one value as in version 2, two as in version 1."""
    folder.mkdir(parents=True, exist_ok=True)
    names = ("cpu.max",) if len(values) == 1 else ("cpu.cfs_quota_us", "cpu.cfs_period_us")
    for name, value in zip(names, values, strict=True):
        (folder / name).write_text(f"{value}\n")


@pytest.fixture
def many_cores(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(16)), raising=False)


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
    assert cores_in("0::/job") == cores


def test_the_tightest_quota_of_nested_groups_counts(tmp_path, many_cores):
    (tmp_path / "cgroup.controllers").write_text("memory cpu")
    quota(tmp_path / "pods/job", "700000 100000")
    quota(tmp_path / "pods", "150000 50000")
    assert cores_in("0::/pods/job") == 3
    quota(tmp_path / "pods", "max 100000")
    assert cores_in("0::/pods/job") == 7
    quota(tmp_path, "400000 100000")
    assert cores_in("0::/pods/job") == 4


def test_quotas_of_version_1(tmp_path, many_cores):
    quota(tmp_path / "cpu", -1, 100000)
    quota(tmp_path / "cpu/docker/abc", 350000, 100000)
    lines = ("9:name=systemd:/x", "5:cpu,cpuacct:/docker/abc", "3:cpuset:/", "0::/")
    assert cores_in(*lines) == 4
    quota(tmp_path / "cpu/docker/abc", -1, 100000)
    assert cores_in(*lines) == 16
    quota(tmp_path / "cpu", 100000, 100000)
    assert cores_in("5:cpu:/elsewhere/abc") == 1


def test_cores_without_a_quota(monkeypatch, many_cores):
    assert available_cores() == 16
    monkeypatch.delattr(os, "sched_getaffinity")
    for count, cores in ((8, 8), (None, 1)):
        monkeypatch.setattr(os, "cpu_count", lambda count=count: count)
        assert available_cores() == cores


def test_view_and_verify_use_the_available_cores(tmp_path, monkeypatch):
    from framearray_cli.array import integrity as verifying
    from framearray_cli.cli.commands import verify, view
    from framearray_cli.tools.view import show as viewing

    seen = []

    def stop(*arguments):
        seen.append(arguments)
        raise OutputError("seen")

    monkeypatch.setattr(verify, "available_cores", lambda: 5)
    monkeypatch.setattr(view, "available_cores", lambda: 6)
    monkeypatch.setattr(verifying, "verify", stop)
    monkeypatch.setattr(viewing, "open_tiles", stop)
    for command in (verify.verify, view.view):
        with pytest.raises(OutputError, match="seen"):
            command(tmp_path)
    assert seen[0][1] == 5 and seen[1][2] == 6


def test_without_limits():
    assert group_memory() is None
    assert memory_in("0::/") is None
    assert memory_in("3:cpuset:/") is None


def test_free_memory_is_that_of_the_machine_or_of_the_group(monkeypatch):
    monkeypatch.setattr(memory, "group_memory", lambda: None)
    assert memory.free_memory() > 2**20
    monkeypatch.setattr(memory, "group_memory", lambda: 5)
    assert memory.free_memory() == 5


def test_what_is_free_is_scarce_over_what_is_held_and_not_over_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "group_memory", lambda: 2**30)
    assert not memory.is_scarce(2**31)
    assert memory.is_scarce(2**34)


def test_swap_is_free_but_no_reason_to_keep_what_others_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "group_memory", lambda: None)
    monkeypatch.setattr("psutil.virtual_memory", lambda: SimpleNamespace(available=2**27))
    monkeypatch.setattr("psutil.swap_memory", lambda: SimpleNamespace(free=2**33))
    assert memory.free_memory() == 2**27 + 2**33
    assert memory.free_memory(swap=False) == 2**27
    assert memory.is_scarce(2**31)
