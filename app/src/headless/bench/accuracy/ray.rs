//! Rays through a grid, and the integral along them, by nothing but the definition of a picture.
//!
//! Shared with no renderer: the reference is among what is measured.

use ::render::volume::{Affine, Point, Vector};

/// Steps of the integral in one smooth stretch: its error is then below 1e-11 of the picture's range.
const STEPS: u32 = 256;

/// A half line from the eye's plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) origin: Point,
    /// Of length 1.
    pub(super) direction: Vector,
}

impl Ray {
    pub(super) fn at(&self, t: f64) -> Point {
        self.origin + self.direction * t
    }
}

/// A cube of `count`³ voxels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cube {
    pub(super) count: usize,
    pub(super) world_from_voxel: Affine,
}

impl Cube {
    /// A place in voxels, held at the outermost centres as samples are.
    pub(super) fn held(&self, p: &Point) -> Point {
        let last = (self.count - 1) as f64;
        self.world_from_voxel.inverse().point(p).map(|c| c.clamp(0.0, last))
    }

    /// Where a ray enters and leaves, in mm, with the places between at which it crosses a plane of outermost
    /// centres: between two of them what is interpolated is as smooth as what was sampled. Empty where it passes by.
    pub(super) fn stretches(&self, ray: &Ray) -> Vec<f64> {
        let inverse = self.world_from_voxel.inverse();
        let (p, d) = (inverse.point(&ray.origin), inverse.vector(&ray.direction));
        let last = (self.count - 1) as f64;
        let (mut near, mut far) = (0.0_f64, f64::INFINITY);
        let mut inner = Vec::new();
        for axis in 0..3 {
            if d[axis] == 0.0 {
                if p[axis] < -0.5 || p[axis] > last + 0.5 {
                    return Vec::new();
                }
                continue;
            }
            let reach = |value: f64| (value - p[axis]) / d[axis];
            let ends = [reach(-0.5), reach(last + 0.5)];
            near = near.max(ends[0].min(ends[1]));
            far = far.min(ends[0].max(ends[1]));
            inner.extend([reach(0.0), reach(last)]);
        }
        if near >= far {
            return Vec::new();
        }
        inner.retain(|t| *t > near && *t < far);
        inner.extend([near, far]);
        inner.sort_by(f64::total_cmp);
        inner
    }
}

/// Premultiplied colour and opacity of what `medium` says, colour and extinction per mm, along the stretches between
/// `ends`: the classical Runge-Kutta rule on the depth and on what is emitted, in each stretch.
pub(super) fn integral(ends: &[f64], medium: impl Fn(f64) -> ([f64; 3], f64)) -> [f64; 4] {
    let mut sum = [0.0; 4];
    let rate = |t: f64, depth: f64| {
        let (color, tau) = medium(t);
        let seen = tau * (-depth).exp();
        [color[0] * seen, color[1] * seen, color[2] * seen, tau]
    };
    for pair in ends.windows(2) {
        let h = (pair[1] - pair[0]) / f64::from(STEPS);
        for i in 0..STEPS {
            let t = pair[0] + h * f64::from(i);
            let a = rate(t, sum[3]);
            let b = rate(t + h / 2.0, sum[3] + h / 2.0 * a[3]);
            let c = rate(t + h / 2.0, sum[3] + h / 2.0 * b[3]);
            let d = rate(t + h, sum[3] + h * c[3]);
            for k in 0..4 {
                sum[k] += h / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]);
            }
        }
    }
    [sum[0], sum[1], sum[2], -(-sum[3]).exp_m1()]
}

/// The same of two or more homogeneous stretches: closed.
pub(super) fn layers(stretches: &[(f64, [f64; 3], f64)]) -> [f64; 4] {
    let (mut sum, mut depth) = ([0.0; 4], 0.0_f64);
    for (length, color, tau) in stretches {
        let seen = (-depth).exp() * -(-tau * length).exp_m1();
        for k in 0..3 {
            sum[k] += color[k] * seen;
        }
        depth += tau * length;
    }
    sum[3] = -(-depth).exp_m1();
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_integral_of_layers_is_their_closed_form() {
        let (red, blue) = ([1.0, 0.0, 0.0], [0.0, 0.25, 1.0]);
        let medium = |t: f64| if t < 3.0 { (red, 0.2) } else { (blue, 0.7) };
        let known = layers(&[(2.0, red, 0.2), (4.0, blue, 0.7)]);
        let found = integral(&[1.0, 3.0 - 1e-15, 3.0, 7.0], medium);
        for k in 0..4 {
            assert!((known[k] - found[k]).abs() < 1e-11, "channel {k}: {known:?} {found:?}");
        }
        // exp(-0.4) of the light of the second layer is left by the first.
        assert!((known[2] - (-0.4_f64).exp() * (1.0 - (-2.8_f64).exp())).abs() < 1e-15, "by hand");
    }

    #[test]
    fn a_ray_along_an_axis_meets_edges_and_outermost_centres() {
        let cube = Cube { count: 4, world_from_voxel: Affine::translation(Vector::new(0.0, 10.0, 0.0)) };
        let ray = Ray { origin: Point::new(1.0, 0.0, 2.0), direction: Vector::y() };
        assert_eq!(cube.stretches(&ray), [9.5, 10.0, 13.0, 13.5], "front, first and last centre, back");
        let beside = Ray { origin: Point::new(4.0, 0.0, 2.0), ..ray };
        assert!(cube.stretches(&beside).is_empty(), "it passes by");
    }
}
