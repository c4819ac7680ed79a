# SPDX-License-Identifier: GPL-3.0-or-later
"""Small imitations of the data sets: files of the right names, with nothing in them."""

import json
from pathlib import Path

import pytest

from fmqm_addon.batch.datasets import LAYOUTS, kind_of, layout_of, model_of, read_dataset
from fmqm_addon.metric.errors import FileError, FMQMError, SettingsError

SETS = {
    "tsmd": (
        "TSMD_MOS.csv",
        "PVS,MOS",
        "just_a_girl_dec0.10_qp6_qt5_cqlevel63",
        "Reference/just_a_girl/just_a_girl_C0-L5_deq_tri.obj",
        "Distortion/just_a_girl/just_a_girl_dec0.10_qp6_qt5_cqlevel_63.obj",
        ("just_a_girl", ""),
    ),
    "sjtu-tmqa": (
        "distortion_dataset/SJTU-TMQA_MOS.csv",
        "name,MOS",
        "deadRose_simpNoTex_L03",
        "reference_dataset/deadRose/deadRose.obj",
        "distortion_dataset/simpNoTex/deadRose/L03/deadRose.obj",
        ("deadRose", "SOT"),
    ),
    "yana": (
        "MOS+CI_3000stimuli.csv",
        '"stimulus","MOS"',
        "1970.16_Neck [1]_100K_simpL5_qp9_qt8_decompJPEG_1024x1024_Q10",
        "1970.16_Neck [1]_100K/source/1970.16_Neck [1]_100K.obj",
        "1970.16_Neck [1]_100K/distortions/JPEG_resize1024x1024_quality10/1970.16_Neck [1]_100K_simpL5_qp9_qt8.obj",
        ("1970.16_Neck [1]_100K", ""),
    ),
}


def made(folder: Path, name: str, extra: str = "") -> None:
    table, header, stimulus, reference, distorted, _ = SETS[name]
    for path in (table, reference, distorted):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).touch()
    (folder / table).write_text(f"{header}\n{stimulus},3.5\n{extra}", encoding="utf-8")


@pytest.mark.parametrize("name", LAYOUTS)
def test_names_of_a_table_become_pairs(name: str, tmp_path: Path) -> None:
    made(tmp_path, name)
    found = read_dataset(str(tmp_path), layout_of(name))
    _, _, stimulus, reference, distorted, (model, kind) = SETS[name]
    (row,) = found.rows
    assert row.id == stimulus
    assert (Path(row.reference), Path(row.distorted)) == (tmp_path / reference, tmp_path / distorted)
    assert (model_of(found.layout, stimulus), kind_of(found.layout, stimulus)) == (model, kind)
    assert found.missing == ()


def test_names_that_match_nothing_are_listed_and_lead_nowhere(tmp_path: Path) -> None:
    made(tmp_path, "sjtu-tmqa", "deadRose_gn_L09,1\nnonsense,2\n../../etc_gn_L01,1\n")
    found = read_dataset(str(tmp_path), layout_of("sjtu-tmqa"))
    assert len(found.rows) == 1
    assert found.missing == ("deadRose_gn_L09", "nonsense", "../../etc_gn_L01")


def test_a_layout_file_changes_what_it_names(tmp_path: Path) -> None:
    made(tmp_path, "sjtu-tmqa")
    (tmp_path / "reference_dataset/deadRose").rename(tmp_path / "reference_dataset/other")
    change = tmp_path / "layout.json"
    change.write_text(json.dumps({"reference": "reference_dataset/other/{model}.obj"}), encoding="utf-8")
    assert len(read_dataset(str(tmp_path), layout_of("sjtu-tmqa", str(change))).rows) == 1
    with pytest.raises(FileError, match=r"reference_dataset/deadRose/deadRose.obj and .* are wanted"):
        read_dataset(str(tmp_path), layout_of("sjtu-tmqa"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "not a JSON file"),
        ('{"colour": "x"}', "some of opinions"),
        ('{"id": 3}', "a text is wanted"),
        ('{"kinds": {"gn": 3}}', "an object is wanted"),
        ('{"id": "("}', "no regular expression"),
        ('{"reference": "{name}.obj"}', "no group for"),
        ('{"id_column": "who"}', "no column who"),
    ],
)
def test_wrong_layouts_give_one_line(text: str, words: str, tmp_path: Path) -> None:
    made(tmp_path, "sjtu-tmqa")
    change = tmp_path / "layout.json"
    change.write_text(text, encoding="utf-8")
    with pytest.raises(FMQMError, match=words):
        read_dataset(str(tmp_path), layout_of("sjtu-tmqa", str(change)))


def test_an_empty_folder_and_an_unknown_set_are_told(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no table of people's scores"):
        read_dataset(str(tmp_path), layout_of("tsmd"))
    with pytest.raises(SettingsError, match="known are tsmd, sjtu-tmqa, yana"):
        layout_of("kadid")
