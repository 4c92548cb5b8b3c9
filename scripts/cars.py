"""Cars that the built-in model leaves unclassified, in scans that it did not learn from; for docs/default-model.md.

    python scripts/cars.py DATA [--out FOLDER]        # needs: pip install '.[las,viz]' lazrs

DATA/airborne holds the scans. Prints how many of the marked cars of two scans are found by a model that learned from
the other scans (see car_clouds.py), and what the built-in model takes for cars elsewhere. FOLDER (default: cars) gets a
picture of the housing estate. Same inputs, same figures.
"""

import argparse
import pathlib
from dataclasses import dataclass

import numpy as np
import scansion
from car_clouds import AHN3, HOUSING, UNSURE, marked, marks
from default_model_accuracy import RETURNS, TITLES, scored, truth, with_cars, without

#: Scans that the built-in model did not learn from.
OTHERS = [
    "lidarhd_building.laz",
    "lidarhd_forest_edge.laz",
    "lidarhd_farm_rgb.laz",
    "lidarhd_fields_rgbnir_extra_bytes.laz",
    "powerline_corridor.laz",
]


@dataclass(frozen=True)
class Rated:
    """A scan and what a model makes of it: given codes, those without and with cars left unclassified."""

    name: str
    cloud: scansion.PointCloud
    given: np.ndarray
    before: np.ndarray
    after: np.ndarray

    @staticmethod
    def by(model, name, data):
        cloud = scansion.read(data / "airborne" / name, columns=["Classification", *RETURNS])
        after = np.asarray(model.classify(cloud, abstain=0.0).codes)
        before = np.asarray(model.classify(cloud, abstain=0.0, settings={"classes.cars.points": 0}).codes)
        return Rated(name, cloud, np.asarray(cloud["Classification"]).astype(int), before, after)

    @property
    def xyz(self):
        return np.asarray(self.cloud.xyz)

    @property
    def car(self):
        return self.before != self.after

    @property
    def height(self):
        return np.asarray(scansion.terrain.height_above_ground(self.cloud, ground="filter", noise=()))

    def prices(self):
        """Overall accuracy before and after, mean IoU before and after; percent, cells of a table."""
        codes = truth(self.name, self.given)
        before, after = scored(self.before, codes), scored(self.after, codes)
        return " | ".join(f"{value:.2f}" for value in (before[0], after[0], before[1], after[1]))

    def print_found(self):
        """Marked cars that are found; those of more than half their points only if they have more than 5."""
        cars = marked(self.xyz, self.given, self.name)
        shares = [self.car[cars == number].mean() for number in np.unique(cars[cars > 0]) if (cars == number).sum() > 5]
        recall = 100 * self.car[cars > 0].mean()
        precision = 100 * (cars[self.car & (cars != UNSURE)] > 0).mean()
        half = f"{sum(share > 0.5 for share in shares)} of {len(shares)}"
        print(f"| {TITLES[self.name]} | {recall:.1f} | {half} | {precision:.1f} | {self.prices()} |", flush=True)

    def print_price(self):
        """What it costs: points of other classes that become class 1."""
        wrong = self.car & (truth(self.name, self.given) >= 0)
        print(f"| {TITLES[self.name]} | {self.car.sum():,} | {wrong.sum():,} | {self.prices()} |", flush=True)


def picture(rated, path):
    """A top view: points below 3 m, grey by height; cars found red, missed blue, other points named car orange."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    origin = np.floor(rated.xyz[:, :2].min(0))
    xy, cars = rated.xyz[:, :2] - origin, marked(rated.xyz, rated.given, rated.name)
    figure, axes = plt.subplots(figsize=(20, 14))
    low = np.flatnonzero((rated.height > 0.3) & (rated.height < 3))
    axes.scatter(*xy[low].T, c=rated.height[low], cmap="gray_r", vmin=0, vmax=3, s=0.5)
    groups = {
        "marked car, found": ("red", (cars > 0) & rated.car),
        "marked car, missed": ("blue", (cars > 0) & ~rated.car),
        "unsure, named car": ("magenta", (cars == UNSURE) & rated.car),
        "no marked car, named car": ("orange", (cars == 0) & rated.car),
    }
    for label, (colour, mask) in groups.items():
        axes.plot(*xy[mask].T, ".", color=colour, markersize=2, label=f"{label}: {mask.sum():,} points")
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) / 2
    for mark in marks(rated.name):
        turn = np.array([[np.cos(mark.heading), np.sin(mark.heading)], [-np.sin(mark.heading), np.cos(mark.heading)]])
        outline = (corners * (mark.length, mark.width)) @ turn + (mark.x, mark.y) - origin
        axes.plot(*outline.T, color="black", linewidth=0.7, linestyle="-" if mark.kind == "car" else ":")
    axes.set_aspect("equal")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.05), ncols=4, markerscale=6)
    axes.set_xlabel("metres")
    figure.savefig(path, dpi=60, bbox_inches="tight")


def header(*columns):
    print(f"\n| {' | '.join(columns)} |\n|{'---|' * len(columns)}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("cars"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    prices = ("OA before", "OA after", "mIoU before", "mIoU after")
    taught = {name: with_cars(without(name, given.data), name, given.data) for name in (HOUSING, AHN3)}
    rated = [Rated.by(model, name, given.data) for name, model in taught.items()]
    header("scan", "car points found, %", "cars more than half found", "precision, %", *prices)
    for scan in rated:
        scan.print_found()
    picture(rated[0], given.out / "housing.png")
    header("scan", "points named car", "of them labelled 2 to 6", *prices)
    for name in OTHERS:
        Rated.by(scansion.PointClassifier.default(), name, given.data).print_price()


if __name__ == "__main__":
    main()
