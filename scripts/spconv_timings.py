"""Our sub-manifold convolution beside that of spconv and dense convolution of torch, on the processor.

    python scripts/spconv_timings.py [R]       # R: 256; needs: pip install . torch spconv ; for docs/sparse-convolution.md

R^2 occupied cells of R^3, at random or on a relief (one cell above each of the ground), 3^3 weights. Finding which cells
neighbour which (the rule book) is part of the times, except where it says reused: both can keep it for further layers on
the same cells (`nn.Sites`, `indice_key`). Times are the least of several runs that take turns; torch's number of threads is
also spconv's. Results on one thread are compared first. On several, spconv 2.3.6 adds up through pointers that its threads
share (`scatter_add` in its `gather.py`), so that some runs give wrong rows: the table counts such runs of 10, of our 20.
"""

import sys

import numpy as np
import torch
from scansion import nn
from torch_timings import least, of_torch

import spconv.pytorch as spconv  # isort: skip

CHANNELS = ((8, 8), (16, 32))
THREADS = (1, 2)


def cells(kind, r, draws):
    """r^2 different cells of r^3."""
    if kind == "random":
        return np.column_stack(np.unravel_index(draws.choice(r**3, r**2, replace=False), (r, r, r)))
    x, y = (axis.ravel() for axis in np.mgrid[:r, :r])
    z = r / 2 + r / 8 * np.sin(9 * x / r) * np.cos(7 * y / r) + draws.normal(0, 0.5, r * r)
    return np.column_stack([x, y, z.astype(np.int64)])


def of_spconv(where, rows, weights, r):
    """A function of the number of threads and whether the rule book is reused; gives the rows of the outputs."""
    inputs, outputs = weights.shape[-2:]
    indices = torch.tensor(np.column_stack([np.zeros(len(where)), where]).astype(np.int32))
    features = torch.tensor(rows)
    layers = []
    for key in (None, "cells"):
        layer = spconv.SubMConv3d(inputs, outputs, 3, bias=False, indice_key=key)
        layer.weight.data = torch.tensor(np.ascontiguousarray(weights.transpose(4, 0, 1, 2, 3)))
        layers.append(layer.eval())
    kept = spconv.SparseConvTensor(features, indices, [r] * 3, 1)

    def run(threads, reused=False):
        torch.set_num_threads(threads)
        with torch.no_grad():
            if reused:
                return layers[1](kept).features
            return layers[0](spconv.SparseConvTensor(features, indices, [r] * 3, 1)).features

    with torch.no_grad():
        kept = kept.replace_feature(features)
        kept.indice_dict = layers[1](kept).indice_dict
    return run


def wrong(run, expected):
    """Of 10 runs, those whose result is not the expected one."""
    return sum(not np.allclose(np.asarray(run()), expected, atol=1e-3) for _ in range(10))


def measured(kind, r, channels, seconds=8.0):
    """Times by (what, threads), and the wrong runs of ours and of spconv."""
    draws = np.random.default_rng(r)
    inputs, outputs = channels
    where = cells(kind, r, draws)
    rows = draws.standard_normal((len(where), inputs)).astype(np.float32)
    weights = draws.standard_normal((3, 3, 3, inputs, outputs)).astype(np.float32)
    theirs = of_spconv(where, rows, weights, r)
    runs, sites = {}, nn.Sites(where)
    for t in THREADS:
        runs["ours", t] = lambda t=t: nn.submanifold_convolution(where, rows, weights, n_jobs=t)
        runs["ours, reused", t] = lambda t=t: nn.submanifold_convolution(sites, rows, weights, n_jobs=t)
        runs["spconv", t] = lambda t=t: theirs(t)
        runs["reused", t] = lambda t=t: theirs(t, reused=True)
    expected = runs["ours", 1]()
    np.testing.assert_array_equal(runs["ours, reused", 1](), expected)
    for name in ("spconv", "reused"):
        np.testing.assert_allclose(runs[name, 1](), expected, atol=1e-3)
    return least(runs, seconds), {key: wrong(run, expected) for key, run in runs.items()}


def dense(r, channels):
    """The same filters on all cells, by torch; more channels take minutes."""
    data, weights = torch.rand(1, channels[0], r, r, r), torch.rand(channels[1], channels[0], 3, 3, 3)
    return least({t: of_torch(data, weights, t) for t in THREADS}, 0.0)


def main(r):
    head = ["cells", "channels", "threads", "ours", "spconv", "spconv / ours", "ours, reused", "spconv, reused"]
    head += ["spconv / ours, reused", "torch, dense", "wrong runs of ours", "of spconv"]
    print("| " + " | ".join(head) + " |\n" + "|---" * len(head) + "|", flush=True)
    for channels in CHANNELS:
        whole = dense(r, channels) if channels == CHANNELS[0] else {}
        for kind in ("random", "relief"):
            found, failed = measured(kind, r, channels)
            for t in THREADS:
                ours, kept, theirs, reused = (found[name, t] for name in ("ours", "ours, reused", "spconv", "reused"))
                numbers = [f"{ours:.3g}", f"{theirs:.3g}", f"{theirs / ours:.1f}"]
                numbers += [f"{kept:.3g}", f"{reused:.3g}", f"{reused / kept:.1f}", f"{whole[t]:.0f}" if whole else ""]
                numbers += [str(failed["ours", t] + failed["ours, reused", t]), str(failed["spconv", t])]
                print(f"| {kind} | {channels[0]} → {channels[1]} | {t} | " + " | ".join(numbers) + " |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 256)
