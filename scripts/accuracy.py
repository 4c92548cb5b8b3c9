"""Accuracy on real labelled clouds, train and test spatially disjoint, 5 seeds; writes docs/accuracy.md.

    python scripts/accuracy.py DATA        # needs: pip install . scikit-learn jakteristics

Three rows per scene: our features with our forest, our features with scikit-learn's forest, and jakteristics' features
with our forest. All are trained on the same points.
"""

import pathlib
import sys
import time

import jakteristics
import numpy as np
import scansion
from sklearn.ensemble import RandomForestClassifier

SEEDS = range(5)
PER_CLASS = 3000
RADII = (0.5, 1.0, 2.0, 4.0)  # at a first scale of 0.25 m, else in proportion
NAMES = {1: "other", 2: "ground", 5: "vegetation", 6: "building / facade", 9: "water", 14: "wire", 15: "pole", 26: "civil structure", 64: "vehicle / person"}


def load(path, classes, merge=()):
    cloud = scansion.read(path, columns=["Classification"])
    code = np.asarray(cloud["Classification"]).copy()
    for old, new in merge:
        code[code == old] = new
    return cloud.xyz, np.where(np.isin(code, classes), code, 0)


def halves(xyz, code, axis, gap=10.0):
    """Two halves with a strip of `gap` metres between them that is not used."""
    middle = np.median(xyz[:, axis])
    low, high = xyz[:, axis] < middle - gap / 2, xyz[:, axis] > middle + gap / 2
    return (xyz[low], code[low]), (xyz[high], code[high])


def join(parts):
    return [np.concatenate(p) for p in zip(*parts)]


def scenes(data):
    housing = load(data / "airborne/lidarhd_housing.laz", (2, 5, 6), [(3, 5), (4, 5)])
    yield "LiDAR HD housing, east from west", *halves(*housing, 0), 0.25
    ahn = load(data / "airborne/ahn3_delft_west.laz", (1, 2, 6))
    yield "AHN3 Delft, north from south", *halves(*ahn, 1), 0.25
    parts = sorted((data / "oakland").glob("part_*.laz"))
    street = [load(p, (2, 5, 6, 14, 15, 64)) for p in parts]
    yield f"Oakland, {len(street[7:])} parts from {len(street[:7])} others", street[:7], street[7:], 0.1


def ours(xyz, first_scale):
    return scansion.features.multiscale(xyz, first_scale=first_scale, levels=8)


def theirs(xyz, first_scale):
    local = np.ascontiguousarray(xyz - xyz.mean(0))
    radii = [r * first_scale / 0.25 for r in RADII]
    columns = [jakteristics.compute_features(local, search_radius=r, num_threads=-1) for r in radii]
    return np.nan_to_num(np.hstack(columns)).astype("f4")


def table(clouds, features, first_scale):
    """Features of each cloud on its own (so that no test point is anybody's neighbour), and the labels."""
    clouds = clouds if isinstance(clouds, list) else [clouds]
    return join([(features(xyz, first_scale), code) for xyz, code in clouds])


def sample(code, seed):
    random = np.random.default_rng(seed)
    rows = [np.flatnonzero(code == c) for c in np.unique(code[code > 0])]
    return np.concatenate([random.choice(r, min(PER_CLASS, len(r)), replace=False) for r in rows])


def forest(kind, seed):
    if kind == "scikit-learn":
        return RandomForestClassifier(50, max_depth=30, random_state=seed, n_jobs=-1)
    return scansion.RandomForestClassifier(50, max_depth=30, random_state=seed, n_jobs=-1)


def run(train, test, kind):
    (x, y), (u, v) = train, test
    results = []
    for seed in SEEDS:
        rows = sample(y, seed)
        model = forest(kind, seed).fit(x[rows], y[rows])
        known = v > 0
        results.append(scansion.evaluation.scores(v[known], model.predict(u[known]).astype("u1")))
    return results


def row(name, results, codes):
    mean = lambda get: np.mean([get(r) for r in results])
    spread = lambda get: np.std([get(r) for r in results])
    by_code = lambda r, code, key: next((l[key] for l in r["labels"] if l["code"] == code), 0.0)
    cells = [f"{100 * mean(lambda r: by_code(r, c, 'intersection_over_union')):.1f} / {100 * mean(lambda r: by_code(r, c, 'f1_score')):.1f}" for c in codes]
    total = [f"{100 * mean(lambda r: r[k]):.2f} ± {100 * spread(lambda r: r[k]):.2f}" for k in ("overall_accuracy", "mean_f1_score", "mean_intersection_over_union")]
    return f"| {name} | " + " | ".join(total + cells) + " |"


def worst(results):
    """The two largest confusions: true class, predicted class, share of the true class."""
    matrix = np.sum([np.array(r["confusion_matrix"], float) for r in results if len(r["labels"]) == len(results[0]["labels"])], axis=0)
    codes = [l["code"] for l in results[0]["labels"]]
    share = matrix / np.maximum(matrix.sum(1, keepdims=True), 1)
    np.fill_diagonal(share, 0)
    order = np.argsort(-share, axis=None)[:2]
    return "; ".join(f"{NAMES[codes[i // len(codes)]]} classified as {NAMES[codes[i % len(codes)]]} {100 * share.flat[i]:.1f} %" for i in order)


def main():
    data = pathlib.Path(sys.argv[1])
    lines = [
        "# Accuracy on real clouds", "",
        "Written by `python scripts/accuracy.py DATA`. Training and test points are spatially disjoint and features",
        f"are computed on each side alone; {PER_CLASS} training points a class at most, 50 trees of depth 30, mean and",
        f"standard deviation of {len(SEEDS)} seeds, every labelled test point counted. Cells of classes: IoU / F1,",
        "percent. The rows are", "",
        "- *Scansion*: our features and our forest;",
        "- *scikit-learn forest*: its forest on our features, which compares the forests;",
        f"- *jakteristics features*: its features at radii {', '.join(f'{r:g}' for r in RADII)} m (on Oakland, which",
        "  is denser, 0.4 times these) with our forest, which compares the features.", "",
    ]
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""  # a part of a scene's title: only that scene, on the terminal alone
    for title, train, test, first_scale in scenes(data):
        if wanted not in title:
            continue
        start = time.time()
        own = table(train, ours, first_scale), table(test, ours, first_scale)
        other = table(train, theirs, first_scale), table(test, theirs, first_scale)
        codes = [int(c) for c in np.unique(own[1][1]) if c > 0]
        head = ["features and forest", "OA", "mean F1", "mean IoU"] + [NAMES[c] for c in codes]
        lines += [f"## {title}", "", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
        results = run(*own, "scansion")
        lines += [row("Scansion", results, codes), row("scikit-learn forest", run(*own, "scikit-learn"), codes)]
        lines += [row("jakteristics features", run(*other, "scansion"), codes), "", f"Largest confusions (Scansion): {worst(results)}.", ""]
        print(title, f"{time.time() - start:.0f} s", flush=True)
        print("\n".join(lines[-8:]), flush=True)
    if not wanted:
        pathlib.Path(__file__).resolve().parent.parent.joinpath("docs/accuracy.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()
