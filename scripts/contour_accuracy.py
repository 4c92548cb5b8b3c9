"""Accuracy and speed of contours on synthetic and real scans; writes the tables and the picture of docs/contours.md.

    python scripts/contour_accuracy.py DATA [PROGRAM] [PART ...]

Needs: pip install . matplotlib scikit-learn scipy laspy[lazrs]; PROGRAM (default: scansion) trains. Parts: scenes, real, missed,
curves (all by default). Curves are drawn to docs/pictures/contour_curves.png.

Synthetic scenes have seeds from which nothing was learned or chosen. Distances are those of the thesis (6 cm, 3 cm, samples
every 2 cm) for voxels of 0.1 m, in proportion to the voxel. Recall by length also counts missing samples near each other.
Edges beside which points are at most a voxel apart count; what is found along the others counts neither way.
"""

import pathlib
import subprocess
import sys

import numpy as np
import scansion
from scansion import contours

SEEDS = (1001, 1002)
KINDS = {
    "urban": "street, tripods",
    "mobile": "street, car",
    "indoor": "room, tripods",
    "airborne": "street, aircraft",
}
#: Least ratings of the parts of lines: one point of a curve each. More lines are drawn first than by default; chosen on scenes of
#: seed 2001.
DRAWN = {"trace.field.bias": -2.0}
LEAST = [
    {**DRAWN, "trace.parts.least": least}
    for least in (0.0, 0.4, 0.5, 0.55, 0.6, 0.64, 0.68, 0.7, 0.72, 0.74, 0.76, 0.8, 0.85, 0.9)
]
#: The same for the cost of a contour, nats, if parts are not rated.
BIASES = [
    {"trace.parts.least": 0.0, "trace.field.bias": bias}
    for bias in (-6.0, -4.0, -3.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0)
]
#: Without a random field, candidates above a probability are contours.
FREE = {"trace.field.isolated": 0.0, "trace.field.one_sided": 0.0}
#: Classes of the airborne scans that carry no line: unclassified, vegetation.
WITHOUT = (1, 3, 4, 5)
ROOT = pathlib.Path(__file__).parents[1]
DATA = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else None
PROGRAM = sys.argv[2] if len(sys.argv) > 2 else "scansion"


def distances(voxel):
    """The distances of the thesis for a voxel."""
    return {"tolerance": 0.6 * voxel, "forgiven": 0.3 * voxel, "step": 0.2 * voxel}


def split(scene, voxel):
    """Edges that count, and those that are scanned too sparsely."""
    dense = scene.edge_spacing <= voxel
    return scene.edges[dense], scene.edges[~dense]


def shares(rows):
    """Precision, recall, and recall by length of sums of counts."""
    keys = ("correct", "false_positives", "covered", "false_negatives", "repeated")
    correct, false, covered, missed, repeated = (sum(row[key] for row in rows) for key in keys)
    found = covered / max(covered + missed, 1), covered / max(covered + missed + repeated, 1)
    return correct / max(correct + false, 1), *found


