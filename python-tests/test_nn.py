"""Sparse convolutions agree with scipy's dense correlation, and their gradients with differences."""

import copy
import pickle
import sys
import types

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
    dense[0][(slice(None), *coordinates.T)] = features.T
    expected = dense_convolution(dense, np.moveaxis(weights, (3, 4), (1, 0)).astype(float))
    found = nn.submanifold_convolution(coordinates - 100, features, weights)
    np.testing.assert_allclose(found, expected[0][(slice(None), *coordinates.T)].T, rtol=1e-4, atol=1e-4)


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


def test_gradients_are_in_the_order_of_the_values():
    tensor = nn.SparseTensor.from_dense(RANDOM.normal(size=(2, 2, 6, 6)) * (RANDOM.random((2, 2, 6, 6)) < 0.4))
    filters = RANDOM.normal(size=(3, 2, 3, 3)).astype(np.float32)
    out = nn.sparse_convolution(tensor, filters)
    gradient = out._replace(values=RANDOM.normal(size=len(out.values)).astype(np.float32))
    expected = nn.sparse_convolution_gradient(tensor, filters, gradient, bias=np.zeros(3))
    order, other = RANDOM.permutation(len(tensor.keys)), RANDOM.permutation(len(out.keys))
    shuffled = tensor._replace(keys=tensor.keys[order].astype(float), values=tensor.values[order])
    turned = gradient._replace(keys=gradient.keys[other], values=gradient.values[other])
    assert nn.sparse_convolution(shuffled, filters).values.tobytes() == out.values.tobytes()
    found = nn.sparse_convolution_gradient(shuffled, filters, turned, bias=np.zeros(3))
    assert found[0].tobytes() == expected[0][order].tobytes()
    assert all(own.tobytes() == other.tobytes() for own, other in zip(found[1:], expected[1:], strict=True))
    # One value of two, as a difference.
    pair = nn.SparseTensor([3, 0], [1.0, 2.0], (1, 1, 2, 2))
    kernel = np.arange(1.0, 10.0).reshape(1, 1, 3, 3)
    once = nn.sparse_convolution(pair, kernel)
    of_values = nn.sparse_convolution_gradient(pair, kernel, once)[0]
    change = nn.sparse_convolution(pair._replace(values=[2.0, 2.0]), kernel).to_dense() - once.to_dense()
    assert (change * once.to_dense()).sum() == of_values[0] != of_values[1]


def test_layers_have_rows_in_any_order():
    places, features = RANDOM.permutation(np.argwhere(np.ones((4, 4, 4)))), RANDOM.normal(size=(64, 2))
    towards, order = RANDOM.normal(size=(64, 3)), RANDOM.permutation(64)
    layer = nn.SparseConv3d(2, 3, random_state=1)
    out, back = layer(places, features), layer.backward(towards)
    np.testing.assert_array_equal(layer(places[order], features[order]), out[order])
    np.testing.assert_array_equal(layer.backward(towards[order]), back[order])
    with pytest.raises(ValueError, match=r"coordinates: expected whole numbers, found \d.5"):
        layer(places + 0.5, features)
    with pytest.raises(ValueError, match="gradient: found shape"):
        layer.backward(towards[:, :2])


def test_wrong_entries_are_named():
    tensor = nn.SparseTensor.from_dense(np.eye(3)[None, None])
    kernel = np.ones((1, 1, 3, 3))
    out = nn.sparse_convolution(tensor, kernel)
    wrong = {
        r"keys: expected whole numbers, found 1.5 at index 1": {"keys": [0, 1.5, 8]},
        "found key -1, expected 0 up to 8": {"keys": [0, -1, 8]},
        "found key 9, expected 0 up to 8": {"keys": [0, 9, 8]},
        r"below 2\^63, found 18446744073709551615": {"keys": np.array([0, 4, 2**64 - 1], np.uint64)},
        "found key 4 twice": {"keys": [4, 0, 4]},
        r"values of shape \(2,\)": {"values": [1.0, 2.0]},
    }
    for message, change in wrong.items():
        with pytest.raises(ValueError, match=f"tensor.*{message}"):
            nn.sparse_convolution(tensor._replace(**change), kernel)
        with pytest.raises(ValueError, match=f"tensor.*{message}"):
            nn.sparse_convolution_gradient(tensor._replace(**change), kernel, out)
        with pytest.raises(ValueError, match=f"gradient.*{message}"):
            nn.sparse_convolution_gradient(tensor, kernel, tensor._replace(**change))
    with pytest.raises(ValueError, match="keys: expected whole numbers, found 1.5"):
        tensor._replace(keys=[0, 1.5, 8]).to_dense()
    for shape in [(1, 1, 9), (2, 1, 3, 3), (1, 2, 3, 3), (9, 9)]:
        with pytest.raises(ValueError, match=r"gradient: found shape .*, expected \(1, 1, 3, 3\)"):
            nn.sparse_convolution_gradient(tensor, kernel, out._replace(shape=shape))


