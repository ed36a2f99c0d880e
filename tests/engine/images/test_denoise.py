"""W is denoised once per camera position, and nothing else is."""

import sys

import numpy as np
import pytest
from support import tiny

from framearray_cli.base.errors import MissingExtraError
from framearray_cli.engine.images import denoise, window
from framearray_cli.engine.images.denoise import denoise_obscurance

SKY = {"background": [0.5, 0.5, 0.5]}


def test_a_denoiser_that_does_nothing_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """R times (R W / R) is R W again: at silhouettes, on mirrors and against the sky too."""
    monkeypatch.setattr(window, "denoise_obscurance", lambda obscurance, reflectivity, normal: obscurance)
    monkeypatch.setattr("framearray_cli.render.prepare.require_denoiser", lambda: None)
    images = [
        tiny.render_frames(
            tiny.prepared(tiny.job(camera=tiny.WALK, reuse={"n_r": 1}, scene=SKY, denoise={"obscurance": wanted}))
        ).images
        for wanted in (False, True)
    ]
    # a product and a quotient more, each rounded to 2^-24
    np.testing.assert_allclose(images[1], images[0], rtol=4 * 2.0**-23, atol=1e-7)


def test_noise_of_obscurance_shrinks() -> None:
    pytest.importorskip("pyoidn", reason="the extra `denoise` is not installed")
    rng = np.random.default_rng(3)
    truth = np.full((48, 64, 3), 0.4, np.float32)
    truth[:, 32:] = 0.7
    noisy = np.clip(truth + 0.1 * rng.normal(size=truth.shape), 0, 1).astype(np.float32)
    normal = np.zeros_like(truth)
    normal[:, :32, 0] = normal[:, 32:, 1] = 1.0
    smooth = denoise_obscurance(noisy, np.full_like(truth, 0.5), normal)
    assert smooth.min() >= 0 and smooth.max() <= 1
    assert np.sqrt(((smooth - truth) ** 2).mean()) < 0.5 * np.sqrt(((noisy - truth) ** 2).mean())


def test_a_missing_denoiser_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(MissingExtraError, match=r"\[denoise\]"):
        denoise.require_denoiser()
