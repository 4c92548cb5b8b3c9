"""Made-up cars and bushes on the open ground of a labelled airborne scan; training data for `scripts/car_clouds.py`.

Needs numpy. The same scene and the same generator of random numbers give the same result.

A ground point whose ray meets the object is moved back along that ray to the place where it first meets it. So density,
pattern and shadow are those of the scanner; what is behind a car is removed. Rays have one direction for each flight
strip, drawn for each object, up to 27 degrees off the vertical.

A car is a height over its plan: the profile of its kind along its middle, sides that lean in above the belt line (the
lower edge of the windows), and rounded corners. Bushes are there because low ones look most like cars in a scan: with
them a model learns the difference.
"""

import itertools
from dataclasses import dataclass

import numpy as np

#: Attempts to find a place for each object asked for.
ATTEMPTS = 400
#: Share of cars that begin a row: side by side, or one behind the other.
ROWS = 0.5
#: Rays are this far off the vertical at most, degrees.
STEEPEST = 27
#: Rays are followed down to this height over the ground, in such steps, metres.
LOWEST, STEP = 0.1, 0.02
#: Ground under an object: steepest slope (rise over run), largest root mean square distance from a plane (metres).
SLOPE, ROUGHNESS = 0.15, 0.06


@dataclass(frozen=True)
class Kind:
    """A kind of car: how frequent it is, ranges of its sizes in metres, and its profile.

    The profile has heights, shares of the car's height, at places from the front to the rear, shares of its length.
    """

    weight: float
    length: tuple
    width: tuple
    height: tuple
    along: tuple
    profile: tuple


KINDS = {
    "hatchback": Kind(
        weight=5,
        length=(3.5, 4.3),
        width=(1.65, 1.80),
        height=(1.40, 1.58),
        along=(0, 0.03, 0.24, 0.42, 0.55, 0.80, 0.95, 1),
        profile=(0.45, 0.52, 0.66, 0.97, 1, 0.97, 0.66, 0.45),
    ),
    "saloon": Kind(
        weight=3,
        length=(4.3, 5.0),
        width=(1.72, 1.88),
        height=(1.38, 1.50),
        along=(0, 0.03, 0.27, 0.43, 0.53, 0.66, 0.82, 0.97, 1),
        profile=(0.42, 0.50, 0.66, 0.97, 1, 0.95, 0.70, 0.66, 0.45),
    ),
    "estate": Kind(
        weight=3,
        length=(4.3, 4.9),
        width=(1.72, 1.90),
        height=(1.42, 1.62),
        along=(0, 0.03, 0.26, 0.41, 0.55, 0.86, 0.97, 1),
        profile=(0.43, 0.52, 0.66, 0.97, 1, 0.96, 0.62, 0.42),
    ),
    "suv": Kind(
        weight=3,
        length=(4.1, 4.9),
        width=(1.78, 1.98),
        height=(1.58, 1.85),
        along=(0, 0.03, 0.25, 0.40, 0.53, 0.86, 0.97, 1),
        profile=(0.48, 0.56, 0.64, 0.97, 1, 0.97, 0.62, 0.42),
    ),
    "mpv": Kind(
        weight=3,
        length=(4.0, 4.9),
        width=(1.70, 1.90),
        height=(1.60, 1.90),
        along=(0, 0.03, 0.16, 0.36, 0.50, 0.88, 0.97, 1),
        profile=(0.45, 0.52, 0.60, 0.96, 1, 0.98, 0.62, 0.42),
    ),
    "small van": Kind(
        weight=1.5,
        length=(4.1, 4.8),
        width=(1.70, 1.90),
        height=(1.75, 1.95),
        along=(0, 0.03, 0.18, 0.34, 0.42, 0.96, 0.99, 1),
        profile=(0.45, 0.50, 0.58, 0.95, 1, 1, 0.90, 0.40),
    ),
    "van": Kind(
        weight=1.2,
        length=(4.8, 5.6),
        width=(1.88, 2.05),
        height=(1.90, 2.30),
        along=(0, 0.03, 0.14, 0.29, 0.36, 0.97, 0.99, 1),
        profile=(0.42, 0.46, 0.54, 0.95, 1, 1, 0.92, 0.40),
    ),
    "high van": Kind(
        weight=0.6,
        length=(5.3, 6.6),
        width=(1.95, 2.10),
        height=(2.35, 2.75),
        along=(0, 0.03, 0.13, 0.26, 0.33, 0.97, 0.99, 1),
        profile=(0.38, 0.42, 0.47, 0.90, 1, 1, 0.95, 0.40),
    ),
    "pick-up": Kind(
        weight=0.4,
        length=(4.9, 5.4),
        width=(1.80, 1.95),
        height=(1.70, 1.85),
        along=(0, 0.03, 0.24, 0.37, 0.48, 0.60, 0.63, 0.66, 0.97, 1),
        profile=(0.50, 0.56, 0.63, 0.97, 1, 0.96, 0.62, 0.55, 0.55, 0.42),
    ),
}