@pytest.mark.parametrize("in_order", [False, True])
def test_sites_that_are_used_again_give_the_same_bytes(in_order):
    coordinates = np.argwhere(RANDOM.random((14, 13, 12)) < 0.3)
    if not in_order:
        coordinates = RANDOM.permutation(coordinates)
    sites = nn.Sites(coordinates)
    assert (len(sites), sites.axes) == (len(coordinates), 3)
    features = RANDOM.normal(size=(len(coordinates), 5)).astype(np.float32)
    towards = RANDOM.normal(size=(len(coordinates), 4)).astype(np.float32)
    empty = sites.nbytes
    for size, dilation in [(3, 1), (3, 2), (1, 1), (5, 1)]:
        for _ in range(2):
            weights = RANDOM.normal(size=(size, size, size, 5, 4)).astype(np.float32)
            for n_jobs in (1, 2):
                found = nn.submanifold_convolution(sites, features, weights, dilation, n_jobs)
                anew = nn.submanifold_convolution(coordinates, features, weights, dilation)
                assert found.tobytes() == anew.tobytes()
                gradients = nn.submanifold_convolution_gradient(sites, features, weights, towards, dilation, n_jobs)
                others = nn.submanifold_convolution_gradient(coordinates, features, weights, towards, dilation)
                assert all(own.tobytes() == other.tobytes() for own, other in zip(gradients, others, strict=True))
    # The neighbours of four kernels, each found once: 5 bytes a pair, the ends of the blocks, nothing else.
    places = {tuple(row) for row in coordinates.tolist()}
    pairs = 0
    for reach, step in [(1, 1), (1, 2), (0, 1), (2, 1)]:
        offsets = step * np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 3), -1).reshape(-1, 3)
        pairs += sum(tuple(row) in places for offset in offsets for row in (coordinates + offset).tolist())
    blocks = -(-len(coordinates) // 256)
    assert sites.nbytes - empty == 5 * pairs + 4 * blocks * (27 + 27 + 1 + 125)


def test_layers_share_sites():
    coordinates = RANDOM.permutation(np.argwhere(RANDOM.random((9, 9, 9)) < 0.3))
    features, towards = RANDOM.normal(size=(len(coordinates), 2)), RANDOM.normal(size=(len(coordinates), 4))
    sites = nn.Sites(coordinates)
    results = []
    for places in (sites, coordinates):
        layers = nn.SparseConv3d(2, 3, random_state=1), nn.SparseConv3d(3, 4, random_state=2)
        out = layers[1](places, layers[0](places, features))
        back = layers[0].backward(layers[1].backward(towards))
        results.append([out, back, layers[0].weight_gradient, layers[1].bias_gradient])
    assert all(own.tobytes() == other.tobytes() for own, other in zip(*results, strict=True))
    kept = sites.nbytes
    nn.SparseConv3d(2, 3)(sites, features)
    assert sites.nbytes == kept


def test_wrong_arrays_are_named():
    with pytest.raises(ValueError, match="stands twice"):
        nn.Sites([[0, 0], [0, 0]])
    with pytest.raises(ValueError, match=r"found shape \(3,\)"):
        nn.Sites([0, 1, 2])
    with pytest.raises(ValueError, match="5 axes"):
        nn.Sites(np.zeros((1, 5)))
    with pytest.raises(ValueError, match=r"features: found shape \(1, 1\)"):
        nn.submanifold_convolution(nn.Sites([[0], [1]]), [[1.0]], np.ones((3, 1, 1)))
    with pytest.raises(ValueError, match=r"expected \(size, 1, outputs"):
        nn.submanifold_convolution(nn.Sites([[0], [1]]), [[1.0], [2.0]], np.ones((3, 3, 1, 1)))
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


def bars(count, seed):
    """Upright and lying bars in images."""
    draws = np.random.default_rng(seed)
    images = np.zeros((count, 12, 12), np.float32)
    upright = np.arange(count) % 2 == 1
    for image, is_upright, at in zip(images, upright, draws.integers(2, 10, count), strict=True):
        image[(slice(2, 10), at) if is_upright else (at, slice(2, 10))] = 1
    return images, np.where(upright, "upright", "lying")


#: For few small images and few steps. A constant rate does not depend on the number of epochs.
FEW = {
    "learning.optimiser": {"adagrad": {}},
    "learning.rate": 0.01,
    "learning.schedule": "constant",
    "learning.augment.shift": 0,
}


def small(**changes):
    settings = {"network.hidden": 16, **FEW, **changes.pop("settings", {})}
    return nn.VoxelClassifier("mnist", density=0.3, epochs=4, settings=settings, **changes)


def test_objects_are_classified_and_networks_come_back_from_their_file(tmp_path):
    (X, y), (other, truth) = bars(80, 1), bars(40, 2)
    network = small().fit(X, y)
    assert network.score(other, truth) > 0.9
    assert [epoch["loss"] for epoch in network.history_][-1] < network.history_[0]["loss"]
    network.save(tmp_path / "net")
    again = nn.VoxelClassifier.load(tmp_path / "net")
    np.testing.assert_array_equal(again.predict_proba(other), network.predict_proba(other))
    assert again.classes_.tolist() == ["lying", "upright"]
    arrays = nn.load_weights(tmp_path / "net")
    np.testing.assert_array_equal(arrays["classes.bias"], network.weights()["classes.bias"])
    np.savez(tmp_path / "net.npz", **arrays)
    tensor = nn.SparseTensor.from_dense(other[:, None])
    np.testing.assert_array_equal(network.predict_proba(tensor), network.predict_proba(other))


def test_training_goes_on_from_a_checkpoint_to_the_same_bytes(tmp_path):
    X, y = bars(60, 3)
    whole = small(n_jobs=1).fit(X, y)
    part = small()
    part.epochs = 2
    part.fit(X, y, checkpoint=tmp_path / "steps")
    rest = small().fit(X, y, checkpoint=tmp_path / "steps")
    assert len(rest.history_) == 2
    for name, values in whole.weights().items():
        np.testing.assert_array_equal(values, rest.weights()[name])
    with pytest.raises(ValueError, match="other settings or samples"):
        small(random_state=5).fit(X, y, checkpoint=tmp_path / "steps")
    before = part.predict_proba(X)
    with pytest.raises(ValueError, match="steps after 4 epochs, expected at most the 2 to be done"):
        part.fit(X, y, checkpoint=tmp_path / "steps")
    np.testing.assert_array_equal(part.predict_proba(X), before)
    np.testing.assert_array_equal(small().fit(X, y, checkpoint=tmp_path / "steps").predict_proba(X), whole.predict_proba(X))


@pytest.mark.parametrize(
    "parameters",
    [
        {"network": "mnist", "density": 0.3, "settings": {"network.hidden": 4}},
        {"network": "mnist-paper", "settings": {"network.hidden": 4, "network.dropout": 0.25}},
        {"network": "mnist", "dense": True, "settings": {"network.hidden": 4}},
        {
            "network": "mnist",
            "settings": {"network.hidden": 4, "network.levels": [{"channels": [2], "density": 0.5}]},
        },
        # Of the same shape as with any other name.
        {
            "network": "modelnet-paper",
            "settings": {
                "network.hidden": 4,
                "network.levels": [{"channels": [2], "density": 0.5}],
                "network.deviation": "none",
            },
        },
    ],
)
def test_loaded_networks_have_the_parameters_of_their_file(tmp_path, parameters):
    X, y = bars(8, 1)
    network = nn.VoxelClassifier(**parameters, epochs=1).fit(X, y)
    network.save(tmp_path / "net")
    again = nn.VoxelClassifier.load(tmp_path / "net")
    assert again.get_params() == {**network.get_params(), "epochs": None}
    clone = pytest.importorskip("sklearn.base").clone(again).set_params(epochs=1)
    clone.fit(X, y)
    assert clone.settings_ == network.settings_
    np.testing.assert_array_equal(clone.predict_proba(X), network.predict_proba(X))


def test_loaded_networks_for_points_have_the_resolution(tmp_path):
    points = [RANDOM.normal(size=(50, 3)) for _ in range(8)]
    settings = {"network.hidden": 4, "network.levels": [{"channels": [2], "density": 0.5}]}
    nn.VoxelClassifier(resolution=8, epochs=1, settings=settings).fit(points, np.arange(8) % 2).save(tmp_path / "net")
    again = nn.VoxelClassifier.load(tmp_path / "net")
    assert again.get_params()["resolution"] == 8 and again.settings == settings
    assert again.set_params(epochs=1).fit(points, np.arange(8) % 2).shape_["extent"] == [8, 8, 8]


def test_clouds_of_points_are_objects():
    draws = np.random.default_rng(4)
    rods = [draws.normal(size=(200, 3)) * [0.05, 0.05, 2] + 1e5 for _ in range(20)]
    balls = [draws.normal(size=(200, 3)) for _ in range(20)]
    X, y = rods + balls, np.repeat([3, 7], 20)
    settings = {"network.hidden": 16, "network.levels": [{"channels": [4], "density": 0.5}]}
    network = nn.VoxelClassifier(resolution=8, epochs=8, settings=settings).fit(X, y)
    assert network.score(X, y) > 0.9 and network.classes_.tolist() == [3, 7]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"network": "alexnet"}, "modelnet"),
        ({"density": 2.0}, "density"),
        ({"settings": {"network.hiden": 3}}, "hiden"),
        ({"settings": {"learning.optimiser.sgd.momentun": 3}}, "momentun"),
        ({"settings": {"learning.rate": np.inf}}, "rate: found inf"),
        ({"settings": {"other.hidden": 3}}, "network or learning"),
        ({"epochs": 0}, "epochs"),
    ],
)
def test_bad_settings_of_networks_are_named(change, message):
    X, y = bars(8, 1)
    with pytest.raises(ValueError, match=message):
        nn.VoxelClassifier(**{"network": "mnist", **change}).fit(X, y)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, {"adam-w": {"beta1": 0.9, "beta2": 0.999, "epsilon": 1e-8, "decay": 0.01}}),
        ({"learning.optimiser.adagrad.epsilon": 0.1}, {"adagrad": {"epsilon": 0.1}}),
        ({"learning.optimiser": {"sgd": {}}}, {"sgd": {"momentum": 0.0, "decay": 0.0}}),
        (
            {"learning.optimiser.sgd.momentum": 0.9, "learning.optimiser.sgd.decay": 0.01},
            {"sgd": {"momentum": 0.9, "decay": 0.01}},
        ),
        ({"learning": {"optimiser": {"adadelta": {"rho": 0.8}}}}, {"adadelta": {"rho": 0.8, "epsilon": 1e-6}}),
        (
            {"learning.optimiser": {"adam-w": {"decay": 0}}},
            {"adam-w": {"beta1": 0.9, "beta2": 0.999, "epsilon": 1e-8, "decay": 0.0}},
        ),
    ],
)
def test_networks_can_have_any_optimiser(settings, expected):
    X, y = bars(8, 1)
    network = nn.VoxelClassifier("mnist", epochs=1, settings={"network.hidden": 4, **settings}).fit(X, y)
    assert network.settings_["learning"]["optimiser"] == expected
    assert np.isfinite(network.predict_proba(X)).all()


