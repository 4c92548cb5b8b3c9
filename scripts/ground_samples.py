"""What the built-in model makes of the ISPRS filter test samples, which it has not learned from; for docs/default-model.md.

    python scripts/ground_samples.py DATA        # needs: pip install .

DATA/ground holds the samples (.npz with xyz and classification: 2 ground, 1 object). Prints, in percent, the classes of the
ground points, the object points that become ground, and the points that are wrong as ground or object, beside those of the
ground filter alone. Same inputs, same figures.
"""

import argparse
import pathlib
import warnings

import numpy as np
import scansion

#: Classes of a column, by their codes.
GROUPS = {"ground": (2,), "vegetation": (3, 4, 5), "building": (6,), "others": (1, 7, 14, 18)}


def line(sample, xyz, is_ground, codes):
    """A line of the table."""
    found = codes == 2
    area = np.prod(np.ptp(xyz[:, :2], axis=0))
    shares = [np.isin(codes[is_ground], group).mean() for group in GROUPS.values()]
    wrong = [(scansion.terrain.ground_points(xyz) != is_ground).mean(), (found != is_ground).mean()]
    cells = " | ".join(f"{100 * share:.1f}" for share in [*shares, found[~is_ground].mean(), *wrong])
    return f"| {sample} | {len(xyz) / area:.1f} | {cells} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    given = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    model = scansion.PointClassifier.default()
    names = [*(f"ground as {name}" for name in GROUPS), "objects as ground", "wrong, filter", "wrong, model"]
    print(f"| sample | points/m² | {' | '.join(names)} |\n{'|---' * (len(names) + 2)}|")
    for path in sorted((given.data / "ground").glob("*.npz")):
        sample = np.load(path)
        xyz, codes = sample["xyz"].astype(float), np.asarray(sample["classification"])
        cloud, name = scansion.PointCloud(xyz[codes > 0]), path.stem.rpartition("samp")[2]
        print(line(name, np.asarray(cloud.xyz), codes[codes > 0] == 2, np.asarray(model.classify(cloud).codes)), flush=True)


if __name__ == "__main__":
    main()
