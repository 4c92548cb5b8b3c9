"""What the built-in model makes of made-up scenes unlike its training; prints the table of docs/default-model.md.

    python scripts/made_up_scenes.py        # needs: pip install .

150 m x 150 m, 7 points per square metre, 3 cm of noise.
"""

import warnings

import numpy as np
import scansion

POINTS, EDGE = 160_000, 150.0


def village(x, y):
    """Houses of 12 m x 10 m with ridged roofs on a grid of 40 m."""
    u, v = x % 40, y % 40
    house = (u > 10) & (u < 22) & (v > 10) & (v < 20)
    return np.where(house, 8 - 0.6 * np.abs(v - 15), 0.02 * x)


def hillside(x, y, slope=0.3):
    """The same houses, with level eaves, on a slope."""
    u, v = x % 40, y % 40
    house = (u > 10) & (u < 22) & (v > 10) & (v < 20)
    return np.where(house, slope * (np.floor(x / 40) * 40 + 22) + 6 - 0.6 * np.abs(v - 15), slope * x)


def pit(x, y, edge=75):
    """With terraces of 15 m on four sides, as far as this from the middle."""
    return 12 * np.floor(np.minimum(np.maximum(np.abs(x - 75), np.abs(y - 75)), edge) / 15)


def terraces(x, y):
    return sum(12 * np.clip(x - edge, 0, 1) for edge in range(15, 135, 15))


def water(x, y):
    return 0.4 * np.sin(x / 3 + 2 * np.sin(y / 11)) + 0.2 * np.sin(y / 2)


def pond(x, y):
    """Inside a disc of 60 m."""
    return np.hypot(x - 75, y - 75) < 30


def spot(x, y):
    """A square of 14 m."""
    return (np.abs(x - 75) < 7) & (np.abs(y - 75) < 7)


def kerb(x, y):
    return (np.abs(x - 83) < 1) & (np.abs(y - 75) < 9)


def depth(x):
    """Of a cutting along y, 40 m wide, with sides of 1 : 1.5."""
    return np.clip((20 - np.abs(x - 75)) / 1.5, 0, 6)


def deck(x, y):
    """Of a bridge across it, askew, 10 m wide."""
    return np.abs(y - 75 - 0.2 * (x - 75)) < 5


SCENES = {
    "flat field": lambda x, y: 0 * x,
    "hills of 16 m, slopes up to 40 degrees": lambda x, y: 8 * np.sin(x / 12) * np.sin(y / 9),
    "cliff of 60 m": lambda x, y: 60 * np.clip((x - 75) / 5, 0, 1),
    "quarry, terraces of 15 m, walls of 12 m": terraces,
    "rough water": water,
    "village": village,
    "village upside down": lambda x, y: -village(x, y),
    "calm pond, 0.5 m below a field": lambda x, y: -0.5 * pond(x, y),
    "car park with a wet spot beside a kerb": lambda x, y: 0.15 * kerb(x, y),
    "bridge over a road in a cutting": lambda x, y: np.where(deck(x, y), 0, -depth(x)),
    "dam across a cutting, sides of 45 degrees": lambda x, y: -np.minimum(depth(x), np.clip(np.abs(y - 75) - 5, 0, None)),
    "village on a slope of 17 degrees": hillside,
    "village on a slope of 27 degrees": lambda x, y: hillside(x, y, 0.5),
    "quarry, a square pit, terraces of 15 m": pit,
    "quarry, such a pit of 90 m in a field": lambda x, y: pit(x, y, 45),
}
#: Where water mirrors eight of nine pulses away.
MIRRORS = {
    "calm pond, 0.5 m below a field": pond,
    "car park with a wet spot beside a kerb": spot,
}


def main():
    model = scansion.PointClassifier.default()
    rng = np.random.default_rng(0)
    print("| scene | ground | vegetation | building | unclassified | warned of |\n|---|---|---|---|---|---|")
    for name, height in SCENES.items():
        x, y = rng.uniform(0, EDGE, (2, POINTS))
        cloud = np.column_stack([x, y, 100 + height(x, y) + 0.03 * rng.standard_normal(POINTS)])
        if name in MIRRORS:
            cloud = cloud[~MIRRORS[name](x, y) | (rng.uniform(size=POINTS) < 1 / 9)]
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            result = model.classify(cloud, abstain=0.0)
        told = [w for w in warned if "has no class for" not in str(w.message)]  # That is said of every cloud.
        shares = [100 * np.isin(result.codes, group).mean() for group in ((2,), (3, 4, 5), (6,), (1,))]
        print(f"| {name} | " + " | ".join(f"{share:.1f}" for share in shares) + f" | {'yes' if told else 'no'} |", flush=True)


if __name__ == "__main__":
    main()
