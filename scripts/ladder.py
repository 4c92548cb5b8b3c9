"""What each family of features and each step after the classifier adds; writes the table of the README.

    python scripts/ladder.py DATA [PROGRAM]        # needs: pip install . ; PROGRAM is the command line, default scansion
    python scripts/ladder.py DATA PROGRAM fewer    # the spheres with fewer radii beside the pyramid, for docs/spheres.md

Each row adds one step to the one above, with the spheres in place of the pyramid; the last row has the recipes in two stages
with all their defaults, and what makes neighbours agree chosen by training. Streets: Oakland parts 06, 11, 13, 14, 15
and 17 from seven others. Airborne: three scenes of LiDAR HD from a housing estate and AHN3. Scores count the points of all test
scenes together; seconds are those of the processor for classifying them on one thread, memory is the largest of them.
"""

import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import scansion

DATA = pathlib.Path(sys.argv[1])
PROGRAM = sys.argv[2] if len(sys.argv) > 2 else "scansion"
STREETS = {
    "train": [DATA / f"oakland/part_{part}.laz" for part in ("01", "02", "03", "05", "07", "08", "10")],
    "test": [DATA / f"oakland/part_{part}.laz" for part in ("06", "11", "13", "14", "15", "17")],
    "labels": [],
    "training": ["training.voxel=0.1"],
    "pyramid": ["features.pyramid.first_scale=0.1", "features.pyramid.levels=7"],
    "spheres": ["spheres.first_radius=0.25", "spheres.scales=6"],
    "two stages": "mobile",
}
AIRBORNE = {
    "train": [DATA / f"airborne/{name}.laz" for name in ("lidarhd_housing", "ahn3_delft_west")],
    "test": [DATA / f"airborne/lidarhd_{name}.laz" for name in ("building", "forest_edge", "farm_rgb")],
    "labels": ["--map", "3-4=5", "--map-of", "ahn3_delft_west.laz:1=5", "--classes", "2,5,6"],
    "training": ["training.voxel=0.25", "training.per_copy=4000", "training.densities=[10.0, 4.0, 1.0]"],
    "pyramid": ["features.pyramid.first_scale=0.25", "features.pyramid.levels=4"],
    "spheres": ["spheres.first_radius=0.5", "spheres.scales=6"],
    "two stages": "airborne",
}
# The numbers of levels and radii are the best of 2 to 8 (`fewer`).
SCENES = [STREETS, AIRBORNE]
#: Name, settings that are added, and the regularisation.
STEPS = [
    ("spheres instead of the pyramid", [], "none"),
    ("+ height above the ground", ["groups.height=true"], "none"),
    ("+ clusters", ["groups.clusters=true"], "none"),
    ("+ boosted trees", ["classifier=gbt"], "none"),
    ("+ the most probable class of each segment", [], "consensus"),
    ("+ random field on the segments", [], "segment-crf"),
]

FEWER = (2, 3, 4, 5, 6, 7, 8)
"""Numbers of levels, and of radii."""


# Starts the program and prints what it took. The memory of a process counts from that of the one that starts it: a small one.
MEASURED = """
import os, sys
process = os.posix_spawnp(sys.argv[1], sys.argv[1:], os.environ, file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)])
_, status, usage = os.wait4(process, 0)
print(usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)
sys.exit(status != 0)
"""


def run(*arguments):
    """Runs the program; processor seconds and the most memory in MB."""
    command = [sys.executable, "-S", "-c", MEASURED, PROGRAM, *map(str, arguments), "-q", "--overwrite"]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit(f"{arguments}: failed")
    return tuple(map(float, done.stdout.split()))


def train(scene, recipe, settings, model):
    sets = [word for setting in settings for word in ("--set", setting)]
    run("train", *scene["train"], "-o", model, "--recipe", recipe, *scene["labels"], *sets)


def scores(scene, model, method, folder):
    """Overall accuracy, mean F1 and mean IoU in percent, seconds and MB. Without a method that of the model."""
    regularize = [] if method is None else ["--regularize", method]
    seconds, most, truth, found = 0.0, 0.0, [], []
    for cloud in scene["test"]:
        output = folder / "classified.laz"
        output.unlink(missing_ok=True)
        used, memory = run("classify", cloud, "-m", model, "-o", output, *regularize, "-j1")
        seconds, most = seconds + used, max(most, memory)
        codes = np.asarray(scansion.read(cloud)["Classification"])
        own = np.where(np.isin(codes, (3, 4)), 5, codes) if scene["labels"] else codes
        counted = np.isin(own, (2, 5, 6)) if scene["labels"] else own > 1
        truth.append(own[counted])
        named = np.asarray(scansion.read(output)["Classification"])
        # The recipe `airborne` divides vegetation by its height.
        named = np.where(np.isin(named, (3, 4)), 5, named) if scene["labels"] else named
        found.append(named[counted])
    truth, found = np.concatenate(truth), np.concatenate(found)
    classes = np.unique(truth)
    right = np.array([((truth == c) & (found == c)).sum() for c in classes])
    either = np.array([((truth == c) | (found == c)).sum() for c in classes])
    both = np.array([(truth == c).sum() + (found == c).sum() for c in classes])
    means = 100 * np.array([(truth == found).mean(), (2 * right / both).mean(), (right / either).mean()])
    return [*means, seconds, most]


def row(name, values):
    """A row of the table: scores and costs of each scene."""
    cells = [cell for v in values for cell in (f"{v[0]:.1f}", f"{v[1]:.1f}", f"{v[2]:.1f}", f"{v[3]:.0f}", f"{v[4]:.0f}")]
    print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


def fewer():
    """The pyramid and the spheres of ever more scales: with how few they are as good, and what that costs."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for recipe, key, what in (
            ("pyramid", "features.pyramid.levels", "levels"),
            ("spheres", "spheres.scales", "radii"),
        ):
            for scales in FEWER:
                row(f"{recipe}, {scales} {what}", [with_scales(scene, recipe, f"{key}={scales}", folder) for scene in SCENES])


def with_scales(scene, recipe, setting, folder):
    """Scores of a recipe whose settings for this scene are changed by one."""
    model = folder / "any.model"
    train(scene, recipe, [*scene["training"], *scene[recipe], "regularise.method=none", setting], model)
    return scores(scene, model, "none", folder)


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        models = [folder / "streets.model", folder / "airborne.model"]
        for scene, model in zip(SCENES, models):
            train(scene, "pyramid", [*scene["training"], *scene["pyramid"], "regularise.method=none"], model)
        row("pyramid", [scores(scene, model, "none", folder) for scene, model in zip(SCENES, models)])
        settings = []
        for name, added, method in STEPS:
            settings += added
            if added or not settings:
                for scene, model in zip(SCENES, models):
                    train(scene, "spheres", [*scene["training"], *scene["spheres"], *settings], model)
            row(name, [scores(scene, model, method, folder) for scene, model in zip(SCENES, models)])
        two_stages(models, folder)


def two_stages(models, folder):
    """The row of the recipes with two stages."""
    for scene, model in zip(SCENES, models):
        train(scene, scene["two stages"], [], model)
    row("two stages: `mobile`, `airborne`", [scores(scene, model, None, folder) for scene, model in zip(SCENES, models)])


if __name__ == "__main__":
    fewer() if sys.argv[3:] == ["fewer"] else main()
