"""`ispm compare`: how far two pictures are apart."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ispm.cli.console import Console
from ispm.cli.options import command
from ispm.errors import OutputError, SettingsError
from ispm.io.atomic import require_writable

EXCEEDED = 1


@command()
def compare(
    console: Console,
    a: str,
    b: str,
    /,
    *,
    mask: Annotated[
        str | None, Parameter(help="compare only where this array is not 0", metavar="FILE.npz:KEY")
    ] = None,
    diff: Annotated[
        str | None, Parameter(help="write where A is brighter (red) or darker (blue)", metavar="OUT.png")
    ] = None,
    reference_error: Annotated[
        float, Parameter(help="the reference's own relMSE, taken off", metavar="X")
    ] = 0.0,
    max_relmse: Annotated[float | None, Parameter(help="exit with 1 above it", metavar="X")] = None,
    max_bias: Annotated[
        float | None, Parameter(help="exit with 1 beyond it, either way", metavar="X")
    ] = None,
) -> int:
    """Measure how far two pictures are apart.

    Example: ispm compare room.exr truth.npz:R --mask truth.npz:metric_mask --max-relmse 0.02

    A is compared with the reference B (.exr .npy .npz:KEY .png) in linear light. bias is
    the light A has too much, as a fraction; relmse the mean of (A-B)^2 / (B^2 + eps) with
    eps = 0.001 mean(B)^2. A PNG is taken as sRGB, and was clipped and tone mapped before.
    flip is how far they differ to the eye, from 0 to 1, shown at the exposure that suits B.
    """
    for name, bound in (("--max-relmse", max_relmse), ("--max-bias", max_bias)):
        if bound is not None and not bound >= 0.0:
            raise SettingsError(f"{name}: {bound} is not a bound; give 0 or more")
    if diff is not None:
        _require_diff(diff, a, b, mask)
    if not 0.0 <= reference_error < math.inf:
        raise SettingsError(f"--reference-error: {reference_error} is not an error; give 0 or more")
    from ispm.bench import metrics
    from ispm.io.image import read_array, read_picture, write_png

    picture, reference = read_picture(a), read_picture(b)
    shown = [name for name in (a, b) if name.lower().endswith(".png")]
    if len(shown) == 1:
        console.warn(
            f"{shown[0]}: a PNG was exposed, tone mapped and clipped, and the other was not; "
            "compare two alike"
        )
    chosen = None if mask is None else read_array(mask)
    result = metrics.compare(
        picture,
        reference,
        chosen,
        reference_error=reference_error,
        displayed=len(shown) == 2,
    )
    values = dataclasses.asdict(result)
    console.table("comparison", list(values.items()))
    if diff is not None:
        write_png(diff, metrics.difference_picture(picture, reference))
        console.written(diff)
    exceeded = [
        f"{name} is {value:.4g}, over {bound:g}"
        for name, value, bound in (
            ("relmse", result.relmse, max_relmse),
            ("bias", abs(result.bias), max_bias),
        )
        if bound is not None and value > bound
    ]
    for line in exceeded:
        console.say(line)
    console.result({**values, "exceeded": exceeded})
    return EXCEEDED if exceeded else 0


def _require_diff(diff: str, *inputs: str | None) -> None:
    """Raise OutputError where the picture of the difference cannot be written, or would replace an input."""
    target = Path(diff)
    if target.suffix.lower() != ".png":
        raise OutputError(f"--diff: '{diff}' must end in .png")
    require_writable(target)
    for name in inputs:
        source = Path(re.sub(r"(?i)(\.(?:npz|exr)):[^/\\:]+$", r"\1", name)) if name else None
        if source and target.exists() and source.exists() and target.samefile(source):
            raise OutputError(f"--diff: {diff} is one of the pictures compared; name another file")
