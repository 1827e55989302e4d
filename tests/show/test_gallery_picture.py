"""The reward gallery as a picture."""

import numpy as np
import pytest

from by_hand import episode
from trdlab.decomposition import TimeAxis
from trdlab.explanations.gallery.gallery import Recorded, gallery_of
from trdlab.rollouts.reel import Reel
from trdlab.show.plots.gallery import gallery_figure


@pytest.mark.parametrize("rewards", [[0.0, 1.0, 0.0, 2.0, 0.0], [0.0] * 5])
def test_each_group_has_its_sentence_and_its_pictures(rewards):
    reel = Reel()
    pictures = tuple(reel.add(np.full((20, 30, 3), 40 * t, np.uint8)) for t in range(6))
    gallery = gallery_of([Recorded(episode(rewards, TimeAxis(0.9, 2)), 0, pictures)], reel)
    figure = gallery_figure(gallery, reel, "Rewards")
    figure.canvas.draw()
    told = [part.get_suptitle() for part in figure.subfigs]
    shown = [len(ax.images) for part in figure.subfigs for ax in part.axes]
    if any(rewards):
        assert [text.partition(" came")[0] for text in told] == ["A reward of 2", "A reward of 1"]
        assert sum(shown) == 3 + 3  # −1 is no step, 6 no picture
    else:
        assert told == ["In 1 episode with 5 steps, no reward came."]
        assert shown == []
