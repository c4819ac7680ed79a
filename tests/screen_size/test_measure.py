# SPDX-License-Identifier: GPL-3.0-or-later
"""Screen sizes: of copies, of worse and worse LODs, and the numbers that engines take."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fmqm_addon.metric.errors import MeshError, SettingsError
from fmqm_addon.metric.texture import Material, PlainColor, Texture
from fmqm_addon.screen_size.definition import FADE, FIRST_RENDER, SIZES, STRICT, Limits
from fmqm_addon.screen_size.engines import ENGINES, Extent, Level, Screen, chain, distance, numbers, pasteable
from fmqm_addon.screen_size.measure import AtSize, ScreenSizes, Switch, switch
from fmqm_addon.screen_size.records import size_record
from tests.metric.meshes import ImageAlpha, cube, mesh_arrays, shaken, sphere, surface, texture


def curve(*differences: float) -> list[AtSize]:
    """With these D under STRICT, from the smallest size on, in two views."""
    return [
        AtSize(size, np.full((2, 2), difference * STRICT.flip), np.zeros((2, 2)))
        for size, difference in zip(SIZES, differences, strict=False)
    ]


def test_the_switch_is_between_the_last_size_that_passes_and_the_first_that_fails() -> None:
    assert switch(curve(0.5, 1.5), STRICT) == Switch(pytest.approx(math.sqrt(16 * 32)), "", 0)
    assert switch(curve(0.2, 1.0, 1.5), STRICT).pixels == pytest.approx(32)
    assert switch(curve(0.2, 1.2, 0.5, 0.6, 0.7, 0.8), STRICT).pixels < 32, "what fails once has failed"
    assert switch(curve(1.2), STRICT) == Switch(16, "below", 0)
    assert switch(curve(*[0.1] * 6), STRICT) == Switch(512, "at least", 0)
    assert switch(curve(1.2), FADE).pixels == 16 and switch(curve(1.2, 1.5), FADE).pixels > 16


def test_the_difference_is_of_the_worse_condition_and_the_worse_measure() -> None:
    each = AtSize(64, np.array([[0.01, 0.03], [0.04, 0.0]]), np.array([[0.0, 0.2], [0.0, 0.0]]))
    assert each.difference(Limits(flip=0.02, ssim=10)) == pytest.approx(1)
    assert each.difference(Limits(flip=10, ssim=0.1)) == pytest.approx(1)
    assert each.worst_view(Limits(flip=0.02, ssim=10)) == (0, pytest.approx(2))


def test_a_copy_lasts_for_ever_and_a_worse_mesh_ends_sooner() -> None:
    reference = mesh_arrays(sphere(), (texture(0, 64),))
    sizes = ScreenSizes(reference)
    sizes.prepare().run()
    same = sizes.measure(reference).run()
    assert same.strict.label == "at least 512" and all(each.difference(STRICT) < 1e-5 for each in same.curve)
    found = [sizes.measure(shaken(reference, amount)).run() for amount in (0.004, 0.02, 0.1)]
    strict = [each.strict.pixels for each in found]
    assert strict == sorted(strict, reverse=True) and strict[0] > strict[-1]
    assert all(each.fade.pixels >= each.strict.pixels for each in found)
    assert found[-1].curve[-1].size < FIRST_RENDER, "what fails early is not rendered larger"


def test_a_repainted_mesh_fails_and_own_normals_are_seen() -> None:
    reference = mesh_arrays(sphere())
    sizes = ScreenSizes(reference)
    sizes.prepare().run()
    repainted = mesh_arrays(sphere(), (PlainColor((0.2, 0.4, 0.8)),))
    assert sizes.measure(repainted).run().strict.bound == "below"
    vertices, triangles = sphere()
    flat = np.cross(*(vertices[triangles[:, k]] - vertices[triangles[:, 0]] for k in (1, 2)))
    faceted = replace(reference, normals=np.repeat(flat[:, None], 3, axis=1))
    assert sizes.measure(faceted).run().strict.bound != "at least"


def test_what_cannot_be_measured_is_one_line() -> None:
    with pytest.raises(SettingsError, match="views is 7"):
        ScreenSizes(mesh_arrays(cube()), 7)
    with pytest.raises(MeshError, match="no faces"):
        ScreenSizes(mesh_arrays((np.zeros((3, 3)), np.zeros((0, 3), int)))).prepare().run()
    sizes = ScreenSizes(mesh_arrays(cube()))
    sizes.prepare().run()
    elsewhere = replace(mesh_arrays(cube()), positions=cube()[0] + 1e6)
    assert sizes.measure(elsewhere).run().strict.bound == "below", "nothing of it is on the image"


def test_a_chain_only_gets_smaller_and_says_what_has_no_place() -> None:
    names = ["a", "b", "c", "d", "e"]
    levels = chain(names, [Switch(90, "", 0), Switch(100, "", 0), None, Switch(40, "", 0), Switch(16, "below", 0)])
    assert [level.pixels for level in levels] == [None, 100, None, 40, None]
    assert [level.why for level in levels] == [
        "b, which comes after it, may be shown as early", "", "it could not be measured", "",
        "it differs too much even at 16 px",
    ]  # fmt: skip


EXTENT = Extent(diagonal=2.0, side=1.5, radius=0.9)
LEVELS = (Level(1, "fine", 200.0), Level(2, "useless", None, "why"), Level(3, "coarse", 50.0))


def values(engine: str, **screen: float) -> list[dict[str, float]]:
    return numbers(engine, LEVELS, EXTENT, Screen(**screen))  # type: ignore[arg-type]


def test_the_numbers_of_engines() -> None:
    """By hand: 1080 high, 1920 wide, 60 degrees."""
    far = 2 * 1080 / (2 * 50 * math.tan(math.radians(30)))
    assert distance(50, EXTENT, Screen()) == pytest.approx(far)
    unity = [each["screenRelativeTransitionHeight"] for each in values("unity", lod_bias=2)]
    assert unity == pytest.approx([2 * 0.75 * 200 / 1080, 2 * 0.75 * 50 / 1080, 0])
    assert [each["ScreenSize"] for each in values("unreal")] == pytest.approx([1, 0.9 * 200 / 1080, 0.9 * 50 / 1080])
    godot = values("godot")
    assert [each["visibility_range_begin"] for each in godot] == pytest.approx([0, far / 4, far])
    assert [each["visibility_range_end"] for each in godot] == pytest.approx([far / 4, far, 0])
    assert godot[1]["visibility_range_end_margin"] == pytest.approx(far / 20)
    assert [each["distance"] for each in values("threejs")] == pytest.approx([0, far / 4, far])
    disks = [math.pi / 4 * (0.9 * size) ** 2 / (1920 * 1080) for size in (200, 50)]
    assert [each["screencoverage"] for each in values("gltf")] == pytest.approx([*disks, 0])
    assert values("gltf", height_ratio=True)[0]["screencoverage"] == pytest.approx(0.9 * 200 / 1080)
    assert [each["level"] for each in values("gltf")] == [0, 1, 3]


@pytest.mark.parametrize("engine", ENGINES)
def test_each_engine_has_a_text_and_names_cannot_leave_their_comments(engine: str) -> None:
    evil = (Level(1, "a\nsystem('b')", 90.0),)
    text = pasteable(engine, numbers(engine, evil, EXTENT, Screen()))
    assert text and not any(line.startswith("system") for line in text.splitlines())


@pytest.mark.parametrize("wrong", [{"height": 0}, {"fov": 180.0}, {"fov": math.nan}, {"lod_bias": 0.0}])
def test_no_screen_is_like_that(wrong: dict[str, float]) -> None:
    with pytest.raises(SettingsError, match=next(iter(wrong)).replace("_", "-")):
        Screen(**wrong)  # type: ignore[arg-type]


def test_an_extent_is_in_the_scene_s_units() -> None:
    extent = Extent.of(surface((2 * cube()[0], cube()[1])))
    assert (extent.diagonal, extent.side, extent.radius) == pytest.approx((2 * 3**0.5, 2, 3**0.5))


def test_leaves_that_lost_their_holes_fail_and_what_does_not_show_is_refused() -> None:
    """And the sizes say that something is see-through."""
    pixels = np.full((4, 4, 4), 255, np.uint8)
    pixels[:, :2, 3] = 0
    holes, none = (Texture(each, interpolation="closest") for each in (pixels, 0 * pixels))
    reference, solid, gone = (
        replace(mesh_arrays(sphere(), (image,)), materials=(Material("leaf", image, alpha),))
        for image, alpha in ((holes, ImageAlpha(holes)), (holes, None), (none, ImageAlpha(none)))
    )
    sizes = ScreenSizes(reference)
    sizes.prepare().run()
    same, worse = (sizes.measure(each).run() for each in (reference, solid))
    assert same.strict.bound == "at least" and worse.strict.bound == "below"
    assert all("see-through" in each.notes[0] for each in (same, worse))
    assert size_record(worse)["notes"] == list(worse.notes)
    nothing = ScreenSizes(gone)
    nothing.prepare().run()
    with pytest.raises(MeshError, match="nothing of it shows"):
        nothing.measure(gone).run()
