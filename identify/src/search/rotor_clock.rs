//! Lateness of measured rotor speeds against the inertial unit: by the torques and the thrust that the rotors make.
//!
//! A clock of their own that is 10 ms off turns the phase of a torque at 10 Hz by 36 deg. Inertia and damping are then wrong if rotor speeds
//! alone drive the model. The model's angular acceleration and specific force under the measured speeds are shifted until they fit the
//! measured ones best. Each component has a gain of its own, as thrust and inertia may be declared wrong. Compared are changes from one knot
//! to the next: the slow part of a torque balances what no rotor makes.

use crate::data::prepared::{BOX_STEPS, Equation, Prepared};
use crate::model::problem::Problem;
use crate::numbers::normal::Block;
use crate::numbers::offset::{Found, descended};

/// Components that are compared. About z the torque is too weak, along x and y rotors make no force.
const COMPONENTS: [(Equation, usize); 3] =
    [(Equation::AngularAcceleration, 0), (Equation::AngularAcceleration, 1), (Equation::SpecificForce, 2)];
/// Offsets up to this one are searched; tuned, no source: three times the greatest of docs/decisions/033-rotor-clocks-and-levers.md.
const SEARCHED_S: f64 = 0.1;
/// A component counts where the shifted model explains this part of its changes.
const LEAST_PART: f64 = 0.2;
/// Bias due to the samples' positions on the grid, as a part of the rotor speeds' period: as for the other clocks.
const BETWEEN_SAMPLES: f64 = 0.1;

/// One component: changes from knot to knot as measured, and the modelled quantity at each instant of the grid.
struct Component {
    measured: Vec<f64>,
    modelled: Vec<f64>,
    /// Weight of a row: the inverse of the variance that is left at the best offset.
    weight: f64,
}

/// Changes from knot to knot, of all components.
struct Changes {
    step_s: f64,
    /// Knots from which a change is counted, each with its index.
    knots: Vec<(usize, usize)>,
    components: Vec<Component>,
}

/// The lateness of the rotor speeds of `flight`; `None` where commands drive it, or the channels that show it are not logged or
/// show too little.
pub fn of_rotor_speed(problem: &Problem, flight: &Prepared) -> Option<Found> {
    let measured = &*flight.flight;
    let has_inertial_unit = !measured.angular_velocity.is_empty();
    if !measured.command.is_empty()
        || measured.rotor_speed.is_empty()
        || !has_inertial_unit
        || flight.is_assumed()
    {
        return None;
    }
    let mut changes = Changes::of(problem, flight);
    let start_s = changes.weigh()?;
    let between_s = BETWEEN_SAMPLES * measured.rotor_speed.period_s().unwrap_or(0.0);
    let blocks = problem.block_knots(flight);
    descended(start_s, SEARCHED_S, between_s, |late_s| changes.blocks(&blocks, late_s))
}

impl Changes {
    fn of(problem: &Problem, flight: &Prepared) -> Self {
        let layout = &flight.layout;
        let step_s = layout.clock.step_s;
        // Shifted windows have to stay on a piece of the grid, with a step to both sides for the derivative, and one for the line between two.
        let margin = (SEARCHED_S / step_s).ceil() as usize + 3 + flight.reach();
        let clock = &layout.clock;
        let is_inside = |knot: usize| {
            let end = knot + BOX_STEPS + margin;
            knot >= margin && end < clock.count && clock.piece(knot - margin) == clock.piece(end)
        };
        let pairs = layout.knots.windows(2).enumerate();
        let kept = pairs.filter(|(_, pair)| pair[1] - pair[0] == BOX_STEPS && is_inside(pair[0]));
        let knots: Vec<(usize, usize)> = kept.map(|(at, pair)| (at, pair[0])).collect();
        let values = problem.model.parameters.baseline();
        let rows = &problem.model.tracks(flight, &values).rows;
        let component = |(equation, axis): (Equation, usize)| {
            let (offset, width) = (flight.offset_of(equation)? + axis, flight.width());
            let row = |at: usize| rows[at * width + offset];
            Some(Component {
                measured: knots.iter().map(|(at, _)| row(at + 1) - row(*at)).collect(),
                modelled: problem.model.side(flight, equation, axis, &values),
                weight: 1.0,
            })
        };
        let components = COMPONENTS.into_iter().filter_map(component).collect();
        Self { step_s, knots, components }
    }

