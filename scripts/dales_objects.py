"""What the built-in model makes of objects of the DALES data set, none of which it has learned from.

    python scripts/dales_objects.py DATA [--out FOLDER]        # needs: pip install '.[viz]'

DATA/objects holds `dales_objects_499.tar.gz`: 499 objects of an airborne scan of a Canadian town, labelled by hand, each cut
out of the scan. The objects of a kind are set on a made-up flat field, 10 m apart, with what a scan of the density of theirs
would have of the ground around them. Prints the classes of their points for docs/default-model.md. FOLDER gets a picture of
each field. Same inputs, same figures.
"""

import argparse
import io
import pathlib
import tarfile
from dataclasses import dataclass

import numpy as np
import scansion

#: Numbers of the first object of a kind and of the first of the next, and the codes that are right for it.
KINDS = {
    "building": (0, 100, (6,)),
    "car": (100, 200, (1,)),
    "fence": (200, 300, ()),
    "pole": (300, 400, ()),
    "tree": (400, 500, (3, 4, 5)),
}
#: Points per square metre of the ground, and its noise, metres.
DENSITY, NOISE = 40, 0.02
#: Distance between objects and height of their lowest point above the ground, metres.
GAP, LOWEST = 10.0, 0.15
#: Ground in cells of this edge that have points of an object is not seen, metres.
SHADOW = 0.25
#: Classes of the table.
GROUPS = {"ground": (2,), "vegetation": (3, 4, 5), "building": (6,), "unclassified": (1,), "noise, wires": (7, 14, 18)}


@dataclass(frozen=True)
class Field:
    """Objects on a field: coordinates, and the number of the object of each point, -1 for the ground."""

    xyz: np.ndarray
    number: np.ndarray

    @staticmethod
    def of(objects, rng):
        placed = list(shelves(objects))
        xyz = np.vstack(placed)
        number = np.repeat(np.arange(len(placed)), [len(rows) for rows in placed])
        size = xyz[:, :2].max(0) + GAP
        ground = rng.random((int(DENSITY * size.prod()), 3)) * [*size, 0]
        ground[:, 2] = rng.normal(0, NOISE, len(ground))
        ground = ground[~np.isin(cells(ground), cells(xyz))]
        return Field(np.vstack([xyz, ground]), np.concatenate([number, np.full(len(ground), -1)]))


def cells(xyz):
    """The number of the cell of each point in plan."""
    x, y = np.floor(xyz[:, :2] / SHADOW).astype(np.int64).T
    return x << 32 | y


def shelves(objects):
    """The objects in rows, the rows one behind the other; those that are deep together."""
    at, deep = np.array([GAP, GAP]), 0.0
    width = max(np.sqrt(sum((np.ptp(rows[:, :2], axis=0) + GAP).prod() for rows in objects)), 200.0)
    for rows in sorted(objects, key=lambda rows: np.ptp(rows[:, 1])):
        size = np.ptp(rows[:, :2], axis=0)
        if at[0] > GAP and at[0] + size[0] > width:
            at, deep = np.array([GAP, at[1] + deep + GAP]), 0.0
        yield rows - rows.min(0) + [*at, LOWEST]
        at, deep = at + [size[0] + GAP, 0], max(deep, size[1])


def objects_of(path, first, end):
    """Coordinates of the objects with these numbers."""
    with tarfile.open(path) as archive:
        members = [member for member in archive.getmembers() if member.name.endswith(".xyz")]
        for member in sorted(members, key=lambda member: member.name):
            if first <= int(pathlib.PurePath(member.name).stem) < end:
                yield np.loadtxt(io.BytesIO(archive.extractfile(member).read()))[:, :3]


def line(kind, field, codes, right):
    """A line of the table."""
    own = field.number >= 0
    shares = [f"{100 * np.isin(codes[own], group).mean():.1f}" for group in GROUPS.values()]
    hits = np.bincount(field.number[own], np.isin(codes[own], right)) / np.bincount(field.number[own])
    whole = f"{(hits > 0.5).sum()} of {len(hits)}" if right else "-"
    ground = 100 * (codes[~own] == 2).mean()
    return f"| {kind} | {own.sum():,} | {' | '.join(shares)} | {whole} | {ground:.1f} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path)
    given = parser.parse_args()
    model = scansion.PointClassifier.default()
    print(f"| kind | points | {' | '.join(GROUPS)} | more than half right | ground of the field found |")
    print("|---" * (len(GROUPS) + 4) + "|")
    for kind, (first, end, right) in KINDS.items():
        objects = list(objects_of(given.data / "objects/dales_objects_499.tar.gz", first, end))
        field = Field.of(objects, np.random.default_rng(first))
        cloud = scansion.PointCloud(field.xyz)
        cloud["Classification"] = np.asarray(model.classify(cloud).codes).astype(np.uint8)
        print(line(kind, field, np.asarray(cloud["Classification"]), right), flush=True)
        if given.out:
            given.out.mkdir(parents=True, exist_ok=True)
            scansion.render(cloud, given.out / f"{kind}.png", view="oblique", azimuth=30, elevation=50, width=1600)


if __name__ == "__main__":
    main()
