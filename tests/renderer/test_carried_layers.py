"""Every layer of a frame is carried from pass to pass."""

from ispm.renderer.progress import KEPT, SUMMED
from ispm.settings import LAYERS


def test_passes_carry_each_layer_once():
    """`full` is the sum of others; a layer that neither list has would be gone from two passes on."""
    assert sorted([*SUMMED, *KEPT]) == sorted(set(LAYERS) - {"full"})
