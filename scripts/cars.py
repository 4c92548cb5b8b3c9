"""Cars as class 1 in airborne scans: a second model beside the built-in one, and a rule on what it finds.

    python scripts/cars.py DATA PROGRAM [--out FOLDER]        # needs: pip install '.[las,viz]' lazrs

DATA/airborne holds the scans, PROGRAM is the scansion program. The car model has the recipe and the scans of the
built-in model, and a fourth class. It learns from the cars of `car_boxes.txt`, which were marked by hand, and from
those of `made_up_cars.py`; of the housing estate, other points of class 1 are not learned from. Where the built-in
model says vegetation or building, the car model says car, and the rule (`like_cars`) agrees, the point becomes class 1.

Prints tables: cars found in a scan that both models did not learn from, and what other scans lose. FOLDER (default:
cars) gets the training clouds, the models and a picture of the housing estate. Same inputs, same figures.
"""

import argparse
import pathlib
import subprocess
from dataclasses import dataclass

import laspy
import numpy as np
import scansion
from default_model_accuracy import HERE, RECIPE, RETURNS, TITLES, TRAINING, density, scored, truth, without
from made_up_cars import Bush, Car, Scene, put

#: Code of cars while the car model is trained; point formats 0 to 5 of LAS hold codes up to 31.
CAR = 30
#: What unsure points are in the result of `marked`.
UNSURE = -1
HOUSING, AHN3 = TRAINING[:2]
#: Scans that neither model learned from.
OTHERS = [
    "lidarhd_building.laz",
    "lidarhd_forest_edge.laz",
    "lidarhd_farm_rgb.laz",
    "lidarhd_fields_rgbnir_extra_bytes.laz",
]


@dataclass(frozen=True)
class MadeUp:
    """What is put on a training cloud: seed, cars and bushes; fewer if not all find a place."""

    seed: int
    cars: int
    bushes: int


MADE_UP = {HOUSING: MadeUp(2, 200, 150), AHN3: MadeUp(1, 300, 250)}


@dataclass(frozen=True)
class Mark:
    """A rectangle around a car, or around something that may be one; `kind` is car or unsure. Metres and radians."""

    kind: str
    x: float
    y: float
    heading: float
    length: float
    width: float

    def inside(self, xy, margin=0.0):
        offsets = xy - (self.x, self.y)
        along = offsets @ (np.cos(self.heading), np.sin(self.heading))
        across = offsets @ (-np.sin(self.heading), np.cos(self.heading))
        return (np.abs(along) < self.length / 2 + margin) & (np.abs(across) < self.width / 2 + margin)

    def points(self, xyz, codes, margin=0.0):
        """Points in it that are 0.25 to 2.8 m above the ground around, and are not labelled ground or building."""
        around = np.flatnonzero(self.inside(xyz[:, :2], 2.5))
        ground = xyz[around[codes[around] == 2], 2]
        if len(ground) == 0:
            return around[:0]
        heights = xyz[around, 2] - np.median(ground)
        chosen = self.inside(xyz[around, :2], margin) & (heights > 0.25) & (heights < 2.8)
        return around[chosen & ~np.isin(codes[around], (2, 6))]


def marks(name):
    """The marks of a scan."""
    sections = (HERE / "scripts/car_boxes.txt").read_text().split("\n[")[1:]
    lines = next(section.splitlines()[1:] for section in sections if section.startswith(f"{name}]"))
    return [Mark(kind, *map(float, numbers)) for kind, *numbers in map(str.split, lines)]


def marked(xyz, codes, name):
    """Number of the marked car of each point, from 1; UNSURE in and around marks where it may be one; else 0."""
    cars = [mark for mark in marks(name) if mark.kind == "car"]
    result = np.zeros(len(xyz), int)
    for mark in marks(name):
        result[mark.points(xyz, codes, 0.5 if mark.kind == "car" else 0.3)] = UNSURE
    for number, mark in enumerate(cars, 1):
        result[mark.points(xyz, codes)] = number
    return result


