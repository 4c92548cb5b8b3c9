"""The arrays of models with a network, as docs/unet.md and docs/windows.md describe them, give the probabilities of the model."""

import numpy as np
import scansion
from scansion import nn


def classified(recipe, path):
    """A cloud of a floor and a wall, a small model's probabilities of its points, and the model's arrays."""
    flat = np.stack(np.meshgrid(np.arange(12.0), np.arange(12.0), [0.0]), -1).reshape(-1, 3)
    cloud = np.concatenate([flat, flat[:, [2, 0, 1]] + [0, 0, 1]]) + 0.5
    cloud = cloud[np.random.default_rng(0).random(len(cloud)) < 0.7]
    model = scansion.PointClassifier({"voxel": 1.0, **recipe}).fit(cloud, np.where(cloud[:, 2] > 1, 6, 2))
    model.save(path)
    return cloud, model.predict_proba(cloud), nn.load_weights(path)


def smoothed(scores):
    """Soft-max, then (1 - 0.01) p + 0.01 / classes."""
    p = np.exp(scores - scores.max(axis=1, keepdims=True))
    return 0.99 * p / p.sum(axis=1, keepdims=True) + 0.01 / scores.shape[1]


def rectified(x):
    return np.maximum(x, 0)


def test_windows(tmp_path):
    recipe = {"recipe": "windows", "network.scales": 2, "network.window": 5, "network.channels": [2, 3]}
    recipe = {**recipe, "network.hidden": 4, "learning.steps": 20, "learning.batch": 4}
    cloud, found, arrays = classified(recipe, tmp_path / "model")
    flat = [[] for _ in cloud]
    for scale in range(2):
        # The origin is a finest cell below the lowest coordinates.
        cells = ((cloud - (cloud.min(axis=0) - 1)) // 2**scale).astype(int)
        for row, own in enumerate(cells):
            x = np.zeros((1, 5, 5, 5))
            for cell in cells - own + 2:
                if ((cell >= 0) & (cell < 5)).all():
                    x[0][tuple(cell)] = 1
            for level in range(2):
                x = convolved(x, arrays, f"network_branch{scale}.level{level}.convolution0")
            flat[row].append(np.moveaxis(x, 0, -1).ravel())
    flat = np.array([np.concatenate(row) for row in flat])
    hidden = rectified(flat @ arrays["network_hidden.weights"] + arrays["network_hidden.bias"])
    scores = hidden @ arrays["network_classes.weights"] + arrays["network_classes.bias"]
    np.testing.assert_allclose(found, smoothed(scores), atol=1e-5)
    np.testing.assert_array_equal(arrays["linear_weights"], arrays["network_classes.weights"].ravel())


def convolved(x, arrays, name):
    """A convolution with zeros around, max(0, x), and the maximum of 2 x 2 x 2 cells; the last of an odd number is dropped."""
    weights, n = arrays[f"{name}.weights"], x.shape[1]
    padded, y = np.pad(x, [(0, 0)] + [(1, 1)] * 3), np.zeros((len(weights), n, n, n))
    for i, j, k in np.ndindex(3, 3, 3):
        y += np.einsum("oi,ixyz->oxyz", weights[:, :, i, j, k], padded[:, i : i + n, j : j + n, k : k + n])
    y, half = rectified(y + arrays[f"{name}.bias"][:, None, None, None]), n // 2
    y = y[:, : 2 * half, : 2 * half, : 2 * half]
    return y.reshape(len(weights), half, 2, half, 2, half, 2).max(axis=(2, 4, 6))


class UNet:
    """The network of the recipe unet, from its arrays."""

    def __init__(self, arrays):
        self.arrays = {name.removeprefix("network_"): values for name, values in arrays.items()}

    def norm(self, name, x, beside=0):
        scale, shift, mean, variance = (self.arrays[f"{name}.{part}"] for part in ("scale", "shift", "mean", "variance"))
        return rectified((x - mean) / np.sqrt(variance + 1e-5) * scale + shift + beside)

    def within(self, name, cells, x):
        """Sub-manifold convolution."""
        weights, row = self.arrays[f"{name}.weights"], {cell: i for i, cell in enumerate(cells)}
        y = np.zeros((len(cells), weights.shape[2]))
        for at, (a, b, c) in enumerate(cells):
            for i, j, k in np.ndindex(3, 3, 3):
                other = row.get((a + i - 1, b + j - 1, c + k - 1))
                if other is not None:
                    y[at] += x[other] @ weights[9 * i + 3 * j + k]
        return y

    def between(self, name, cells):
        """For each cell the row of its coarse cell, and the weights that connect both."""
        rows = {cell: i for i, cell in enumerate(coarser(cells))}
        weights = self.arrays[f"{name}.weights"]
        return [(rows[a // 2, b // 2, c // 2], weights[4 * (a % 2) + 2 * (b % 2) + c % 2]) for a, b, c in cells]

    def scores(self, levels, x):
        beside = []
        for level, cells in enumerate(levels):
            name = f"level{level}"
            if level == 0:
                raw = self.within(f"{name}.enter", cells, x)
            else:
                raw = np.zeros((len(cells), self.arrays[f"{name}.enter.weights"].shape[2]))
                for fine, (row, weights) in zip(x, self.between(f"{name}.enter", levels[level - 1]), strict=True):
                    raw[row] += fine @ weights
            entered = self.norm(f"{name}.enter", raw)
            inner = self.norm(f"{name}.residual0", self.within(f"{name}.residual0", cells, entered))
            x = self.norm(f"{name}.residual1", self.within(f"{name}.residual1", cells, inner), entered)
            beside.append(x)
        for level in reversed(range(len(levels) - 1)):
            name, cells = f"level{level}", levels[level]
            raw = np.array([x[row] @ weights for row, weights in self.between(f"{name}.up", cells)])
            x = np.concatenate([beside[level], self.norm(f"{name}.up", raw)], axis=1)
            for part in ("merge", "last"):
                x = self.norm(f"{name}.{part}", self.within(f"{name}.{part}", cells, x))
        return x @ self.arrays["head.weights"] + self.arrays["head.bias"]


def coarser(cells):
    return sorted({tuple(c // 2 for c in cell) for cell in cells})


def test_unet(tmp_path):
    recipe = {"recipe": "unet", "network.widths": [4, 5, 6], "inputs.height": False}
    cloud, found, arrays = classified({**recipe, "learning.steps": 20, "learning.parts": 1}, tmp_path / "model")
    own = [tuple(cell) for cell in np.floor(cloud).astype(int).tolist()]
    levels = [sorted(set(own))]
    levels += [coarser(levels[0]), coarser(coarser(levels[0]))]
    # Each cell has one point, in its middle.
    inputs = np.tile([1, 0, 0, 0, np.log(2) / 3], (len(own), 1))
    scores = UNet(arrays).scores(levels, inputs)
    row = {cell: i for i, cell in enumerate(levels[0])}
    np.testing.assert_allclose(found, smoothed(scores[[row[cell] for cell in own]]), atol=1e-5)
    np.testing.assert_array_equal(arrays["linear_weights"], arrays["network_head.weights"].ravel())
