"""Training clouds of the classifier of cars in the built-in model: marked and made-up cars, and made-up bushes.

    python scripts/car_clouds.py DATA FOLDER        # needs: pip install numpy laspy lazrs

DATA/airborne holds the scans. Writes three copies of two of them to FOLDER, in which cars have the code 30; same inputs,
same bytes. Real cars are those of `car_boxes.txt`, which were marked by hand; `made_up_cars.py` adds others, and bushes.
Other points of class 1 of the housing estate are not learned from.

Two of the copies are bare: without buildings, and without what is high. A classifier that has only seen cars near houses
finds none in open country.
"""

import argparse
import pathlib
from dataclasses import dataclass

import laspy
import numpy as np
from made_up_cars import Bush, Car, Scene, put

SCRIPTS = pathlib.Path(__file__).resolve().parent
#: Code of cars while the car model is trained; point formats 0 to 5 of LAS hold codes up to 31.
CAR = 30
#: What unsure points are in the result of `marked`.
UNSURE = -1
HOUSING, AHN3 = "lidarhd_housing.laz", "ahn3_delft_west.laz"


#: Points of bare copies are lower than this over the lowest ground in squares of such an edge, metres.
BARE, SQUARE = 3.0, 6.0


@dataclass(frozen=True)
class MadeUp:
    """What is put on a copy of a scan: seed, cars and bushes, fewer if not all find a place; whether it is a bare copy."""

    seed: int
    cars: int
    bushes: int
    bare: bool = False


MADE_UP = {
    HOUSING: [MadeUp(2, 200, 150), MadeUp(2, 200, 150, bare=True), MadeUp(12, 200, 200, bare=True)],
    AHN3: [MadeUp(1, 300, 250), MadeUp(1, 300, 250, bare=True), MadeUp(11, 300, 300, bare=True)],
}


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
    sections = (SCRIPTS / "car_boxes.txt").read_text().split("\n[")[1:]
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


def low(xyz, codes):
    """Which points are neither building nor high over the ground."""
    square = np.floor((xyz[:, :2] - xyz[:, :2].min(0)) / SQUARE).astype(np.int64)
    key = square[:, 0] * (square[:, 1].max() + 1) + square[:, 1]
    ground = np.full(key.max() + 1, np.inf)
    np.minimum.at(ground, key[codes == 2], xyz[codes == 2, 2])
    # Where no ground is known nothing is low.
    ground[np.isinf(ground)] = -np.inf
    return (codes != 6) & (xyz[:, 2] - ground[key] < BARE)


def training_cloud(las, name, made_up):
    """The copy of a scan with marked cars, made-up cars and bushes; prints how many there are."""
    xyz, codes = np.column_stack([las.x, las.y, las.z]), np.asarray(las.classification).astype(int)
    open_ground = (codes == 2) & (np.asarray(las.number_of_returns) == 1)
    scene = Scene(xyz, open_ground, np.asarray(las.point_source_id))
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
    las.points = las.points[~cars.removed & (low(xyz, codes) | (not made_up.bare))]
    numbers = (cars.objects, cars.on_object.sum(), bushes.objects, bushes.on_object.sum(), (real > 0).sum(), len(las.points))
    print(f"| {name} | " + " | ".join(f"{number:,}" for number in numbers) + " |", flush=True)
    return las


def training_clouds(data, name, folder):
    """Writes the copies of a scan; their paths."""
    for number, made_up in enumerate(MADE_UP[name], 1):
        path = folder / f"{pathlib.PurePath(name).stem}_{number}.laz"
        training_cloud(laspy.read(data / "airborne" / name), name, made_up).write(path)
        yield path


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    print("| training cloud | made-up cars | points | made-up bushes | points | points of marked cars | all points |")
    print("|---|---|---|---|---|---|---|")
    for name in MADE_UP:
        list(training_clouds(given.data, name, given.folder))


if __name__ == "__main__":
    main()
