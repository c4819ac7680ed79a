# SPDX-License-Identifier: GPL-3.0-or-later
"""What is installed: the pins that people edit, the hashes that are made of them, the ranges that are promised."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).resolve().parents[1]
KINDS = ("requirements", "requirements-cluster", "requirements-dev")


def pins(kind: str) -> list[Requirement]:
    """What a .in file names, less the files that it takes in."""
    lines = (ROOT / f"{kind}.in").read_text(encoding="utf-8").splitlines()
    return [Requirement(line) for line in lines if line and line[0] not in "#-"]


def locked(kind: str) -> dict[str, list[str]]:
    """The files' hashes by what is installed, as "name==version"."""
    text = (ROOT / f"{kind}.txt").read_text(encoding="utf-8").replace("\\\n", " ")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return {line.split()[0]: re.findall(r"--hash=sha256:([0-9a-f]{64})", line) for line in lines}


@pytest.mark.parametrize("kind", KINDS)
def test_each_pin_is_locked_and_all_is_by_hashes(kind: str) -> None:
    found = locked(kind)
    wanted = {f"{pin.name}{pin.specifier}" for pin in pins(kind)}
    assert wanted <= set(found), "edited without make lock"
    assert all(re.fullmatch(r"[a-z0-9.-]+==\S+", name) for name in found), "each of one version, from no address"
    assert all(found.values()), "each by hashes"
    assert all(len(set(found[f"bpy=={version}"])) >= 3 for version in ("4.5.15", "5.2.3")), "for every system"


def test_the_three_agree_and_the_larger_hold_the_smaller() -> None:
    small, middle, large = map(locked, KINDS)
    assert small.items() <= middle.items() <= large.items()


def test_the_ranges_hold_what_is_tested() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    ranges = [*project["dependencies"], *(name for part in project["optional-dependencies"].values() for name in part)]
    tested = pins("requirements") + pins("requirements-cluster")
    evidence = {Requirement(each).name for each in project["optional-dependencies"]["evidence"]}
    tested += [pin for pin in pins("requirements-dev") if pin.name in evidence]
    assert {Requirement(each).name for each in ranges} == {pin.name for pin in tested}
    for each in map(Requirement, ranges):
        same = [pin for pin in tested if pin.name == each.name and (not each.marker or pin.marker == each.marker)]
        versions = [next(iter(pin.specifier)).version for pin in same]
        assert versions and all(version in each.specifier for version in versions)
        assert any(part.operator in ("<", "==") for part in each.specifier), "nothing newer is promised"


def test_the_pinned_build_is_the_one_that_builds_in_tests() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (build,) = project["build-system"]["requires"]
    assert build in {f"{pin.name}{pin.specifier}" for pin in pins("requirements-dev")}


def test_the_pythons_that_are_promised_have_a_bpy() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    promised = SpecifierSet(project["requires-python"])
    found = [minor for minor in range(8, 20) if f"3.{minor}.9" in promised]
    blender = [Requirement(each) for each in project["optional-dependencies"]["blender"]]
    markers = [each.marker for each in blender if each.marker]
    environments = {minor: {"python_version": f"3.{minor}"} for minor in range(8, 20)}
    with_bpy = [minor for minor, each in environments.items() if any(marker.evaluate(each) for marker in markers)]
    assert found == with_bpy == [11, 13]
