# SPDX-License-Identifier: GPL-3.0-or-later
"""The trust report on real models, in the Python API and in the sidebar's rows."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import fmqm_addon
from fmqm_addon import api
from fmqm_addon.blender.files.load import load_mesh
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.comparison.measurement import Measurement
from fmqm_addon.comparison.surface_facts import Fact
from fmqm_addon.metric.evaluation import COLUMNS
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.surface import MeshArrays
from fmqm_addon.report.trust_table import trust_dict
from fmqm_addon.ui.panels import trust as panels
from fmqm_addon.ui.properties.rows import pair_of, row_reverse, row_trust
from tests.blender import scenes

QUICK = Settings(samples=20_000, scored_patches=100)


def values(facts: tuple[Fact, ...]) -> dict[str, object]:
    return {fact.name: fact.value for fact in facts}


def compared(reference: MeshArrays, *distorted: MeshArrays) -> Iterator[tuple[dict[str, object], ...]]:
    """Facts of the reference, the distorted, the pair."""
    measurement = Measurement(reference, BVHQuery, QUICK)
    measurement.prepare().run()
    for mesh in distorted:
        trust = measurement.compare(mesh).run().trust
        yield values(trust.reference), values(trust.distorted), values(trust.pair)


@pytest.mark.parametrize("name", ["spot", "egyptian_cat"])
def test_clean_closed_models_leave_no_doubt(shared_data: Path, name: str) -> None:
    mesh = load_mesh(str(shared_data / "objpng" / name / f"{name}.obj"))
    turned = replace(mesh, triangles=mesh.triangles[:, ::-1], corners=mesh.corners[:, ::-1])
    itself, inside_out = compared(mesh, mesh, turned)
    for facts in itself[:2]:
        assert facts["watertight"] and facts["sign_in_doubt"] == 0 and facts["uv_missing"] == 0
    assert itself[2]["flipped"] == 0 and itself[2]["added"] == 0 and itself[2]["maps_not_seen"] == []
    assert inside_out[2]["flipped"] == 1 and inside_out[1]["sign_in_doubt"] == 1


def test_distortions_of_a_model_are_not_taken_for_flipped_or_added(shared_data: Path) -> None:
    """Vertices shaken, decimated to 12 %: what LODs do to a surface."""
    names = ("gn_3", "swt_3")
    meshes = [load_mesh(str(shared_data / "pairs" / "spot" / name / "mesh.obj")) for name in names]
    for _, _, pair in compared(load_mesh(str(shared_data / "objpng" / "spot" / "spot.obj")), *meshes):
        assert pair["flipped"] < 0.001 and pair["added"] == 0 and pair["sign_in_doubt_and_different"] < 0.001


def test_open_cloth_and_foliage(shared_data: Path) -> None:
    """Open edges as the models' collector counted them; leaves are cards with holes."""
    ((cloth, *_),) = compared(mesh := load_mesh(str(shared_data / "sheen_cloth" / "sheen_cloth.glb")), mesh)
    assert cloth["open_edges"] == 960 and cloth["non_manifold_edges"] == 0 and not cloth["watertight"]
    ((tree, _, pair),) = compared(mesh := load_mesh(str(shared_data / "tree_alpha" / "scene.gltf")), mesh)
    assert tree["open_edges"] == 512 and 0.05 < tree["see_through"] < 0.95  # type: ignore[operator]
    assert sum(tree["samples_by_material"].values()) == pytest.approx(1)  # type: ignore[attr-defined]
    assert pair["sign_in_doubt_and_different"] == 0


@pytest.fixture
def pair(tmp_path: Path) -> list[bpy.types.Object]:
    """A monkey, and one with a cube floating beside it."""
    image = scenes.write_png(tmp_path / "noise.png", scenes.noise(32))
    made = [scenes.monkey(name, [scenes.textured(image)]) for name in ("Clean", "Littered")]
    junk = scenes.cube("Junk")
    junk.location = (4, 2, 3)
    junk.scale = (0.2, 0.2, 0.2)
    bpy.ops.object.select_all(action="DESELECT")
    for object_ in (junk, made[1]):
        object_.select_set(True)
    bpy.context.view_layer.objects.active = made[1]
    bpy.ops.object.join()
    return made


