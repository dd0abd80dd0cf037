//! The algebra of one second-order cone in three dimensions: all (a, b) with a ≥ |b|, b in the plane.
//!
//! A contact's impulse lies in it (its normal, times the coefficient of friction, and its friction), and so does its rate. An
//! interior-point method scales both to the same point, by Nesterov and Todd's scaling (M. Andersen, J. Dahl, L. Vandenberghe,
//! CVXOPT, 2013, "Nonnegative orthants and second-order cones").

use nalgebra::{Vector2, Vector3};

/// The unit element: the middle of the cone.
pub(super) fn unit() -> Vector3<f64> {
    Vector3::x()
}

fn tail(point: &Vector3<f64>) -> Vector2<f64> {
    point.yz()
}

fn with_head(head: f64, tail: &Vector2<f64>) -> Vector3<f64> {
    Vector3::new(head, tail.x, tail.y)
}

/// Distance of the point from the cone's surface: negative outside.
pub(super) fn depth(point: &Vector3<f64>) -> f64 {
    point.x - tail(point).norm()
}

/// The product of the point's two eigenvalues.
fn determinant(point: &Vector3<f64>) -> f64 {
    depth(point) * (point.x + tail(point).norm())
}

/// The Jordan product.
pub(super) fn product(one: &Vector3<f64>, other: &Vector3<f64>) -> Vector3<f64> {
    with_head(one.dot(other), &(tail(other) * one.x + tail(one) * other.x))
}

/// The factor whose Jordan product with `by` is `product`.
pub(super) fn quotient(product: &Vector3<f64>, by: &Vector3<f64>) -> Vector3<f64> {
    let head = (by.x * product.x - tail(by).dot(&tail(product))) / determinant(by);
    with_head(head, &((tail(product) - tail(by) * head) / by.x))
}

/// The longest step from a point inside of the cone along `way` that stays in it; infinity where all do.
pub(super) fn longest_step(point: &Vector3<f64>, way: &Vector3<f64>) -> f64 {
    // Seen from where the point is the unit element.
    let size = determinant(point).sqrt();
    let point = point / size;
    let head = point.x * way.x - tail(&point).dot(&tail(way));
    let side = tail(way) - tail(&point) * ((head + way.x) / (point.x + 1.0));
    let sinks = side.norm() - head;
    if sinks > 0.0 { size / sinks } else { f64::INFINITY }
}

/// The scaling W of a pair (z, s) inside of the cone: W z = W⁻¹ s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scaling {
    size: f64,
    axis: Vector3<f64>,
}

impl Scaling {
    /// The scaling of `z` and `s`; none where one of them is not inside of the cone.
    pub(super) fn new(z: &Vector3<f64>, s: &Vector3<f64>) -> Option<Self> {
        let [in_z, in_s] = [z, s].map(determinant);
        let is_inside = in_z > 0.0 && in_s > 0.0 && z.x > 0.0 && s.x > 0.0;
        if !is_inside {
            return None;
        }
        let (z, s) = (z / in_z.sqrt(), s / in_s.sqrt());
        let length = (2.0 * (1.0 + z.dot(&s))).sqrt();
        let axis = tail(&(s - z)) / length;
        // Of length 1 in the cone's metric.
        let axis = with_head((1.0 + axis.norm_squared()).sqrt(), &axis);
        Some(Self { size: (in_s / in_z).sqrt().sqrt(), axis })
    }

    /// W x.
    pub(super) fn times(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let along = tail(&self.axis).dot(&tail(x));
        let side = tail(x) + tail(&self.axis) * (x.x + along / (1.0 + self.axis.x));
        with_head(self.axis.x * x.x + along, &side) * self.size
    }

    /// W⁻¹ x.
    pub(super) fn divides(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let along = tail(&self.axis).dot(&tail(x));
        let side = tail(x) + tail(&self.axis) * (along / (1.0 + self.axis.x) - x.x);
        with_head(self.axis.x * x.x - along, &side) / self.size
    }

    /// The eigenvectors of W², of length 1, and its eigenvalues.
    pub(super) fn square(&self) -> ([Vector3<f64>; 3], [f64; 3]) {
        let reach = tail(&self.axis).norm();
        let along = if reach > 0.0 { tail(&self.axis) / reach } else { Vector2::x() };
        let (square, stretch) = (self.size * self.size, (self.axis.x + reach) * (self.axis.x + reach));
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let ways = [
            with_head(half, &(along * half)),
            with_head(half, &(along * -half)),
            Vector3::new(0.0, -along.y, along.x),
        ];
        (ways, [square * stretch, square / stretch, square])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAIRS: [[[f64; 3]; 2]; 3] = [
        [[1.0, 0.2, -0.3], [2.0, 1.5, 0.4]],
        [[1e-3, 0.0, 9.9e-4], [4.0, 0.0, 0.0]],
        [[3.0, 2.0, 2.0], [1e-6, -5e-7, 8e-7]],
    ];

    #[test]
    fn the_scaling_takes_both_to_one_point() {
        for [z, s] in PAIRS.map(|pair| pair.map(Vector3::from)) {
            let scaling = Scaling::new(&z, &s).unwrap();
            let [one, other] = [scaling.times(&z), scaling.divides(&s)];
            assert!((one - other).amax() < 1e-12 * one.amax(), "{one} {other}");
            let back = scaling.divides(&scaling.times(&s));
            assert!((back - s).amax() < 1e-12 * s.amax(), "{back} {s}");
            let (ways, values) = scaling.square();
            let square: Vector3<f64> =
                ways.iter().zip(values).map(|(way, value)| way * (value * way.dot(&z))).sum();
            let twice = scaling.times(&scaling.times(&z));
            assert!((square - twice).amax() < 1e-12 * square.amax(), "{square} {twice}");
        }
        assert!(Scaling::new(&Vector3::new(1.0, 1.0, 0.1), &unit()).is_none(), "outside");
    }

    #[test]
    fn a_quotient_undoes_a_product() {
        for [z, s] in PAIRS.map(|pair| pair.map(Vector3::from)) {
            let found = quotient(&product(&z, &s), &z);
            assert!((found - s).amax() < 1e-9 * s.amax(), "{found} {s}");
        }
    }

    #[test]
    fn the_longest_step_ends_on_the_surface() {
        let point = Vector3::new(1.0, 0.2, -0.3);
        for way in [[-1.0, 0.0, 0.0], [0.1, 2.0, 0.0], [-0.2, -0.5, 0.9]].map(Vector3::from) {
            let end = point + way * longest_step(&point, &way);
            assert!(depth(&end).abs() < 1e-12 && end.x >= 0.0, "{end}");
        }
        assert!(longest_step(&point, &unit()).is_infinite());
    }
}
