"""Partitions of an S3DIS room compared with published superpoints; prints the table of docs/cut-pursuit.md.

    python scripts/superpoints.py DATA    # needs: pip install . h5py

The file DATA/partition/s3dis_superpoints_reference.h5 holds voxels with colour, shape features and elevation, and three
levels of superpoints. For each level the strength is searched that gives the same number of segments. Oracle: share
of the voxels that are right if every segment gets its most frequent class. Boundary recall and precision as in
docs/partitions.md.
"""

import pathlib
import sys

import h5py
import numpy as np
from scansion import graph, segmentation

NEIGHBOURS, CUTOFF, POSITION = 10, 10, 0.1
COLUMNS = ("linearity", "planarity", "scattering", "verticality", "elevation")
UNKNOWN, TRIALS, CLOSE = 13, 16, 0.01


def load(path):
    """Coordinates, values, classes (-1 for unknown ones) and the published segments of each level."""
    with h5py.File(path) as file:
        voxels = file["level_0"]
        xyz = voxels["pos"][()]
        colour = voxels["rgb"][()] / 255
        values = np.column_stack([colour, *(voxels[c][()] for c in COLUMNS), POSITION * xyz])
        rows = np.repeat(np.arange(len(xyz)), np.diff(voxels["_csr_/y/pointers"][()]))
        votes = np.zeros((len(xyz), UNKNOWN + 1))
        votes[rows, voxels["_csr_/y/columns"][()]] = voxels["_csr_/y/values"][()]
        levels, segments = [], np.arange(len(xyz))
        for level in range(3):
            segments = file[f"level_{level}/super_index"][()].astype(int)[segments]
            levels.append(segments)
    truth = votes.argmax(1)
    return xyz, values.astype(np.float32), np.where(truth == UNKNOWN, -1, truth), levels


def oracle(segments, truth):
    known = truth >= 0
    votes = np.zeros((segments.max() + 1, UNKNOWN), int)
    np.add.at(votes, (segments[known], truth[known]), 1)
    return votes.max(1).sum() / known.sum()


def boundaries(segments, truth, edges):
    """Recall and precision; edges with an unknown end do not count."""
    a, b = edges[(truth[edges] >= 0).all(1)].T
    true, found = truth[a] != truth[b], segments[a] != segments[b]

    def met(wanted, others):
        near = np.zeros(len(truth), bool)
        near[a[others]] = near[b[others]] = True
        return (wanted & (near[a] | near[b])).sum() / max(wanted.sum(), 1)

    return met(true, found), met(found, true)


def search(method, values, edges, wanted):
    """The segments whose number is nearest to the wanted one."""
    strength, low, high, best = 0.1, None, None, None
    for _ in range(TRIALS):
        labels = method(values, edges, strength=strength, cutoff=CUTOFF).labels.astype(int)
        count = labels.max() + 1
        if best is None or abs(count - wanted) < abs(best.max() + 1 - wanted):
            best = labels
        if abs(count - wanted) < CLOSE * wanted:
            break
        low, high = (strength, high) if count > wanted else (low, strength)
        strength = np.sqrt(low * high) if low and high else strength * (2 if count > wanted else 0.5)
    return best


def main(data):
    xyz, values, truth, levels = load(data / "partition/s3dis_superpoints_reference.h5")
    edges = graph.knn_graph(xyz, k=NEIGHBOURS)[0].astype(int)
    print("| | segments | oracle | boundary recall | precision |")
    print("|---|---|---|---|---|")
    for published in levels:
        wanted = published.max() + 1
        rows = {"published": published}
        for method in (segmentation.cut_pursuit, segmentation.merge):
            rows[f"`{method.__name__}`"] = search(method, values, edges, wanted)
        for name, segments in rows.items():
            recall, precision = boundaries(segments, truth, edges)
            share = f"{100 * oracle(segments, truth):.2f} % | {100 * recall:.1f} % | {100 * precision:.1f} %"
            print(f"| {name} | {segments.max() + 1} | {share} |", flush=True)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
