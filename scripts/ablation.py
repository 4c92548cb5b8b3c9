"""What each step of the recipe airborne gains and costs; writes the table of docs/airborne.md.

    python scripts/ablation.py DATA [PROGRAM]        # needs: pip install . ; PROGRAM is the command line, default scansion

Each row adds one step to the one above. Models are trained on the clouds of the built-in model; no scene of the table is
one of them (the square of the demo is cut out of one). Time and memory are those of `classify` on one thread for DATA's
Autzen cut to 433 m x 597 m, which is in feet: 1.83 million points.
"""

import pathlib
import resource
import subprocess
import sys
import tempfile

import numpy as np
import scansion

HERE = pathlib.Path(__file__).resolve().parent.parent
DATA = pathlib.Path(sys.argv[1])
PROGRAM = sys.argv[2] if len(sys.argv) > 2 else "scansion"
SCENES = {
    "demo": HERE / "crates/cli/assets/demo.laz",
    "forest edge": DATA / "airborne/lidarhd_forest_edge.laz",
    "mountain house": DATA / "airborne/lidarhd_building.laz",
    "farm": DATA / "airborne/lidarhd_farm_rgb.laz",
    "fields": DATA / "airborne/lidarhd_fields_rgbnir_extra_bytes.laz",
}
TRAINING = ["lidarhd_housing.laz", "ahn3_delft_west.laz", "lidarhd_sparse_1km.laz", "lidarhd_rural_sparse_1km.laz"]
PYRAMID = """
recipe = "pyramid"
[features.pyramid]
first_scale = 0.25
levels = 8
[forest]
max_depth = 18
min_samples_leaf = 8
[training]
voxel = 0.25
per_copy = 4000
densities = [10.0, 4.0, 1.0]
exclude = [[770495.0, 6277500.0, 770555.0, 6277565.0]]
[regularise]
method = "none"
"""
BARE = {
    "rated_voxel": "0",
    "features.height": "false",
    "features.profile.cells": "[]",
    "features.returns": "false",
    "context.voxels": "[]",
    "context.cells": "[]",
    "context.stacks": "[]",
}
#: Name of the step and the settings that are no longer held back.
STEPS = [
    ("+ boosted trees on the forest's probabilities", []),
    ("+ height above the ground", ["features.height"]),
    ("+ profiles", ["features.profile.cells"]),
    ("+ return numbers", ["features.returns"]),
    ("+ context", ["context.voxels", "context.cells", "context.stacks"]),
    ("+ first stage on one point a voxel", ["rated_voxel"]),
]


def run(*arguments):
    """Runs the program; returns the seconds of the processor."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([PROGRAM, *map(str, arguments), "--overwrite"], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime


def memory(*arguments):
    """Peak memory of the program, MB."""
    code = (
        "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, capture_output=True);"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    found = subprocess.run([sys.executable, "-c", code, PROGRAM, *map(str, arguments), "--overwrite"], check=True, capture_output=True)
    return int(found.stdout) / 1000


def codes(path):
    found = np.asarray(scansion.read(path, columns=["Classification"])["Classification"]).astype(int)
    return np.where(np.isin(found, (3, 4)), 5, found)


def mean_iou(path, found):
    truth = codes(path)
    known = np.isin(truth, (2, 5, 6))
    truth, found = truth[known], found[known]
    both = [(truth == c, found == c) for c in (2, 5, 6)]
    return 100 * np.mean([(a & b).sum() / (a | b).sum() for a, b in both if a.any()])


def row(name, recipe, settings, folder):
    model, named, crop = folder / "m.model", folder / "named.laz", folder / "crop.laz"
    held = [f"--set={key}={value}" for key, value in settings.items()]
    labels = ["--map", "3-4=5", "--map-of", "ahn3_delft_west.laz:1=5", "--classes", "2,5,6"]
    clouds = [DATA / "airborne" / name for name in TRAINING]
    run("train", *clouds, "--recipe", recipe, *labels, *held, "-o", model)
    cells = []
    for scene, path in SCENES.items():
        run("classify", path, "--model", model, "-o", named, "--force")
        found = codes(named)
        cells.append(f"{mean_iou(path, found):.1f}" if scene != "fields" else f"{100 * (found == 6).mean():.2f}")
    arguments = ["classify", crop, "--model", model, "-o", named, "--unit", "0.3048", "--threads", "1"]
    seconds = run(*arguments) / 1.832416
    text = f"| {name} | " + " | ".join(cells) + f" | {seconds:.1f} | {memory(*arguments):.0f} |"
    print(text, flush=True)
    return text


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        run("convert", DATA / "scale/autzen_10M.laz", folder / "crop.laz", "--bounds", "635577,848882,637000,850900")
        pyramid = folder / "pyramid.toml"
        pyramid.write_text(PYRAMID)
        rows = [row("pyramid and forest", pyramid, {}, folder)]
        held = dict(BARE)
        for name, free in STEPS:
            held = {key: value for key, value in held.items() if key not in free}
            rows.append(row(name, HERE / "crates/core/assets/default.toml", held, folder))
    page = (HERE / "docs/airborne.md").read_text()
    head, rest = page.split("<!-- ablation -->\n")
    table, tail = rest.split("\n\n", 1)
    text = f"{head}<!-- ablation -->\n" + "\n".join(table.split("\n")[:2] + rows) + "\n\n" + tail
    (HERE / "docs/airborne.md").write_text(text)


if __name__ == "__main__":
    main()
