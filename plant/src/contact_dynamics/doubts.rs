//! Results that a run took although they are off, counted for its summary: impulses, and the energy of free bodies.

use super::free_bodies::Energy;
use super::unsolved::Found;

/// Part of the kinetic energy that a step may add to free bodies: integration is of first order while a contact holds. A body that
/// pivots on a corner at 80 rad/s gains it in a step of half a millisecond. Tuned, no source.
const GAIN_OF_MOTION: f64 = 1e-4;

/// Height by which a step may lift each body for each body of a pile: overlaps of up to a micrometre are taken out of the poses.
const LIFT_M: f64 = 2e-6;

/// Part of the energy that rounding may add.
const ROUNDING: f64 = 1e-12;

/// Results that are off, since the plant was made. They are not part of its state.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Doubts {
    /// Searches for impulses.
    searches: u64,
    /// Searches whose impulses were taken although a rate was off.
    off: u64,
    /// The one of them whose rate was off most.
    farthest: Option<Found>,
    /// Steps whose energy was checked.
    steps: u64,
    /// Steps that added energy.
    gaining: u64,
    /// Sum of what these added.
    gained_J: f64,
    /// The most that one of them added.
    most_J: f64,
}

/// Energy that a step from `start` to `end` added; `None` if it may have added as much.
fn gained_J(start: &Energy, end: &Energy) -> Option<f64> {
    let gain_J = (end.kinetic_J - start.kinetic_J) + (end.potential_J - start.potential_J);
    let motion_J = end.kinetic_J.max(start.kinetic_J);
    let rounding_J = ROUNDING * (motion_J + end.potential_J.abs());
    let most_J = GAIN_OF_MOTION * motion_J + LIFT_M * end.piled_N + rounding_J;
    (gain_J > most_J).then_some(gain_J)
}

impl Doubts {
    /// Counts a search for impulses. One that ends the run is not taken.
    pub(super) fn note_impulses(&mut self, found: &Found) {
        self.searches += 1;
        if found.is_accurate() || !found.is_met() {
            return;
        }
        self.off += 1;
        if self.farthest.is_none_or(|farthest| farthest.off_m_s < found.off_m_s) {
            self.farthest = Some(*found);
        }
    }

    /// Counts a step of the free bodies, from `start` to `end`.
    pub(super) fn note_step(&mut self, start: &Energy, end: &Energy) {
        self.steps += 1;
        if let Some(gain_J) = gained_J(start, end) {
            self.gaining += 1;
            self.gained_J += gain_J;
            self.most_J = self.most_J.max(gain_J);
        }
    }

    /// The counts in words; `None` if nothing was off.
    pub(super) fn remark(&self) -> Option<String> {
        let told: Vec<String> = [self.about_impulses(), self.about_energy()].into_iter().flatten().collect();
        (!told.is_empty()).then(|| {
            let told = told.join("; ");
            format!("{told}; to see what depends on that, compare with other `substeps`")
        })
    }

    fn about_impulses(&self) -> Option<String> {
        let Found { off_m_s, fastest_m_s } = self.farthest?;
        let (off, searches) = (self.off, self.searches);
        Some(format!(
            "contact impulses were taken in {off} of {searches} searches although a rate was off, by up to {off_m_s:.1e} m/s \
             where the fastest was {fastest_m_s:.1e} m/s"
        ))
    }

    fn about_energy(&self) -> Option<String> {
        let Self { steps, gaining, gained_J, most_J, .. } = self;
        (*gaining > 0).then(|| {
            format!(
                "free bodies gained energy in {gaining} of {steps} steps, {gained_J:.1e} J in all, up to {most_J:.1e} J in one"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noted(all: &[[f64; 2]]) -> Doubts {
        let mut doubts = Doubts::default();
        for [off_m_s, fastest_m_s] in all.iter().copied() {
            doubts.note_impulses(&Found { off_m_s, fastest_m_s });
        }
        doubts
    }

    #[test]
    fn impulses_within_a_thousandth_of_the_fastest_rate_or_below_the_least_error_are_not_told() {
        let doubts = noted(&[[0.0, 0.0], [9e-4, 1.0], [9e-6, 1e-6], [1e-12, 3.0]]);
        assert_eq!((doubts.searches, doubts.remark()), (4, None));
        // This one ends the run, with an error of its own.
        assert_eq!(noted(&[[0.06, 1.0]]).remark(), None);
    }

    #[test]
    fn impulses_that_are_taken_although_off_are_counted_with_the_farthest() {
        let doubts = noted(&[[2e-3, 1.0], [1e-9, 1.0], [2e-2, 0.5], [1e-2, 4.0]]);
        let remark = doubts.remark().expect("three are off");
        for part in ["in 3 of 4 searches", "by up to 2.0e-2 m/s", "the fastest was 5.0e-1 m/s", "`substeps`"]
        {
            assert!(remark.contains(part), "{remark}");
        }
        assert!(!remark.contains("energy"), "{remark}");
    }

    fn energy(kinetic_J: f64, potential_J: f64) -> Energy {
        Energy { kinetic_J, potential_J, piled_N: 100.0 }
    }

    #[test]
    fn a_lift_out_of_an_overlap_and_what_integration_adds_are_not_told() {
        let mut doubts = Doubts::default();
        // A fall, an impact, a lift by a micrometre, and a millionth of the motion.
        for [start, end] in [
            [energy(0.0, 5.0), energy(2.0, 3.0)],
            [energy(5.0, 0.0), energy(1.0, 0.0)],
            [energy(0.0, 0.0), energy(0.0, 1e-4)],
            [energy(7.0, 1.0), energy(7.0 + 7e-6, 1.0)],
        ] {
            doubts.note_step(&start, &end);
        }
        assert_eq!((doubts.steps, doubts.remark()), (4, None));
    }

    #[test]
    fn steps_that_add_energy_are_counted_with_the_sum_and_the_most() {
        let mut doubts = Doubts::default();
        doubts.note_step(&energy(1.0, 2.0), &energy(1.5, 2.0));
        doubts.note_step(&energy(1.5, 2.0), &energy(1.5, 3.5));
        doubts.note_step(&energy(1.5, 3.5), &energy(0.0, 4.9));
        let remark = doubts.remark().expect("two steps gain");
        let expected = "free bodies gained energy in 2 of 3 steps, 2.0e0 J in all, up to 1.5e0 J in one";
        assert!(remark.contains(expected), "{remark}");
    }
}
