"""What cannot become a film, found out before anything that takes long."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ispm.errors import SettingsError
from ispm.film.output import Output
from ispm.film.settings import Film
from ispm.io.atomic import require_writable
from ispm.settings import VIEWS, Settings, nearest


def require_possible(output: Output, film: Film, settings: Settings, saved: Mapping[str, Any]) -> None:
    """Raise an IspmError for what cannot become a film, before a scene is read; as `animate`."""
    if settings.live and settings.most_passes > 1:
        raise SettingsError(
            "passes: frames that go on from the ones before have one each; leave out passes, target_error "
            "and time_limit, or the history"
        )
    if settings.live and film.shutter:
        raise SettingsError(
            "shutter: frames that go on from the ones before have no motion blur; leave one out"
        )
    show = saved.get("show", "full")
    if show == "bounce-map":
        raise SettingsError("show: the view 'bounce-map' has a size of its own; a film takes the others")
    if output.is_film:
        from ispm.film.video import codec_of, require_pictures

        if show not in VIEWS:
            raise SettingsError(f"show: '{show}' is not one of {', '.join(VIEWS)}{nearest(show, VIEWS)}")
        require_pictures(output.path, codec_of(output.path, film), settings)
    require_writable(output.path if output.is_film else output.picture(0))
