"""Charts of benchmark reports, as SVG."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

Report = dict[str, Any]

STAGES = ("direct", "bounce map", "copy", "trace", "radiance", "upsample", "compose")
_COLORS = ("#bcbd22", "#8c564b", "#7f7f7f", "#1f77b4", "#d62728", "#2ca02c", "#9467bd")
_BAR, _GAP, _TOP = 16, 8, 64  # pixels
_NAMES, _PANEL, _BETWEEN = 190, 360, 40
_SMALL, _MARGIN = 250, 56  # a panel of the growth chart, and room for its numbers


def talk_chart(report: Report) -> str:
    """Return bars of the stages' ms for each row: ours on the left, the talk's on the right, to scales of
    their own; a mark at our whole frame, which is shorter than its stages where they overlap. The longest row
    is drawn no longer than there is room, and its length written."""
    rows = report["rows"]
    ours = [
        [each["times"]["columns"][f"{s.replace(' ', '_')}_ms"]["median"] for s in STAGES] for each in rows
    ]
    whole = [each["times"]["columns"]["total_ms"]["median"] for each in rows]
    theirs = [each["talk"]["stages"] for each in rows]
    left, right = _NAMES, _NAMES + _PANEL + _BETWEEN
    bottom = _TOP + len(rows) * (_BAR + _GAP)
    first = _Linear([max(sum(each), ms) for each, ms in zip(ours, whole, strict=True)], left)
    second = _Linear(list(map(sum, theirs)), right)
    parts = [
        *_linear_grid(first, bottom, "here, ms"),
        *_linear_grid(second, bottom, "the talk, ms"),
    ]
    for k, each in enumerate(rows):
        y = _TOP + k * (_BAR + _GAP)
        talk = each["talk"]
        parts.append(_text(left - 8, y + 12, f"{talk['number']} {talk['scene']}", "end"))
        parts += _stacked(first, y, ours[k])
        parts += _stacked(second, y, theirs[k])
        at = first(min(whole[k] * _shortened(first, ours[k]), first.end))
        parts.append(f'<path d="M{at:.1f} {y - 3} V{y + _BAR + 3}" stroke="#000" stroke-width="1.5"/>')
    x = left
    for color, name in zip(_COLORS, STAGES, strict=True):
        parts.append(f'<rect x="{x}" y="12" width="12" height="12" fill="{color}"/>')
        parts.append(_text(x + 17, 22, name))
        x += 34 + 7 * len(name)
    parts.append(f'<path d="M{x + 4} 10 V26" stroke="#000" stroke-width="1.5"/>')
    parts.append(_text(x + 12, 22, "whole frame"))
    return _svg(right + _PANEL + 24, bottom + 34, parts)


def growth_chart(report: Report) -> str:
    """Return a panel for each curve: ms against the amount, both logarithmic; dashed: linear growth."""
    parts = []
    for k, curve in enumerate(report["curves"]):
        left, top = _MARGIN + k % 3 * (_SMALL + _MARGIN + 10), 36 + k // 3 * (_SMALL + 72)
        parts += _panel(curve, left, top)
    rows = -(-len(report["curves"]) // 3)
    height = rows * (_SMALL + 72) + 20
    parts.append(_text(_MARGIN, height - 10, "Dashed: linear growth up to the last point."))
    return _svg(3 * (_SMALL + _MARGIN + 10), height, parts)


def _panel(curve: Report, left: float, top: float) -> Iterator[str]:
    amounts = curve["amounts"]
    times = [[t["median"] for t in each["times"]] for each in curve["series"]]
    x = _Logarithmic(amounts, left, left + _SMALL)
    flat = [t for each in times for t in each if t > 0.0]
    y = _Logarithmic([0.5 * min(flat), *flat], top + _SMALL, top)  # room for the lines in the corner
    yield f'<rect x="{left}" y="{top}" width="{_SMALL}" height="{_SMALL}" fill="none" stroke="#bbb"/>'
    yield _text(left + _SMALL / 2, top - 10, f"ms of a frame against {curve['name']}", "middle")
    for amount in amounts:
        yield f'<path d="M{x(amount):.1f} {top} V{top + _SMALL}" stroke="#eee"/>'
        yield _text(x(amount), top + _SMALL + 16, _short(amount), "middle")
    for ms in _decades(flat):
        if top <= y(ms) <= top + _SMALL:
            yield f'<path d="M{left} {y(ms):.1f} H{left + _SMALL}" stroke="#eee"/>'
            yield _text(left - 6, y(ms) + 4, f"{ms:g}", "end")
    for color, each, medians in zip(("#333", "#1f77b4"), curve["series"], times, strict=True):
        if min(medians) <= 0.0:
            continue
        places = [(x(n), y(ms)) for n, ms in zip(amounts, medians, strict=True)]
        path = " ".join(f"{px:.1f},{py:.1f}" for px, py in places)
        yield f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="1.5"/>'
        yield from (f'<circle cx="{px:.1f}" cy="{py:.1f}" r="3" fill="{color}"/>' for px, py in places)
        line = top + _SMALL - (26 if each is curve["series"][0] else 10)
        yield _text(left + _SMALL - 8, line, f"{each['name']} ~ n^{each['power'][0]:.2f}", "end", color)
    # through the last point of the frame, down to the panel's lower or left edge
    last, start = times[0][-1], amounts[0]
    least = 10.0**y.low
    if last * start / amounts[-1] < least:
        start = amounts[-1] * least / last
    yield (
        f'<path d="M{x(amounts[-1]):.1f} {y(last):.1f} L{x(start):.1f} {y(last * start / amounts[-1]):.1f}" '
        f'stroke="#999" stroke-dasharray="4 4"/>'
    )


class _Logarithmic:
    """A logarithmic axis from the least to the largest of some values, with a little room."""

    def __init__(self, values: Sequence[float], first: float, last: float) -> None:
        low, high = math.log10(min(values)), math.log10(max(values))
        room = 0.08 * max(high - low, 0.1)
        self.low, self.high, self.first, self.last = low - room, high + room, first, last

    def __call__(self, value: float) -> float:
        share = (math.log10(value) - self.low) / (self.high - self.low)
        return self.first + share * (self.last - self.first)


def _decades(times: Sequence[float]) -> list[float]:
    """1, 2 and 5 times powers of ten that hold the times."""
    low, high = math.floor(math.log10(0.5 * min(times))), math.ceil(math.log10(max(times)))
    return [step * 10.0**k for k in range(low, high + 1) for step in (1, 2, 5)]


class _Linear:
    """A linear axis from 0 to a round number above all lengths but the largest, over a panel."""

    def __init__(self, lengths: Sequence[float], left: float) -> None:
        most = sorted(lengths)[-2:][0]
        power = 10.0 ** math.floor(math.log10(most))
        self.end = next(
            step * power for step in (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.5, 10.0) if step * power >= most
        )
        self.left = left

    def __call__(self, value: float) -> float:
        return self.left + value / self.end * _PANEL


def _linear_grid(axis: _Linear, bottom: float, title: str) -> Iterator[str]:
    yield _text(axis.left + _PANEL / 2, bottom + 28, title, "middle")
    for k in range(6):
        value = axis.end * k / 5
        yield f'<path d="M{axis(value):.1f} {_TOP - 8} V{bottom}" stroke="#ddd"/>'
        yield _text(axis(value), _TOP - 14, f"{value:g}", "middle")


def _stacked(axis: _Linear, y: float, values: Sequence[float]) -> Iterator[str]:
    end, factor = 0.0, _shortened(axis, values)
    for color, value in zip(_COLORS, values, strict=False):  # the talk has the first five stages alone
        begin, end = end, end + factor * value
        width = axis(end) - axis(begin)
        yield f'<rect x="{axis(begin):.1f}" y="{y}" width="{width:.1f}" height="{_BAR}" fill="{color}"/>'
    if factor < 1.0:
        yield _text(axis(end) - 4, y + 12, f"shortened: {sum(values):,.0f}", "end", "#fff")


def _shortened(axis: _Linear, values: Sequence[float]) -> float:
    """Return the factor by which a bar that is too long is drawn."""
    return min(axis.end / sum(values), 1.0)


def _short(amount: float) -> str:
    for unit, name in ((1e6, "M"), (1e3, "k")):
        if amount >= unit:
            return f"{amount / unit:.3g}{name}"
    return f"{amount:g}"


def _text(x: float, y: float, text: str, anchor: str = "start", color: str = "#333") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{color}">{text}</text>'


def _svg(width: float, height: float, parts: Sequence[str]) -> str:
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
            f'height="{height:g}" font-family="sans-serif" font-size="12" fill="#333">',
            f'<rect width="{width:g}" height="{height:g}" fill="#fff"/>',
            *parts,
            "</svg>\n",
        ]
    )
