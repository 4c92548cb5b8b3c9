"""Boosting compared with LightGBM with the same settings, on feature tables of five real scans; prints the table of docs/boosting.md.

    python scripts/boosting.py DATA [SPLITS]    # needs: pip install '.[las]' lightgbm

Each row: the held-out loss and accuracy of both over several random splits (a fifth of the rows held out), mean ± standard
deviation, and the mean and standard deviation of the difference in loss. One thread each.
"""

import pathlib
import sys
import time

import lightgbm
import numpy as np
import scansion
from scansion import features

TABLES = {
    "LiDAR HD, village": ("airborne/lidarhd_building.laz", 0.25, 6, (2, 3, 4, 5, 6)),
    "LiDAR HD, housing estate": ("airborne/lidarhd_housing.laz", 0.25, 6, (2, 3, 4, 5, 6)),
    "AHN3, Delft": ("airborne/ahn3_delft_west.laz", 0.25, 6, (1, 2, 6, 9)),
    "LiDAR HD, forest edge": ("airborne/lidarhd_forest_edge.laz", 0.25, 6, (2, 3, 4, 5, 6)),
    "Oakland, street": ("oakland/part_01.laz", 0.1, 7, ()),
}
ROWS, ROUNDS, FEWEST = 60_000, 50, 200
SETTINGS = (0.0, 1.0)


def table(data, path, first_scale, levels, keep):
    """Pyramid features of points drawn from a scan, and their classes from 0."""
    cloud = scansion.read(data / path)
    code = np.asarray(cloud["Classification"]).astype(int)
    kinds, counts = np.unique(code, return_counts=True)
    wanted = np.isin(code, keep or kinds[counts > FEWEST])
    values = features.multiscale(cloud.xyz - cloud.xyz.min(0), first_scale=first_scale, levels=levels)
    drawn = np.random.default_rng(0).permutation(np.flatnonzero(wanted))[:ROWS]
    return values[drawn], np.unique(code[drawn], return_inverse=True)[1]


def ours(X, y, penalty):
    model = scansion.GradientBoostingClassifier(ROUNDS, l2_regularization=penalty, n_jobs=1)
    return model.fit(X, y).predict_proba


def theirs(X, y, penalty):
    settings = {
        "objective": "multiclass",
        "num_class": int(y.max()) + 1,
        "lambda_l2": penalty,
        "num_threads": 1,
        "verbosity": -1,
    }
    return lightgbm.train(settings, lightgbm.Dataset(X, y), ROUNDS).predict


def judged(fit, X, y, held, penalty):
    """Loss, accuracy, seconds of training."""
    start = time.time()
    predict = fit(X[~held], y[~held], penalty)
    seconds = time.time() - start
    shares, truth = predict(X[held]), y[held]
    own = np.clip(shares[np.arange(len(truth)), truth], 1e-15, 1.0)
    return -np.log(own).mean(), (shares.argmax(1) == truth).mean(), seconds


def row(name, X, y, penalty, splits):
    found = []
    for split in range(splits):
        held = np.random.default_rng(split).permutation(len(y)) % 5 == 0
        found.append([judged(fit, X, y, held, penalty) for fit in (ours, theirs)])
        print(f"  {name}, lambda {penalty:g}, split {split}: {np.round(found[-1], 5).tolist()}", file=sys.stderr, flush=True)
    found = np.array(found)
    mean, spread = found.mean(0), found.std(0, ddof=1)
    apart = found[:, 0, 0] - found[:, 1, 0]
    share = 100 * apart / mean[1, 0]
    loss = " / ".join(f"{m:.5f} ± {s:.5f}" for m, s in zip(mean[:, 0], spread[:, 0], strict=True))
    accuracy = " / ".join(f"{100 * m:.2f} %" for m in mean[:, 1])
    return f"| {name} | {penalty:g} | {loss} | {share.mean():+.1f} % ± {share.std(ddof=1):.1f} | {accuracy} |"


def main(data, splits=5):
    print("| table | λ | held-out loss, here / LightGBM | difference | accuracy, here / LightGBM |")
    print("|---|---|---|---|---|")
    for name, (path, *rest) in TABLES.items():
        X, y = table(data, path, *rest)
        for penalty in SETTINGS:
            print(row(f"{name} ({int(y.max()) + 1} classes, {X.shape[1]} features)", X, y, penalty, splits), flush=True)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]), *map(int, sys.argv[2:3]))