@pytest.mark.parametrize(
    "small",
    [
        {"recipe": "unet", "voxel": 0.5, "network.widths": [2, 2], "learning": {"steps": 1, "parts": 1}},
        {
            "recipe": "windows",
            "voxel": 0.5,
            "network": {"scales": 1, "channels": [2], "hidden": 4},
            "learning": {"steps": 1, "batch": 2},
        },
    ],
)
def test_networks_of_recipes_can_have_any_optimiser(small):
    tomllib = pytest.importorskip("tomllib")
    xyz = np.random.default_rng(7).uniform(size=(300, 3)) * 4
    codes = np.where(xyz[:, 2] > 2, 6, 2)
    # Values that are not given are PyTorch's.
    for name, given, all_values in [
        ("sgd", {"momentum": 0.9, "decay": 0.01}, {"momentum": 0.9, "decay": 0.01}),
        ("adadelta", {"rho": 0.8}, {"rho": 0.8, "epsilon": 1e-6}),
    ]:
        for optimiser in ({"optimiser": {name: given}}, {f"optimiser.{name}.{key}": v for key, v in given.items()}):
            recipe = {**small, "learning": {**small["learning"], **optimiser}}
            found = tomllib.loads(scansion.PointClassifier(recipe).fit(xyz, codes).recipe_)
            assert found["learning"]["optimiser"] == {name: all_values}


