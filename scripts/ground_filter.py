"""Errors of the ground filter on the ISPRS samples and on classified clouds, for the tables of docs/terrain.md.

    python scripts/ground_filter.py DATA    # needs: pip install . laspy[lazrs] cloth-simulation-filter

DATA/ground holds the samples (.npz with xyz and classification: 2 ground, 1 object), DATA/airborne clouds whose class 2
is ground (.laz). Type I: share of the ground points that are lost; type II: share of the object points that are taken for
ground; total error: share of all points that are wrong. Seconds are the best of three. The cloth simulation is by its
authors (W. Zhang et al. 2016, doi:10.3390/rs8060501); of the settings in CLOTHS it has those of the least mean total error
of the samples, and in the last line those that are best for each.
"""

import functools
import itertools
import pathlib
import sys
import time

import CSF
import laspy
import numpy as np
from scansion import terrain

PUBLISHED = {"method": "morphological", "slope": 0.15, "window": 18.0, "threshold": 0.5, "scaling": 1.25}
#: Edge of the cloth's cells in metres, rigidness (1 steep to 3 flat), and whether slopes are smoothed afterwards.
CLOTHS = list(itertools.product((0.5, 1.0, 2.0), (1, 2, 3), (False, True)))


def cloth(xyz, settings):
    """Which points are ground by the cloth simulation; all other settings are its defaults."""
    simulation = CSF.CSF()
    simulation.params.cloth_resolution, simulation.params.rigidness, simulation.params.bSloopSmooth = settings
    simulation.setPointCloud(xyz)
    ground, others = CSF.VecInt(), CSF.VecInt()
    simulation.do_filtering(ground, others, False)
    found = np.zeros(len(xyz), bool)
    found[np.array(ground, int)] = True
    return found


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


def best_cloth(folder):
    """The settings of the least mean total error of the samples; prints this error, and that with the best of each."""
    totals = [
        [errors(cloth(xyz, settings)[counts], truth[counts])[2] for settings in CLOTHS]
        for name, xyz, truth, counts in samples(folder)
        if "isprs" in name
    ]
    means = np.mean(totals, 0)
    best = CLOTHS[int(np.argmin(means))]
    print(f"cloth simulation {best}: {means.min():.2f} %; with settings for each sample: {np.mean(np.min(totals, 1)):.2f} %")
    return best


def main(folder):
    methods = {
        "published": lambda xyz: terrain.ground_points(xyz, **PUBLISHED),
        "refined": terrain.ground_points,
        "cloth simulation": functools.partial(cloth, settings=best_cloth(folder)),
    }
    isprs = {name: [] for name in methods}
    print("| cloud | method | type I | type II | total | kappa | s per million points |\n|---|---|---|---|---|---|---|")
    for cloud, xyz, truth, counts in samples(folder):
        for name, method in methods.items():
            seconds = []
            for _ in range(3):
                start = time.perf_counter()
                found = method(xyz)
                seconds.append(time.perf_counter() - start)
            values = errors(found[counts], truth[counts])
            if "isprs" in cloud:
                isprs[name].append(values)
            cells = " | ".join(f"{v:.2f}" for v in [*values, min(seconds) / len(xyz) * 1e6])
            print(f"| {cloud} | {name} | {cells} |")
    for name, rows in isprs.items():
        print(f"| mean of the samples | {name} | " + " | ".join(f"{v:.2f}" for v in np.mean(rows, 0)) + " | |")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
