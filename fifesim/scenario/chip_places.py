"""Where the chips of a landscape lie: windows of the ground that do not overlap, by tiles of its random field."""

import math


def place_of(number, size, corner, tile, margin=(0, 0)):
    """
    First cell of a chip among those of a landscape.

    Chips fill one tile of the lattice after the other, in squares that grow about the tile of the corner: those of a
    tile follow each other, and none overlap. A tile also holds the margin around its chips, so that no chip needs two.

    Parameters
    ----------
    number : int
        From 0 on.
    size : (int, int)
        Rows and columns of a chip.
    corner : (int, int)
        Row and column on the lattice about which chips lie.
    tile : int
        Rows and columns of a tile. Chips that do not fit with their margin lie by their own size.
    margin : (int, int), optional
        Rows and columns of ground around a chip that its pixels see; margins of chips overlap.

    Returns
    -------
    row, column : int
        On the lattice.

    Examples
    --------
    Four chips fit into a tile:

    >>> [place_of(number, (4, 5), (0, 0), 10) for number in range(5)]
    [(0, 0), (0, 5), (4, 0), (4, 5), (0, 10)]

    One chip fits with a margin of two cells:

    >>> [place_of(number, (4, 5), (0, 0), 10, (2, 2)) for number in range(2)]
    [(2, 2), (2, 12)]
    """
    fitting = [max(tile - 2 * around, 0) // length for length, around in zip(size, margin, strict=True)]
    if not all(fitting):
        down, across = ring_place(number)
        return corner[0] + down * size[0], corner[1] + across * size[1]
    at, inside = divmod(number, math.prod(fitting))
    down, across = ring_place(at)
    row, column = divmod(inside, fitting[1])
    return (
        (corner[0] // tile + down) * tile + margin[0] + row * size[0],
        (corner[1] // tile + across) * tile + margin[1] + column * size[1],
    )


def ring_place(number):
    """
    Place on a square spiral.

    Parameters
    ----------
    number : int
        From 0 on.

    Returns
    -------
    down, across : int
        From the place of number 0.

    Examples
    --------
    >>> [ring_place(number) for number in range(6)]
    [(0, 0), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1)]
    """
    if not number:
        return 0, 0
    ring = (math.isqrt(number) + 1) // 2
    side, step = divmod(number - (2 * ring - 1) ** 2, 2 * ring)
    # Up the right side first, then leftward, down and rightward.
    along = step - ring + 1
    return [(-along, ring), (-ring, -along), (along, -ring), (ring, along)][side]
