"""Reference edges of real clouds, from fitted planes: to measure `scansion contours` on scans that nobody drew lines over.

    python scripts/contour_reference.py DATA [FOLDER]        # needs: numpy scipy laspy[lazrs] matplotlib

For each scene below DATA that is there, FOLDER (default: out) gets NAME.geojson with the lines, NAME.npz with the evaluated
points (`evaluated`: packed bits of a mask over the points of the file; `count`: their number), and pictures. The surfaces
come from region growing of its own: nothing here uses code or a model of Scansion, and the draws have fixed seeds.

- Creases are where the planes of two surfaces meet at an angle, as far as points of both lie beside the common line.
- Borders are straight parts of a surface's outline if the strip beyond has no points level with the surface, and a wider
  one none in front: what is in front (a tree above an eave, a chair before a wall) casts shadows, whose ends are no edges.
  In front is above for roofs and towards the middle of a room, where something must be seen behind the strip, too.

The evaluated region is where the reference is complete: points of surfaces (roofs: of class building), and those beside
reference lines, if farther than `doubt` from all that is unexplained: points of no surface (but ground), and outlines that
gave no line. From the air also smooth open ground far from all else. A sample of a found line counts for precision if the
nearest point of the cloud is evaluated (`counted`). For recall all reference lines count. Small objects, and walls seen from
the air, count for neither.
"""

import json
import pathlib
import sys
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from scipy.spatial import Delaunay, cKDTree

SCENES = ("airborne/lidarhd_housing.laz", "airborne/lidarhd_building.laz", "indoor/s3dis_office.ply")
GROUND, BUILDING = 2, 6


# Settings: lengths in metres, areas in square metres, angles in degrees. thin: one point of each cube of this size is used.
# Surfaces: noise, the greatest distance of a point from its plane; turn, the greatest angle between its normal and the plane's;
# steep, the least upward part of a plane's normal; area, the least; radius, the greatest circumradius of triangles that fill it.
# Lines: angle, the least between planes that give a crease; points within reach are beside a line; step, the length of the
# pieces that are judged; crease and border, the least lengths; straight, the greatest distance of an outline from a border;
# front, how far in front of a surface things may cast shadows; behind, how far behind a border something must be seen (0: need
# not). doubt: nothing is evaluated as near to what is unexplained.
ROOFS = SimpleNamespace(
    **dict(thin=0.05, noise=0.1, turn=15, steep=0.5, area=4, radius=0.5, angle=10, reach=0.45, step=0.4),
    **dict(crease=1.0, border=1.0, straight=0.15, front=30, behind=0, doubt=0.6),
)
ROOM = SimpleNamespace(
    **dict(thin=0.03, noise=0.025, turn=15, steep=0, area=0.4, radius=0.12, angle=20, reach=0.08, step=0.05),
    **dict(crease=0.3, border=0.6, straight=0.02, front=1.0, behind=1.2, doubt=0.12),
)


@dataclass
class Plane:
    """Points x of the plane fulfil normal . x = offset; the normal looks to the front; rows: its points."""

    normal: np.ndarray
    offset: float
    rows: np.ndarray

    def axes(self):
        """Two directions in the plane, across each other."""
        first = np.cross(self.normal, np.eye(3)[np.abs(self.normal).argmin()])
        return np.array([first, np.cross(self.normal, first)]) / np.linalg.norm(first)


def load(path):
    """Coordinates and classes; no classes for rooms (PLY with float x, y, z, then a byte and an int of labels)."""
    if path.suffix == ".ply":
        body = path.read_bytes().split(b"end_header\n", 1)[1]
        return np.frombuffer(body, [("xyz", "<f4", 3), ("label", "u1"), ("instance", "<i4")])["xyz"].astype(float), None
    import laspy

    cloud = laspy.read(path)
    return np.column_stack([cloud.x, cloud.y, cloud.z]), np.asarray(cloud.classification)


