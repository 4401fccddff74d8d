"""Buffer views compressed by EXT_meshopt_compression.

Streams are untrusted: each byte is read within bounds, and what they become has a size known before.
Source: Khronos, EXT_meshopt_compression, appendices A (bitstream) and B (filters).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ispm.errors import SceneError
from ispm.optics.jit import jit

i64 = np.int64

_ATTRIBUTES, _TRIANGLES, _INDICES = 0xA0, 0xE1, 0xD1  # the first byte of a stream
_TAIL = 32  # bytes at least that end attributes, with the element before the first
_TABLE = 16  # bytes that end triangles: pairs of codes of corners
_RESERVED = 4  # bytes that end indices
_BLOCK, _MOST, _GROUP = 8192, 256, 16  # bytes and elements of a block at most, elements of a group
_EDGE_A, _EDGE_B, _VERTEX = range(3)  # rows of the queues of what was met last
_NEXT, _LAST, _AT, _EDGES, _VERTICES = range(5)  # of the state: vertices, a byte, how many were queued
_WORD = (1 << 32) - 1


def decode(stream: memoryview, mode: str, filtered: str, count: int, stride: int) -> np.ndarray:
    """Return the (count, stride) uint8 elements of a stream.

    mode      ATTRIBUTES, TRIANGLES or INDICES
    filtered  the filter: NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL
    stride    bytes of an element
    Raises SceneError where the stream is damaged, or the numbers do not go together.
    """
    data = np.array(stream, np.uint8)
    if mode == "ATTRIBUTES":
        if not 0 < stride <= _MOST or stride % 4:
            raise SceneError(f"elements of {stride} bytes; multiples of 4 up to {_MOST} are possible")
        out = np.zeros((count, stride), np.uint8)
        _require(decode_attributes(data, out))
        return _unfiltered(out, filtered)
    if stride not in (2, 4) or filtered != "NONE" or (mode == "TRIANGLES" and count % 3):
        raise SceneError(f"{count} {mode.lower()} of {stride} bytes, filter {filtered}, are not possible")
    corners = np.zeros(count, np.uint32)
    if mode == "TRIANGLES":
        _require(decode_triangles(data, np.zeros((3, 16), np.uint32), np.zeros(5, np.int64), corners))
    else:
        _require(decode_indices(data, np.zeros(5, np.int64), corners))
    _require(stride == 4 or not count or int(corners.max()) < 1 << 16)
    return corners.astype(f"<u{stride}").reshape(-1, 1).view(np.uint8)


def _require(whole: Any) -> None:
    if not whole:
        raise SceneError("its meshopt stream is damaged")


@jit
def decode_attributes(data, out):
    """Decode mode 0.

    data  (n,) uint8;  out  (count, stride) uint8
    -> whether the stream is whole
    """
    count, stride = out.shape
    end = i64(len(data)) - max(stride, _TAIL)
    if end < 1 or data[0] != _ATTRIBUTES:
        return False
    most = min((_BLOCK // stride) & ~15, _MOST)
    at = i64(1)
    for first in range(0, count, most):
        last = min(first + most, count)
        for byte in range(stride):
            before = i64(out[first - 1, byte]) if first else i64(data[len(data) - stride + byte])
            at = _decode_bytes(data, at, end, before, out[first:last, byte])
            if at < 0:
                return False
    return at == end


@jit
def _decode_bytes(data, at, end, before, out):
    """Decode one byte of each element of a block.

    data  (n,) uint8, of which those from `at` to `end` may be read
    before  of the element before;  out  (elements,) uint8
    -> where the next bytes begin; -1 where the data end before
    """
    groups = (len(out) + _GROUP - 1) // _GROUP
    header = at
    at += (groups + 3) // 4
    if at > end:
        return i64(-1)
    for group in range(groups):
        mode = i64(data[header + group // 4]) >> 2 * (group % 4) & 3
        bits = i64(0) if mode == 0 else i64(1) << mode
        packed = at
        at += 2 * bits
        if at > end:
            return i64(-1)
        for k in range(_GROUP):
            delta = i64(0)
            if mode:
                mask = (i64(1) << bits) - 1
                delta = i64(data[packed + k * bits // 8]) >> 8 - bits - k * bits % 8 & mask
                if mode < 3 and delta == mask:  # it does not fit
                    if at >= end:
                        return i64(-1)
                    delta = i64(data[at])
                    at += 1
            if group * _GROUP + k < len(out):
                before = before + _signed(delta) & 255
                out[group * _GROUP + k] = before
    return at


@jit(inline=True)
def _signed(code):
    """0, -1, 1, -2, ... of 0, 1, 2, 3, ..."""
    return code >> 1 ^ -(code & 1)


@jit
def decode_triangles(data, queues, state, out):
    """Decode mode 1.

    data    (n,) uint8
    queues  (3, 16) uint32, zeros: the ends of the last edges, the last vertices
    state   (5,) int64, zeros
    out     (3 T,) uint32
    -> whether the stream is whole
    """
    triangles = len(out) // 3
    end = i64(len(data)) - _TABLE
    if end < 1 + triangles or data[0] != _TRIANGLES:
        return False
    state[_AT] = 1 + triangles
    for triangle in range(triangles):
        code = i64(data[1 + triangle])
        if code < 0xF0:
            edge = state[_EDGES] - 1 - (code >> 4) & 15
            a, b = i64(queues[_EDGE_A, edge]), i64(queues[_EDGE_B, edge])
            third = code & 15
            if third == 13 or third == 14:
                state[_LAST] = state[_LAST] + (-1 if third == 13 else 1) & _WORD
                c = state[_LAST]
            else:
                c = _corner(data, end, third, third, queues, state)
            if third == 0 or third > 12:
                _queue_vertex(c, queues, state)
        else:
            first, pair = i64(0), i64(0)
            if code < 0xFE:
                pair = i64(data[end + (code & 15)])
            else:
                if state[_AT] >= end:
                    return False
                pair = i64(data[state[_AT]])
                state[_AT] += 1
                first = i64(0) if code == 0xFE else i64(15)
                if pair == 0:
                    state[_NEXT] = 0
            second, third = pair >> 4, pair & 15
            a = _corner(data, end, first, first - 1, queues, state)
            b = _corner(data, end, second, second - 1, queues, state)
            c = _corner(data, end, third, third - 1, queues, state)
            _queue_vertex(a, queues, state)
            if second == 0 or second == 15:
                _queue_vertex(b, queues, state)
            if third == 0 or third == 15:
                _queue_vertex(c, queues, state)
            _queue_edge(b, a, queues, state)
        if state[_AT] > end:
            return False
        _queue_edge(c, b, queues, state)
        _queue_edge(a, c, queues, state)
        out[3 * triangle], out[3 * triangle + 1], out[3 * triangle + 2] = a, b, c
    return state[_AT] == end


@jit
def _corner(data, end, code, back, queues, state):
    """Return a vertex by the code of a corner: 0: a new one, 15: the data tell, else one that was queued.

    data, end, queues, state  as of `decode_triangles`
    back  how many were queued since
    """
    if code == 0:
        state[_NEXT] += 1
        return state[_NEXT] - 1
    if code == 15:
        state[_LAST] = state[_LAST] + _signed(_number(data, end, state)) & _WORD
        return state[_LAST]
    return i64(queues[_VERTEX, state[_VERTICES] - 1 - back & 15])


@jit
def _queue_vertex(vertex, queues, state):
    """Keep a vertex; queues, state as of `decode_triangles`."""
    queues[_VERTEX, state[_VERTICES] & 15] = vertex
    state[_VERTICES] += 1


@jit
def _queue_edge(a, b, queues, state):
    """Keep an edge, by its vertices; queues, state as of `decode_triangles`."""
    queues[_EDGE_A, state[_EDGES] & 15] = a
    queues[_EDGE_B, state[_EDGES] & 15] = b
    state[_EDGES] += 1


@jit
def _number(data, end, state):
    """Return the number of seven bits a byte at state[_AT], which moves on; beyond `end` where it is cut."""
    number, shift = i64(0), i64(0)
    while shift < 35 and state[_AT] < end:
        byte = i64(data[state[_AT]])
        state[_AT] += 1
        number |= (byte & 127) << shift
        if byte < 128:
            return number & _WORD
        shift += 7
    state[_AT] = end + 1
    return i64(0)


@jit
def decode_indices(data, state, out):
    """Decode mode 2.

    data  (n,) uint8;  state  (5,) int64, zeros;  out  (count,) uint32
    -> whether the stream is whole
    """
    end = i64(len(data)) - _RESERVED
    if end < 1 or data[0] != _INDICES:
        return False
    state[_AT] = 1
    for k in range(len(out)):
        code = _number(data, end, state)
        if state[_AT] > end:
            return False
        last = _LAST if code & 1 else _NEXT  # each is a base for differences here
        state[last] = state[last] + _signed(code >> 1) & _WORD
        out[k] = state[last]
    return state[_AT] == end


def _unfiltered(rows: np.ndarray, filtered: str) -> np.ndarray:
    """(count, stride) uint8 elements without their filter. Raises SceneError for a stride that it has not."""
    stride = rows.shape[1]
    if filtered == "NONE":
        return rows
    if stride not in {"OCTAHEDRAL": (4, 8), "QUATERNION": (8,), "EXPONENTIAL": range(4, 257, 4)}[filtered]:
        raise SceneError(f"elements of {stride} bytes have no filter {filtered}")
    if filtered == "EXPONENTIAL":
        words = rows.view("<i4")
        with np.errstate(over="ignore"):
            values = np.ldexp((words << 8 >> 8).astype(np.float32), words >> 24)
        return np.asarray(values.astype("<f4").view(np.uint8))
    kind = f"<i{stride // 4}"
    stored = rows.view(kind)
    directions = _octahedral(stored) if filtered == "OCTAHEDRAL" else _quaternions(stored)
    scaled = directions * np.float32(np.iinfo(kind).max)
    rounded = np.copysign(np.floor(np.abs(scaled) + 0.5), scaled)
    return np.asarray(rounded.astype(kind).view(np.uint8))


def _octahedral(stored: np.ndarray) -> np.ndarray:
    """(n, 4) of which the first three are unit vectors, the last what keeps its bits."""
    values = stored.astype(np.float32)
    one = np.maximum(values[:, 2], 1.0)
    x, y = values[:, 0] / one, values[:, 1] / one
    z = 1.0 - np.abs(x) - np.abs(y)
    fold = np.minimum(z, 0.0)
    vectors = np.stack([x - np.copysign(fold, x), y - np.copysign(fold, y), z], axis=1)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.hstack([vectors, values[:, 3:] / np.float32(np.iinfo(stored.dtype).max)])


def _quaternions(stored: np.ndarray) -> np.ndarray:
    """(n, 4) unit quaternions, of which three components were stored."""
    values = stored.astype(np.float32)
    three = values[:, :3] / ((stored[:, 3:] | 3) * np.float32(math.sqrt(2.0)))
    greatest = np.sqrt(np.maximum(1.0 - (three * three).sum(axis=1), 0.0))
    result = np.empty_like(values)
    places = (stored[:, 3:] & 3) + np.arange(4) & 3
    np.put_along_axis(result, places, np.column_stack([greatest, three]), axis=1)
    return result
