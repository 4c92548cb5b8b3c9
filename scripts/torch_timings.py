"""Direct sparse convolution beside dense convolution of torch on the processor, for docs/sparse-convolution.md.

    python scripts/torch_timings.py [R ...] [--plot FILE]    # needs: pip install . torch ; with --plot matplotlib

One sample of 8 channels in r^3 cells of which a share of 1/r is occupied at random, 8 filters of 3^3 weights for each
channel of which a share is left; our responses are bounded by 1/r. Times are the least of several runs that take turns, on 1
and on 2 threads. Beside them, on 2 threads: our sub-manifold convolution of the same number of cells, and a level of our
dense networks (with its pooling).
"""

import sys
import time

import numpy as np
import torch
from scansion import nn

CHANNELS = 8
FILTERS = (0.1, 0.3, 0.5, 1.0)
THREADS = (1, 2)


def data(r, draws):
    """A dense array and the same as a sparse tensor."""
    dense = np.zeros((1, CHANNELS, r, r, r), np.float32)
    for plane in dense[0].reshape(CHANNELS, -1):
        plane[draws.choice(r**3, r**2, replace=False)] = draws.random(r**2) + 0.1
    return dense, nn.SparseTensor.from_dense(dense)


def dense_level(r, tensor):
    """Our dense convolution: a network of one level, whose other layers are as small as can be."""
    level = {"channels": [CHANNELS], "density": "none"}
    settings = {"network.levels": [level], "network.hidden": 1, "learning.augment.turn": False}
    network = nn.VoxelClassifier(epochs=1, settings=settings, n_jobs=2)
    two = nn.SparseTensor(
        np.concatenate([tensor.keys, tensor.keys + np.uint64(CHANNELS * r**3)]),
        np.concatenate([tensor.values, tensor.values]),
        (2, CHANNELS, r, r, r),
    )
    network.fit(two, ["a", "b"])
    return lambda: network.predict_proba(tensor)


def least(runs, seconds):
    """The least time of each function in ms; they take turns."""
    best = dict.fromkeys(runs, np.inf)
    end = time.perf_counter() + seconds
    turns = 0
    while turns < 3 or (time.perf_counter() < end and turns < 200):
        for name, run in runs.items():
            start = time.perf_counter()
            run()
            best[name] = min(best[name], 1000 * (time.perf_counter() - start))
        turns += 1
    return best


def of_torch(dense, weights, threads):
    def run():
        torch.set_num_threads(threads)
        with torch.no_grad():
            torch.nn.functional.conv3d(dense, weights, padding=1)

    return run


def measured(r, seconds=6.0):
    """Times by (what, filter density, threads)."""
    draws = np.random.default_rng(r)
    dense, tensor = data(r, draws)
    weights = draws.standard_normal((CHANNELS, CHANNELS, 3, 3, 3)).astype(np.float32)
    runs = {("torch", 1.0, t): of_torch(torch.tensor(dense), torch.tensor(weights), t) for t in THREADS}
    for share in FILTERS:
        own = np.where(draws.random(weights.shape) < share, weights, 0)
        for t in THREADS:
            runs["direct", share, t] = lambda own=own, t=t: nn.sparse_convolution(tensor, own, density=1 / r, n_jobs=t)
    cells = np.column_stack(np.unravel_index(draws.choice(r**3, r**2, replace=False), (r, r, r)))
    rows, kernel = draws.random((r**2, CHANNELS)), weights.transpose(2, 3, 4, 1, 0)
    runs["sites", 1.0, 2] = lambda: nn.submanifold_convolution(cells, rows, kernel, n_jobs=2)
    if r <= 128:
        runs["twin", 1.0, 2] = dense_level(r, tensor)
    return least(runs, seconds)


def plot(times, path):
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5, 3.5), layout="constrained")
    rs = sorted(times)
    axes.plot(rs, [times[r]["torch", 1.0, 2] for r in rs], "k--", label="torch, dense")
    for share in FILTERS:
        axes.plot(rs, [times[r]["direct", share, 2] for r in rs], "o-", ms=3, label=f"sparse, filters {share:g}")
    axes.set(xscale="log", yscale="log", xlabel="r", ylabel="ms, 2 threads", xticks=rs, xticklabels=rs)
    axes.minorticks_off()
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=90)


def main(resolutions, picture):
    head = [f"torch, {t}" for t in THREADS] + [f"ours, {t}" for t in THREADS] + [f"times faster, {t}" for t in THREADS]
    print("| r | filters | " + " | ".join(head) + " | sub-manifold, 2 | dense twin, 2 |\n" + "|---" * 10 + "|")
    times = {}
    for r in resolutions:
        found = times[r] = measured(r)
        for share in FILTERS:
            theirs = [found["torch", 1.0, t] for t in THREADS]
            ours = [found["direct", share, t] for t in THREADS]
            cells = [f"{v:.3g}" for v in theirs + ours] + [f"{a / b:.1f}" for a, b in zip(theirs, ours)]
            others = [found.get((name, share, 2)) for name in ("sites", "twin")]
            cells += ["" if v is None else f"{v:.3g}" for v in others]
            print(f"| {r} | {share:g} | " + " | ".join(cells) + " |", flush=True)
    if picture:
        plot(times, picture)


if __name__ == "__main__":
    arguments = sys.argv[1:]
    picture = None
    if "--plot" in arguments:
        at = arguments.index("--plot")
        picture = arguments[at + 1]
        del arguments[at : at + 2]
    main([int(r) for r in arguments] or [16, 32, 64, 128, 256], picture)
