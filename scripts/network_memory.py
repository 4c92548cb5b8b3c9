"""Memory of the tensors of the sparse levels of the network for objects, by resolution; for docs/sparse-convolution.md.

    python scripts/network_memory.py [R ...] [--plot FILE]       # needs: pip install . ; with --plot matplotlib

One object in a step, as in table 6.1 of Hackel 2018: points on a box, whose cells are as dense as those of ModelNet. Kept for
the gradients are input and output of each convolution: keys of 8 and values of 4 bytes of the entries, or 4 bytes a cell.
"""

import argparse

import numpy as np
from scansion import nn

CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 0.7) for z in (0.0, 0.9)])
FACES = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
TRIANGLES = [t for a, b, c, d in FACES for t in ((a, b, c), (a, c, d))]


def dense_bytes(levels, r):
    """Bytes of the same tensors if they were dense."""
    total, inputs = 0, 1
    for level in levels:
        for outputs in level["channels"]:
            if level["density"] not in (None, "none"):
                total += 4 * (inputs + outputs) * r**3
            inputs = outputs
        r //= 2
    return total


def measured(r):
    """Bytes of sparse and of dense tensors, densities of the levels, seconds of a step."""
    points = [nn.sample_surface(CORNERS * s, TRIANGLES, 20 * r * r, seed) for seed, s in enumerate((1.0, [1, 1, 0.6]))]
    # The fully connected layers hold no part of these bytes.
    settings = {"network.hidden": 8, "learning.augment.jitter": 0.0}
    network = nn.VoxelClassifier(resolution=r, epochs=1, batch_size=1, settings=settings).fit(points, ["a", "b"])
    levels, report = network.settings_["network"]["levels"], network.history_[-1]
    bounds = [level["density"] for level in levels if level["density"] not in (None, "none")]
    return report["bytes"], dense_bytes(levels, r), bounds, report["seconds"] / 2


def main(resolutions, picture):
    print("| r | bounds of the levels | sparse, MB | dense, MB | dense / sparse | seconds of a step |\n" + "|---" * 6 + "|")
    rows = []
    for r in resolutions:
        sparse, dense, bounds, seconds = measured(r)
        rows.append((r, sparse / 1e6, dense / 1e6))
        cells = [f"{v:g}" for v in bounds], f"{sparse / 1e6:.2f}", f"{dense / 1e6:.2f}", f"{dense / sparse:.1f}"
        print(f"| {r} | {' / '.join(cells[0])} | " + " | ".join(cells[1:]) + f" | {seconds:.2f} |", flush=True)
    if picture:
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(figsize=(4.5, 3), layout="constrained")
        for name, column, style in (("sparse", 1, "o-"), ("dense", 2, "k--")):
            axes.plot(resolutions, [row[column] for row in rows], style, ms=3, label=name)
        axes.set(xscale="log", yscale="log", xlabel="r", ylabel="MB", xticks=resolutions, xticklabels=resolutions)
        axes.minorticks_off()
        axes.legend()
        figure.savefig(picture, dpi=90)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("resolutions", nargs="*", type=int, default=[16, 32, 64, 128, 256])
    parser.add_argument("--plot", metavar="FILE")
    given = parser.parse_args()
    main(given.resolutions, given.plot)