def fitted(groups):
    """Normals, offsets and roughness of the planes of least squares of groups of points, shape (n, k, 3)."""
    centres = groups.mean(axis=1)
    apart = groups - centres[:, None]
    values, axes = np.linalg.eigh(np.swapaxes(apart, 1, 2) @ apart / groups.shape[1])
    normals = axes[:, :, 0]
    return normals, (normals * centres).sum(axis=1), np.sqrt(np.maximum(values[:, 0], 0))


def surfaces(points, viewer, s):
    """Planes, and the plane of each point or -1. They grow from the flattest points on."""
    near = cKDTree(points).query(points, 14)[1]
    normals, _, rough = fitted(points[near])
    free, planes = np.ones(len(points), bool), []
    for seed in np.argsort(rough, kind="stable"):
        if free[seed] and rough[seed] < s.noise:
            rows = grown(seed, points, normals, near, free, s)
            free[rows] = free[seed] = False
            if len(rows) > 20:
                (normal,), (offset,), _ = fitted(points[None, rows])
                sign = 1 if viewer @ normal > offset else -1
                plane = Plane(sign * normal, sign * offset, rows)
                cells = np.floor(points[rows] @ plane.axes().T / (0.6 * s.radius))
                large = len(np.unique(cells, axis=0)) * (0.6 * s.radius) ** 2 > s.area
                planes += [plane] if large and abs(plane.normal[2]) >= s.steep else []
    if not planes:
        raise ValueError(f"no surface of {s.area} square metres or more")
    return planes, settled(planes, points, near, s)


def grown(seed, points, normals, near, free, s):
    """Rows of the plane that grows from a point over free neighbours; it is fitted anew whenever it is a third larger."""
    rows = frontier = near[seed][free[near[seed]]]
    taken, last = ~free, 0
    taken[rows] = True
    (normal,), (offset,), _ = fitted(points[None, near[seed]])
    while len(frontier):
        found = np.unique(near[frontier])
        found = found[~taken[found]]
        fits = np.abs(points[found] @ normal - offset) < s.noise
        frontier = found[fits & (np.abs(normals[found] @ normal) > np.cos(np.radians(s.turn)))]
        taken[frontier] = True
        rows = np.concatenate([rows, frontier])
        if len(rows) > 1.3 * last and len(rows) > 8:
            (normal,), (offset,), _ = fitted(points[None, rows])
            last = len(rows)
    return rows[np.abs(points[rows] @ normal - offset) < s.noise]


def settled(planes, points, near, s):
    """The plane of each point, or -1: the nearest of those of its neighbours, six times in turn. Sets the planes' rows."""
    label, every = np.full(len(points), -1), np.arange(len(points))
    for number, plane in enumerate(planes):
        label[plane.rows] = number
    normals, offsets = np.array([p.normal for p in planes]), np.array([p.offset for p in planes])
    for _ in range(6):
        around = label[near]
        away = np.abs(np.einsum("ni,nki->nk", points, normals[around]) - offsets[around])
        away[around < 0] = np.inf
        best = away.argmin(axis=1)
        label = np.where(away[every, best] < s.noise, around[every, best], -1)
    for number, plane in enumerate(planes):
        plane.rows = np.flatnonzero(label == number)
    return label


def occupied(along, low, count, step):
    """Which of the `count` pieces of a line from `low` on hold points, given where along it they lie."""
    pieces = np.floor((along - low) / step).astype(int)
    return np.bincount(pieces[(pieces >= 0) & (pieces < count)], minlength=count) > 0


def runs(start, way, low, step, marks, least):
    """Lines along the runs of marked pieces; one that is not marked does not end a run."""
    at = np.flatnonzero(marks)
    groups = [g for g in np.split(at, np.flatnonzero(np.diff(at) > 2) + 1) if len(g)]
    spans = [(low + g[0] * step, low + (g[-1] + 1) * step) for g in groups]
    return [np.array([start + a * way, start + b * way]) for a, b in spans if b - a >= least]


