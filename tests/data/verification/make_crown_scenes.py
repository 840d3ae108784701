"""
Make crown_scenes.csv: crowns full of discs, leaf by leaf, by Monte Carlo.

Takes ten minutes. Run it in this folder. It reads the places of the crowns in crown_places.csv.
"""

import math

import numpy as np
import pandas as pd
from numba import njit

HEADER = """# Two scenes of RAMI-3: crowns at the places of crown_places.csv, full of discs with spherical leaf angles,
# over Lambertian ground, repeated without end. Sun at 20 degrees, principal plane, no skylight.
# HET01: spheres of 10 m radius between 0 and 30 m above 100 m x 100 m, 50000 discs of 0.1 m radius in each; leaf
# reflectance 0.4957, transmittance 0.4409; ground 0.159. Leaf area index 2.356 of the ground, crown cover 0.4712.
# HET04: spheres of 4 m radius, and upright cylinders of 3 m radius and 12 m height, between 0 and 15 m above 270 m x
# 270 m; 32000 discs of 0.05 m radius in each sphere and 18000 in each cylinder; leaf reflectance 0.49 and 0.45,
# transmittance 0.41 and 0.30; ground 0.15. Leaf area index 1.50 of the ground. The crowns, seen from above, cover
# 0.2989 of the ground: computed from their places; at random places, crowns of the same areas would cover 0.2592.
# Source: Monte Carlo by make_crown_scenes.py, which puts the discs at random into their crowns; scenes of Widlowski et
# al. (2007), doi 10.1029/2006JD007821. raa 0 has sun and sensor on the same side.
# vza, raa [degree]; brf: bidirectional reflectance factor [1]; sd: its standard deviation [1].
"""

# By shape: radius and height of the crown, number and radius of its discs, their reflectance and transmittance.
SCENES = {
    "HET01": {
        "size": (100.0, 31.0),
        "background": 0.159,
        "crowns": {"sphere": (10.0, 20.0, 50_000, 0.1, 0.4957, 0.4409)},
    },
    "HET04": {
        "size": (270.0, 15.1),
        "background": 0.15,
        "crowns": {
            "sphere": (4.0, 8.0, 32_000, 0.05, 0.49, 0.41),
            "cylinder": (3.0, 12.0, 18_000, 0.05, 0.45, 0.30),
        },
    },
}
SZA = 20.0
VIEWS = np.arange(-75.0, 76.0, 10.0)


def discs_of(shape, radius, height, count, rng):
    """Centres and normals of discs at random places of a crown, from its middle or the foot of its axis. [m]"""
    if shape == "sphere":
        outward = rng.normal(size=(count, 3))
        outward /= np.linalg.norm(outward, axis=1)[:, None]
        centres = radius * outward * rng.uniform(size=(count, 1)) ** (1 / 3)
    else:
        turn, away = rng.uniform(0, 2 * np.pi, count), radius * np.sqrt(rng.uniform(size=count))
        upward = rng.uniform(0, height, count)
        centres = np.stack([away * np.cos(turn), away * np.sin(turn), upward], axis=1)
    normals = rng.normal(size=(count, 3))
    return centres, normals / np.linalg.norm(normals, axis=1)[:, None]


