"""Inputs and results of torch, with which the tests of the core's layers and optimisers compare theirs.

    python scripts/torch_reference.py       # needs: pip install torch safetensors

Writes crates/core/src/nn/testdata/*.safetensors. Results are computed in double precision from inputs that are exact in
single precision, and rounded to single precision. Array `case.x` is an input, `case.towards` the gradient of the loss with
respect to the result `case.y`, and `case.dx` that with respect to x. Layouts are those of torch.
"""

import pathlib

import numpy as np
import torch
import torch.nn.functional as F
from safetensors.numpy import save_file

FOLDER = pathlib.Path(__file__).parent.parent / "crates/core/src/nn/testdata"
CONVOLUTIONS = {1: F.conv1d, 2: F.conv2d, 3: F.conv3d}
#: Name, extent, share of the inputs that are not 0, dilation.
GRIDS = [
    ("line", (13,), 0.7, 1),
    ("image", (5, 7), 0.6, 1),
    ("cube", (3, 2, 4), 0.5, 1),
    ("scattered", (4, 3, 5), 0.05, 1),
    ("dilated", (5, 2, 4), 1.0, 2),
]
#: Name, size, padding.
STRIDED = [("cubes", 2, 0), ("overlapping", 3, 1)]


def numbers(draws, *shape):
    """Normal numbers that are exact in single precision."""
    return torch.tensor(draws.standard_normal(shape).astype(np.float32).astype(np.float64), requires_grad=True)


def gradients(found, y, towards, **inputs):
    """Adds a result and the gradients with respect to the inputs to the arrays."""
    y.backward(towards)
    for name, value in inputs.items():
        found[name], found["d" + name] = value, value.grad
    return {**found, "y": y, "towards": towards}


def convolutions(draws):
    arrays = {}
    for name, extent, density, dilation in GRIDS:
        x, weights = numbers(draws, 2, 2, *extent), numbers(draws, 9, 2, *[3] * len(extent))
        bias = numbers(draws, 9)
        with torch.no_grad():
            x *= torch.tensor(draws.random(x.shape) < density)
            weights *= torch.tensor(draws.random(weights.shape) < 0.6)
        run = CONVOLUTIONS[len(extent)]
        y = run(x, weights, bias, padding=dilation, dilation=dilation)
        towards = numbers(draws, *y.shape).detach()
        # Direct sparse convolution has gradients where there is a response.
        towards *= run(x, weights, padding=dilation, dilation=dilation) != 0
        arrays[name] = gradients({}, y, towards, x=x, weights=weights, bias=bias)
    return arrays


def strided(draws):
    arrays = {}
    for name, size, padding in STRIDED:
        fine, coarse = numbers(draws, 2, 3, 4, 6, 4), numbers(draws, 2, 3, 2, 3, 2)
        down, up = numbers(draws, 5, 3, *[size] * 3), numbers(draws, 3, 5, *[size] * 3)
        y = F.conv3d(fine, down, stride=2, padding=padding)
        arrays[name] = gradients({}, y, numbers(draws, *y.shape).detach(), x=fine, weights=down)
        y = F.conv_transpose3d(coarse, up, stride=2, padding=padding, output_padding=size - 2)
        towards = numbers(draws, *y.shape).detach()
        arrays["transposed-" + name] = gradients({}, y, towards, x=coarse, weights=up)
    return arrays