def creases(planes, points, s):
    """Lines where two planes meet, as far as points of both lie beside them."""
    boxes = [(points[p.rows].min(axis=0) - s.reach, points[p.rows].max(axis=0) + s.reach) for p in planes]
    for i, j in zip(*np.triu_indices(len(planes), 1)):
        pair, way = (planes[i], planes[j]), np.cross(planes[i].normal, planes[j].normal)
        low, high = np.maximum(boxes[i][0], boxes[j][0]), np.minimum(boxes[i][1], boxes[j][1])
        if np.linalg.norm(way) < np.sin(np.radians(s.angle)) or (low > high).any():
            continue
        way /= np.linalg.norm(way)
        known = [*(p.offset for p in pair), way @ (low + high) / 2]
        start = np.linalg.solve([*(p.normal for p in pair), way], known)
        sides = [beside(points[p.rows] - start, way, s.reach) for p in pair]
        first, last = (max(map(np.min, sides)), min(map(np.max, sides))) if all(map(len, sides)) else (0, -1)
        if last > first:
            count = int((last - first) / s.step) + 1
            both = np.logical_and(*(occupied(side, first, count, s.step) for side in sides))
            yield from runs(start, way, first, s.step, both, s.crease)


def beside(points, way, reach):
    """Where along a line through the origin the points within reach of it lie."""
    along = points @ way
    return along[np.linalg.norm(points - along[:, None] * way, axis=1) < reach]


def outline(points, radius):
    """Rows of the vertices of the outline, holes included, of a plane's points: triangles of small circumradius fill it."""
    triangles = Delaunay(points).simplices
    a, b, c = points[triangles].swapaxes(0, 1)
    sides = np.prod([np.linalg.norm(u - v, axis=1) for u, v in ((a, b), (b, c), (c, a))], axis=0)
    kept = triangles[sides < 2 * radius * np.abs(np.linalg.det(np.stack([b - a, c - a], axis=1)))]
    edges, count = np.unique(np.sort(kept[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)), axis=0, return_counts=True)
    return np.unique(edges[count == 1])


def straight_parts(vertices, s):
    """Straight runs of an outline: place, direction and vertices; one line after the other, that of most vertices first."""
    rng, misses = np.random.default_rng(0), 0
    while len(vertices) > 4 and misses < 10:
        place, way = through(best_line(vertices, rng, s))
        along, across = (vertices - place) @ way, (vertices - place) @ [-way[1], way[0]]
        rows = np.flatnonzero(np.abs(across) < s.straight)
        rows = rows[np.argsort(along[rows])]
        groups = np.split(rows, np.flatnonzero(np.diff(along[rows]) > 2 * s.radius) + 1)
        groups = [g for g in groups if len(g) > 3 and np.ptp(along[g]) >= s.border]
        yield from ((*through(vertices[g]), vertices[g]) for g in groups)
        misses, gone = misses + (not groups), np.isin(np.arange(len(vertices)), rows[: not groups])
        for first, last in ((along[g[0]], along[g[-1]]) for g in groups):  # A second line within the outline's roughness is none.
            gone |= (np.abs(across) < 3 * s.straight) & (along >= first) & (along <= last)
        vertices = vertices[~gone]


def best_line(vertices, rng, s):
    """Of 200 lines through two vertices that are not too near, the vertices by the line that has most."""
    best = vertices[:2]
    for first, second in vertices[rng.integers(len(vertices), size=(200, 2))]:
        way, size = second - first, np.linalg.norm(second - first)
        if size > s.crease / 2:
            away, far = (vertices - first) @ [-way[1], way[0]] / size, np.linalg.norm(vertices - first, axis=1)
            by = vertices[(np.abs(away) < s.straight) & (far < 2 * size)]
            best = by if len(by) > len(best) else best
    return best


def through(vertices):
    """Middle and direction of the line of least squares."""
    middle = vertices.mean(axis=0)
    return middle, np.linalg.svd(vertices - middle, full_matrices=False)[2][0]


