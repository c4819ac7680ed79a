# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose loss it is: pairs that differ in one thing only, and how that is found out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import numpy as np
import pytest

import fmqm_addon
from fmqm_addon import api
from fmqm_addon.blender.files.load import load_mesh
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.measure import measuring
from fmqm_addon.blender.scene.target import target_of
from fmqm_addon.comparison.attribution import Attribution, attribute
from fmqm_addon.comparison.measurement import Measurement
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.settings import PRESETS, Settings
from fmqm_addon.metric.surface import MeshArrays
from fmqm_addon.metric.texture import Material, PlainColor
from fmqm_addon.ui.operators import inputs
from fmqm_addon.ui.panels import details
from fmqm_addon.ui.properties.rows import row_attribution
from tests.blender import scenes
from tests.blender.script import noise, read_json, score, strict_json, write_png, write_torus

SMALL = Settings(samples=6400, patches=40, color_units=20)


@pytest.fixture(scope="module")
def torus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, MeshArrays]:
    """A torus, one with another texture, one of another shape, one that differs in both."""
    folder = tmp_path_factory.mktemp("torus")
    write_png(folder / "a.png", noise(32, seed=1))
    write_png(folder / "b.png", noise(32, seed=2))
    paths = {
        "reference": write_torus(folder, "reference", "a.png"),
        "texture": write_torus(folder, "texture", "b.png"),
        "geometry": write_torus(folder, "geometry", "a.png", shake=0.02),
        "both": write_torus(folder, "both", "b.png", shake=0.02),
    }
    return {name: load_mesh(str(path)) for name, path in paths.items()}


def attributed(reference: MeshArrays, distorted: MeshArrays, settings: Settings = SMALL) -> Attribution:
    measurement = Measurement(reference, BVHQuery, settings)
    measurement.prepare().run()
    return attribute(measurement, reference, distorted, measurement.compare(distorted).run()).run()


def test_each_loss_alone_is_exactly_one_part(torus: dict[str, MeshArrays]) -> None:
    texture = attributed(torus["reference"], torus["texture"])
    assert texture.geometry_loss == 0 and texture.texture_loss > 0.1
    assert texture.phrase == "most of the loss is the texture"
    geometry = attributed(torus["reference"], torus["geometry"])
    assert geometry.texture_loss == 0 and geometry.geometry_loss > 0.02
    assert geometry.phrase == "most of the loss is the geometry"
    assert texture.how == geometry.how == "materials"


def test_parts_of_a_mixed_loss_are_those_of_the_two_alone(torus: dict[str, MeshArrays]) -> None:
    both = attributed(torus["reference"], torus["both"])
    assert both.geometry_loss == attributed(torus["reference"], torus["geometry"]).geometry_loss
    assert both.texture_loss == attributed(torus["reference"], torus["texture"]).texture_loss


def test_nothing_lost(torus: dict[str, MeshArrays]) -> None:
    nothing = attributed(torus["reference"], torus["reference"])
    assert (nothing.geometry_loss, nothing.texture_loss, nothing.mostly) == (0, 0, "nothing")


def test_the_texture_of_what_has_moved_far_is_as_it_was(torus: dict[str, MeshArrays]) -> None:
    """Another place of the texture is nearest then, but the two are unwrapped alike."""
    moved = replace(torus["reference"], positions=torus["reference"].positions + np.array([0.5, 0, 0]))
    found = attributed(torus["reference"], moved)
    assert (found.texture_loss, found.how) == (0, "materials") and found.geometry_loss > 0.2


def test_a_mesh_unwrapped_anew_is_painted_from_nearest_points(torus: dict[str, MeshArrays]) -> None:
    """Its texture coordinates are shifted by half a texture, of which the same image makes another look."""
    shifted = replace(torus["reference"], corners=torus["reference"].corners + np.float32(0.5))
    found = attributed(torus["reference"], shifted)
    assert found.how == "nearest points"
    assert found.geometry_loss < 0.01 and found.texture_loss > 0.1


