"""Images of what eye paths end at."""

import numpy as np

from ispm.optics.records import RECEIVER
from ispm.paths.ends import image_of_ends


def test_passes_take_the_ends_of_a_cell_in_turn():
    """Of 2 x 1 cells with 4 and 3 ends; any four passes in a row show all of them."""
    points = np.zeros(7, RECEIVER)
    points["valid"], points["alpha"] = 1, np.arange(7)  # names them
    cells = np.array([0, 1, 0, 1, 0, 1, 0])
    shown = np.array([image_of_ends(points, cells, (2, 1), 2, index)["alpha"] for index in range(4)])
    assert set(shown[:, 0]) == {0, 2, 4, 6} and set(shown[:, 1]) == {1, 3, 5}