def borders(plane, vertices, members, points, box, s):
    """Straight parts of a plane's outline, of which the vertices are given, beyond which nothing is level or in front."""
    axes, height = plane.axes(), points @ plane.normal - plane.offset
    for place, way, own in straight_parts(vertices @ axes.T, s):
        out = np.array([-way[1], way[0]])
        inner = (members @ axes.T - place)[np.linalg.norm(members @ axes.T - place, axis=1) < s.border]
        out = -out if (inner @ out).mean() > 0 else out
        place = place + out * np.quantile((own - place) @ out, 0.75)
        low, high = ((own - place) @ way).min(), ((own - place) @ way).max()
        start, way, out = place @ axes + plane.offset * plane.normal, way @ axes, out @ axes
        along, beyond = (points - start) @ way, (points - start) @ out - 2 * s.straight
        count = int((high - low) / s.step) + 1
        step, strip = (high - low) / count, (beyond > 0) & (beyond < s.reach)
        level, before = strip & (np.abs(height) < 1.5 * s.noise), (beyond > 0) & (beyond < 2 * s.reach) & (height > 0)
        blocked, back = level | before & (height < s.front), strip & (height < -1.5 * s.noise)
        places = start + ((np.arange(count)[:, None] + 0.5) * step + low) * way + 2 * s.reach * out
        free = ((places > box[0]) & (places < box[1]))[:, :2].all(axis=1) & ~occupied(along[blocked], low, count, step)
        if s.behind:
            free &= occupied(along[back & (height > -s.behind)], low, count, step)
        yield from runs(start, way, low, step, free, s.border)


def joined(lines, reach):
    """Lines whose ends are moved along them to where they pass another line, if that is near to both."""
    lines = np.array(lines).reshape(-1, 2, 3)
    sizes = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    ways, moved = (lines[:, 1] - lines[:, 0]) / sizes[:, None], lines.copy()
    for i, j in np.ndindex(len(lines), 2):
        cosines, gaps = ways @ ways[i], lines[i, j] - lines[:, 0]
        own = (gaps * ways).sum(axis=1)
        along = (cosines * own - gaps @ ways[i]) / np.maximum(1 - cosines**2, 0.1)
        at = lines[i, j] + along[:, None] * ways[i]
        there = lines[:, 0] + np.clip(own + along * cosines, -reach, sizes + reach)[:, None] * ways
        good = (np.abs(cosines) < 0.9) & (np.abs(along) < reach) & (np.linalg.norm(there - at, axis=1) < reach / 2)
        if good.any():
            moved[i, j] = at[np.where(good, np.abs(along), np.inf).argmin()]
    return moved


def distances(lines, places, step):
    """Distance of each place from the nearest of samples of the lines."""
    parts = [np.linspace(*line, int(np.linalg.norm(line[1] - line[0]) / step) + 2) for line in lines]
    return cKDTree(np.concatenate(parts)).query(places)[0] if parts else np.full(len(places), np.inf)


def derived(path):
    """Lines, how many of them (the first) are creases, mask of the evaluated points, all points, and the origin of both."""
    points, classes = load(pathlib.Path(path))
    origin = np.floor(points.min(axis=0))
    points, s = points - origin, ROOM if classes is None else ROOFS
    rows = np.sort(np.unique(np.floor(points / s.thin).astype(int), axis=0, return_index=True)[1])
    solid = points[rows if classes is None else rows[classes[rows] == BUILDING]]
    viewer = np.median(points, axis=0) if classes is None else np.array([0, 0, 1e5])
    planes, label = surfaces(solid, viewer, s)
    found = list(creases(planes, solid, s))
    count, box = len(found), (points.min(axis=0), points.max(axis=0))
    outlines = [solid[p.rows][outline(solid[p.rows] @ p.axes().T, s.radius)] for p in planes]
    open_ones = [vertices[distances(found, vertices, s.step / 8) > s.reach] for vertices in outlines]
    for plane, vertices in zip(planes, open_ones):
        found += borders(plane, vertices, solid[plane.rows], points, box, s)
    lines = joined(found, s.reach)
    return lines, count, evaluated(points, classes, solid, label, np.concatenate(outlines), lines, s), points, origin


