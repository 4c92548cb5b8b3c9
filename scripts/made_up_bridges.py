"""What the built-in model makes of bridges put into a real scan of a field; prints a table of docs/default-model.md.

    python scripts/made_up_bridges.py DATA        # needs: pip install .

A channel is cut across the middle of the field. Of water no pulse comes back where it is half a metre deep or more.
"""

import re
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scansion

FIELD = "airborne/lidarhd_fields_rgbnir_extra_bytes.laz"
#: Half the edge of the square that is used, metres.
HALF = 75.0
DENSITIES = (2.5, 5.0, 12.0)
WIDTHS = (4.0, 9.0, 15.0)
#: Horizontal to vertical, of the banks, of walls and of ramps.
BANK, WALL, GRADE = 1.5, 0.05, 0.08


@dataclass(frozen=True)
class Bridge:
    """A deck across a channel; metres."""

    name: str
    channel: float
    depth: float
    width: float
    #: Of the deck above the banks.
    rise: float = 0.0
    slope: float = BANK
    wet: bool = False


WET = [
    Bridge("over water", channel, 1.2, width, rise, wet=True)
    for channel in (6.0, 10.0, 16.0)
    for rise in (0.0, 0.5, 1.2)
    for width in WIDTHS
]
DRY = [
    Bridge(name, channel, depth, width, slope=slope)
    for channel, depth in ((6.0, 1.2), (8.0, 2.0), (12.0, 2.5), (12.0, 4.0), (25.0, 6.0), (40.0, 7.0))
    for width in WIDTHS
    for name, slope in (("over land, banks of 1 : 1.5", BANK), ("over land, walls", WALL))
]


def field(data):
    """The points of the middle of the field, around the origin."""
    xyz = np.array(scansion.read(data / FIELD).xyz)
    low, high = xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)
    xyz[:, :2] -= (low + high) / 2
    return xyz[(np.abs(xyz[:, :2]) < HALF).all(axis=1)]


def turned(u, v, angle):
    return u * np.cos(angle) - v * np.sin(angle), u * np.sin(angle) + v * np.cos(angle)


def scan(ground, bridge, density, railings, rng):
    """Points with the bridge, and which of them are on its deck. The channel runs along u, the deck along v."""
    xyz = ground[rng.random(len(ground)) < density * (2 * HALF) ** 2 / len(ground)].copy()
    angle = rng.uniform(0, np.pi)
    u, v = turned(xyz[:, 0], xyz[:, 1], -angle)
    beside, beyond = np.abs(u) - bridge.width / 2, np.abs(v) - bridge.channel / 2
    deck = (beside < 0) & (beyond < 0)
    cut = np.clip(-beyond / bridge.slope, 0, bridge.depth) * ~deck
    ramp = bridge.rise - GRADE * np.maximum(beyond, 0) - np.maximum(beside, 0) / BANK
    xyz[:, 2] += np.where(deck, bridge.rise, np.where(beyond < 0, 0, np.maximum(ramp, 0))) - cut
    seen = deck | (cut < 0.5) if bridge.wet else np.ones(len(xyz), bool)
    xyz, deck = xyz[seen], deck[seen]
    if railings:
        along = np.arange(-bridge.channel / 2, bridge.channel / 2, 1 / np.sqrt(density))
        along = np.tile(along, 2)
        x, y = turned(np.repeat([-0.5, 0.5], len(along) // 2) * bridge.width, along, angle)
        z = np.median(xyz[deck, 2]) + rng.uniform(0.3, 1.1, len(along))
        xyz, deck = np.vstack([xyz, np.column_stack([x, y, z])]), np.append(deck, np.zeros(len(along), bool))
    return xyz, deck


def outcome(model, bridge, xyz, deck):
    """The share of the deck that is ground or building, and whether a warning names the place."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        codes = model.classify(xyz, abstain=0.0).codes
    places = re.findall(r"(-?\d+\.\d) (-?\d+\.\d) \(", " ".join(str(warning.message) for warning in warned))
    reach = max(bridge.width, bridge.channel) / 2 + 5
    return np.isin(codes[deck], (2, 6)).mean(), any(np.hypot(float(x), float(y)) < reach for x, y in places)


def main():
    ground = field(Path(sys.argv[1]))
    model = scansion.PointClassifier.default()
    rows = {}
    for seed, bridge in enumerate(WET + DRY):
        row = rows.setdefault((bridge.name, "2 m or less" if bridge.depth <= 2 else "more"), [])
        for density in DENSITIES:
            for railings in (False, True):
                rng = np.random.default_rng([seed, railings])
                row.append(outcome(model, bridge, *scan(ground, bridge, density, railings, rng)))
    print("| bridges | depth | number | named in a warning | else, 90 % of the deck ground or building | else, half |")
    print("|---|---|---|---|---|---|")
    for (name, depth), row in rows.items():
        silent = np.array([share for share, named in row if not named])
        print(f"| {name} | {depth} | {len(row)} | {len(row) - len(silent)} | {(silent > 0.9).sum()} | {(silent > 0.5).sum()} |")


if __name__ == "__main__":
    main()
