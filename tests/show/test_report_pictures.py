"""Pictures in a page: exact where they are drawn, and small where they are photographs."""

from base64 import b64decode
from io import BytesIO

import numpy as np
import pytest
from PIL import Image, features

from trdlab.rollouts.reel import Reel
from trdlab.show.report.pictures import data_uri, sheets, shrunk


def read(uri: str) -> np.ndarray:
    return np.asarray(Image.open(BytesIO(b64decode(uri.partition(",")[2]))).convert("RGB"))


@pytest.mark.parametrize("colours", [2, 200, 3_000])
@pytest.mark.parametrize("webp", [True, False])
def test_what_is_drawn_comes_back_as_it_was(colours, webp, monkeypatch):
    if webp and not features.check("webp"):
        pytest.skip("Pillow has no WebP here")
    monkeypatch.setattr(features, "check", lambda name: webp)
    rng = np.random.default_rng(0)
    known = rng.integers(256, size=(colours, 3), dtype=np.uint8)
    picture = known[rng.integers(colours, size=(60, 80))]
    assert (read(data_uri(picture)) == picture).all()


def test_a_photograph_is_smaller_than_its_pixels():
    rows, columns = np.mgrid[:256, :256]
    picture = np.stack([rows, columns, (rows * columns) // 256], axis=2).astype(np.uint8)
    uri = data_uri(picture)
    assert len(uri) < picture.nbytes / 4
    assert np.abs(read(uri).astype(int) - picture).mean() < 8.0


def test_a_sheet_has_each_picture_once_where_it_says():
    reel, rng = Reel(), np.random.default_rng(1)
    pictures = rng.integers(4, size=(70, 9, 7, 3), dtype=np.uint8) * 60
    numbers = [reel.add(picture) for picture in (*pictures, pictures[0])]
    found = {}
    for uri, width, height, columns, held in sheets(reel, numbers):
        sheet = read(uri)
        for at, number in enumerate(held):
            top, left = at // columns * height, at % columns * width
            found[number] = sheet[top : top + height, left : left + width]
    assert len(found) == 70
    assert all((found[numbers[i]] == picture).all() for i, picture in enumerate(pictures))


def test_large_pictures_are_shrunk_and_small_ones_stay():
    large, small = np.zeros((1000, 500, 3), np.uint8), np.ones((84, 84, 3), np.uint8)
    assert shrunk(large).shape == (420, 210, 3)
    assert shrunk(small) is small
