"""Sparse convolutions agree with scipy's dense correlation, and their gradients with differences."""

import numpy as np
import pytest
import scansion
from scansion import nn
from scipy.ndimage import correlate

RANDOM = np.random.default_rng(3)


def dense_convolution(dense, weights):
    """By scipy: dense (samples, inputs, ...), weights (outputs, inputs, ...)."""
    found = np.zeros((dense.shape[0], weights.shape[0], *dense.shape[2:]))
    for sample, output, channel in np.ndindex(dense.shape[0], weights.shape[0], dense.shape[1]):
        found[sample, output] += correlate(dense[sample, channel], weights[output, channel], mode="constant")
    return found


@pytest.mark.parametrize("extent", [(30,), (9, 14), (8, 7, 12)])
def test_direct_convolution_is_that_of_scipy(extent):
    dense = RANDOM.normal(size=(2, 3, *extent)) * (RANDOM.random((2, 3, *extent)) < 0.2)
    weights = RANDOM.normal(size=(10, 3, *[3] * len(extent)))
    weights[RANDOM.random(weights.shape) < 0.5] = 0
    tensor = nn.SparseTensor.from_dense(dense)
    expected = dense_convolution(tensor.to_dense(), weights)
    found = nn.sparse_convolution(tensor, weights)
    np.testing.assert_allclose(found.to_dense(), expected, rtol=1e-5, atol=1e-5)
    bound = nn.sparse_convolution(tensor, weights, density=0.1, attention="magnitude")
    cells = int(np.prod(extent))
    per_channel = np.bincount(bound.keys.astype(int) // cells, minlength=20)
    most = max(int(0.1 * cells), 1)
    assert (per_channel <= most).all() and per_channel.max() == most
    kept = np.abs(bound.to_dense()).reshape(20, -1).max(1)
    np.testing.assert_allclose(kept, np.abs(expected).reshape(20, -1).max(1), rtol=1e-4)


def test_submanifold_convolution_is_that_of_scipy_at_the_occupied_cells():
    occupied = RANDOM.random((9, 8, 7)) < 0.15
    coordinates = RANDOM.permutation(np.argwhere(occupied))
    features = RANDOM.normal(size=(len(coordinates), 4)).astype(np.float32)
    weights = RANDOM.normal(size=(3, 3, 3, 4, 6)).astype(np.float32)
    dense = np.zeros((1, 4, 9, 8, 7))
    dense[0][:, *coordinates.T] = features.T
    expected = dense_convolution(dense, np.moveaxis(weights, (3, 4), (1, 0)).astype(float))
    found = nn.submanifold_convolution(coordinates - 100, features, weights)
    np.testing.assert_allclose(found, expected[0][:, *coordinates.T].T, rtol=1e-4, atol=1e-4)


def test_gradients_are_those_of_differences():
    coordinates = np.argwhere(RANDOM.random((6, 6)) < 0.4)
    features = RANDOM.normal(size=(len(coordinates), 2)).astype(np.float32)
    weights = RANDOM.normal(size=(3, 3, 2, 3)).astype(np.float32)
    towards = RANDOM.normal(size=(len(coordinates), 3)).astype(np.float32)
    of_features, of_weights = nn.submanifold_convolution_gradient(coordinates, features, weights, towards)
    # The outputs are linear in both: a step of 1 has no error but that of rounding.
    moved = features.copy()
    moved[4, 1] += 1
    change = nn.submanifold_convolution(coordinates, moved, weights) - nn.submanifold_convolution(coordinates, features, weights)
    assert (change * towards).sum() == pytest.approx(of_features[4, 1], abs=1e-4)
    moved = weights.copy()
    moved[2, 0, 1, 2] += 1
    change = nn.submanifold_convolution(coordinates, features, moved) - nn.submanifold_convolution(coordinates, features, weights)
    assert (change * towards).sum() == pytest.approx(of_weights[2, 0, 1, 2], abs=1e-3)

    tensor = nn.SparseTensor.from_dense(RANDOM.normal(size=(1, 2, 9, 9)) * (RANDOM.random((1, 2, 9, 9)) < 0.3))
    filters = RANDOM.normal(size=(4, 2, 3, 3)).astype(np.float32)
    filters[1, 1] = 0
    out = nn.sparse_convolution(tensor, filters)
    gradient = out._replace(values=RANDOM.normal(size=len(out.values)).astype(np.float32))
    of_values, of_filters, of_bias = nn.sparse_convolution_gradient(tensor, filters, gradient, bias=np.zeros(4))
    assert (of_filters[1, 1] == 0).all()
    assert of_bias.sum() == pytest.approx(gradient.values.sum(), abs=1e-3)
    values = tensor.values.copy()
    values[5] += 1
    change = nn.sparse_convolution(tensor._replace(values=values), filters).to_dense() - out.to_dense()
    assert (change * gradient.to_dense()).sum() == pytest.approx(of_values[5], abs=1e-3)


def test_wrong_arrays_are_named():
    with pytest.raises(ValueError, match="stands twice"):
        nn.submanifold_convolution([[0, 0], [0, 0]], [[1.0], [1.0]], np.ones((3, 3, 1, 1)))
    with pytest.raises(ValueError, match="weights"):
        nn.submanifold_convolution([[0, 0]], [[1.0]], np.ones((3, 3, 2, 1)))
    tensor = nn.SparseTensor.from_dense(np.eye(3)[None, None])
    with pytest.raises(ValueError, match="attention"):
        nn.sparse_convolution(tensor, np.ones((1, 1, 3, 3)), density=0.5, attention="strong")
    with pytest.raises(ValueError, match="density"):
        nn.sparse_convolution(tensor, np.ones((1, 1, 3, 3)), density=2.0)
    with pytest.raises(ValueError, match="size"):
        nn.sparse_convolution(tensor, np.ones((1, 1, 2, 2)))


def test_a_network_is_a_point_classifier():
    ground = np.column_stack([RANDOM.uniform(0, 30, (4000, 2)), RANDOM.normal(0, 0.05, 4000)])
    roof = (np.abs(ground[:, :2] - 15) < 5).all(1)
    ground[roof, 2] += 4
    recipe = {
        "recipe": "unet",
        "voxel": 0.8,
        "network.widths": [8, 8],
        "learning.steps": 15,
        "learning.parts": 2,
        "learning.radius": 16,
    }
    model = scansion.PointClassifier(recipe=recipe).fit(ground, np.where(roof, 6, 2))
    assert model.score(ground, np.where(roof, 6, 2)) > 0.95
