"""Streams that cut into rising ground: drainage down the steepest ways, stream power and hillslope creep."""

from typing import NamedTuple

import numpy as np
from numba import njit


class StreamPower(NamedTuple):
    r"""
    Law of erosion over one unit of time.

    .. math:: \frac{\partial z}{\partial t} = U - K A^m S + D \nabla^2 z

    with the uplift U, the erodibility K, the drained area A [m2] and its exponent m, the slope S and the creep D.
    """

    steps: int
    area_exponent: float
    uplift: float
    creep: float
    node: float  # distance of nodes [m]


@njit(nogil=True, cache=True)
def erode(start, erodibility, preference, law):
    """
    Ground after one unit of time of uplift, stream power and creep; its border stays.

    Parameters
    ----------
    start : array, shape (n, n)
        Ground before. [m]
    erodibility : array, shape (n, n)
        For drained areas in m2.
    preference : array, shape (8, n * n)
        Factors on the slopes to the neighbours, by which ways down are chosen. [1]
    law : StreamPower

    Returns
    -------
    ground : array, shape (n, n)
        Stream power is implicit, creep explicit in parts of a step. [m]

    References
    ----------
    [Braun2013]_
    """
    size, step = start.shape[0], 1.0 / law.steps
    ground, new = start.copy().ravel(), np.empty(size * size)
    receiver, order = np.empty(size * size, np.int32), np.empty(size * size, np.int32)
    drained, distance = np.empty(size * size, np.int32), np.ones(size * size)
    # Powers of areas, which are whole numbers of nodes; 0 where none has been asked for.
    powers, factor = np.zeros(size * size + 1), np.empty(size * size)
    # The explicit scheme is stable below a quarter.
    parts = int(law.creep * step / law.node**2 / 0.2) + 1
    share = law.creep * step / law.node**2 / parts
    for _ in range(law.steps):
        _receivers(ground, preference, size, law.node, receiver, distance)
        _drain(receiver, order, drained)
        _powers(drained, law.node**2, law.area_exponent, powers)
        _factors(step, erodibility.ravel(), powers, drained, distance, receiver, factor)
        _cut(order, receiver, factor, ground)
        for _ in range(parts):
            _creep(ground.reshape(size, size), share, law.uplift * step / parts, new.reshape(size, size))
            ground, new = new, ground
    return ground.reshape(size, size)


@njit(nogil=True, cache=True)
def least_ways(cost):
    """
    Least cost of a way from each node to the border, over eight neighbours.

    Parameters
    ----------
    cost : array, shape (n, n)
        Of a way of one node. [1]

    Returns
    -------
    way : array, shape (n, n)
        By sweeps until nothing changes. [node]
    """
    size = cost.shape[0]
    way = np.full((size, size), np.inf)
    way[0] = way[-1] = way[:, 0] = way[:, -1] = 0.0
    diagonal = np.sqrt(2.0)
    changed = True
    while changed:
        changed = False
        for sweep in range(4):
            for i in range(1, size - 1):
                y = i if sweep < 2 else size - 1 - i
                for j in range(1, size - 1):
                    x = j if sweep % 2 == 0 else size - 1 - j
                    for a in range(-1, 2):
                        for b in range(-1, 2):
                            length = diagonal if a * b != 0 else 1.0
                            through = way[y + a, x + b] + length * 0.5 * (cost[y, x] + cost[y + a, x + b])
                            if through < way[y, x]:
                                way[y, x] = through
                                changed = True
    return way


@njit(nogil=True, cache=True)
def _receivers(ground, preference, size, node, receiver, distance):
    """Where each node drains to: the neighbour down the steepest way, some being preferred; itself on the border."""
    for i in range(size * size):
        receiver[i] = i
    steepest = np.empty(size - 2)
    for y in range(1, size - 1):
        first = y * size + 1
        here, to = ground[first : first + size - 2], receiver[first : first + size - 2]
        far = distance[first : first + size - 2]
        steepest[:] = 0.0
        k = 0
        # Neighbour by neighbour and not node by node: each is a line of nodes without branches.
        for a in range(-1, 2):
            for b in range(-1, 2):
                if a == 0 and b == 0:
                    continue
                j = first + a * size + b
                there, liked = ground[j : j + size - 2], preference[k, first : first + size - 2]
                length = node * (np.sqrt(2.0) if a * b != 0 else 1.0)
                for x in range(size - 2):
                    slope = (here[x] - there[x]) / length * liked[x]
                    steeper = slope > steepest[x]
                    steepest[x] = slope if steeper else steepest[x]
                    to[x] = np.int32(j + x) if steeper else to[x]
                    far[x] = length if steeper else far[x]
                k += 1


@njit(nogil=True, cache=True)
def _drain(receiver, order, drained):
    """Order of nodes in which each comes before the one that it drains to, and the nodes that drain through each."""
    above = np.zeros(receiver.size, np.int32)
    for i in range(receiver.size):
        above[receiver[i]] += receiver[i] != i
    drained[:] = 1
    # Sources, then whatever all water has come to that flows into it. An entry stays if the count goes on past it:
    # a branch would be guessed wrongly at every other node.
    filled = 0
    for i in range(receiver.size):
        order[filled] = i
        filled += above[i] == 0
    for done in range(receiver.size):
        i = order[done]
        into = receiver[i]
        drained[into] += drained[i] if into != i else 0
        above[into] -= 1
        if filled < receiver.size:
            order[filled] = into
            filled += above[into] == 0


@njit(nogil=True, cache=True)
def _powers(drained, own, exponent, powers):
    """Powers of the areas of so many nodes, those that are not known yet."""
    for i in range(drained.size):
        if powers[drained[i]] == 0.0:
            powers[drained[i]] = (drained[i] * own) ** exponent


@njit(nogil=True, cache=True, error_model="numpy")
def _factors(step, erodibility, powers, drained, distance, receiver, factor):
    """What the implicit step weighs the receiver of a node with; 0 on the border, which stays."""
    for i in range(factor.size):
        cut = step * erodibility[i] * powers[drained[i]] / distance[i]
        factor[i] = cut if receiver[i] != i else 0.0


@njit(nogil=True, cache=True, error_model="numpy")
def _cut(order, receiver, factor, ground):
    """Ground after one implicit step of stream power, from the border upstream."""
    for k in range(order.size - 1, -1, -1):
        i = order[k]
        ground[i] = (ground[i] + factor[i] * ground[receiver[i]]) / (1.0 + factor[i])


@njit(nogil=True, cache=True)
def _creep(ground, share, uplift, new):
    new[:] = ground
    for y in range(1, ground.shape[0] - 1):
        north, row, south, out = ground[y - 1], ground[y], ground[y + 1], new[y]
        for x in range(1, row.size - 1):
            around = row[x - 1] + row[x + 1] + north[x] + south[x]
            out[x] = row[x] + share * (around - 4.0 * row[x]) + uplift
