"""The experiment of Guinard and Landrieu 2017 on real clouds, 5 seeds; writes docs/weak-accuracy.md.

    python scripts/weak.py DATA [SEEDS]    # needs: pip install .

A model trained on the labels of 15 random points a class (25 on the airborne scene) classifies the whole cloud, by four
methods. The figures of the paper and of other libraries are printed for comparison.
"""

import pathlib
import sys
import time

import numpy as np
import scansion

METHODS = {
    "none": "point by point",
    "point-crf": "field on points",
    "consensus": "segments, no field",
    "segment-crf": "field on segments",
}
PAPER = "weak-paper"
WAYS = {"default": "Defaults", "paper": "As the paper"}
STREET, SCENE = (2, 5, 6, 14, 15), (2, 5, 6)


def load(path, classes, merge=()):
    cloud = scansion.read(path, columns=["Classification"])
    code = np.asarray(cloud["Classification"]).copy()
    for old, new in merge:
        code[code == old] = new
    return cloud.xyz, np.where(np.isin(code, classes), code, 0).astype(np.uint8)


def pick(code, per_class, seed):
    """Labels of a few random points; -1 elsewhere."""
    random = np.random.default_rng(seed)
    labels = np.full(len(code), -1, np.int16)
    for c in np.unique(code[code > 0]):
        members = np.flatnonzero(code == c)
        chosen = random.choice(members, min(per_class, len(members)), replace=False)
        labels[chosen] = c
    return labels


def run(xyz, code, per_class, seed, way):
    """Overall accuracy and mean F1 of each method in percent: over all classified points, and over the unlabelled ones."""
    recipe = PAPER if way == "paper" else None
    labels = pick(code, per_class, seed)
    model = scansion.WeakClassifier(recipe, random_state=seed).fit(xyz, labels)
    rows = []
    for method in METHODS:
        found = model.classify(xyz, regularize=method).codes
        row = []
        for counted in (code > 0, (code > 0) & (labels < 0)):
            scores = scansion.evaluation.scores(code[counted], found[counted])
            row += [100 * scores["overall_accuracy"], 100 * scores["mean_f1_score"]]
        rows.append(row)
    return rows


def line(name, points, runs, first=0):
    """A row of the table; `first` is 0 for all points, 2 for those without a label."""
    mean, spread = np.mean(runs, axis=0), np.std(runs, axis=0)
    a, f = first, first + 1
    cells = " | ".join(f"{m[a]:.1f} ± {s[a]:.1f} / {m[f]:.1f} ± {s[f]:.1f}" for m, s in zip(mean, spread))
    return f"| {name} | {points} | {cells} |"


HEAD = """# Accuracy of the weakly supervised classification

Written by `python scripts/weak.py DATA` ({seeds} seeds, {minutes:.0f} minutes on {cores} cores). A model trained on the labels of random
points of each class classifies the whole cloud. Cells are overall accuracy / mean F1 in percent over all points of these
classes, mean and standard deviation over the seeds. Method: [weak.md](weak.md). "As the paper" is
the recipe `weak-paper`. Scores count all points. The last row of the Oakland tables counts only points without
a label (in part_10 all eight points of one class have one, so that the class is left out).

"""
TABLE = "| cloud | points | " + " | ".join(METHODS.values()) + " |\n|---|---|" + "---|" * len(METHODS)
PRINTED = """
| for comparison: OA / mean F1 | point by point | field on points | segments, no field | field on segments |
|---|---|---|---|---|
| printed in the paper (Oakland, 655,297 points) | 85.2 / 53.1 | 94.8 / 75.2 | - | 97.3 / 77.1 |
| other libraries on part_14 (scikit-learn, pycut-pursuit, alpha-expansion) | 92.4 / 70.7 | 97.3 / 85.1 | 97.3 / 84.3 | 97.9 / 87.0 |
"""


def main(data, seeds):
    start = time.time()
    text = []
    for way, title in WAYS.items():
        text += [f"## {title}: Oakland, 15 labels a class (classes {', '.join(map(str, STREET))})\n", TABLE]
        all_runs = []
        for path in sorted((data / "oakland").glob("part_*.laz")):
            xyz, code = load(path, STREET)
            runs = [run(xyz, code, 15, seed, way) for seed in range(seeds)]
            all_runs.append(np.mean(runs, axis=0))
            text.append(line(path.stem, f"{len(xyz):,}", runs))
            print(text[-1], flush=True)
        text.append(line("mean of the parts", "", all_runs))
        text.append(line("the same, points without a label", "", all_runs, 2) + "\n")
        print(*text[-2:], sep="\n", flush=True)
    text.append(PRINTED)
    for way, title in WAYS.items():
        text += [f"## {title}: LiDAR HD housing, 25 labels a class (2, 5, 6; 3 and 4 count as 5)\n", TABLE]
        xyz, code = load(data / "airborne/lidarhd_housing.laz", SCENE, [(3, 5), (4, 5)])
        runs = [run(xyz, code, 25, seed, way) for seed in range(seeds)]
        text.append(line("lidarhd_housing", f"{len(xyz):,}", runs) + "\n")
        print(text[-1], flush=True)
    import os

    head = HEAD.format(seeds=seeds, minutes=(time.time() - start) / 60, cores=os.cpu_count())
    page = pathlib.Path(__file__).parent.parent / "docs/weak-accuracy.md"
    page.write_text(head + "\n".join(text) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 5)
