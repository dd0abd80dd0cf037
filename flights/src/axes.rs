//! Axes of a logged vector in another order, with any signs.

use nalgebra::Vector3;

use crate::agreement::{Agreement, Pairs};
use crate::declaration::{EachNumber, Entry, Frame};

/// Orders of the axes other than the declared one.
const OTHER_ORDERS: [[usize; 3]; 5] = [[1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]];
/// Orders under which correlations differ by less cannot be told apart.
const ALIKE: f64 = 0.02;
/// Names of the axes.
const NAMES: [&str; 3] = ["x", "y", "z"];

/// An order of the axes of a logged vector, with signs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes {
    /// Places of x, y and z in the logged vector.
    places: [usize; 3],
    /// Their signs.
    signs: [f64; 3],
}

impl Axes {
    /// The order, other than the declared one, under which `pairs` agree best, and their agreement under it; `None` if there are few pairs, if the
    /// derived vector is mostly below `quiet`, or if another order fits as well. An axis that hardly moves keeps its sign.
    pub fn that_fit(pairs: &Pairs, quiet: f64) -> Option<(Self, Agreement)> {
        let sign = |bits: u8, axis: u8| if (bits >> axis) & 1 == 1 { -1.0 } else { 1.0 };
        let signed = (0..8).map(|bits| [0, 1, 2].map(|axis| sign(bits, axis)));
        let all = signed.flat_map(|signs| OTHER_ORDERS.map(|places| Self { places, signs }));
        let agreed: Vec<_> = all.filter_map(|axes| Some((axes, axes.agreement(pairs, quiet)?))).collect();
        let best = agreed.iter().map(|(_, agreement)| agreement.correlation).fold(-1.0, f64::max);
        let fitting = || agreed.iter().filter(|(_, agreement)| agreement.correlation > best - ALIKE);
        let minuses = |axes: &Self| axes.signs.iter().filter(|sign| **sign < 0.0).count();
        let (axes, agreement) = fitting().min_by_key(|(axes, _)| minuses(axes))?;
        fitting().all(|(other, _)| other.places == axes.places).then_some((*axes, *agreement))
    }

    fn agreement(&self, pairs: &Pairs, quiet: f64) -> Option<Agreement> {
        let Self { places: [x, y, z], signs } = *self;
        pairs.turned(|v| Vector3::new(v[x], v[y], v[z]).component_mul(&Vector3::from(signs))).agreement(quiet)
    }

    /// The names of `entry` in this order, or else the axes.
    pub fn advice(&self, entry: Option<&Entry>) -> String {
        // Where the log has y and z the other way, so have the vector's signs.
        let frame = entry.and_then(|entry| entry.frame).unwrap_or_default();
        let of_frame = if frame == Frame::FrdNed { [1.0, -1.0, -1.0] } else { [1.0; 3] };
        let sign = |axis: usize| of_frame[axis] * self.signs[axis] * of_frame[self.places[axis]];
        let minus = |is_negated: bool| if is_negated { "-" } else { "" };
        match entry.and_then(|entry| Some((entry, entry.columns.as_deref()?))) {
            Some((entry, names)) if names.len() == NAMES.len() => {
                let name = |axis: usize| {
                    let name = &names[self.places[axis]];
                    format!("\"{}{}\"", minus(name.sign() * sign(axis) < 0.0), name.plain)
                };
                let mut each = [&entry.scale, &entry.offset].into_iter().flatten();
                let has_each = each.any(|each| matches!(each, EachNumber::Each(_)));
                let also = if has_each { ", and `scale` and `offset` in the same order" } else { "" };
                format!("the names in the order [{}, {}, {}]{also}", name(0), name(1), name(2))
            }
            _ => {
                let name = |axis: usize| format!("{}{}", minus(sign(axis) < 0.0), NAMES[self.places[axis]]);
                format!("the axes in the order {}, {}, {}", name(0), name(1), name(2))
            }
        }
    }
}

/// Axes that follow their twins, those that follow them with the other sign, and those that do not.
pub fn axis_by_axis(signs: [f64; 3]) -> String {
    let named = |sign: f64| {
        let names = NAMES.into_iter().zip(signs).filter(|(_, of_axis)| (of_axis - sign).abs() < 0.5);
        names.map(|(name, _)| name).collect::<Vec<_>>().join(", ")
    };
    let parts = [(1.0, "agree"), (-1.0, "opposite sign"), (0.0, "unrelated")];
    let told =
        parts.map(|(sign, what)| (named(sign), what)).into_iter().filter(|(names, _)| !names.is_empty());
    told.map(|(names, what)| format!("{names}: {what}")).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_and_the_signs_under_which_vectors_agree_are_found() {
        let derived: Vec<_> = (0..60)
            .map(|k| 0.1 * f64::from(k))
            .map(|t| Vector3::new(libm::sin(t), 0.4 * libm::cos(1.7 * t), 0.6 * libm::sin(2.9 * t)))
            .collect();
        // x of the motion is logged with the other sign as z, y as x, z as y.
        let logged = derived.iter().map(|v| Vector3::new(v.y, v.z, -v.x)).collect();
        let (axes, agreement) = Axes::that_fit(&Pairs { logged, derived }, 0.05).unwrap();
        assert_eq!(axes, Axes { places: [2, 0, 1], signs: [-1.0, 1.0, 1.0] });
        assert!((agreement.correlation - 1.0).abs() < 1e-12);
        assert_eq!(axes.advice(None), "the axes in the order -z, x, y");
    }

    #[test]
    fn an_axis_that_does_not_move_keeps_its_sign_and_one_that_moves_alone_shows_no_order() {
        let course =
            |of: fn(f64) -> Vector3<f64>| (0..60).map(|k| of(0.1 * f64::from(k))).collect::<Vec<_>>();
        let level = course(|t| Vector3::new(libm::sin(t), libm::cos(1.7 * t), 0.0));
        let logged = level.iter().map(|v| Vector3::new(v.y, v.x, 0.0)).collect();
        let (axes, _) = Axes::that_fit(&Pairs { logged, derived: level }, 0.05).unwrap();
        assert_eq!(axes, Axes { places: [1, 0, 2], signs: [1.0; 3] });
        let rolling = course(|t| Vector3::new(libm::sin(t), 0.0, 0.0));
        let logged = rolling.iter().map(|v| Vector3::new(0.0, v.x, 0.0)).collect();
        assert!(Axes::that_fit(&Pairs { logged, derived: rolling }, 0.05).is_none());
    }

    #[test]
    fn nothing_is_found_in_few_vectors() {
        let few = vec![Vector3::x(); 3];
        assert!(Axes::that_fit(&Pairs { logged: few.clone(), derived: few }, 0.05).is_none());
    }
}
