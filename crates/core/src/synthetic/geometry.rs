//! Vectors, rays and flat patches.

/// A place or direction in metres.
pub(super) type Vector = [f64; 3];

pub(super) fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn scaled(a: Vector, by: f64) -> Vector {
    a.map(|v| v * by)
}

pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// The direction of a vector; zero for zero.
pub(super) fn unit(a: Vector) -> Vector {
    scaled(a, 1.0 / length(a).max(f64::MIN_POSITIVE))
}

/// The place between two others, at `share` of the way.
pub(super) fn between([a, b]: [Vector; 2], share: f64) -> Vector {
    add(a, scaled(sub(b, a), share))
}

/// A half line; `direction` has length 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) origin: Vector,
    pub(super) direction: Vector,
    /// 1 by each component of the direction.
    pub(super) inverse: Vector,
}

impl Ray {
    pub(super) fn new(origin: Vector, direction: Vector) -> Self {
        let direction = unit(direction);
        Self { origin, direction, inverse: direction.map(|v| 1.0 / v) }
    }

    pub(super) fn at(&self, range: f64) -> Vector {
        add(self.origin, scaled(self.direction, range))
    }
}

/// What part of its plane a patch covers, in coordinates u and v along its sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// u >= 0, v >= 0, u + v <= 1.
    Triangle,
    /// u and v in 0..=1.
    Parallelogram,
    /// u^2 + v^2 <= 1: a disc around the corner.
    Disc,
}

/// A flat piece of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub(super) corner: Vector,
    pub(super) sides: [Vector; 2],
    pub(super) form: Form,
    /// The surface that it belongs to.
    pub(super) surface: u32,
}

impl Patch {
    /// The range at which a ray meets the patch, from either side (Moeller and Trumbore 1997,
    /// doi:10.1080/10867651.1997.10487468).
    #[inline]
    pub(super) fn meet(&self, ray: &Ray) -> Option<f64> {
        let [u_side, v_side] = self.sides;
        let p = cross(ray.direction, v_side);
        let determinant = dot(u_side, p);
        if determinant == 0.0 {
            return None;
        }
        let inverse = 1.0 / determinant;
        let from = sub(ray.origin, self.corner);
        let u = dot(from, p) * inverse;
        if !(-1.0..=1.0).contains(&u) {
            return None;
        }
        let q = cross(from, u_side);
        let v = dot(ray.direction, q) * inverse;
        self.covers([u, v], 0.0).then(|| dot(v_side, q) * inverse)
    }

    /// Whether the patch covers a place of its plane, with a margin in units of its sides.
    pub(super) fn covers(&self, [u, v]: [f64; 2], margin: f64) -> bool {
        let positive = u >= -margin && v >= -margin;
        match self.form {
            Form::Triangle => positive && u + v <= 1.0 + margin,
            Form::Parallelogram => positive && u <= 1.0 + margin && v <= 1.0 + margin,
            Form::Disc => u * u + v * v <= 1.0 + margin,
        }
    }

    pub(super) fn normal(&self) -> Vector {
        unit(cross(self.sides[0], self.sides[1]))
    }

    /// Lowest and highest corner of a box around the patch.
    pub(super) fn bounds(&self) -> [Vector; 2] {
        let [u, v] = self.sides;
        let Self { corner, form, .. } = *self;
        let ends = match form {
            Form::Triangle => [corner, add(corner, u), add(corner, v), corner],
            Form::Parallelogram => [corner, add(corner, u), add(corner, v), add(add(corner, u), v)],
            Form::Disc => {
                let reach = [0, 1, 2].map(|a| u[a].hypot(v[a]));
                [sub(corner, reach), add(corner, reach), corner, corner]
            }
        };
        [0, 1].map(|high| {
            [0, 1, 2].map(|a| {
                let values = ends.iter().map(|end| end[a]);
                if high == 0 { values.fold(f64::INFINITY, f64::min) } else { values.fold(f64::NEG_INFINITY, f64::max) }
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch(form: Form) -> Patch {
        Patch { corner: [5.0, 0.0, 0.0], sides: [[0.0, 2.0, 0.0], [0.0, 0.0, 3.0]], form, surface: 0 }
    }

    #[test]
    fn rays_meet_a_plane_at_its_analytic_distance_and_only_inside_the_form() {
        for angle in [0.0, 0.1, 0.2, 0.35] {
            let ray = Ray::new([0.0; 3], [f64::cos(angle), f64::sin(angle), 0.1]);
            let expected = 5.0 / ray.direction[0];
            assert!((patch(Form::Parallelogram).meet(&ray).unwrap() - expected).abs() < 1e-12);
        }
        let corner = Ray::new([0.0, 1.9, 2.9], [1.0, 0.0, 0.0]);
        assert_eq!(patch(Form::Triangle).meet(&corner), None);
        assert_eq!(patch(Form::Disc).meet(&corner), None);
        assert_eq!(patch(Form::Parallelogram).meet(&corner), Some(5.0));
        let below = Ray::new([0.0, -1.0, 0.0], [1.0, 0.0, 0.0]);
        assert_eq!(patch(Form::Disc).meet(&below), Some(5.0));
        assert_eq!(patch(Form::Parallelogram).meet(&below), None);
        assert_eq!(patch(Form::Disc).bounds(), [[5.0, -2.0, -3.0], [5.0, 2.0, 3.0]]);
    }
}
