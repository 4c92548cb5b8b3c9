"""Contours as features of classes, and the other way round, on real scans (sections 4.6.3 and 4.6.4 of the thesis):
the tables of docs/contours.md.

    python scripts/contour_classes.py DATA [PROGRAM] [PART ...]    # needs: numpy scipy scikit-learn laspy[lazrs] matplotlib

PROGRAM (default: scansion) trains and classifies. Parts: classes, contours (both by default). Files go to target/.

classes: three parts of Oakland are learned from and three others classified, three seeds, with and without the likelihood of
lying on a contour, which the built-in model gives, among the features.

contours: a model of ground, vegetation and building is trained on four scans and rates the scan of the experiment. The truth of
points comes from the reference lines of `contour_reference.py`: within half a voxel of a line they lie on a contour; those
farther than a voxel do not, where the reference is complete, or if they are vegetation. Contours are learned in each half of
lidarhd_housing and measured in the other. Each row is one forest per half and seed; curves put halves and seeds together.
"""

import json
import pathlib
import subprocess
import sys
from types import SimpleNamespace

import contour_reference
import laspy
import numpy as np
from sklearn.ensemble import RandomForestClassifier

SEEDS, SAMPLES = range(3), 20_000
#: Scans that the model of classes learns from.
TAUGHT = ("ahn3_delft_west", "lidarhd_farm_rgb", "lidarhd_sparse_1km", "lidarhd_rural_sparse_1km")
GROUND, BUILDING, VEGETATION = 2, 6, (3, 4, 5)
#: The scan, and the edge of the voxels that `contours --without 1,3,4,5` finds in it, metres.
NAME, VOXEL = "lidarhd_housing", 0.651
ROOT = pathlib.Path(__file__).parents[1]
#: Parts of Oakland that are learned from, and that are classified.
LEARNED, CLASSIFIED = ("03", "05", "08"), ("11", "14", "17")
SCORES = ("overall_accuracy", "mean_intersection_over_union", "mean_f1_score")
CONTOURS = ROOT / "crates/core/assets/contours.model"
DATA = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path()
AIRBORNE = DATA / "airborne"
PROGRAM = sys.argv[2] if len(sys.argv) > 2 else "scansion"


def run(output, *words):
    """Runs the program unless its output is there; the output."""
    output = ROOT / "target" / output
    if not output.exists():
        output.parent.mkdir(exist_ok=True)
        subprocess.run([PROGRAM, *words, "-o", output, "--quiet"], check=True, stdout=subprocess.DEVNULL)
    return output


def class_model():
    """The model of ground, vegetation and building."""
    scans = [AIRBORNE / f"{name}.laz" for name in TAUGHT]
    codes = ["--map", "3-4=5", "--map-of", "ahn3_delft_west.laz:1=5", "--classes", "2,5,6"]
    return run("contours_classes.model", "train", *scans, "--recipe", ROOT / "crates/core/assets/default.toml", *codes)


def scan():
    """Places, truth (1 contour, 0 background, -1 unknown), vegetation, and tables of features of the scan."""
    path = AIRBORNE / f"{NAME}.laz"
    lines, _, complete, points, _ = contour_reference.derived(path)
    codes = contour_reference.load(path)[1]
    apart = contour_reference.distances(lines, points, VOXEL / 20)
    solid, vegetation = np.isin(codes, (GROUND, BUILDING)), np.isin(codes, VEGETATION)
    off = (apart > VOXEL) & (complete | vegetation)
    truth = np.where((apart < VOXEL / 2) & solid, 1, np.where(off, 0, -1))
    # As in the recipe `contours`: eight levels, the finest of half a voxel.
    settings = ["--set", f"features.pyramid.first_scale={VOXEL / 2}", "--set", "features.pyramid.levels=8"]
    table = np.nan_to_num(np.load(run(f"{NAME}.npy", "features", path, *settings)))
    rated = laspy.read(run(f"{NAME}_classes.laz", "classify", path, "-m", class_model(), "--probabilities"))
    chances = np.column_stack([rated[key] for key in rated.point_format.dimension_names if key.startswith("P_")])
    known = solid | vegetation
    right = np.asarray(rated.classification)[known] == np.where(vegetation, 5, codes)[known]
    counts = [int(mask.sum()) for mask in (truth == 1, (truth == 0) & ~vegetation, (truth == 0) & vegetation)]
    print(f"{len(lines)} lines; on, off, vegetation {counts}; {100 * right.mean():.1f} % of classes right", flush=True)
    tables = {"all features": table, "and class probabilities": np.column_stack([table, chances])}
    tables["class probabilities alone"] = chances
    return SimpleNamespace(points=points, truth=truth, vegetation=vegetation, tables=tables)