@dataclass(frozen=True)
class Scene:
    """A labelled scan: coordinates, whether a point is ground and its pulse's only return, number of its strip."""

    xyz: np.ndarray
    open_ground: np.ndarray
    strip: np.ndarray


@dataclass(frozen=True)
class Placed:
    """The scene with objects: coordinates, whether a point is on an object, number of objects.

    Points are removed that are behind an object, or whose pulse is lost on it.
    """

    xyz: np.ndarray
    on_object: np.ndarray
    removed: np.ndarray
    objects: int

    def scene(self, before):
        """The scene for more objects beside these."""
        return Scene(self.xyz, before.open_ground & ~self.on_object & ~self.removed, before.strip)


@dataclass(frozen=True)
class Pose:
    """Where an object stands: its middle in plan, and the direction from its front to its rear, radians."""

    centre: np.ndarray
    heading: float

    def on_plan(self, offsets, length):
        """Distances from the front along the object, and from its middle line, of points given from the centre."""
        along = np.array([np.cos(self.heading), np.sin(self.heading)])
        across = np.array([-along[1], along[0]])
        return offsets @ along + length / 2, offsets @ across


@dataclass(frozen=True)
class Surface:
    """How an object reflects the pulses.

    A car: the shares lost on bonnet, windows, roof and boot (dark or shining), the shares that are lost in glass and
    that pass through it to the seats, and the noise of the heights in metres. A bush: the roughness of its leaves in
    metres, the share that gets into it and how deep on average, in metres, and the share that passes through gaps.
    """

    lost: np.ndarray
    lost_in_glass: float
    through_glass: float
    noise: float
    leaf_roughness: float
    leaf_depth: float
    into_leaves: float
    gaps: float

    @staticmethod
    def draw(rng):
        dark = rng.random(4) < 0.12
        lost = rng.uniform(0.5, 1.0, 4) * dark
        through_glass, lost_in_glass = rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.5)
        noise = rng.uniform(0.008, 0.025)
        roughness, depth, into_leaves = rng.uniform(0.03, 0.12), rng.uniform(0.1, 0.5), rng.uniform(0.2, 0.7)
        return Surface(lost, lost_in_glass, through_glass, noise, roughness, depth, into_leaves, rng.uniform(0.02, 0.2))


@dataclass(frozen=True)
class Hits:
    """Where rays first meet an object: along it, across it, height over the ground; NaN for rays that do not."""

    along: np.ndarray
    across: np.ndarray
    height: np.ndarray


@dataclass(frozen=True)
class Car:
    """A car: sizes, profile (heights along it), belt line, half width of the roof, metres; whether it is a van."""

    length: float
    width: float
    height: float
    along: np.ndarray
    profile: np.ndarray
    belt: float
    half_roof: float
    van: bool
    #: It hides what is behind it.
    opaque = True
    in_rows = True

    @staticmethod
    def draw(rng):
        weights = np.array([kind.weight for kind in KINDS.values()], float)
        name = list(KINDS)[int(np.searchsorted(np.cumsum(weights) / weights.sum(), rng.random()))]
        kind, van = KINDS[name], "van" in name
        length, width, height = rng.uniform(*kind.length), rng.uniform(*kind.width), rng.uniform(*kind.height)
        along = np.array(kind.along, float)
        along[1:-1] += rng.normal(0, 0.012, len(along) - 2)
        along = np.maximum.accumulate(np.clip(along, 0, 1))
        half_roof = width / 2 - (rng.uniform(0.04, 0.12) if van else rng.uniform(0.17, 0.28))
        belt = height * (0.9 if van else rng.uniform(0.60, 0.66))
        return Car(length, width, height, along, np.array(kind.profile, float) * height, belt, half_roof, van)

    def top(self, along, across):
        """Height of the car at a place of its plan; 0 beside it."""
        middle = np.interp(along / self.length, self.along, self.profile)
        to_end = np.minimum(along, self.length - along)
        half = self.width / 2 - 0.22 * (np.maximum(0, 0.45 - to_end) / 0.45) ** 2
        from_middle = np.abs(across)
        inwards = np.clip((half - from_middle) / np.maximum(half - self.half_roof, 0.02), 0, 1)
        side = np.where(from_middle <= self.half_roof, np.inf, self.belt + (self.height - self.belt) * inwards)
        beside = (along < 0) | (along > self.length) | (from_middle > half)
        return np.where(beside, 0.0, np.minimum(middle, side))

    def returns(self, hits, surface, rng):
        """Heights that are measured, and whether the pulse is lost."""
        draws = rng.random((len(hits.height), 3))
        glass = (hits.height > self.belt * 1.03) & (hits.height < self.height * 0.93)
        glass &= (not self.van) | (hits.along < self.length * 0.35)
        bonnet, boot = hits.along < 0.3 * self.length, hits.along > 0.85 * self.length
        paint = surface.lost[np.where(bonnet, 0, np.where(boot, 3, 2))]
        lost = draws[:, 0] < np.where(glass, np.maximum(surface.lost_in_glass, surface.lost[1]), paint)
        seats = np.maximum(hits.height - 0.5 * draws[:, 2], 0.4)
        height = np.where(glass & (draws[:, 1] < surface.through_glass), seats, hits.height)
        return height + rng.normal(0, surface.noise, len(height)), lost


