"""Where warnings point."""

from typing import Any

import pytest

from ispm.errors import SceneWarning


def test_warnings_point_to_the_line_that_called_the_package() -> None:
    package: dict[str, Any] = {"__name__": "ispm.made_up"}
    lines = "from ispm.errors import warn_caller\ndef inner(): warn_caller('so')\ndef outer(): inner()"
    exec(lines, package)
    with pytest.warns(SceneWarning, match="so") as found:
        package["outer"]()
    assert found[0].filename == __file__