    /// The modelled changes of a component with the rotor speeds taken as `late_s`.
    fn modelled(&self, component: &Component, late_s: f64) -> Vec<f64> {
        let shift = late_s / self.step_s;
        let at = |knot: usize| {
            let place = knot as f64 + shift;
            let (before, part) = (place.floor() as usize, place - place.floor());
            (1.0 - part) * component.modelled[before] + part * component.modelled[before + 1]
        };
        self.knots.iter().map(|(_, knot)| at(knot + BOX_STEPS) - at(*knot)).collect()
    }

    /// The gain that fits best, and the part of the changes that it explains: none where it is negative.
    fn gain(component: &Component, modelled: &[f64]) -> (f64, f64) {
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (cross, square) = (product(&component.measured, modelled), product(modelled, modelled));
        let all = product(&component.measured, &component.measured);
        if cross <= 0.0 || square <= 0.0 || all <= 0.0 {
            (0.0, 0.0)
        } else {
            (cross / square, cross * cross / (square * all))
        }
    }

    /// Drops what shows nothing, weighs the rest, and gives the offset of a coarse search at which most is explained.
    fn weigh(&mut self) -> Option<f64> {
        let steps = (SEARCHED_S / self.step_s) as i32;
        let offsets: Vec<f64> = (-steps..=steps).map(|step| f64::from(step) * self.step_s).collect();
        let explained: Vec<Vec<f64>> = self
            .components
            .iter()
            .map(|one| offsets.iter().map(|late_s| Self::gain(one, &self.modelled(one, *late_s)).1).collect())
            .collect();
        let best = |parts: &[f64]| parts.iter().copied().fold(0.0, f64::max);
        let is_shown: Vec<bool> = explained.iter().map(|parts| best(parts) > LEAST_PART).collect();
        let total = |at: usize| -> f64 {
            // The logarithm of the likelihood, by component.
            let shown = explained.iter().zip(&is_shown).filter(|(_, is_shown)| **is_shown);
            shown.map(|(parts, _)| -libm::log((1.0 - parts[at]).max(1e-9))).sum()
        };
        let place = (0..offsets.len()).max_by(|a, b| total(*a).total_cmp(&total(*b)))?;
        let mut shown = is_shown.iter();
        self.components.retain(|_| *shown.next().unwrap_or(&false));
        let kept: Vec<f64> = explained
            .iter()
            .zip(&is_shown)
            .filter(|(_, shown)| **shown)
            .map(|(parts, _)| parts[place])
            .collect();
        for (component, part) in self.components.iter_mut().zip(kept) {
            let all: f64 = component.measured.iter().map(|change| change * change).sum();
            component.weight = self.knots.len() as f64 / ((1.0 - part).max(1e-9) * all);
        }
        (!self.components.is_empty()).then_some(offsets[place])
    }

    /// The normal equations by block of time at an offset: by the offset, and by the gain of each component.
    fn blocks(&self, knots: &[(usize, usize)], late_s: f64) -> Vec<Block> {
        let mut blocks = vec![Block::zero(1 + self.components.len()); knots.len()];
        for (number, component) in self.components.iter().enumerate() {
            let modelled = self.modelled(component, late_s);
            let gain = Self::gain(component, &modelled).0;
            let aside = [1.0, -1.0].map(|sign| self.modelled(component, late_s + sign * self.step_s));
            for (at, (knot, _)) in self.knots.iter().enumerate() {
                let block = knots.partition_point(|(_, end)| end <= knot);
                let mut row = vec![0.0; 1 + self.components.len()];
                row[0] = -gain * (aside[0][at] - aside[1][at]) / (2.0 * self.step_s);
                row[1 + number] = -modelled[at];
                blocks[block].add(component.measured[at] - gain * modelled[at], &row, component.weight);
            }
        }
        blocks.iter_mut().for_each(Block::complete);
        blocks
    }
}