@dataclass(frozen=True)
class Bush:
    """A round bush, or a hedge with a flat top; sizes in metres."""

    length: float
    width: float
    height: float
    round: bool
    #: What is behind it is seen through it.
    opaque = False
    in_rows = False

    @staticmethod
    def draw(rng):
        if rng.random() < 0.5:
            return Bush(rng.uniform(1.5, 8), rng.uniform(0.6, 2.0), rng.uniform(0.7, 2.3), round=False)
        width = rng.uniform(0.8, 3.8)
        return Bush(width * rng.uniform(1, 1.6), width, rng.uniform(0.5, 2.3), round=True)

    def top(self, along, across):
        """Height of the bush at a place of its plan; 0 beside it."""
        x, y = np.abs(2 * along / self.length - 1), np.abs(2 * across / self.width)
        outwards = x**2 + y**2 if self.round else np.maximum(x, y) ** 8
        return np.where(outwards < 1, self.height * np.sqrt(np.maximum(1 - outwards, 0)), 0.0)

    def returns(self, hits, surface, rng):
        """Heights that are measured, NaN where the pulse passes through, and whether it is lost: never."""
        draws = rng.random((len(hits.height), 3))
        depth = rng.exponential(surface.leaf_depth, len(hits.height))
        height = hits.height - np.where(draws[:, 1] < surface.into_leaves, depth, 0)
        height = height + rng.normal(0, surface.leaf_roughness, len(height))
        passes = (draws[:, 0] <= surface.gaps) | (height <= LOWEST)
        return np.where(passes, np.nan, height), np.zeros(len(height), bool)


class Squares:
    """Points of a scene by squares of 2 m."""

    EDGE = 2.0

    def __init__(self, xy):
        self.low = xy.min(0)
        square = np.floor((xy - self.low) / self.EDGE).astype(np.int64)
        self.last = square.max(0)
        key = square[:, 0] * (self.last[1] + 1) + square[:, 1]
        self.order = np.argsort(key, kind="stable")
        self.begin = np.searchsorted(key[self.order], np.arange((self.last[0] + 1) * (self.last[1] + 1) + 1))
        #: Points per square metre, of the squares that have points.
        self.density = len(xy) / (self.EDGE**2 * len(np.unique(key)))

    def around(self, centre, reach):
        """Points of the squares that are within a distance along both axes."""
        first = np.maximum(np.floor((centre - reach - self.low) / self.EDGE).astype(int), 0)
        last = np.minimum(np.floor((centre + reach - self.low) / self.EDGE).astype(int), self.last)
        if (first > last).any():
            return np.zeros(0, np.int64)
        rows = np.arange(first[0], last[0] + 1) * (self.last[1] + 1)
        return np.concatenate([self.order[self.begin[row + first[1]] : self.begin[row + last[1] + 1]] for row in rows])


def poses(xyz, open_ground, in_rows, rng):
    """Places on open ground to try; `xyz` may change meanwhile."""
    candidates = np.flatnonzero(open_ground)
    while True:
        centre = xyz[candidates[rng.integers(len(candidates))], :2] + rng.normal(0, 0.5, 2)
        heading = rng.uniform(0, 2 * np.pi)
        row = [Pose(centre, heading)]
        if in_rows and rng.random() < ROWS:
            row += neighbours(row[0], rng)
        yield from row


def neighbours(first, rng):
    """The others of a row of 2 to 6 cars."""
    cars, side_by_side = rng.integers(2, 7), rng.random() < 0.5
    distance = rng.uniform(2.3, 2.8) if side_by_side else rng.uniform(4.9, 6.2)
    direction = first.heading + (np.pi / 2 if side_by_side else 0)
    step = distance * np.array([np.cos(direction), np.sin(direction)])
    for number in range(1, cars):
        heading = first.heading + rng.normal(0, 0.04)
        yield Pose(first.centre + number * step, heading + (np.pi if rng.random() < 0.3 else 0))


