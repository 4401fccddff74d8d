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


def test_footprints_reach_the_nearest_neighbour_on_the_same_surface():
    """Ends 3 apart in a row and 5 from row to row, the last row's facing away, a cell without an end."""
    x, y = np.meshgrid(np.arange(4), np.arange(3))
    points = np.zeros(12, RECEIVER)
    points["valid"], points["footprint"] = 1, 0.5
    points["position"][:, 0], points["position"][:, 1] = 3 * x.ravel() ** 2, 5 * y.ravel()
    points["ng"] = np.where(y.ravel()[:, None] < 2, (0, 0, 1), (0, 0, -1))
    cells = np.delete(np.arange(12), 1)
    image = image_of_ends(points[cells], cells, (4, 3), 2, 0)
    # Across, places are 0, 3, 12 and 27; down, the first two rows are 5 apart.
    assert image["footprint"].tolist() == [5, 0, 5, 5, 3, 3, 5, 5, 3, 3, 9, 15]
    assert image["valid"].tolist() == [1, 0] + [1] * 10
    alone = points[:1]
    assert image_of_ends(alone, np.array([1]), (2, 1), 2, 0)["footprint"].tolist() == [0, 1]
