"""Errors of the ground filter on the ISPRS samples and on classified clouds, for the tables of docs/terrain.md.

    python scripts/ground_filter.py DATA    # needs: pip install . laspy[lazrs]

DATA/ground holds the samples (.npz with xyz and classification: 2 ground, 1 object), DATA/airborne clouds whose class 2
is ground (.laz). Type I: share of the ground points that are lost; type II: share of the object points that are taken for
ground; total error: share of all points that are wrong. Seconds are the best of three.
"""

import pathlib
import sys
import time

import laspy
import numpy as np
from scansion import terrain

PUBLISHED = {"method": "morphological", "slope": 0.15, "window": 18.0, "threshold": 0.5, "scaling": 1.25}
METHODS = {"published": PUBLISHED, "refined": {}}


def samples(folder):
    """Name, coordinates, which points are ground, and which count."""
    for path in sorted((folder / "ground").glob("*.npz")):
        sample = np.load(path)
        code = sample["classification"]
        yield path.stem, sample["xyz"].astype(float), code == 2, code > 0
    for path in sorted((folder / "airborne").glob("*.laz")):
        las = laspy.read(path)
        code = np.asarray(las.classification)
        # Unclassified points of LiDAR HD may be ground; in AHN3, class 1 is everything above the ground.
        yield path.stem, np.stack([las.x, las.y, las.z], -1), code == 2, code > (0 if "ahn" in path.stem else 1)


def errors(found, truth):
    """Type I, type II and total error and Cohen's kappa, %."""
    table = np.array([[(found & truth).sum(), (~found & truth).sum()], [(found & ~truth).sum(), (~found & ~truth).sum()]])
    share = table / table.sum()
    chance = (share.sum(0) * share.sum(1)).sum()
    kappa = (np.trace(share) - chance) / (1 - chance)
    lost, taken = table[0, 1] / table[0].sum(), table[1, 0] / table[1].sum()
    return 100 * np.array([lost, taken, share[0, 1] + share[1, 0], kappa])


def main(folder):
    isprs = {name: [] for name in METHODS}
    print("| cloud | method | type I | type II | total | kappa | s per million points |\n|---|---|---|---|---|---|---|")
    for cloud, xyz, truth, counts in samples(folder):
        for name, settings in METHODS.items():
            seconds = []
            for _ in range(3):
                start = time.perf_counter()
                found = terrain.ground_points(xyz, **settings)
                seconds.append(time.perf_counter() - start)
            values = errors(found[counts], truth[counts])
            if "isprs" in cloud:
                isprs[name].append(values)
            cells = " | ".join(f"{v:.2f}" for v in [*values, min(seconds) / len(xyz) * 1e6])
            print(f"| {cloud} | {name} | {cells} |")
    for name, rows in isprs.items():
        if rows:
            print(f"| mean of the samples | {name} | " + " | ".join(f"{v:.2f}" for v in np.mean(rows, 0)) + " | |")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
