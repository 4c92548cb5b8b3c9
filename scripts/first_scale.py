"""The finest scale of the recipe `pyramid` on three kinds of scenes; writes the table of docs/pyramid.md.

    python scripts/first_scale.py DATA        # needs: pip install .

Each model learns from some clouds and classifies others; the office is halved in plan. `none` is the point spacing.
Scores in percent over all test points of a scene, without regularisation.
"""

import pathlib
import sys

import numpy as np
import scansion

DATA = pathlib.Path(sys.argv[1])
SCALES = (None, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8)


def clouds(names, column="Classification", merged=()):
    """Coordinates and labels of files; -1 where there is no label, or one that is not to be learned."""
    found = []
    for name in names:
        cloud = scansion.read(DATA / name)
        code = np.asarray(cloud[column]).astype(np.int16)
        if merged:
            code = np.where(np.isin(code, (3, 4)), 5, code)
            code = np.where(np.isin(code, (2, 5, 6)), code, -1)
        elif column == "Classification":
            code = np.where(code > 0, code, -1)
        found.append((cloud.xyz, code))
    return found


def office():
    """Two halves of a room."""
    xyz, code = clouds(["indoor/s3dis_office.ply"], "label")[0]
    axis = int(np.ptp(xyz[:, :2], axis=0).argmax())
    left = xyz[:, axis] < np.median(xyz[:, axis])
    return [(xyz[left], code[left])], [(xyz[~left], code[~left])]


def scenes():
    street = [[f"oakland/part_{part}.laz" for part in parts] for parts in
              (("01", "02", "03", "05", "07", "08", "10"), ("06", "11", "13", "14", "15", "17"))]
    airborne = [[f"airborne/{name}.laz" for name in names] for names in
                (("lidarhd_housing", "ahn3_delft_west"), ("lidarhd_building", "lidarhd_forest_edge", "lidarhd_farm_rgb"))]
    yield "streets", *map(clouds, street)
    yield "airborne", *(clouds(names, merged=True) for names in airborne)
    yield "office", *office()


def scores(train, test, scale):
    recipe = {"features.pyramid.first_scale": scale, "regularise.method": "none"}
    model = scansion.PointClassifier(recipe).fit([xyz for xyz, _ in train], [code for _, code in train])
    own = next(line for line in model.recipe_.splitlines() if line.startswith("first_scale"))
    found = np.concatenate([model.predict(xyz) for xyz, _ in test]).astype(int)
    truth = np.concatenate([code for _, code in test])
    found, truth = found[truth >= 0], truth[truth >= 0]
    ious = [((truth == c) & (found == c)).sum() / ((truth == c) | (found == c)).sum() for c in np.unique(truth)]
    return own.split(" = ")[1], 100 * (truth == found).mean(), 100 * np.mean(ious)


def main():
    for name, train, test in scenes():
        for scale in SCALES:
            own, accuracy, iou = scores(train, test, scale)
            print(f"| {name} | {'spacing' if scale is None else scale} | {own} | {accuracy:.1f} | {iou:.1f} |", flush=True)


if __name__ == "__main__":
    main()