def test_a_texture_is_compared_with_a_mesh_that_has_none(torus: dict[str, MeshArrays]) -> None:
    """The other one's material reads no texture coordinates, and its corners hold none."""
    whole = torus["geometry"]
    grey = (Material("grey", PlainColor((0.5, 0.5, 0.5))),)
    bare = replace(whole, corners=whole.corners[:, :, :0], materials=grey, material=np.zeros_like(whole.material))
    for reference, distorted in ((bare, torus["reference"]), (torus["reference"], bare)):
        found = attributed(reference, distorted)
        assert found.how == "nearest points" and found.texture_loss > found.geometry_loss > 0


def test_materials_are_told_by_name_then_by_place(torus: dict[str, MeshArrays]) -> None:
    """Two materials that have changed places look as before."""
    whole = torus["reference"]
    half = (np.arange(len(whole.triangles)) % 2).astype(np.int64)
    first, second = (replace(torus[key].materials[0], name=key) for key in ("reference", "texture"))
    reference = replace(whole, material=half, materials=(first, second))
    swapped = replace(whole, material=1 - half, materials=(second, first))
    assert attributed(reference, swapped).texture_loss == 0
    renamed = replace(reference, materials=(replace(first, name="x"), replace(second, name="y")))
    found = attributed(reference, renamed)
    assert (found.geometry_loss, found.texture_loss, found.how) == (0, 0, "materials")


@pytest.mark.parametrize(
    "losses, phrase",
    [
        ((0.0, 0.01), "there is hardly any loss"),
        ((0.3, 0.1), "most of the loss is the geometry"),
        ((0.1, 0.3), "most of the loss is the texture"),
        ((0.2, 0.3), "geometry and texture share the loss"),
    ],
)
def test_phrases(losses: tuple[float, float], phrase: str) -> None:
    assert Attribution(*losses, "materials").phrase == phrase


@pytest.mark.parametrize(
    "kind, mostly", [("ds_3", "texture"), ("tmc_3", "texture"), ("gn_3", "geometry"), ("swt_3", "geometry")]
)
def test_real_models(shared_data: Path, kind: str, mostly: str) -> None:
    """Smaller texture, JPEG; noise, decimation."""
    reference = load_mesh(str(shared_data / "objpng" / "spot" / "spot.obj"))
    distorted = load_mesh(str(shared_data / "pairs" / "spot" / kind / "mesh.obj"))
    found = attributed(reference, distorted, Settings(**PRESETS["fast"]))
    parts = {"geometry": found.geometry_loss, "texture": found.texture_loss}
    assert found.mostly == mostly and parts[mostly] > 0.05
    assert sum(parts.values()) - parts[mostly] < 0.01


