# SPDX-License-Identifier: GPL-3.0-or-later
"""FLIP and SSIM against the programs that others trust."""

from __future__ import annotations

import flip_evaluator
import numpy as np
import pytest
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from fmqm_addon.metric.colorspace import decode_srgb
from fmqm_addon.screen_size.definition import PIXELS_PER_DEGREE
from fmqm_addon.screen_size.flip import appearance, flip_map
from fmqm_addon.screen_size.ssim import ssim_map, structure


def picture(seed: int, size: int = 96) -> NDArray[np.float32]:
    """(size, size + 32, 3) encoded colors: flat parts, edges and noise."""
    random = np.random.default_rng(seed)
    flat = np.kron(random.random((4, 4, 3)), np.ones((size // 4, size // 4 + 8, 1)))
    return np.asarray(0.85 * flat + 0.15 * random.random(flat.shape), np.float32)


def changed(image: NDArray[np.float32], kind: str) -> NDArray[np.float32]:
    random = np.random.default_rng(7)
    if kind == "noise":
        return np.clip(image + 0.1 * random.standard_normal(image.shape), 0, 1).astype(np.float32)
    if kind == "moved":
        return np.roll(image, 1, axis=1)
    if kind == "inverse":
        return 1 - image
    if kind == "tinted":
        return np.clip(image * np.array([1.0, 0.9, 0.7]), 0, 1).astype(np.float32)
    return image[::-1].copy()


KINDS = ("noise", "moved", "inverse", "tinted", "upside down")


def ours(one: NDArray[np.float32], other: NDArray[np.float32], ppd: float = PIXELS_PER_DEGREE) -> NDArray[np.float32]:
    return flip_map(*(appearance(decode_srgb(image), ppd) for image in (one, other)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ppd", [67.0, 40.0])
def test_flip_is_that_of_its_authors_program(kind: str, ppd: float) -> None:
    image = picture(3)
    other = changed(image, kind)
    theirs, mean, _ = flip_evaluator.evaluate(
        image, other, "LDR", inputsRGB=True, applyMagma=False, parameters={"ppd": ppd}
    )
    found = ours(image, other, ppd)
    assert found.mean() == pytest.approx(mean, abs=1e-4)
    assert np.abs(np.asarray(theirs).reshape(found.shape) - found).max() < 1e-3


def test_flip_of_the_same_is_zero_and_of_green_and_blue_nearly_one() -> None:
    image = picture(1)
    assert (ours(image, image) == 0).all()
    green, blue = (np.broadcast_to(np.array(rgb, np.float32), (64, 64, 3)) for rgb in ((0, 1, 0), (0, 0, 1)))
    assert ours(green, blue)[32, 32] == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_ssim_is_that_of_scikit_image(kind: str) -> None:
    image = picture(3)
    other = changed(image, kind)
    luma = np.array([0.2126, 0.7152, 0.0722])
    _, theirs = structural_similarity(
        image @ luma, other @ luma, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0,
        full=True,
    )  # fmt: skip
    assert np.abs(ssim_map(structure(image), structure(other)) - theirs).max() < 1e-3
    assert np.abs(ssim_map(structure(image), structure(image)) - 1).max() < 1e-5