def test_floating_junk_is_a_warning_and_the_other_direction_sees_it(pair: list[bpy.types.Object]) -> None:
    settings = Settings(samples=8000, patches=40)
    outcome = api.measure(*pair, settings, space="world", both=True)[0]
    assert outcome.trust is not None and outcome.scores is not None and outcome.reverse is not None
    assert 0.005 < values(outcome.trust.pair)["added"] < 0.5  # type: ignore[operator]
    assert any("cannot see" in warning for warning in outcome.warnings)
    fmqm = COLUMNS.index("FMQM")
    assert outcome.reverse[fmqm] < outcome.scores[fmqm]
    alone = api.measure(*pair[::-1], settings, space="world")[0]
    assert alone.scores is not None and np.array_equal(alone.scores, outcome.reverse)
    assert alone.reverse is None


class Layout:
    """Writes down what a panel says, line by line, in the place of Blender's own."""

    def __init__(self, said: list[str] | None = None) -> None:
        self.said = [] if said is None else said
        self.line: list[str] | None = None

    def column(self, align: bool = False) -> Layout:
        return Layout(self.said)

    def row(self, align: bool = False) -> Layout:
        """A row's part belongs to its line."""
        made = Layout(self.said)
        made.line = [] if self.line is None else self.line
        return made

    def separator(self, factor: float) -> None:
        pass

    def label(self, text: str, translate: bool = True, icon: str = "NONE") -> None:
        if self.line:
            self.said.pop()
        if self.line is not None:
            self.line.append(text)
            text = ": ".join(self.line)
        self.said.append(text)


def said_at(width: int) -> list[str]:
    """What the panel says of the chosen row in a sidebar of so many pixels."""
    context = SimpleNamespace(
        scene=bpy.context.scene,
        region=SimpleNamespace(width=width),
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
    )
    layout = Layout()
    panels.FMQM_PT_trust.draw(SimpleNamespace(layout=layout), context)
    return layout.said


def test_rows_keep_the_report_and_the_other_direction(pair: list[bpy.types.Object]) -> None:
    fmqm_addon.register()
    try:
        fmqm = bpy.context.scene.fmqm
        fmqm.settings.samples, fmqm.settings.patches, fmqm.settings.both = 8000, 40, True
        fmqm.reference = pair[0]
        fmqm.compared.add().object = pair[1]
        assert not panels.FMQM_PT_trust.poll(bpy.context)
        assert bpy.ops.fmqm.measure() == {"FINISHED"}
        row = fmqm.rows[0]
        assert panels.FMQM_PT_trust.poll(bpy.context)
        (outcome,) = api.measure(*pair, Settings(samples=8000, patches=40), both=True)
        assert outcome.trust is not None
        assert row_trust(row) == json.loads(json.dumps(trust_dict(outcome.trust)))
        kept = pair_of(row)
        assert kept.trust == row_trust(row) and kept.reverse == row_reverse(row) is not None
        assert (kept.reverse.scores, kept.reverse.perceived) == (outcome.reverse, outcome.reverse_perceived)
        wide, narrow = said_at(800), said_at(230)
        assert {"Watertight: no", "Triangles: 968 / 980", "Flipped: 0 % of samples"} <= set(wide)
        assert any(said.startswith("Non-manifold edges") for said in wide)
        assert any(said.startswith("Base color, LOD: ") and said.endswith("32, sRGB") for said in wide)
        assert not any("distorted" in said or "Baked at" in said for said in wide), "called Compared; nothing was baked"
        place = narrow.index("UV missing: 0 %")
        assert narrow[place + 1] == "of the textured area" and max(map(len, narrow)) <= 30
        report = trust_dict(outcome.trust)
        report["reference"]["uv_missing"] |= {"value": None, "why": "no one looked"}
        report["distorted"]["colors_from"]["value"] = {"Rust": "baked"}
        row.trust = json.dumps(report)
        assert any(said.startswith("Baked at: 1,024 pixels a side") for said in said_at(800))
        assert said_at(230)[place : place + 2] == ["UV missing: ? / 0 %", "no one looked; of the"]
    finally:
        fmqm_addon.unregister()