def training_cloud(data, name, folder):
    """Writes a scan with marked cars, made-up cars and bushes; prints how many there are."""
    las = laspy.read(data / "airborne" / name)
    xyz, codes = np.column_stack([las.x, las.y, las.z]), np.asarray(las.classification).astype(int)
    open_ground = (codes == 2) & (np.asarray(las.number_of_returns) == 1)
    scene, made_up = Scene(xyz, open_ground, np.asarray(las.point_source_id)), MADE_UP[name]
    rng = np.random.default_rng(made_up.seed)
    cars = put(Car, made_up.cars, scene, rng)
    bushes = put(Bush, made_up.bushes, cars.scene(scene), rng)
    real = marked(xyz, codes, name)
    # Of AHN3 the code 1 is vegetation. Code 0 is not learned from.
    labels = np.where(codes == 1, 5 if name == AHN3 else 0, codes)
    labels[real == UNSURE], labels[real > 0] = 0, CAR
    labels[bushes.on_object], labels[cars.on_object] = 5, CAR
    las.x, las.y, las.z = bushes.xyz.T
    las.classification = labels.astype(np.uint8)
    las.points = las.points[~cars.removed]
    las.write(folder / name)
    numbers = (cars.objects, cars.on_object.sum(), bushes.objects, bushes.on_object.sum(), (real > 0).sum())
    print(f"| {name} | " + " | ".join(f"{number:,}" for number in numbers) + " |", flush=True)


@dataclass(frozen=True)
class Paths:
    """Where things are: the data, the program, and what this script writes."""

    data: pathlib.Path
    program: str
    out: pathlib.Path

    def car_model(self, left_out=None):
        """A car model, trained on the scans except for one."""
        output = self.out / f"without_{left_out.removesuffix('.laz')}.model" if left_out else self.out / "cars.model"
        folders = {name: self.out if name in MADE_UP else self.data / "airborne" for name in TRAINING}
        clouds = [folder / name for name, folder in folders.items() if name != left_out]
        options = ["--map", "3-4=5", "--classes", f"2,5,6,{CAR}", "--output", output, "--overwrite", "--quiet"]
        command = [self.program, "train", *clouds, "--recipe", RECIPE, *options]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return scansion.PointClassifier.load(output)


@dataclass(frozen=True)
class Limits:
    """What a connected component of car points must be like; a component may be several cars side by side.

    Lengths in metres; heights are above the ground. The limits were chosen on the housing estate, AHN3, the house in
    the mountains and the farm.
    """

    #: At least this many points.
    points: int = 12
    #: At least this probability of a car, mean of the points.
    probability: float = 0.85
    #: Sides of the smallest rectangle around the points, at least. Cars are 3.5 to 5 m by 1.7 m; of those beside a wall
    #: or under a tree only a part is seen.
    length: float = 2.0
    width: float = 1.0
    #: Area of the cells, square metres: from a part of a car to almost twenty cars side by side.
    area: tuple = (2.5, 200.0)
    #: The 95th percentile of the heights. Low cars have 1.4 m, but the roof may lack points; high vans have 2.8 m.
    top: tuple = (1.1, 2.9)
    #: Median of the heights, at least: less is a flower bed or a kerb.
    middle: float = 0.5
    #: Of the cells around it, at least this share holds points named ground,
    ground_around: float = 0.4
    #: and at most this share other points higher than 0.3 m: cars stand free, hedges and bushes next to others.
    things_around: float = 0.35


@dataclass(frozen=True)
class Found:
    """Of each point: the car model's code and probability of a car, and the height above filtered ground, metres."""

    xyz: np.ndarray
    codes: np.ndarray
    probability: np.ndarray
    height: np.ndarray

    @staticmethod
    def by(model, cloud):
        result = model.classify(cloud, abstain=0.0, probabilities=True)
        probability = np.asarray(result.probabilities)[:, list(model.codes_).index(CAR)]
        height = scansion.terrain.height_above_ground(cloud, ground="filter", noise=())
        return Found(np.asarray(cloud.xyz), np.asarray(result.codes), probability, np.asarray(height))


def like_cars(found, limits=None):
    """The rule: points that the model calls car, in connected components of cells that are like cars.

    Cells have 0.5 m, or 1.5 distances between points where the scan is sparse; the 8 cells around are neighbours.
    """
    limits = limits or Limits()
    cell = max(0.5, 1.5 / np.sqrt(density(found.xyz)))
    cells = np.floor(found.xyz[:, :2] / cell).astype(np.int64)
    car = found.codes == CAR
    ground = occupied(cells[found.codes == 2])
    things = occupied(cells[(found.height > 0.3) & ~car])
    of_cell = {}
    for point, place in zip(np.flatnonzero(car), map(tuple, cells[car].tolist())):
        of_cell.setdefault(place, []).append(point)
    result = np.zeros(len(cells), bool)
    for component in components(of_cell):
        points = np.concatenate([of_cell[place] for place in sorted(component)])
        border = {beside for place in component for beside in neighbours(place)} - component
        free = (
            len(border & ground) >= limits.ground_around * len(border)
            and len(border & things) <= limits.things_around * len(border)
            and limits.area[0] <= len(component) * cell**2 <= limits.area[1]
        )
        result[points] = free and of_size(found, points, limits)
    return result