@dataclass(frozen=True)
class Place:
    """The surroundings of an object: points, their offsets from its centre in plan, their heights over the ground.

    The ground is a plane: slopes along both axes, and height at the centre.
    """

    points: np.ndarray
    offsets: np.ndarray
    heights: np.ndarray
    plane: np.ndarray

    def ground(self, offsets):
        return offsets @ self.plane[:2] + self.plane[2]


class Placing:
    """A scene while objects of one kind, `Car` or `Bush`, are placed on it."""

    def __init__(self, scene):
        self.scene = scene
        self.xyz = scene.xyz.copy()
        self.on_object = np.zeros(len(scene.xyz), bool)
        self.removed = np.zeros(len(scene.xyz), bool)
        self.squares = Squares(scene.xyz[:, :2])

    def place(self, thing, pose, rng):
        """The place of an object, if it is open, even ground."""
        points = self.squares.around(pose.centre, thing.length / 2 + 2.5)
        if len(points) == 0:
            return None
        offsets = self.xyz[points, :2] - pose.centre
        along, across = pose.on_plan(offsets, thing.length)
        margin = rng.choice([0.05, 0.15, 0.3])
        inside = (along > -margin) & (along < thing.length + margin) & (np.abs(across) < thing.width / 2 + margin)
        under = points[inside]
        if len(under) < max(6, 0.5 * self.squares.density * thing.length * thing.width):
            return None
        if not (self.scene.open_ground[under] & ~self.removed[under] & ~self.on_object[under]).all():
            return None
        design = np.column_stack([offsets[inside], np.ones(len(under))])
        plane, *_ = np.linalg.lstsq(design, self.xyz[under, 2], rcond=None)
        distances = self.xyz[under, 2] - design @ plane
        if np.hypot(plane[0], plane[1]) > SLOPE or np.sqrt((distances**2).mean()) > ROUGHNESS:
            return None
        heights = self.xyz[points, 2] - (offsets @ plane[:2] + plane[2])
        return Place(points, offsets, heights, plane)

    def add(self, thing, pose, rng):
        """Puts an object there; False if it finds no place."""
        place = self.place(thing, pose, rng)
        if place is None:
            return False
        surface = Surface.draw(rng)
        measured = self.xyz[place.points]
        hit, removed = np.zeros((2, len(place.points)), bool)
        strips, visible = self.scene.strip[place.points], ~self.removed[place.points]
        free = self.scene.open_ground[place.points]
        for strip in np.unique(strips):
            seen = np.flatnonzero((strips == strip) & visible)
            offsets = place.offsets[seen]
            slant = drawn_slant(rng)
            hits = first_hits(thing, pose, offsets, slant)
            # Points that lie above the object are seen before it.
            hits.height[~(place.heights[seen] < hits.height)] = np.nan
            height, lost = thing.returns(hits, surface, rng)
            met = np.isfinite(height)
            there = offsets + slant * hits.height[:, None]
            measured[seen] = np.column_stack([pose.centre + there, place.ground(there) + height])
            hit[seen] = met & free[seen]
            removed[seen] = met & (lost | ~free[seen]) & thing.opaque
        if hit.sum() < 4 or self.on_object[place.points[hit]].any():
            return False
        moved = hit & ~removed
        self.xyz[place.points[moved]] = measured[moved]
        self.on_object[place.points[moved]] = True
        self.removed[place.points[removed]] = True
        return True


def drawn_slant(rng):
    """Direction of the rays of a strip: metres in plan for each metre of height."""
    off, direction = np.deg2rad(rng.uniform(0, STEEPEST)), rng.uniform(0, 2 * np.pi)
    return np.array([np.tan(off) * np.cos(direction), np.tan(off) * np.sin(direction)])


def first_hits(thing, pose, offsets, slant):
    """Where the rays to these points of the ground first meet an object, coming from above."""
    levels = np.arange(thing.height + STEP, LOWEST, -STEP)
    rays = offsets[:, None, :] + slant * levels[None, :, None]
    below_top = thing.top(*pose.on_plan(rays, thing.length)) >= levels
    height = np.where(below_top.any(1), levels[below_top.argmax(1)], np.nan)
    along, across = pose.on_plan(offsets + slant * height[:, None], thing.length)
    return Hits(along, across, height)


def put(kind, count, scene, rng):
    """Puts up to `count` objects of a kind, `Car` or `Bush`, on a scene: as many as find a place."""
    placing, objects = Placing(scene), 0
    places = poses(placing.xyz, scene.open_ground, kind.in_rows, rng)
    for pose in itertools.islice(places, count * ATTEMPTS):
        objects += placing.add(kind.draw(rng), pose, rng)
        if objects == count:
            break
    return Placed(placing.xyz, placing.on_object, placing.removed, objects)
