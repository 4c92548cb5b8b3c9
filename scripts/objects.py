"""Strength of the density regulariser, with pruning, on objects; for docs/sparse-convolution.md.

    python scripts/objects.py DATA [--sets modelnet dales] [--network NAME] [--epochs N] [--batch N]
                                   [--rate R] [--most N] [--strengths S ...] [--seeds S ...] [--plot FILE]

Needs: pip install . ; with --plot matplotlib.

DATA holds modelnet10_voxels32_chair_monitor.npz and dales_objects_499.tar.gz. A fourth of the objects of each class is for
testing. NAME is modelnet or modelnet-paper, which has the constants of the thesis unless others are given, and its penalty: S
is then its λ, which is half of our strength. Rows are named by our strength. Beside the networks stand their dense twin and our
forest on descriptors of each object, without and with its size (the network sees objects scaled to the same cube). Seconds are
those of the processor, summed over the threads. With several seeds, each of which picks other training objects and first
weights, numbers are means, and the last column has the lowest and the highest accuracy.
"""

import argparse
import pathlib
import tarfile
import tempfile
import time

import numpy as np
import scansion
from scansion import nn

STRENGTHS = (0.0, 0.1, 0.2, 0.3)
#: Weights below this at two ends of epochs are removed, as in the thesis for ModelNet40.
PRUNING = 1e-4
KINDS = ["building", "car", "fence", "pole", "tree"]


def modelnet(data):
    """Cells, the same as points for descriptors, classes; objects without a cell are left out."""
    cells, names = nn.load_voxels(data / "modelnet10_voxels32_chair_monitor.npz")
    some = cells.any(axis=(1, 2, 3))
    cells, names = cells[some], names[some]
    return cells.astype(np.float32), [np.argwhere(one) for one in cells], names


