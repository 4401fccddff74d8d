"""Which part of lamps and of the environment a pixel draws from: numbers that are even in its square."""

from __future__ import annotations

import math

import numpy as np

from ispm.optics.jit import jit
from ispm.optics.rng import random4

f32, i64, u32 = np.float32, np.int64, np.uint32

DIMENSION = 5 << 20  # of the random numbers
SIDE = 4  # pixels of a square that draws from each part once


@jit
def first_turn(view):
    """The turn, of 16, that a picture's first pass takes."""
    start, _, _, _ = random4(u32(0), u32(DIMENSION + 1), u32(0), view.seed)
    return i64(start * f32(SIDE * SIDE))


@jit
def _aside(first, square, view):
    """By how many columns and rows a pixel's part lies aside of its own place in the square.

    In 16 passes pixels draw from each part once, and soon from some far apart: turns are in the order of
    Bayer's matrix (1973). Each square has an order of its own, or what its pixels have not drawn from yet
    would make a pattern; but for the first turn: that pass's filter takes in parts of several squares.
    """
    parts = i64(SIDE * SIDE)
    turn = i64(view.pass_index) % parts
    if turn > i64(0):
        own, _, _, _ = random4(square, u32(DIMENSION + 1), u32(1), view.seed)
        swapped = i64(own * f32(parts))
        if turn != swapped:  # which stays, as turn 0 does
            turn ^= swapped
    turn ^= first
    b0, b1, b2, b3 = turn & 1, turn >> 1 & 1, turn >> 2 & 1, turn >> 3 & 1
    return 2 * b0 + b2, 2 * (b0 ^ b1) + (b2 ^ b3)


@jit
def numbers_of(view, i, k, first):
    """Three float32 random numbers of [0, 1) for draw k, of four, of row i: of lamps, and of what one of them
    or the environment is drawn by.

    The latter are from a row and a column of parts, in Graeco-Latin squares: four pixels side by side, and
    the four draws of one, are from each row and each column once. Where a filter takes in less than a whole
    square, as at the foot of a wall, or some pixels draw four times and others once, it is even in both.
    """
    square = u32((i // view.columns // SIDE) * view.columns + i % view.columns // SIDE)
    right, down = _aside(first, square, view)
    x, y, turned = i % view.columns % SIDE, i // view.columns % SIDE, _times_two(k)
    part = _part_of_lamps((x + right) % SIDE ^ k, (y + down) % SIDE ^ turned)
    column, row = x ^ y ^ right ^ k ^ turned, x ^ _times_two(y) ^ down ^ turned
    r0, r1, r2, _ = random4(u32(i), u32(DIMENSION) + u32(4 * k), view.pass_index, view.seed)
    # Shifted at random from square to square: a triangle is not to be drawn with the same parts of it. But
    # not from turn to turn, or a pixel in the shadow of one lamp of two would draw the other by chance.
    shift, _, _, _ = random4(square, u32(DIMENSION + 2), view.pass_index // u32(SIDE * SIDE), view.seed)
    u0 = (f32(part) + r0) * f32(1 / (SIDE * SIDE)) + shift
    u0 -= f32(math.floor(u0))
    return u0, (f32(column) + r1) * f32(1 / SIDE), (f32(row) + r2) * f32(1 / SIDE)


@jit
def _times_two(k):
    """2 k in the field of four elements, of which sums are `^`: that of y and of 2 y, added to x, are two
    orthogonal Latin squares (Bose, Sankhya 3, 1938)."""
    return (k << 1 & 3) ^ 3 * (k >> 1)


@jit
def _part_of_lamps(column, row):
    """Which of 16 parts of all lamps a place in the square draws from: half of each 2 x 2 places from either
    half of them, and so do a place's first two turns, and of four turns one from each quarter."""
    low, high = column & 1 ^ row & 1 ^ column >> 1, row >> 1 ^ column & 1
    return low << 3 | high << 2 | (row & 1) << 1 | column >> 1