def of_size(found, points, limits):
    """Whether these points are enough, certain enough, and as high, long and wide as cars."""
    if len(points) < limits.points or found.probability[points].mean() < limits.probability:
        return False
    heights = found.height[points]
    if not limits.top[0] <= np.percentile(heights, 95) <= limits.top[1] or np.median(heights) < limits.middle:
        return False
    length, width = smallest_rectangle(found.xyz[points, :2])
    return length >= limits.length and width >= limits.width


def smallest_rectangle(xy):
    """Length and width of the smallest rectangle in 36 directions, 2 % of the points cut off at each end."""
    xy = xy - xy.mean(0)
    sides = []
    for angle in np.radians(np.arange(0, 90, 2.5)):
        axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        sides.append(np.subtract(*np.percentile(xy @ axes, (98, 2), axis=0)))
    best = min(sides, key=np.prod)
    return best.max(), best.min()


def occupied(cells):
    return set(map(tuple, np.unique(cells, axis=0).tolist()))


def neighbours(cell):
    return [(cell[0] + x, cell[1] + y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]


def components(cells):
    """Sets of connected cells."""
    left = dict.fromkeys(cells)
    while left:
        component, edge = set(), [left.popitem()[0]]
        while edge:
            cell = edge.pop()
            component.add(cell)
            beside = [place for place in neighbours(cell) if place in left]
            edge += beside
            for place in beside:
                del left[place]
        yield component


@dataclass(frozen=True)
class Rated:
    """A scan and what the two models make of it.

    Given codes, those of the model without cars, whether a point becomes class 1, and what the car model found.
    """

    name: str
    xyz: np.ndarray
    given: np.ndarray
    before: np.ndarray
    car: np.ndarray
    found: Found

    @staticmethod
    def by(model, cars, name, data):
        cloud = scansion.read(data / "airborne" / name, columns=["Classification", *RETURNS])
        before = np.asarray(model.classify(cloud, abstain=0.0).codes)
        found = Found.by(cars, cloud)
        given = np.asarray(cloud["Classification"]).astype(int)
        return Rated(name, found.xyz, given, before, like_cars(found) & np.isin(before, (3, 4, 5, 6)), found)

    def prices(self):
        """Overall accuracy before and after, mean IoU before and after; percent, cells of a table."""
        codes = truth(self.name, self.given)
        before, after = scored(self.before, codes), scored(np.where(self.car, 1, self.before), codes)
        return " | ".join(f"{value:.2f}" for value in (before[0], after[0], before[1], after[1]))

    def print_found(self):
        """Marked cars that are found; those of more than half their points only if they have more than 5."""
        cars = marked(self.xyz, self.given, self.name)
        shares = [self.car[cars == number].mean() for number in np.unique(cars[cars > 0]) if (cars == number).sum() > 5]
        recall = [100 * share[cars > 0].mean() for share in (self.found.codes == CAR, self.car)]
        precision = 100 * (cars[self.car & (cars != UNSURE)] > 0).mean()
        half = f"{sum(share > 0.5 for share in shares)} of {len(shares)}"
        numbers = f"{recall[0]:.1f} | {recall[1]:.1f} | {half} | {precision:.1f}"
        print(f"| {TITLES[self.name]} | {numbers} | {self.prices()} |", flush=True)

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
    low = np.flatnonzero((rated.found.height > 0.3) & (rated.found.height < 3))
    axes.scatter(*xy[low].T, c=rated.found.height[low], cmap="gray_r", vmin=0, vmax=3, s=0.5)
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
    parser.add_argument("program")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("cars"))
    given = parser.parse_args()
    paths = Paths(given.data, given.program, given.out)
    paths.out.mkdir(parents=True, exist_ok=True)
    header("training cloud", "made-up cars", "points", "made-up bushes", "points", "points of marked cars")
    for name in MADE_UP:
        training_cloud(paths.data, name, paths.out)
    prices = ("OA before", "OA after", "mIoU before", "mIoU after")
    header("scan", "recall before the rule", "recall", "cars more than half found", "precision", *prices)
    for name in (HOUSING, AHN3):
        rated = Rated.by(without(name, paths.data), paths.car_model(name), name, paths.data)
        rated.print_found()
        if name == HOUSING:
            picture(rated, paths.out / "housing.png")
    header("scan", "points named car", "of them labelled 2 to 6", *prices)
    builtin, cars = scansion.PointClassifier.default(), paths.car_model()
    for name in OTHERS:
        Rated.by(builtin, cars, name, paths.data).print_price()


if __name__ == "__main__":
    main()
