"""Accuracy of the built-in model on scenes that it was not trained on; writes docs/default-model.md.

    python scripts/default_model_accuracy.py DATA [--quick]        # needs: pip install '.[las]' lazrs

DATA/airborne holds the scenes named below, except for the scan of the demo, which is in the repository. Scenes of the
training are rated by models trained on the other scenes. --quick leaves out thinned and otherwise changed copies.
"""

import dataclasses
import pathlib
import sys
import tempfile

import numpy as np
import scansion
from car_clouds import CAR, MADE_UP, training_clouds

HERE = pathlib.Path(__file__).resolve().parent.parent
RECIPE = HERE / "crates/core/assets/default.toml"
#: Files that the built-in model is trained on; the class 1 of AHN3 is vegetation.
TRAINING = ["lidarhd_housing.laz", "ahn3_delft_west.laz", "lidarhd_sparse_1km.laz", "lidarhd_rural_sparse_1km.laz"]
TITLES = {
    "demo.laz": "Housing, square of the demo (same flight as training)",
    "lidarhd_building.laz": "House in the mountains",
    "lidarhd_forest_edge.laz": "Forest edge",
    "lidarhd_farm_rgb.laz": "Farm (machine labels)",
    "lidarhd_fields_rgbnir_extra_bytes.laz": "Fields (machine labels)",
    "powerline_corridor.laz": "Power line corridor (machine labels)",
    "b9_partial_labels_rgb.ply": "Small town (a ninth of the points labelled)",
    "lidarhd_housing.laz": "Housing estate, left out of training",
    "ahn3_delft_west.laz": "AHN3 Delft, left out of training",
    "lidarhd_sparse_1km.laz": "Square kilometre, left out of training",
    "lidarhd_rural_sparse_1km.laz": "Rural square kilometre, left out of training",
}
RETURNS = ["ReturnNumber", "NumberOfReturns"]
#: Codes of the labels 0, 1 and 2 of the PLY file; -1 is no label.
PLY_CODES = {-1: 0, 0: 2, 1: 5, 2: 6}


def read(path):
    """The scan, with its labels as Classification and its return numbers."""
    if path.suffix != ".ply":
        return scansion.read(path, columns=["Classification", *RETURNS])
    cloud = scansion.read(path, columns=["label"])
    cloud["Classification"] = np.vectorize(PLY_CODES.get)(cloud["label"]).astype(np.uint8)
    return cloud


def truth(name, codes):
    """Codes 2, 5 and 6; others -1."""
    codes = np.asarray(codes).astype(int)
    if name.startswith("ahn3"):
        codes = np.where(codes == 1, 5, codes)
    codes = np.where(np.isin(codes, (3, 4)), 5, codes)
    return np.where(np.isin(codes, (2, 5, 6)), codes, -1)


FOOT = 0.3048


@dataclasses.dataclass
class Copy:
    """A changed copy of a scene."""

    name: str
    keep: np.ndarray
    """Which points it has."""
    xyz: np.ndarray
    """Coordinates of all points of the scene."""
    returns: bool = True
    """Whether it has return numbers."""
    unit: float = 1.0
    """Metres per unit of the coordinates."""

    def codes(self, model, cloud):
        """What the model makes of it."""
        columns = {n: np.asarray(cloud[n])[self.keep] for n in RETURNS if self.returns and n in cloud}
        copy = scansion.PointCloud(self.xyz[self.keep], **columns)
        return np.asarray(model.classify(copy, metres_per_unit=self.unit, abstain=0.0).codes)


def density(xyz):
    return len(xyz) / (4 * len(np.unique(np.floor(xyz[:, :2] / 2).astype("i8"), axis=0)))


def changed(cloud):
    """Thinned and otherwise changed copies."""
    xyz = np.asarray(cloud.xyz)
    every = np.ones(len(xyz), bool)
    here = density(xyz)
    for target in (20, 10, 4, 1):
        if target < here:
            keep = np.random.default_rng(0).random(len(xyz)) < target / here
            yield Copy(f"{target} points/m²", keep, xyz)
            if target == 4:
                yield Copy("4 points/m², without returns", keep, xyz, returns=False)
    yield Copy("without returns", every, xyz, returns=False)
    heights = scansion.terrain.height_above_ground(cloud)
    yield Copy("heights above ground", np.isfinite(heights), np.column_stack([xyz[:, :2], heights]))
    middle = xyz.mean(0)
    turn = np.array([[np.cos(0.6), -np.sin(0.6)], [np.sin(0.6), np.cos(0.6)]])
    yield Copy("turned by 34°", every, np.column_stack([(xyz[:, :2] - middle[:2]) @ turn.T, xyz[:, 2]]))
    yield Copy("50 m in the middle", (np.abs(xyz[:, :2] - middle[:2]) < 25).all(1), xyz)
    yield Copy("in feet", every, xyz / FOOT, unit=FOOT)
    yield Copy("in feet, heights upside down", every, xyz * [1, 1, -1] / FOOT, unit=FOOT)