def evaluated(points, classes, solid, label, vertices, lines, s):
    """Mask of the points where the reference is complete, by the rule at the top of this file."""
    own, ground = (np.full(len(points), True),) * 2 if classes is None else (classes == BUILDING, classes == GROUND)
    away = distances(lines, points, s.step / 8)
    explained = own & (label[cKDTree(solid).query(points)[1]] >= 0)
    strange = ~explained & (away > s.reach) & (own | ~ground)
    open_ones = vertices[distances(lines, vertices, s.step / 8) > s.reach / 2]
    doubts = np.concatenate([points[strange], open_ones, [[1e9] * 3]])
    mask = own & (explained | (away < s.reach)) & (cKDTree(doubts).query(points)[0] > s.doubt)
    return mask if classes is None else mask | open_ground(points, ground)


def open_ground(points, ground, clear=1.5, rough=0.03):
    """Ground `clear` metres from everything else and from the end of the scan, smooth within about a metre."""
    inside = ((points > points.min(axis=0) + clear) & (points < points.max(axis=0) - clear))[:, :2].all(axis=1)
    rows = np.flatnonzero(ground & inside)
    rows = rows[cKDTree(points[~ground][:, :2]).query(points[rows, :2])[0] > clear]
    smooth = fitted(points[ground][cKDTree(points[ground]).query(points[rows], 60)[1]])[2] < rough
    return np.isin(np.arange(len(points)), rows[smooth])


def reference(path):
    """Reference lines, shape (m, 2, 3), in the coordinates of the file, and the mask of its evaluated points."""
    lines, _, mask, _, origin = derived(path)
    return lines + origin, mask


def counted(places, points, mask):
    """Which places along found lines count for precision: those whose nearest point is evaluated."""
    return mask[cKDTree(points).query(places)[1]]


def write(path, lines, creases_first, mask, origin):
    """PATH.geojson and PATH.npz."""
    kinds = ["crease"] * creases_first + ["border"] * (len(lines) - creases_first)
    shapes = [{"type": "LineString", "coordinates": (line + origin).round(3).tolist()} for line in lines]
    features = [{"type": "Feature", "properties": {"kind": k}, "geometry": shape} for k, shape in zip(kinds, shapes)]
    path.with_suffix(".geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    np.savez_compressed(path.with_suffix(".npz"), evaluated=np.packbits(mask), count=len(mask))


def picture(path, lines, creases_first, mask, points, x, y):
    """The cloud in grey, evaluated points darker; creases red, borders blue."""
    import matplotlib.pyplot as plot

    figure, axis = plot.subplots(figsize=(20, 20 * np.ptp(points[:, y]) / np.ptp(points[:, x])), layout="constrained")
    for own, colour in ((~mask, "0.8"), (mask, "0.5")):
        axis.scatter(*points[own][:, [x, y]].T, s=0.8, c=colour, linewidths=0)
    for number, line in enumerate(lines):
        axis.plot(*line[:, [x, y]].T, "r" if number < creases_first else "b", linewidth=1.5)
    axis.set_aspect("equal")
    figure.savefig(path, dpi=80)
    plot.close(figure)


def main(data, folder="out"):
    out = pathlib.Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    for path in (pathlib.Path(data) / scene for scene in SCENES):
        if not path.exists():
            print(f"{path.stem}: absent, left out")
            continue
        lines, count, mask, points, origin = derived(path)
        write(out / path.stem, lines, count, mask, origin)
        for view, x, y in (("top", 0, 1), ("front", 0, 2), ("side", 1, 2))[: 3 if path.suffix == ".ply" else 1]:
            picture(out / f"{path.stem}_{view}.png", lines, count, mask, points, x, y)
        sizes = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
        kinds = f"{count} creases of {sizes[:count].sum():.0f} m, {len(lines) - count} borders of {sizes[count:].sum():.0f} m"
        print(f"{path.stem}: {kinds}, {100 * mask.mean():.0f} % of {len(mask)} points evaluated", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