def test_script_attributes_and_explains(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", noise(32, seed=1))
    reference = write_torus(tmp_path, "reference", "a.png")
    shaken = write_torus(tmp_path, "shaken", "a.png", shake=0.03)
    flags = ("--samples", 3200, "--patches", 20, "--quiet", "--attribution", "--explain")
    done = score(reference, shaken, tmp_path / "nowhere.obj", *flags, "--json", tmp_path / "out.json")
    pair, failed = strict_json((tmp_path / "out.json").read_text(encoding="utf-8"))["pairs"]
    assert pair["attribution"]["mostly"] == "geometry" and pair["attribution"]["texture_loss"] == 0
    assert pair["explanation"] in done.stdout and "Most of the loss is the geometry" in pair["explanation"]
    assert 0 < pair["where"]["below_mean"] < 1 and len(pair["where"]["worst"]) == 3
    assert failed["explanation"] in done.stdout and failed["explanation"].startswith("Not scored: ")


@pytest.fixture
def monkeys(tmp_path: Path, empty_session: None) -> list[bpy.types.Object]:
    """The original and one with another texture, which has been set aside."""
    images = [scenes.write_png(tmp_path / f"{seed}.png", noise(32, seed=seed)) for seed in (1, 2)]
    made = [scenes.monkey(image.stem, [scenes.textured(image)]) for image in images]
    made[1].location.x += 5
    return made


def test_the_button_attributes_as_the_script_does(monkeys: list[bpy.types.Object], tmp_path: Path) -> None:
    """In the row, on the panel and in the saved file; nothing of it where it was not asked for."""
    fmqm_addon.register()
    try:
        fmqm = bpy.context.scene.fmqm
        fmqm.settings.samples, fmqm.settings.patches, fmqm.settings.color_units = 6400, 40, 20
        inputs.set_reference(fmqm, monkeys[0])
        inputs.set_compared(fmqm, monkeys[1:])
        (saved,) = measured_and_saved(tmp_path / "without.json")
        assert "attribution" not in saved and row_attribution(fmqm.rows[0]) is None
        assert not any("Loss" in text for text in said())
        fmqm.settings.attribution = True
        (saved,) = measured_and_saved(tmp_path / "with.json")
        found = saved["attribution"]
        assert found == row_attribution(fmqm.rows[0])
        assert found["mostly"] == "texture" and found["texture_loss"] > 0.1 and found["geometry_loss"] < 0.001
        texts = said()
        assert texts[texts.index("    Geometry Loss") + 1] == f"{found['geometry_loss']:.4f}"
        assert texts[texts.index("    Texture Loss") + 1] == f"{found['texture_loss']:.4f}"
        assert "Most of the loss is the texture" in texts
    finally:
        fmqm_addon.unregister()
    blend = scenes.export(tmp_path, "blend")
    flags = ("--samples", 6400, "--patches", 40, "--color-units", 20, "--quiet", "--attribution")
    done = score(*(f"{blend}:{monkey.name}" for monkey in monkeys), *flags, "--json", tmp_path / "script.json")
    assert done.returncode == 0, done.stderr
    assert read_json(tmp_path / "script.json")["pairs"][0]["attribution"] == found


def measured_and_saved(path: Path) -> list[dict[str, object]]:
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    assert bpy.ops.fmqm.save_results(filepath=str(path), file_format="json") == {"FINISHED"}
    pairs: list[dict[str, object]] = read_json(path)["pairs"]
    return pairs


def said() -> list[str]:
    """What the panel of details says."""
    layout = MagicMock()
    for part in (layout.column, layout.row, layout.split):
        part.return_value = layout
    context = SimpleNamespace(
        scene=bpy.context.scene,
        region=SimpleNamespace(width=400),
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
    )
    details.FMQM_PT_details.draw(SimpleNamespace(layout=layout), context)
    return [call.kwargs["text"] for call in layout.label.call_args_list]


def test_attribution_from_python_and_its_progress(monkeys: list[bpy.types.Object]) -> None:
    """Its progress is a part of its object's; it changes no score."""
    plain = api.measure(*monkeys, SMALL, both=True)[0]
    stepper = measuring(
        target_of(monkeys[0]), [target_of(monkeys[1])], PairOptions(settings=SMALL, both=True, attribution=True)
    )
    seen = [("", 0.0)]
    while stepper.step():
        seen.append((stepper.progress.stage, stepper.progress.done))
    assert [done for _, done in seen] == sorted(done for _, done in seen) and 0.95 < seen[-1][1] <= 1
    assert list(dict.fromkeys(stage for stage, _ in seen))[-2:] == ["Preparing 1", "Measuring 2"]
    (outcome,) = stepper.result
    assert plain.attribution is None and outcome.attribution is not None
    assert np.array_equal(plain.scores, outcome.scores) and np.array_equal(plain.reverse, outcome.reverse)
    assert api.measure(*monkeys, SMALL, attribution=True)[0].attribution == outcome.attribution