def rated(scene, folds, name):
    """Rating, truth and whether it is vegetation, of all measured points of all folds and seeds."""
    found = []
    for learned, measured in folds:
        rows, own = (np.flatnonzero(side & (scene.truth >= 0)) for side in (learned, measured))
        for seed in SEEDS:
            few = np.random.default_rng(seed).permutation(rows)[:SAMPLES]
            forest = RandomForestClassifier(50, min_samples_leaf=5, random_state=seed, n_jobs=-1)
            forest.fit(scene.tables[name][few], scene.truth[few])
            values = forest.predict_proba(scene.tables[name][own])[:, 1]
            found.append((values, scene.truth[own] == 1, scene.vegetation[own]))
    return [np.concatenate(part) for part in zip(*found)]


def curve(values, truth):
    """Precision and recall above each value, the highest first."""
    order = np.argsort(-values, kind="stable")
    hits, last = np.cumsum(truth[order]), np.append(np.diff(values[order]) != 0, True)
    return np.column_stack([hits / np.arange(1, len(hits) + 1), hits / hits[-1]])[last]


def cells(values, truth):
    """The best F1, and recall at precisions."""
    both = curve(values, truth)
    f1 = (2 * both.prod(axis=1) / np.maximum(both.sum(axis=1), 1e-9)).max()
    best = [max((r for p, r in both if p >= least), default=0) for least in (0.7, 0.8, 0.9, 0.95)]
    return " | ".join(f"{value:.3f}" for value in (f1, *best))


def rated_part(part):
    """A part of Oakland with the likelihood of lying on a contour, P_contour."""
    path = DATA / "oakland" / f"part_{part}.laz"
    return run(f"oakland_{part}_contour.laz", "classify", path, "-m", CONTOURS, "--probabilities", "--to", "Contour")


def classes():
    """Contours as features of classes."""
    print("| features | overall accuracy | mean IoU | mean F1 |\n|---|---|---|---|")
    kinds = {"`pyramid`": [], 'and `features.dimensions=["P_contour"]`': ["--set", 'features.dimensions=["P_contour"]']}
    parts = [rated_part(part) for part in LEARNED]
    for number, (title, settings) in enumerate(kinds.items()):
        rows = []
        for seed in SEEDS:
            name = f"oakland_{number}_{seed}"
            model = run(f"{name}.model", "train", *parts, "--recipe", "pyramid", *settings, "--seed", str(seed))
            for part in CLASSIFIED:
                named = run(f"{name}_{part}.laz", "classify", rated_part(part), "-m", model)
                report = run(f"{name}_{part}.json", "evaluate", rated_part(part), named)
                found = json.loads(report.read_text())
                rows.append([found[key] for key in SCORES])
        print(f"| {title} | " + " | ".join(f"{100 * value:.1f}" for value in np.mean(rows, axis=0)) + " |", flush=True)


def contours():
    """Classes as features of contours."""
    scene = scan()
    x = scene.points[:, 0] - np.median(scene.points[:, 0])
    folds = [(x < -5, x > 5), (x > 5, x < -5)]
    print("| background | features | best F1 | recall at 0.7 | at 0.8 | at 0.9 | at 0.95 |")
    print("|---|---|---|---|---|---|---|")
    for name in scene.tables:
        values, truth, vegetation = rated(scene, folds, name)
        for background, kept in (("all", vegetation | True), ("without vegetation", ~vegetation)):
            print(f"| {background} | {name} | {cells(values[kept], truth[kept])} |", flush=True)


if __name__ == "__main__":
    for part in sys.argv[3:] or ("classes", "contours"):
        {"classes": classes, "contours": contours}[part]()
