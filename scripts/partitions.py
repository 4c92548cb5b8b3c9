"""Eight segmentation methods at equal numbers of segments, on four sensors; writes docs/partitions.md.

    python scripts/partitions.py DATA    # needs: pip install .

The number of segments of each method is reached by searching one of its parameters; if that does not suffice, limits on
the number of points are relaxed one after the other. Oracle: share of the points that are right if every segment gets
its most frequent class. Boundary recall and precision: share of the edges between classes that coincide with a segment
boundary (or are one edge away from it), and the reverse.
"""

import pathlib
import sys
import time

import numpy as np
import scansion

SCENES = {
    "oakland/part_14.laz": ("Mobile laser, street (Oakland part_14)", 1000, "Classification", 1.0),
    "airborne/lidarhd_housing.laz": ("Airborne laser, housing (LiDAR HD)", 3000, "Classification", 1.0),
    "indoor/s3dis_office.ply": ("Indoor, Matterport (S3DIS office)", 1000, "label", 0.2),
    "rgbd/pcl_data__learn0.pcd": ("RGB-D camera, table top (PCL)", 200, "Classification", 0.02),
}
METHODS = {
    "cut-pursuit": ("strength", 0.05),
    "merge": ("strength", 0.05),
    "riemannian": ("strength", 0.1),
    "local-graph": ("size", 1.2),
    "slic": ("size", 2.4),
    "vccs": ("size", 2.4),
    "region-growing": ("region_growing.min_size", 50.0),
    "octree-region-growing": ("octree_region_growing.min_size", 50.0),
}
# Voxels halve from level to level, so that their size cannot be searched finely: the fewest points of a region are, for each size
# of the largest voxel and fewest points of a voxel that may grow.
RULES = {
    "octree-region-growing": [
        {"size": size, "octree_region_growing.min_points": points}
        for points in (10, 5, 3)
        for size in (2.0, 1.0, 0.5, 0.25)
    ]
}
TRIALS, CLOSE = 14, 0.02


def load(path, column):
    cloud = scansion.read(path)
    names = [name for name in cloud.columns if name.lower() == column.lower()]
    if not names:
        raise SystemExit(f"{path}: no column {column} among {', '.join(cloud.columns)}")
    code = np.asarray(cloud[names[0]]).astype(np.int64)
    kept = np.isfinite(cloud.xyz).all(1)
    _, code = np.unique(code, return_inverse=True)
    rgb = {n: np.asarray(cloud[n])[kept] for n in ("Red", "Green", "Blue") if n in cloud.columns}
    return scansion.PointCloud(cloud.xyz[kept], Classification=code[kept].astype(np.uint8), **rgb)


def part(cloud, method, value, scale, rule):
    key = METHODS[method][0]
    recipe = {name: v for name, v in rule.items() if name != "size"}
    if method == "riemannian":
        recipe["riemannian.octree.stop.sigma"] = 0.1 * scale
    named = {"size": rule["size"] * scale} if "size" in rule else {}
    if key in ("strength", "size"):
        named[key] = value
    else:
        recipe[key] = value
    if method == "octree-region-growing":
        recipe |= {f"octree_region_growing.{n}": v * scale for n, v in (("residual", 0.05), ("distance", 0.05))}
    return scansion.segment(cloud, method=method, recipe=recipe, **named).report


def miss(report, wanted):
    return abs(np.log(report["segments"] / wanted))


def bisect(cloud, method, wanted, scale, rule):
    """The report whose number of segments is nearest to the wanted one: larger values give fewer segments."""
    key, value = METHODS[method]
    value *= scale if key == "size" else 1.0
    low = high = best = None
    tried = set()
    for _ in range(TRIALS):
        whole = value if key in ("strength", "size") else max(1, round(value))
        if whole in tried:
            break
        tried.add(whole)
        start = time.time()
        report = part(cloud, method, whole, scale, rule)
        report |= {"seconds": time.time() - start, "by": setting(key, whole, rule, scale)}
        if best is None or miss(report, wanted) < miss(best, wanted):
            best = report
        if miss(report, wanted) < CLOSE:
            break
        if report["segments"] > wanted:
            low = value
            value = np.sqrt(value * high) if high else 2 * value
        else:
            high = value
            value = np.sqrt(low * value) if low else value / 2
    return best


def setting(key, value, rule, scale):
    if "size" in rule:
        rule = rule | {"size": rule["size"] * scale}
    return ", ".join([f"{key} {value:.3g}", *(f"{name.split('.')[-1]} {v:g}" for name, v in rule.items())])


def search(cloud, method, wanted, scale):
    """As bisect, with the first rule that comes close; the nearest of all if none does."""
    best = None
    for rule in RULES.get(method, [{}]):
        report = bisect(cloud, method, wanted, scale, rule)
        if best is None or miss(report, wanted) < miss(best, wanted):
            best = report
        if miss(best, wanted) < CLOSE:
            break
    return best


HEAD = """# Segmentation methods compared

Written by `python scripts/partitions.py DATA` ({minutes:.0f} minutes). All methods have about the same number of segments, which is
reached by searching one parameter of each method (for octree-based region growing also the size of its voxels and the
least number of points in them). Oracle is the share of the points that are right if every segment gets its most frequent
class; recall and precision are those of the class boundaries, with a tolerance of one edge of the graph of 10
neighbours. Everything else has its default, with lengths scaled to the scene. Seconds are wall time of the whole call on
{cores} cores, which were not always idle.

"""


def main(data):
    start, text = time.time(), []
    for path, (title, wanted, column, scale) in SCENES.items():
        cloud = load(data / path, column)
        text += [
            f"## {title}: {len(cloud):,} points, about {wanted} segments\n",
            "| method | by | segments | oracle | boundary recall | precision | seconds |",
            "|---|---|---|---|---|---|---|",
        ]
        for method in METHODS:
            r = search(cloud, method, wanted, scale)
            b = r["boundaries"]
            text.append(
                f"| {method} | {r['by']} | {r['segments']:,} | {100 * r['oracle_accuracy']:.2f} % | "
                f"{100 * b['recall']:.1f} % | {100 * b['precision']:.1f} % | {r['seconds']:.1f} |"
            )
            print(text[-1], flush=True)
        text.append("")
    import os

    page = pathlib.Path(__file__).parent.parent / "docs/partitions.md"
    tail = page.read_text(encoding="utf-8").partition("## Which method to use")[1:] if page.exists() else ("", "")
    head = HEAD.format(minutes=(time.time() - start) / 60, cores=os.cpu_count())
    page.write_text(head + "\n".join(text) + "\n" + "".join(tail), encoding="utf-8")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