def test_files_of_objects(tmp_path):
    (tmp_path / "a.idx").write_bytes(bytes([0, 0, 8, 2, 0, 0, 0, 1, 0, 0, 0, 2, 5, 9]))
    assert nn.read_idx(tmp_path / "a.idx").tolist() == [[5, 9]]
    with pytest.raises(scansion.FileFormatError, match="IDX"):
        (tmp_path / "b.idx").write_bytes(b"no")
        nn.read_idx(tmp_path / "b.idx")
    (tmp_path / "a.off").write_text("OFF3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    vertices, triangles = nn.read_off(tmp_path / "a.off")
    assert nn.sample_surface(vertices, triangles, 50).shape == (50, 3)
    with pytest.raises(ValueError, match="vertex 9"):
        nn.sample_surface(vertices, [[0, 1, 9]], 5)
    np.savez(tmp_path / "a.npz", chair=np.ones((2, 4, 4, 4)), desk=np.zeros((1, 4, 4, 4)))
    X, y = nn.load_voxels(tmp_path / "a.npz")
    assert X.shape == (3, 4, 4, 4) and y.tolist() == ["chair", "chair", "desk"]


def test_folders_of_xyz_files_are_objects(tmp_path):
    draws = np.random.default_rng(5)
    for number in range(12):
        points = draws.normal(size=(100, 3)) * ([0.05, 0.05, 2] if number < 6 else [1, 1, 1]) + 1e5
        rows = "\n".join(" ".join(map(repr, map(float, row))) for row in [*points])
        (tmp_path / f"{number:03}.xyz").write_text(rows + "\n")
    (tmp_path / "000.xyz").write_text("# x y z class\n0 0 0 1\n\n0 0 1 1\n0.5,0,2 1\n")
    (tmp_path / "notes.txt").write_text("no object")
    X, names = nn.load_xyz(tmp_path)
    assert names.tolist() == [f"{number:03}" for number in range(12)]
    assert X[0].tolist() == [[0, 0, 0], [0, 0, 1], [0.5, 0, 2]] and X[11].shape == (100, 3)
    settings = {"network.hidden": 8, "network.levels": [{"channels": [4], "density": 0.5}]}
    network = nn.VoxelClassifier(resolution=8, epochs=1, settings=settings).fit(X, np.repeat(["rod", "ball"], 6))
    assert network.predict_proba(X).shape == (12, 2)
    (tmp_path / "003.xyz").write_text("1 2 3\n4 5\n")
    with pytest.raises(scansion.FileFormatError, match="line 2"):
        nn.load_xyz(tmp_path)
    with pytest.raises(FileNotFoundError):
        nn.load_xyz(tmp_path / "absent")


def test_damaged_files_are_format_errors(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, chair=np.ones((2, 4, 4, 4)), desk=np.zeros((1, 4, 4, 4)))
    whole = path.read_bytes()
    for cut in range(0, len(whole), 7):
        path.write_bytes(whole[:cut])
        with pytest.raises(scansion.FileFormatError, match="npz"):
            nn.load_voxels(path)
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        try:
            nn.load_voxels(path)
        except scansion.FileFormatError:
            pass
    np.savez(path, chair=np.ones((2, 4, 4, 4)), desk=np.zeros((1, 4, 4, 5)))
    with pytest.raises(scansion.FileFormatError, match="one shape"):
        nn.load_voxels(path)
    with pytest.raises(FileNotFoundError):
        nn.load_voxels(tmp_path / "absent.npz")
    for text in [b"", b"no", b"\x02" + bytes(7) + b"{]", b"\x02" + bytes(7) + b"[]", b"\x0a" + bytes(7) + b'{"a":{}}  ']:
        path.write_bytes(text)
        with pytest.raises(scansion.FileFormatError, match="safetensors"):
            nn.load_weights(path)
    X, y = bars(8, 1)
    network = small()
    network.epochs = 1
    network.fit(X, y).save(path)
    whole = path.read_bytes()
    for place in [*range(0, 600, 3), *range(600, len(whole), len(whole) // 50)]:
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
        with pytest.raises(ValueError):
            nn.VoxelClassifier.load(path)
        try:
            nn.load_weights(path)
        except scansion.FileFormatError:
            pass


def test_a_damaged_checkpoint_is_refused(tmp_path):
    X, y = bars(8, 1)
    network = small()
    network.epochs = 1
    network.fit(X, y, checkpoint=tmp_path / "steps")
    whole = (tmp_path / "steps").read_bytes()
    # The lowest bit of a parameter: the value stays finite.
    place = len(whole) - 8
    (tmp_path / "steps").write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
    with pytest.raises(scansion.FileFormatError, match="checksum"):
        small().fit(X, y, checkpoint=tmp_path / "steps")


@pytest.mark.parametrize("labels", [["0", "1"], ["²", "3"], [0, 1], [False, True], ["-1", "--2"]])
def test_labels_come_back_with_their_type(tmp_path, labels):
    X, y = bars(40, 1)
    y = np.where(y == "upright", labels[1], labels[0])
    network = small().fit(X, y)
    network.save(tmp_path / "net")
    again = nn.VoxelClassifier.load(tmp_path / "net")
    assert again.classes_.tolist() == network.classes_.tolist()
    assert again.classes_.dtype.kind == y.dtype.kind
    assert again.score(X, y) == network.score(X, y) > 0.9
    objects = small().fit(X, y.astype(object)) if y.dtype.kind != "b" else network
    assert objects.classes_.tolist() == network.classes_.tolist()


def test_labels_of_files_without_their_type_are_numbers_if_all_are():
    from scansion.nn import _objects

    assert _objects._labels(["-1", "20"], None).tolist() == [-1, 20]
    for names in [["²", "3"], ["a", "3"], ["--2", "3"], ["", "3"]]:
        assert _objects._labels(names, None).tolist() == names


def test_digits_are_not_turned():
    X, y = bars(8, 1)
    turns = [
        nn.VoxelClassifier(name, epochs=1, settings={"network.hidden": 4, **levels}).fit(X, y).settings_["learning"]
        for name, levels in [("mnist", {}), ("modelnet", {"network.levels": [{"channels": [2], "density": 0.5}]})]
    ]
    assert [learning["augment"]["turn"] for learning in turns] == [False, True]


def test_networks_of_the_thesis_have_its_constants():
    X, y = bars(8, 1)
    network = nn.VoxelClassifier("mnist-paper", settings={"network.hidden": 4}, density=0.035)
    settings = network.fit(X, y).settings_
    learning = settings["learning"]
    assert (learning["epochs"], learning["rate"], learning["pruning"]) == (10, 0.01, 5e-3)
    assert learning["regulariser"]["strength"] == 0 and settings["network"]["deviation"] == 0.1
    assert [level["density"] for level in settings["network"]["levels"]] == [0.035, 0.035]
    assert len(network.history_) == 10

    settings = {"network.hidden": 4, "network.levels": [{"channels": [2], "density": 0.5}], "learning.pruning": 0}
    network = nn.VoxelClassifier("modelnet-paper", epochs=2, settings=settings)
    learning = network.fit(X, y).settings_["learning"]
    assert (learning["epochs"], learning["batch"], learning["rate"]) == (2, 32, 0.001)
    regulariser = {"strength": 0.6, "offset": 0.1, "above": 0.1, "below": 0.1, "smoothing": 0.0, "biases": True}
    assert learning["regulariser"] == {**regulariser, "density": 1.0}
    assert learning["pruning"] == 0 and len(network.history_) == 2


def test_entries_in_any_order_are_those_of_the_objects():
    X, y = bars(20, 1)
    network = small().fit(X, y)
    tensor = nn.SparseTensor.from_dense(X[:, None])
    order = RANDOM.permutation(len(tensor.keys))
    shuffled = tensor._replace(keys=tensor.keys[order], values=tensor.values[order])
    np.testing.assert_array_equal(network.predict_proba(shuffled), network.predict_proba(X))
    wrong = {
        "key 2880": tensor._replace(keys=np.append(tensor.keys[:-1], np.uint64(2880))),
        "key -1": tensor._replace(keys=np.append(tensor.keys[:-1].astype(np.int64), -1)),
        "twice": tensor._replace(keys=np.append(tensor.keys[:-1], tensor.keys[:1])),
        "keys of shape": tensor._replace(keys=tensor.keys[:-1]),
        "whole numbers": tensor._replace(keys=tensor.keys + 0.5),
        "1 to 4 axes": tensor._replace(shape=(20, 144)),
    }
    for message, X in wrong.items():
        with pytest.raises(ValueError, match=message):
            network.predict_proba(X)


def test_arrays_without_channels_or_axes_are_named():
    one = np.ones((3, 1, 1))
    with pytest.raises(ValueError, match="channels"):
        nn.submanifold_convolution([[0]], np.ones((1, 0)), np.ones((3, 0, 1)))
    with pytest.raises(ValueError, match="channels"):
        nn.submanifold_convolution([[0]], [[1.0]], np.ones((3, 1, 0)))
    with pytest.raises(ValueError, match="axes"):
        nn.submanifold_convolution(np.ones((1, 0)), [[1.0]], np.ones((1, 1)))
    for dilation in [2**62, 2**63 // 3 + 1, 2**63, 2**64 - 1, 2**80, 0, -1, 1.5]:
        with pytest.raises(ValueError):
            nn.submanifold_convolution([[0], [1]], [[1.0], [2.0]], one, dilation=dilation)
    with pytest.raises(ValueError, match="dilation"):
        nn.submanifold_convolution_gradient([[0]], [[1.0]], one, [[1.0]], dilation=2**62)
    for shape in [(1, 1), (1,), (1, 1, 1, 1, 1, 1, 1)]:
        tensor = nn.SparseTensor(np.zeros(1, np.uint64), np.ones(1, np.float32), shape)
        with pytest.raises(ValueError, match="1 to 4 axes"):
            nn.sparse_convolution(tensor, np.ones((1, 1)))


def test_training_objects_that_do_not_fit_are_an_error():
    from scansion import _core

    X, y = bars(8, 1)
    labelled, shape = nn._samples.samples(X, np.unique(y, return_inverse=True)[1], 8)
    other, _ = nn._samples.samples(X, None, 8)
    level = '{"channels": [2], "density": 0.5}'
    training = _core.ObjectTraining(f'{{"levels": [{level}], "hidden": 2}}', "{}", labelled, ["a", "b"])
    with pytest.raises(ValueError, match="labels"):
        training.epoch(other)
    small_images, _ = nn._samples.samples(X[:, :10, :10], np.zeros(8, int), 8)
    with pytest.raises(ValueError, match="10"):
        training.epoch(small_images)


class Tensor:
    """As much of a tensor of torch as is needed, of numpy's arrays."""

    def __init__(self, array, indices=None, shape=None):
        self.array, self.places, self.is_sparse = array, indices, indices is not None
        self.shape = array.shape if shape is None else shape

    def detach(self):
        return self

    cpu = coalesce = detach

    def numpy(self):
        return self.array

    def indices(self):
        return Tensor(self.places)

    def values(self):
        return Tensor(self.array)


def test_tensors_go_to_torch_and_back(monkeypatch):
    def sparse_coo_tensor(places, values, shape):
        return Tensor(values.array, places.array, shape)

    torch = types.SimpleNamespace(from_numpy=Tensor, sparse_coo_tensor=sparse_coo_tensor)
    monkeypatch.setitem(sys.modules, "torch", torch)
    dense = RANDOM.normal(size=(2, 3, 4, 5)) * (RANDOM.random((2, 3, 4, 5)) < 0.3)
    tensor = nn.SparseTensor.from_dense(dense)
    there = tensor.to_torch()
    assert there.places.shape == (4, len(tensor.keys)) and there.shape == (2, 3, 4, 5)
    np.testing.assert_array_equal(there.array, tensor.to_dense()[tuple(there.places)])
    assert not np.shares_memory(there.array, tensor.values)
    for found in (nn.SparseTensor.from_torch(there), nn.SparseTensor.from_torch(Tensor(tensor.to_dense()))):
        np.testing.assert_array_equal(found.keys, tensor.keys)
        np.testing.assert_array_equal(found.values, tensor.values)
        assert found.shape == tensor.shape


def test_a_layer_has_the_gradients_of_its_function():
    layer = nn.SparseConv3d(2, 3, random_state=1)
    places = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 1]])
    features = RANDOM.normal(size=(3, 2)).astype(np.float32)
    found = layer(places, features)
    np.testing.assert_allclose(found, nn.submanifold_convolution(places, features, layer.weight) + layer.bias)
    expected = nn.submanifold_convolution_gradient(places, features, layer.weight, np.ones_like(found))
    # The layer has a copy of what it was given.
    features[:] = 0
    np.testing.assert_array_equal(layer.backward(np.ones_like(found)), expected[0])
    np.testing.assert_array_equal(layer.weight_gradient, expected[1])
    assert layer.weight_gradient.shape == layer.weight.shape and layer.bias_gradient.tolist() == [3, 3, 3]
    with pytest.raises(ValueError, match="call"):
        nn.SparseConv3d(1, 1).backward([[1.0]])


def test_scores_of_objects_need_a_label_for_each():
    X, y = bars(20, 1)
    network = small().fit(X, y)
    for wrong in (y[:1], y[:, None], None):
        with pytest.raises(ValueError, match="y: found"):
            network.score(X, wrong)


def test_positions_and_corners_are_whole_numbers():
    assert len(nn.Sites([[0.0, -3.0]])) == 1
    for wrong in (0.5, np.nan, np.inf, 1e30):
        with pytest.raises(ValueError, match="coordinates: expected whole numbers, found .* at index 1, 0"):
            nn.Sites([[0.0], [wrong]])
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    for wrong in (1.5, np.nan):
        with pytest.raises(ValueError, match=r"triangles: expected whole numbers .* found .* at index 0, 2"):
            nn.sample_surface(corners, [[0, 1, wrong]], 5)


def test_training_that_fails_leaves_a_network_as_it_was():
    X, y = bars(20, 1)
    network = small().fit(X, y)
    before, found = dict(network.__dict__), network.predict(X)
    network.set_params(settings={"network.hidden": -1})
    with pytest.raises(ValueError):
        network.fit(X[:, :10, :10], np.arange(20) % 3)
    for name in ("classes_", "shape_", "settings_", "history_"):
        assert network.__dict__[name] is before[name]
    assert np.array_equal(network.predict(X), found)


@pytest.mark.parametrize("labels", [["lying", "upright"], [3, 7], [False, True]])
def test_networks_are_copied_and_pickled(labels):
    X, y = bars(40, 1)
    y = np.where(y == "upright", labels[1], labels[0])
    network = small(random_state=np.random.RandomState(3)).fit(X, y)
    joblib = pytest.importorskip("joblib")
    by_joblib = joblib.Parallel(n_jobs=2)(joblib.delayed(type(network).predict_proba)(network, X) for _ in range(2))
    for again in (pickle.loads(pickle.dumps(network)), copy.deepcopy(network), copy.copy(network)):
        np.testing.assert_array_equal(again.predict_proba(X), network.predict_proba(X))
        assert again.classes_.dtype == network.classes_.dtype and again.classes_.tolist() == network.classes_.tolist()
        assert again.history_ == network.history_ and again.settings_ == network.settings_
        assert repr(again.get_params()["settings"]) == repr(network.settings)
        assert again.weights().keys() == network.weights().keys()
    for found in by_joblib:
        np.testing.assert_array_equal(found, network.predict_proba(X))
    assert pickle.loads(pickle.dumps(small())).get_params() == small().get_params()


def test_scores_of_objects_with_labels_of_another_kind_are_refused():
    X, y = bars(40, 1)
    codes = np.where(y == "upright", 1, 0)
    for labels, other, found in [(y, codes, "numbers"), (codes, y, "text"), (codes, y.astype(object), "text")]:
        network = small().fit(X, labels)
        assert network.score(X, labels) > 0.9
        with pytest.raises(ValueError, match=f"y: found {found}, expected (text|numbers), which is what the model learned"):
            network.score(X, other)
    with pytest.raises(ValueError, match="not fitted"):
        small().score(X, y)


def test_layers_are_copied_and_pickled_after_a_call():
    layer = nn.SparseConv3d(2, 3, random_state=1)
    places, features = [[0, 0, 0], [0, 0, 1]], np.ones((2, 2))
    found = layer(places, features)
    for again in (pickle.loads(pickle.dumps(layer)), copy.deepcopy(layer)):
        np.testing.assert_array_equal(again(places, features), found)
    assert layer.backward(np.ones((2, 3))).shape == (2, 2)


def test_sites_survive_pickle():
    random = np.random.default_rng(8)
    for axes in (1, 2, 3, 4):
        rows = np.unique(random.integers(-9, 9, (60, axes)), axis=0)
        rows = random.permutation(rows)
        features, weights = random.normal(size=(len(rows), 2)), random.normal(size=(*[3] * axes, 2, 3))
        sites = nn.Sites(rows + 1000)
        expected = nn.submanifold_convolution(sites, features, weights)
        for again in (pickle.loads(pickle.dumps(sites)), copy.deepcopy(sites)):
            assert (len(again), again.axes) == (len(rows), axes)
            assert nn.submanifold_convolution(again, features, weights).tobytes() == expected.tobytes()
    assert len(pickle.loads(pickle.dumps(nn.Sites(np.zeros((0, 3), int))))) == 0