def scenes():
    print(
        "| scene | voxel, m | precision | recall | recall by length | candidates: recall at precision 0.9"
        " | all edges: precision | recall | recall by length |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for kind, title in KINDS.items():
        own, everything, voxels, ratings = [], [], [], []
        for seed in SEEDS:
            scene = contours.synthetic_scene(kind, random_state=seed)
            rated = contours.stages(scene.cloud)
            found, voxel = rated.lines(), rated.voxel
            dense, sparse = split(scene, voxel)
            own.append(contours.score(found, dense, unsure=sparse, **distances(voxel)))
            everything.append(contours.score(found, scene.edges, **distances(voxel)))
            voxels.append(voxel)
            ratings.append(labelled(rated.candidates(dense, unsure=sparse)))
        curve = precision_recall(*map(np.concatenate, zip(*ratings)))
        best = max((r for p, r in curve if p >= 0.9), default=0)
        cells = [np.mean(voxels), *shares(own), best, *shares(everything)]
        print(f"| {title} | " + " | ".join(f"{cell:.2f}" for cell in cells) + " |", flush=True)


def labelled(rows):
    """Probabilities and truth of candidates that clearly run along an edge, or along none."""
    known = (rows[:, 1] >= 0.9) | ((rows[:, 1] < 0.6) & (rows[:, 2] <= 0.2))
    return rows[known, 0], rows[known, 1] >= 0.9


def precision_recall(values, truth):
    """Precision and recall above each value, the highest first."""
    order = np.argsort(-values, kind="stable")
    hits = np.cumsum(truth[order])
    last = np.append(np.diff(values[order]) != 0, True)
    return np.column_stack([hits / np.arange(1, len(hits) + 1), hits / max(hits[-1], 1)])[last]


def real():
    sys.path.insert(0, str(ROOT / "scripts"))
    import contour_reference

    title = "| scan | points | voxel, m | precision | with those near the reference | recall | recall by length |"
    print(title + " within a voxel: precision | recall |\n|---|---|---|---|---|---|---|---|---|")
    for name in contour_reference.SCENES:
        path = DATA / name
        lines, _, mask, points, origin = contour_reference.derived(path)
        airborne = path.suffix == ".laz"
        found = contours.extract(path, without=WITHOUT if airborne else ())
        near = distances(found.voxel)
        samples = np.concatenate([sampled(line - origin, near["step"]) for line in found])
        apart = contour_reference.distances(lines, samples, near["step"])
        counts = contour_reference.counted(samples, points, mask)
        good, close = apart <= near["tolerance"], apart <= found.voxel
        reaches = near["tolerance"], found.voxel
        here, wide = (
            contours.score(found, lines + origin, **{**near, "tolerance": reach}) for reach in reaches
        )
        values = [good[counts].mean(), good.sum() / (good | counts).sum(), here["recall"]]
        values += [here["recall_by_length"], close[counts].mean(), wide["recall"]]
        cells = " | ".join(f"{value:.2f}" for value in values)
        print(f"| {path.stem} | {len(points)} | {found.voxel:.2f} | {cells} |", flush=True)


def sampled(line, step):
    """Places along a line."""
    parts = [
        np.linspace(a, b, int(np.linalg.norm(b - a) / step) + 2)[:-1] for a, b in zip(line[:-1], line[1:])
    ]
    return np.concatenate([*parts, line[-1:]])


def missed():
    """What the missed samples of edges lie beside; shares in percent."""
    from scipy.spatial import cKDTree

    print("| scene | candidates pass | missed | of these within 1.5 voxels of a line | of these, the line lies on another edge |")
    print("|---|---|---|---|---|")
    for kind, title in KINDS.items():
        scene = contours.synthetic_scene(kind, random_state=SEEDS[0])
        rated = contours.stages(scene.cloud)
        near = distances(rated.voxel)
        edges = split(scene, rated.voxel)[0]
        truth = [sampled(edge, near["step"]) for edge in edges]
        own, truth = np.repeat(np.arange(len(edges)), [len(part) for part in truth]), np.concatenate(truth)
        every = rated.lines({**FREE, "trace.field.bias": -50.0, "trace.parts.least": 0.0})
        passed = cKDTree(np.concatenate([sampled(line, near["step"]) for line in every])).query(truth)[0]
        drawn = np.concatenate([sampled(line, near["step"]) for line in rated.lines()])
        apart, place = cKDTree(drawn).query(truth)
        # The edge that each sample of a line lies on, if on any.
        off, at = cKDTree(truth).query(drawn)
        on = np.where(off <= near["tolerance"], own[at], -1)[place]
        lost = apart > near["tolerance"]
        close = lost & (apart <= 1.5 * rated.voxel)
        other = close & (on >= 0) & (on != own)
        shares = (passed <= near["tolerance"]).mean(), lost.mean(), close.sum() / lost.sum(), other.sum() / close.sum()
        print(f"| {title} | " + " | ".join(f"{100 * share:.0f}" for share in shares) + " |", flush=True)


def curves():
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plot

    made = {kind: contours.synthetic_scene(kind, random_state=SEEDS[0]) for kind in KINDS}
    figure, axes = plot.subplots(1, 3, figsize=(15, 5), layout="constrained")
    for axis, title in zip(axes, ("points", "candidates", "lines")):
        axis.set(title=title, xlabel="recall", ylabel="precision", xlim=(0, 1), ylim=(0, 1))
        axis.grid(alpha=0.3)
    for name, curve in point_curves(made).items():
        axes[0].plot(curve[:, 1], curve[:, 0], label=name)
        report("points", name, curve)
    bare = ROOT / "target/contours_without_shape.model"
    if not bare.exists():
        sets = ["--set", "candidates.descriptor.without_shape=true"]
        command = [PROGRAM, "train", "--recipe", "contours", "--synthetic", "32", "-o", bare, *sets]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    models = {
        "likelihood only": (bare, FREE, LEAST),
        "and shape": (None, FREE, LEAST),
        "and random field": (None, {}, LEAST),
        "and random field, parts not rated": (None, {}, BIASES),
    }
    for name, (model, field, sweep) in models.items():
        ratings, lines = [], [[] for _ in sweep]
        for scene in made.values():
            rated = contours.stages(scene.cloud, model)
            dense, sparse = split(scene, rated.voxel)
            ratings.append(labelled(rated.candidates(dense, unsure=sparse)))
            for settings, rows in zip(sweep, lines):
                found = rated.lines({**field, **settings})
                rows.append(contours.score(found, dense, unsure=sparse, **distances(rated.voxel)))
        if "field" not in name:
            curve = precision_recall(*map(np.concatenate, zip(*ratings)))
            axes[1].plot(curve[:, 1], curve[:, 0], label=name)
            report("candidates", name, curve)
        curve = np.array([shares(rows) for rows in lines])
        axes[2].plot(curve[:, 1], curve[:, 0], ".-", label=name)
        report("lines", name, curve)
        report("lines, by length", name, curve[:, [0, 2]])
    for name, curve in baseline_curves(made).items():
        axes[2].plot(curve[:, 1], curve[:, 0], ".--", label=name)
        report("lines", name, curve)
        report("lines, by length", name, curve[:, [0, 2]])
    for axis in axes:
        axis.legend(loc="lower left", fontsize=8)
    figure.savefig(ROOT / "docs/pictures/contour_curves.png", dpi=70)


def report(stage, name, curve):
    """A row: the best F1, and recall at precisions."""
    precision, recall = curve[:, 0], curve[:, 1]
    f1 = (2 * precision * recall / np.maximum(precision + recall, 1e-9)).max()
    best = [recall[precision >= least].max(initial=0) for least in (0.7, 0.8, 0.9)]
    print(
        f"| {stage} | {name} | {f1:.2f} | " + " | ".join(f"{value:.2f}" for value in best) + " |", flush=True
    )


def point_curves(made):
    """Curves of forests on parts of the features, taught by other scenes, and of the built-in model's two classifiers."""
    from sklearn.ensemble import RandomForestClassifier

    others = {kind: contours.synthetic_scene(kind, random_state=SEEDS[1]) for kind in KINDS}
    (known, labels), (table, truth) = (points_of(part, scaled_features) for part in (others, made))
    names = scansion.features.names(first_scale=0.05)
    curvature = [name for name in names if name.startswith("SurfaceVariation")]
    one = [f"{name}_r0p1" for name in ("SurfaceVariation", "FirstMoment", "SecondMoment")]
    parts = {
        "curvature, one scale": one[:1],
        "curvature, all scales": curvature,
        "curvature and occlusion, one scale": one,
        "all features": names,
    }
    found = {}
    for title, own in parts.items():
        columns = [names.index(name) for name in own]
        forest = RandomForestClassifier(50, min_samples_leaf=5, random_state=0, n_jobs=-1).fit(
            known[:, columns], labels
        )
        found[title] = precision_recall(forest.predict_proba(table[:, columns])[:, 1], truth)
    model = scansion.PointClassifier.load(ROOT / "crates/core/assets/contours.model")
    rated, truth = points_of(made, lambda cloud, _: model.predict_proba(cloud)[:, 1:])
    found["the built-in model"] = precision_recall(rated[:, 0], truth)
    return found


def scaled_features(cloud, voxel):
    """Features of all points, with voxels of 0.1 m."""
    return features(scansion.PointCloud(cloud.xyz * (0.1 / voxel)))[0]


def points_of(made, describe):
    """Values of labelled points of scenes, by a function of cloud and voxel, and whether they are on contours."""
    tables, truth = [], []
    for scene in made.values():
        voxel = contours.stages(scene.cloud).voxel
        dense, sparse = split(scene, voxel)
        labels = contours.labels(scene.cloud, dense, voxel=voxel)
        labels[(contours.labels(scene.cloud, sparse, voxel=voxel) != 0) & (labels == 0)] = -1
        rows = np.random.default_rng(0).permutation(np.flatnonzero(labels >= 0))[:30_000]
        tables.append(describe(scene.cloud, voxel)[rows])
        truth.append(labels[rows] == 1)
    return np.concatenate(tables), np.concatenate(truth)


def features(cloud):
    """Features of all points and their names."""
    return np.nan_to_num(scansion.features.multiscale(cloud, first_scale=0.05)), scansion.features.names(
        first_scale=0.05
    )


def baseline_curves(made):
    """Curves of simpler methods, on curvature and on the probabilities of the model."""
    rows = {}
    model = scansion.PointClassifier.load(ROOT / "crates/core/assets/contours.model")
    for scene in made.values():
        rated = contours.stages(scene.cloud)
        dense, sparse = split(scene, rated.voxel)
        table, names = features(scansion.PointCloud(scene.cloud.xyz * (0.1 / rated.voxel)))
        curvature = np.clip(3 * table[:, names.index("SurfaceVariation_r0p1")], 0, 1)
        rated_points = model.predict_proba(scene.cloud)[:, 1]
        for title, strengths, steps in (
            ("curvature", curvature, (0.1, 0.2, 0.3, 0.4, 0.5)),
            ("likelihood", rated_points, (0.3, 0.5, 0.7, 0.8, 0.9)),
        ):
            for step in steps:
                for method, own in (
                    ("threshold", {"least": step}),
                    ("canny", {"high": step, "low": step / 2}),
                ):
                    found = contours.baseline(scene.cloud, strengths, method, voxel=rated.voxel, settings=own)
                    scores = contours.score(found, dense, unsure=sparse, **distances(rated.voxel))
                    rows.setdefault(f"{method} on {title}", {}).setdefault(step, []).append(scores)
    return {name: np.array([shares(list(part)) for part in steps.values()]) for name, steps in rows.items()}


if __name__ == "__main__":
    for part in sys.argv[3:] or ("scenes", "real", "missed", "curves"):
        {"scenes": scenes, "real": real, "missed": missed, "curves": curves}[part]()