def scored(found, codes):
    """Overall accuracy, mean IoU, IoU of the three classes, share named building, percent."""
    found = np.where(np.isin(found, (3, 4)), 5, found)
    known = codes >= 0
    present = [c for c in (2, 5, 6) if (codes == c).any()]
    iou = {}
    for c in present:
        a, b = codes[known] == c, found[known] == c
        iou[c] = 100 * (a & b).sum() / (a | b).sum()
    values = [100 * (codes[known] == found[known]).mean(), np.mean(list(iou.values()))]
    values += [iou.get(c, np.nan) for c in (2, 5, 6)] + [100 * (found == 6).mean()]
    return values


#: What other codes mean in these scenes.
OTHERS = {1: "unclassified: cars, furniture, walls", 9: "water", 17: "bridge", 26: "civil structure", 67: "other building"}


def others(title, codes, found):
    """Lines: what becomes of each other code that has 100 points or more; percent."""
    groups = ((2,), (3, 4, 5), (6,), (1,), (7, 14, 18))
    for code, meaning in OTHERS.items():
        mine = found[codes == code]
        if len(mine) >= 100:
            shares = " | ".join(f"{100 * np.isin(mine, group).mean():.0f}" for group in groups)
            text = f"| {title} | {meaning} | {len(mine):,} | {shares} |"
            print(text, flush=True)
            yield text


def line(name, values):
    cells = ["-" if np.isnan(v) else f"{v:.1f}" for v in values[:5]] + [f"{values[5]:.2f}"]
    text = f"| {name} | " + " | ".join(cells) + " |"
    print(text, flush=True)
    return text


def without(left_out, data):
    """A model of the same recipe, trained on the other scenes."""
    names = [n for n in TRAINING if n != left_out]
    clouds = [read(data / "airborne" / n) for n in names]
    labels = [truth(n, c["Classification"]) for n, c in zip(names, clouds)]
    return scansion.PointClassifier(RECIPE).fit(clouds, labels)


def with_cars(model, left_out, data):
    """The model, which also learns cars, from the other scenes."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [data / "airborne" / name for name in TRAINING if name not in (left_out, *MADE_UP)]
        for name in MADE_UP:
            if name != left_out:
                paths += training_clouds(data, name, pathlib.Path(folder))
        return model.add_cars(paths, code=CAR)


def main():
    data, quick = pathlib.Path(sys.argv[1]), "--quick" in sys.argv
    builtin = scansion.PointClassifier.default()
    scenes, copies, unknown = [], [], []
    for name, title in TITLES.items():
        path = HERE / "crates/cli/assets/demo.laz" if name == "demo.laz" else data / "airborne" / name
        cloud = read(path)
        codes = truth(name, cloud["Classification"])
        model = with_cars(without(name, data), name, data) if name in TRAINING else builtin
        found = np.asarray(model.classify(cloud, abstain=0.0).codes)
        scenes.append(line(f"{title} | {density(np.asarray(cloud.xyz)):.1f}", scored(found, codes)))
        # Of AHN3 the code 1 is vegetation, of the farm a third of the roofs.
        given = np.asarray(cloud["Classification"])
        rest = np.where((given == 1) & name.startswith(("ahn3", "lidarhd_farm")), 0, given)
        unknown.extend(others(title, rest, found))
        for copy in [] if quick else changed(cloud):
            values = scored(copy.codes(model, cloud), codes[copy.keep])
            copies.append(line(f"{title} | {copy.name}", values))
    page = (HERE / "docs/default-model.md").read_text()
    for mark, rows in (("scenes", scenes), ("copies", copies), ("others", unknown)):
        if rows:
            head, rest = page.split(f"<!-- {mark} -->\n")
            table, tail = rest.split("\n\n", 1)
            page = f"{head}<!-- {mark} -->\n" + "\n".join(table.split("\n")[:2] + rows) + "\n\n" + tail
    (HERE / "docs/default-model.md").write_text(page)


if __name__ == "__main__":
    main()