def layers(draws):
    x, scale, shift = numbers(draws, 37, 5), numbers(draws, 5), numbers(draws, 5)
    mean, variance = numbers(draws, 5).detach(), numbers(draws, 5).detach().abs()
    found = {"mean": mean.clone(), "variance": variance.clone()}
    found["evaluated"] = F.batch_norm(x, mean, variance, scale, shift, training=False)
    y = F.batch_norm(x, mean, variance, scale, shift, training=True)
    found |= {"mean-after": mean, "variance-after": variance}
    arrays = {"norm": gradients(found, y, numbers(draws, 37, 5).detach(), x=x, scale=scale, shift=shift)}

    x, weights, bias = numbers(draws, 11, 7), numbers(draws, 6, 7), numbers(draws, 6)
    y = F.linear(x, weights, bias)
    towards = numbers(draws, 11, 6).detach()
    arrays["linear"] = gradients({}, y, towards, x=x, weights=weights, bias=bias)

    scores, classes = numbers(draws, 20, 4), numbers(draws, 4).detach().abs()
    with torch.no_grad():
        scores *= 4
    labels = torch.tensor(draws.integers(0, 4, 20))
    labels[3:6] = -100
    loss = F.cross_entropy(scores, labels, classes)
    targets = torch.where(labels[:, None] == torch.arange(4), classes, 0.0)
    found = {"targets": targets, "probabilities": F.softmax(scores, dim=1)}
    arrays["entropy"] = gradients(found, loss, torch.tensor(1.0, dtype=torch.float64), x=scores)
    for name, extent, pool in [("pool2", (5, 6), F.max_pool2d), ("pool3", (4, 5, 6), F.max_pool3d)]:
        x = numbers(draws, 2, 3, *extent)
        y = pool(x, 2)
        arrays[name] = gradients({}, y, numbers(draws, *y.shape).detach(), x=x)
        x = (numbers(draws, 2, 3, *extent) - 0.7).detach().clamp(min=0).requires_grad_()
        y = pool(x, 2)
        arrays["sparse-" + name] = gradients({}, y, numbers(draws, *y.shape).detach(), x=x)
    return arrays


def optimisers(draws):
    """Values after each of 10 steps with given gradients; weights decay, the bias does not."""
    weights, bias = numbers(draws, 7), numbers(draws, 3)
    # Small ones too, so that it matters where epsilon is added.
    slopes = numbers(draws, 10, 10).detach() * torch.logspace(0, -18, 10, 2.0, dtype=torch.float64)
    arrays = {"given": {"weights": weights, "bias": bias, "gradients": slopes}}
    rules = {
        "sgd": lambda groups, decay: torch.optim.SGD(groups, 0.1, momentum=0.9),
        "adagrad": lambda groups, decay: torch.optim.Adagrad(groups, 0.1, eps=1e-10),
        "adadelta": lambda groups, decay: torch.optim.Adadelta(groups, 0.1, rho=0.9, eps=1e-6),
        "adamw": lambda groups, decay: torch.optim.AdamW(groups, 0.1, betas=(0.9, 0.999), eps=1e-8),
    }
    for name, rule in rules.items():
        values = [v.detach().clone().requires_grad_() for v in (weights, bias)]
        decay = {"sgd": 0.05, "adamw": 0.2}.get(name, 0.0)
        groups = [{"params": [v], "weight_decay": d} for v, d in zip(values, (decay, 0.0))]
        optimiser, steps = rule(groups, decay), []
        for step, slope in enumerate(slopes):
            for group in optimiser.param_groups:
                group["lr"] = 0.1 / (1 + step // 5)
            values[0].grad, values[1].grad = slope[:7].clone(), slope[7:].clone()
            optimiser.step()
            steps.append(torch.cat([v.detach() for v in values]))
        arrays[name] = {"steps": torch.stack(steps)}
    return arrays


def main():
    for seed, make in enumerate((convolutions, strided, layers, optimisers)):
        arrays = make(np.random.default_rng(seed))
        flat = {
            f"{case}.{key}": np.atleast_1d(value.detach().numpy()).astype(np.float32)
            for case, own in arrays.items()
            for key, value in own.items()
        }
        path = FOLDER / f"{make.__name__}.safetensors"
        save_file(flat, path, metadata={"scansion": f"scripts/torch_reference.py, torch {torch.__version__.split('+')[0]}"})
        print(path.name, path.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
