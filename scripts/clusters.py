"""Feature sets A, B, C of Grilli, Poux and Remondino 2021 on real clouds; prints the tables of docs/clusters-results.md.

    python scripts/clusters.py DATA [SEEDS]    # needs: pip install .

Training part: the 2nd, 5th and 9th of ten slabs of equal numbers of points along the longer side of the cloud, 30 % of it;
the rest is the test part. "random" is a split of points, which have neighbours in the other part: its accuracy says little
about other places. 20,000 points of the training part are drawn for each seed. Scores are means over the seeds.
"""

import pathlib
import sys
import textwrap
import time

import numpy as np
import scansion
from scansion import segmentation

SCENES = {
    "oakland/part_14.laz": ("Mobile laser, street (Oakland part_14)", "Classification", []),
    "airborne/lidarhd_housing.laz": ("Airborne laser, housing (LiDAR HD)", "Classification", []),
    "indoor/s3dis_office.ply": ("Indoor, Matterport (S3DIS office)", "label", []),
    "airborne/ahn3_delft_west.laz": ("Airborne laser, town (AHN3 Delft)", "Classification", []),
    "airborne/lidarhd_farm_rgb.laz": ("Airborne laser with colour, farm (LiDAR HD)", "Classification", [1]),
}
RUNS = [("a", "rank"), ("a", "descriptor"), ("b", "rank"), ("c", "rank"), ("c", "descriptor")]
COLOUR = ("Red", "Green", "Blue")
DRAWN = 20_000


def load(path, column, ignored):
    cloud = scansion.read(path)
    name = next(name for name in cloud.columns if name.lower() == column.lower())
    code = np.asarray(cloud[name]).astype(np.int64)
    kept = np.isfinite(cloud.xyz).all(1) & ~np.isin(code, ignored)
    rgb = {n: np.asarray(cloud[n])[kept] for n in COLOUR if n in cloud.columns}
    return scansion.PointCloud(cloud.xyz[kept], **rgb), code[kept], len(rgb) == 3


def slabs(xyz):
    """Whether a point is in the training part."""
    axis = int(np.argmax(np.ptp(xyz[:, :2], axis=0)))
    rank = np.empty(len(xyz), np.int64)
    rank[np.argsort(xyz[:, axis], kind="stable")] = np.arange(len(xyz))
    return np.isin(10 * rank // len(xyz), [1, 4, 8])


def scores(truth, found):
    """Overall accuracy, weighted F1, macro F1, F1 of each class of the test part."""
    classes, counts = np.unique(truth, return_counts=True)
    f1 = []
    for c in classes:
        right = ((truth == c) & (found == c)).sum()
        f1.append(2 * right / max((truth == c).sum() + (found == c).sum(), 1))
    return (truth == found).mean(), np.average(f1, weights=counts), np.mean(f1), dict(zip(classes, f1, strict=True))


def learn(table, code, train, seeds):
    rows = []
    for seed in range(seeds):
        random = np.random.default_rng(seed)
        inside = np.flatnonzero(train)
        picked = random.choice(inside, min(DRAWN, len(inside)), replace=False)
        forest = scansion.RandomForestClassifier(random_state=seed).fit(table[picked], code[picked])
        rows.append(scores(code[~train], forest.predict(table[~train])))
    classes = rows[0][3]
    means = [np.mean([row[i] for row in rows]) for i in range(3)]
    return means, {c: np.mean([row[3][c] for row in rows]) for c in classes}


def scene(path, seeds):
    title, column, ignored = SCENES[path]
    cloud, code, coloured = load(DATA / path, column, ignored)
    train = slabs(cloud.xyz)
    print(f"\n## {title}\n")
    automatic = segmentation.automatic_parameters(cloud)
    levels = segmentation.cluster_levels(cloud)
    oracle = []
    for label in levels.labels[:2]:
        _, inverse = np.unique(label, return_inverse=True)
        table = np.zeros((inverse.max() + 1, code.max() + 1), np.int64)
        np.add.at(table, (inverse, code), 1)
        covered = label > 0
        best = table.argmax(1)[inverse]
        oracle.append((covered.mean(), (best == code)[covered].mean()))
    print(textwrap.fill(f"{len(code):,} points. " + "; ".join(automatic.reasons) + ".", 118) + "\n")
    text = (
        f"Level 1: {levels.counts[0]:,} segments with {100 * oracle[0][0]:.1f} % of the points, of which "
        f"{100 * oracle[0][1]:.2f} % are right if each segment gets its most frequent class; level 2: {levels.counts[1]:,} and {100 * oracle[1][1]:.2f} %; "
        f"level 3: {levels.counts[2]} categories."
    )
    print(textwrap.fill(text, 118) + "\n")
    classes = np.unique(code[~train])
    print("| set | form | colour | features | s | OA | weighted F1 | macro F1 |", *(f"{c} |" for c in classes))
    print("|---|---|---|---|---|---|---|---|" + "---|" * len(classes))
    for with_colour in [False, True][: 1 + coloured]:
        for name, form in RUNS:
            start = time.time()
            maker = scansion.ClusterFeatures(set=name, form=form, colour=with_colour)
            table = maker.fit_transform(cloud)
            seconds = time.time() - start
            means, f1 = learn(table, code, train, seeds)
            print(row(name, "-" if name == "b" else form, with_colour, table, seconds, means, f1, classes), flush=True)
            if (name, form) == ("c", "rank"):
                split = np.random.default_rng(0).random(len(code)) < 0.3
                means, f1 = learn(table, code, split, seeds)
                print(row(f"{name}, random", form, with_colour, table, seconds, means, f1, classes), flush=True)


def row(name, form, colour, table, seconds, means, f1, classes):
    head = f"| {name} | {form} | {'yes' if colour else 'no'} | {table.shape[1]} | {seconds:.1f} |"
    return head + "".join(f" {100 * v:.1f} |" for v in [*means, *(f1.get(c, 0.0) for c in classes)])


if __name__ == "__main__":
    DATA = pathlib.Path(sys.argv[1])
    for path in SCENES:
        if (DATA / path).exists():
            scene(path, int(sys.argv[2]) if len(sys.argv) > 2 else 5)
        else:
            print(f"\n{path}: absent", file=sys.stderr)
