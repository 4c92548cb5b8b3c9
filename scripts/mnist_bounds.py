"""MNIST by the bound of the density, for docs/sparse-convolution.md: loss, time of an epoch, accuracy, beside the dense twin.

    python scripts/mnist_bounds.py DATA [--network NAME] [--bounds B ...] [--images N] [--epochs N] [--rate R] [--plot FILE]

DATA holds the four IDX files, compressed or not; pixels below 50 become 0. NAME is mnist or mnist-paper, which has the constants
of the thesis. Seconds are those of the processor, summed over
the threads. Needs: pip install . ; with --plot matplotlib.
"""

import argparse
import pathlib
import time

import numpy as np
from scansion import nn

BOUNDS = [0.035, 0.045, 0.055, 0.065, 0.075, 0.085, 0.095]


def images(data, part):
    """Images with values from 0 to 1, and their digits."""
    pixels, digits = (nn.read_idx(next(data.glob(f"{part}-{kind}-idx*"))) for kind in ("images", "labels"))
    return np.where(pixels < 50, 0, pixels) / np.float32(255), digits


def main(given):
    train, digits = images(given.data, "train")
    test, truth = images(given.data, "t10k")
    own = np.random.default_rng(0).permutation(len(train))[: given.images]
    losses = {}
    epochs = [f"loss, epoch {e + 1}" for e in range(given.epochs)]
    print(f"| bound | {' | '.join(epochs)} | seconds an epoch | accuracy, % |\n" + "|---" * (given.epochs + 3) + "|", flush=True)
    for bound in [*given.bounds, None]:
        start = time.process_time()
        network = nn.VoxelClassifier(
            given.network,
            density=bound,
            dense=bound is None,
            epochs=given.epochs,
            learning_rate=given.rate,
        ).fit(train[own], digits[own])
        seconds = (time.process_time() - start) / given.epochs
        name = "dense" if bound is None else f"{bound:g}"
        losses[name] = [epoch["loss"] for epoch in network.history_]
        cells = [*(f"{loss:.3f}" for loss in losses[name]), f"{seconds:.0f}", f"{100 * network.score(test, truth):.2f}"]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)
    if given.plot:
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(figsize=(4.5, 3), layout="constrained")
        for name, loss in losses.items():
            axes.plot(range(1, len(loss) + 1), loss, "k--" if name == "dense" else "-", label=name)
        axes.set(xlabel="epoch", ylabel="loss", yscale="log")
        axes.legend(fontsize=8)
        figure.savefig(given.plot, dpi=90)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--network", default="mnist")
    parser.add_argument("--bounds", nargs="*", type=float, default=BOUNDS)
    parser.add_argument("--images", type=int, default=60_000, help="images to train on, picked at random")
    parser.add_argument("--epochs", type=int, default=10)
    parser.add_argument("--rate", type=float, help="the highest learning rate; without it the network's own")
    parser.add_argument("--plot", metavar="FILE")
    main(parser.parse_args())