def voxels_of(centres, size, low, high, edge):
    """Discs by voxels of a box: where the list of each begins, and the lists."""
    counts = np.ceil((high - low) / edge).astype(int)
    first = np.clip(((centres - size - low) // edge).astype(int), 0, counts - 1)
    last = np.clip(((centres + size - low) // edge).astype(int), 0, counts - 1)
    places, discs = [], []
    for number, (begin, end) in enumerate(zip(first, last, strict=True)):
        cells = np.stack(np.meshgrid(*map(np.arange, begin, end + 1), indexing="ij"), axis=-1).reshape(-1, 3)
        places.append(np.ravel_multi_index(cells.T, counts))
        discs.append(np.full(len(cells), number))
    places, discs = np.concatenate(places), np.concatenate(discs)
    starts = np.concatenate([[0], np.cumsum(np.bincount(places, minlength=counts.prod()))])
    return counts, starts, discs[np.argsort(places, kind="stable")]


@njit
def _disc_hit(origin, ray, low, edge, counts, starts, listed, centres, normals, size, near, far):
    """Distance to the first disc of one crown between two distances, and its number; in the crown's coordinates."""
    cell = np.empty(3, np.int64)
    step = np.empty(3, np.int64)
    following = np.empty(3)
    delta = np.empty(3)
    for axis in range(3):
        at = (origin[axis] + (near + 1e-9) * ray[axis] - low[axis]) / edge
        cell[axis] = min(max(math.floor(at), 0), counts[axis] - 1)
        step[axis] = 1 if ray[axis] > 0 else -1
        if abs(ray[axis]) < 1e-12:
            following[axis], delta[axis] = np.inf, np.inf
        else:
            border = low[axis] + edge * (cell[axis] + (1 if ray[axis] > 0 else 0))
            following[axis] = (border - origin[axis]) / ray[axis]
            delta[axis] = edge / abs(ray[axis])
    best, found = far, -1
    while True:
        place = (cell[0] * counts[1] + cell[1]) * counts[2] + cell[2]
        for k in range(starts[place], starts[place + 1]):
            disc = listed[k]
            slope = normals[disc, 0] * ray[0] + normals[disc, 1] * ray[1] + normals[disc, 2] * ray[2]
            if abs(slope) < 1e-9:
                continue
            distance, offset = 0.0, 0.0
            for axis in range(3):
                distance += normals[disc, axis] * (centres[disc, axis] - origin[axis])
            distance /= slope
            if near < distance < best:
                for axis in range(3):
                    offset += (origin[axis] + distance * ray[axis] - centres[disc, axis]) ** 2
                if offset <= size * size:
                    best, found = distance, disc
        axis = 0
        if following[1] < following[axis]:
            axis = 1
        if following[2] < following[axis]:
            axis = 2
        if following[axis] > best:
            return best, found
        cell[axis] += step[axis]
        if cell[axis] < 0 or cell[axis] >= counts[axis]:
            return best, found
        following[axis] += delta[axis]


@njit
def _crown_span(origin, ray, round_, radius, height, size):
    """Distances at which a ray enters and leaves a crown with its discs; the second is the smaller where it misses."""
    radius = radius + size
    if round_:
        along = origin[0] * ray[0] + origin[1] * ray[1] + origin[2] * ray[2]
        inside = along**2 - (origin[0] ** 2 + origin[1] ** 2 + origin[2] ** 2 - radius**2)
        if inside <= 0:
            return 1.0, 0.0
        root = math.sqrt(inside)
        return max(-along - root, 0.0), -along + root
    a = ray[0] ** 2 + ray[1] ** 2
    b = origin[0] * ray[0] + origin[1] * ray[1]
    c = origin[0] ** 2 + origin[1] ** 2 - radius**2
    enter, leave = 0.0, np.inf
    if a > 1e-18:
        inside = b * b - a * c
        if inside <= 0:
            return 1.0, 0.0
        root = math.sqrt(inside)
        enter, leave = max((-b - root) / a, 0.0), (-b + root) / a
    elif c > 0:
        return 1.0, 0.0
    if abs(ray[2]) > 1e-12:
        one, two = (-size - origin[2]) / ray[2], (height + size - origin[2]) / ray[2]
        enter, leave = max(enter, min(one, two)), min(leave, max(one, two))
    elif not -size < origin[2] < height + size:
        return 1.0, 0.0
    return enter, leave


@njit
def _hit(origin, ray, near, scene, crowns, kinds, tables):
    """Distance to the first hit of a ray, and its crown and disc: -1 and -1 for the ground, -2 for the sky."""
    width, top, squares, begin, members = scene
    edge = width / squares
    # Where it leaves the layer of crowns.
    if abs(ray[2]) < 1e-9:
        return np.inf, -2, -2
    ground = ray[2] < 0
    best = -origin[2] / ray[2] if ground else (top - origin[2]) / ray[2]
    crown, disc = (-1, -1) if ground else (-2, -2)
    column, row = math.floor(origin[0] / edge), math.floor(origin[1] / edge)
    following = np.array([np.inf, np.inf])
    delta = np.array([np.inf, np.inf])
    if abs(ray[0]) > 1e-12:
        following[0] = (edge * (column + (1 if ray[0] > 0 else 0)) - origin[0]) / ray[0]
        delta[0] = edge / abs(ray[0])
    if abs(ray[1]) > 1e-12:
        following[1] = (edge * (row + (1 if ray[1] > 0 else 0)) - origin[1]) / ray[1]
        delta[1] = edge / abs(ray[1])
    own = np.empty(3)
    while True:
        square = (row % squares) * squares + column % squares
        for k in range(begin[square], begin[square + 1]):
            number = members[k]
            for axis in range(3):
                own[axis] = origin[axis] - crowns[number, axis]
            # The nearest of the repeated crowns to the middle of this square.
            for axis, place in enumerate((column, row)):
                own[axis] -= width * round(((place + 0.5) * edge - origin[axis] + own[axis]) / width)
            kind = kinds[number]
            round_, radius, height, size, low, voxel, counts, starts, listed, centres, normals = tables[kind]
            enter, leave = _crown_span(own, ray, round_, radius, height, size)
            enter = max(enter, near)
            if enter < leave and enter < best:
                distance, found = _disc_hit(
                    own, ray, low, voxel, counts, starts, listed, centres, normals, size, enter, min(leave, best)
                )
                if found >= 0:
                    best, crown, disc = distance, number, found
        axis = 0 if following[0] < following[1] else 1
        if following[axis] > best:
            return best, crown, disc
        if axis == 0:
            column += 1 if ray[0] > 0 else -1
        else:
            row += 1 if ray[1] > 0 else -1
        following[axis] += delta[axis]


@njit
def _turned(normal, sign, rng):
    """Direction of a cosine law about a normal or its opposite."""
    while True:
        x, y = rng.uniform(-1, 1), rng.uniform(-1, 1)
        if x * x + y * y < 1:
            break
    z = math.sqrt(1 - x * x - y * y)
    helper = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
    first = np.cross(normal, helper)
    first /= np.sqrt(np.sum(first**2))
    return x * first + y * np.cross(normal, first) + sign * z * normal


@njit
def _reflectance(view, sun, paths, rng, background, scene, crowns, kinds, tables, optics):
    """Bidirectional reflectance factor toward a view, and its standard deviation, from paths back from the sensor."""
    width, top = scene[0], scene[1]
    total, squares = 0.0, 0.0
    upward = np.array([0.0, 0.0, 1.0])
    for _ in range(paths):
        origin = np.array([rng.uniform(0, width), rng.uniform(0, width), top])
        ray = -view
        weight, found = 1.0, 0.0
        while True:
            distance, crown, disc = _hit(origin, ray, 1e-7, scene, crowns, kinds, tables)
            if crown == -2:
                break
            origin = origin + distance * ray
            origin[0] %= width
            origin[1] %= width
            if crown == -1:
                origin[2] = 0.0
                normal, incoming = upward, 1.0
                back, through = background, 0.0
            else:
                normal = tables[kinds[crown]][10][disc]
                incoming = 1.0 if normal[0] * ray[0] + normal[1] * ray[1] + normal[2] * ray[2] < 0 else -1.0
                back, through = optics[kinds[crown]]
            lit = normal[0] * sun[0] + normal[1] * sun[1] + normal[2] * sun[2]
            scattered = back if lit * incoming > 0 else through
            if scattered > 0 and _hit(origin, sun, 1e-7, scene, crowns, kinds, tables)[1] == -2:
                found += weight * scattered * abs(lit) / sun[2]
            albedo = back + through
            weight *= albedo
            if weight < 0.1:
                if rng.uniform(0, 1) > weight / 0.2:
                    break
                weight = 0.2
            sign = incoming if rng.uniform(0, albedo) < back else -incoming
            ray = _turned(normal, sign, rng)
        total += found
        squares += found * found
    mean = total / paths
    return mean, math.sqrt(max(squares / paths - mean**2, 0.0) / paths)


def scene_of(name, seed):
    """What `_reflectance` takes of a scene."""
    about, rng = SCENES[name], np.random.default_rng(seed)
    (width, top), shapes = about["size"], list(about["crowns"])
    table = pd.read_csv("crown_places.csv", comment="#").query("scene == @name")
    crowns = table[["x", "y", "z"]].to_numpy(float) + [width / 2, width / 2, 0]
    kinds = table["shape"].map(shapes.index).to_numpy()
    tables, optics = [], []
    for shape, (radius, height, count, size, *leaf) in about["crowns"].items():
        centres, normals = discs_of(shape, radius, height, count, rng)
        round_ = shape == "sphere"
        # Discs whose centres lie at the surface of a crown reach beyond it.
        low = np.array([-radius, -radius, -radius if round_ else 0.0]) - size
        edge = 8 * size
        voxels = voxels_of(centres, size, low, low + np.array([2 * radius, 2 * radius, height]) + 2 * size, edge)
        tables.append((round_, radius, height, size, low, edge, *voxels, centres, normals))
        optics.append(leaf)
    squares = int(width // 9)
    edge = width / squares
    members = [[] for _ in range(squares**2)]
    for number, (x, y) in enumerate(crowns[:, :2]):
        reach = tables[kinds[number]][1] + tables[kinds[number]][3]
        for row in range(math.floor((y - reach) / edge), math.floor((y + reach) / edge) + 1):
            for column in range(math.floor((x - reach) / edge), math.floor((x + reach) / edge) + 1):
                members[(row % squares) * squares + column % squares].append(number)
    begin = np.concatenate([[0], np.cumsum([len(each) for each in members])])
    scene = width, top, squares, begin, np.array([number for each in members for number in each])
    return about["background"], scene, crowns, kinds, tuple(tables), np.array(optics)


def reflectance(name, views=VIEWS, paths=100_000, seed=1):
    """Bidirectional reflectance factors of a scene across the principal plane, positive toward the sun."""
    background, *rest = scene_of(name, seed)
    sun = np.array([math.sin(math.radians(SZA)), 0.0, math.cos(math.radians(SZA))])
    found = []
    for number, vza in enumerate(np.radians(views)):
        view = np.array([math.sin(vza), 0.0, math.cos(vza)])
        found.append(_reflectance(view, sun, paths, np.random.default_rng([seed, number]), background, *rest))
    brf, sd = np.transpose(found)
    return pd.DataFrame({"vza": np.abs(views), "raa": np.where(views < 0, 180, 0), "brf": brf, "sd": sd})


if __name__ == "__main__":
    found = pd.concat([reflectance(name).assign(scene=name) for name in SCENES])
    with open("crown_scenes.csv", "w", encoding="utf-8") as sink:
        sink.write(HEADER)
        columns = ["scene", "vza", "raa", "brf", "sd"]
        found[columns].to_csv(sink, index=False, float_format="%.5g", lineterminator="\n")