def dales(data):
    """Points, twice, and classes; the hundreds of a file's number are its class."""
    with tarfile.open(data / "dales_objects_499.tar.gz") as archive, tempfile.TemporaryDirectory() as folder:
        for member in archive.getmembers():
            if member.isfile() and member.name.endswith(".xyz"):
                path = pathlib.Path(folder, pathlib.PurePosixPath(member.name).name)
                path.write_bytes(archive.extractfile(member).read())
        points, numbers = nn.load_xyz(folder)
    names = np.array([KINDS[int(number) // 100] for number in numbers])
    points = [one - one.mean(axis=0) for one in points]
    return points, points, names


def descriptors(points, size):
    """Shape of one object: extents, principal axes, distribution of heights and of distances from the vertical axis."""
    lengths = np.ptp(points, axis=0) + 1e-6
    widths = np.sort(lengths[:2])[::-1]
    values, axes = np.linalg.eigh(np.cov(points.T) + 1e-9 * np.eye(3))
    values = np.sqrt(np.maximum(values, 0) / values.sum())
    centred = (points - points.min(axis=0) - lengths / 2) / lengths.max()
    radius = np.hypot(centred[:, 0], centred[:, 1])
    shares = np.linspace(0.1, 0.9, 9)
    own = [*(widths / lengths[2]), *values, *np.abs(axes[2]), *np.quantile(centred[:, 2], shares), *np.quantile(radius, shares)]
    return own + [*widths, lengths[2], len(points)] if size else own


def halves(names):
    """Numbers of the objects for training and for testing."""
    draws, test = np.random.default_rng(0), []
    for name in np.unique(names):
        own = draws.permutation(np.flatnonzero(names == name))
        test.extend(own[: len(own) // 4])
    return np.setdiff1d(np.arange(len(names)), test), np.array(test)


def pick(objects, rows):
    return objects[rows] if isinstance(objects, np.ndarray) else [objects[i] for i in rows]


def factor(given):
    """Our strength of the regulariser divided by the given one: twice the λ of the thesis for its networks."""
    return 2 if given.network.endswith("-paper") else 1


def network_of(strength, seed, given):
    """A network with a strength of the regulariser; None: its dense twin."""
    dense = strength is None
    regulariser = {
        "learning.regulariser.strength": factor(given) * (strength or 0.0),
        "learning.pruning": 0.0 if dense else PRUNING,
    }
    return nn.VoxelClassifier(
        given.network,
        epochs=given.epochs,
        batch_size=given.batch,
        learning_rate=given.rate,
        dense=dense,
        random_state=seed,
        settings=regulariser,
    )


def learned(network, learn, test):
    """Weights left after each epoch, loss of the last one, seconds of an epoch, accuracy in percent."""
    start = time.process_time()
    network.fit(*learn)
    seconds = (time.process_time() - start) / len(network.history_)
    weights = [epoch["weights"] for epoch in network.history_]
    return weights, network.history_[-1]["loss"], seconds, 100 * network.score(*test)


def forest_score(table, names, rows, seed):
    """Accuracy of a forest on descriptors, percent."""
    train, test = rows
    forest = scansion.RandomForestClassifier(random_state=seed).fit(table[train], names[train])
    return 100 * np.mean(forest.predict(table[test]) == names[test])


def spread(scores):
    """The mean, and the lowest and highest of several."""
    least, most = min(scores), max(scores)
    return f"{np.mean(scores):.1f}" + (f" | {least:.1f} to {most:.1f}" if len(scores) > 1 else "")


def rows_of(title, data, splits, given):
    """Prints the rows of the networks; returns the shares of weights that are left, epoch after epoch, of the first seed."""
    objects, names = data
    curves = {}
    for strength in [*given.strengths, None]:
        runs = []
        for seed, parts in splits.items():
            learn, test = ((pick(objects, rows), names[rows]) for rows in parts)
            runs.append(learned(network_of(strength, seed, given), learn, test))
        weights, losses, seconds, scores = zip(*runs)
        name = "dense twin" if strength is None else f"strength {factor(given) * strength:g}"
        left = np.mean([one[-1] for one in weights])
        share = 100 * np.mean([one[-1] / one[0] for one in weights])
        cells = ["- | -" if strength is None else f"{left:,.0f} | {share:.2f}"]
        cells += [f"{np.mean(losses):.3f}", f"{np.mean(seconds):.0f}", spread(scores)]
        print(f"| {title} | {name} | " + " | ".join(cells) + " |", flush=True)
        curves[name] = weights[0]
    return curves


def main(given):
    heads = ["objects", "", "weights left", "of all, %", "loss, last epoch", "seconds an epoch", "accuracy, %"]
    heads += ["lowest to highest"] * (len(given.seeds) > 1)
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|", flush=True)
    curves = {}
    for title, load in (("ModelNet", modelnet), ("DALES", dales)):
        if load.__name__ not in given.sets:
            continue
        objects, points, names = load(given.data)
        train, test = halves(names)
        splits = {
            seed: (np.random.default_rng(1 + seed).permutation(train)[: given.most], test) for seed in given.seeds
        }
        for size in (False, True):
            table = np.array([descriptors(one, size) for one in points], np.float32)
            scores = [forest_score(table, names, rows, seed) for seed, rows in splits.items()]
            name = "forest, with size" if size else "forest, shape only"
            print(f"| {title} | {name} | - | - | - | - | {spread(scores)} |", flush=True)
        curves[title] = rows_of(title, (objects, names), splits, given)
    if given.plot:
        import matplotlib.pyplot as plt

        figure, plots = plt.subplots(1, len(curves), figsize=(8, 3), layout="constrained", squeeze=False)
        for axes, (title, lines) in zip(plots[0], curves.items()):
            for name, weights in lines.items():
                if name != "dense twin":
                    axes.plot(range(1, len(weights) + 1), weights, label=name)
            axes.set(title=title, xlabel="epoch", ylabel="weights left")
            axes.legend(fontsize=8)
        figure.savefig(given.plot, dpi=90)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--sets", nargs="+", choices=("modelnet", "dales"), default=("modelnet", "dales"))
    parser.add_argument("--network", default="modelnet")
    parser.add_argument("--strengths", nargs="*", type=float, default=STRENGTHS)
    parser.add_argument("--epochs", type=int)
    parser.add_argument("--batch", type=int)
    parser.add_argument("--rate", type=float, help="default: 0.003, with the constants of the thesis its 0.001")
    parser.add_argument("--most", type=int, help="objects to train on, picked at random")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--plot", metavar="FILE")
    given = parser.parse_args()
    if given.rate is None and given.network == "modelnet":
        given.rate = 0.003
    main(given)
