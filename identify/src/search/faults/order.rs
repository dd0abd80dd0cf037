//! Order of the rotors in commands and in rotor speeds, and their senses of rotation.
//!
//! The angular accelerations show both, at any size of thrust and inertia and at any delay: each order, with each choice of
//! reversed spins, is a regression of its own. Of up to four rotors all orders and all spins are tried. Of more rotors, these
//! orders are tried: two rotors exchanged, and those that begin at another rotor; each with one, two or all spins reversed.
//! Commands on another clock pass for none of them: the declared order is tried at times far from the motion's, too.

use super::evidence::Evidence;
use crate::data::fault::{Fault, Part};
use crate::data::prepared::Equation;
use crate::data::rotor_track::EachRotor;
use nalgebra::Vector3;
use std::ops::RangeInclusive;
use vehicles::{ROTORS_MAX, Rotor};

/// Longest delay that is tried.
const LATE_S: f64 = 0.2;
/// An order of more than [`ALL_MAX`] rotors is named only if it leaves less than this part.
const LEFT_UNTRIED: f64 = 0.25;
/// Greatest difference of two clocks that is looked for.
const APART_S: f64 = 1.0;
/// Least part of the angular accelerations that the declared order explains on the right clock. It explains more by [`MORE`] than any does
/// within [`LATE_S`], or by [`MORE_OUTSIDE`].
const APART_SHARE: f64 = 1.0 / 3.0;
/// Least gain of the declared order at a time beyond [`LATE_S`]: of commands that are early, some are nearly right at the longest delay. On
/// the right clock one of the orders that were tried explains more within it than the declared one does elsewhere.
const MORE_OUTSIDE: f64 = ALIKE;
/// Instants beside the times within [`LATE_S`] at which the declared order is compared with these.
const ASIDE: isize = 4;
/// Most steps from the best time to the one that roll and pitch show.
const SUMMIT_STEPS: usize = 40;
/// Least gain of another order of the rotors: share of the squared angular accelerations, summed over the axes.
const MORE: f64 = 0.5;
/// Least gain where the other order leaves less than [`LEFT`] of what the declared one leaves.
const MORE_OF_LITTLE: f64 = 0.2;
const LEFT: f64 = 1.0 / 3.0;
/// Least mean share, and least mean gain, of another order over all flights that explains [`TIMES`] as much as the declared one; axes that
/// turn against the commands are taken off. Noise and disturbances may leave little of the angular accelerations to the commands: a tenth on real
/// logs of a Crazyflie at 100 Hz. There an exchange of two opposite motors does not change the yaw: the
/// declared order still explains 56 % of what the right one explains.
const MORE_IN_ALL: f64 = 0.1;
const TIMES: f64 = 1.7;
/// Least gain of spins that other flights of the same vehicle show.
const MORE_AS_OTHERS: f64 = 0.05;
/// Sum of the shares of an arrangement that explains all.
const AXES: f64 = 3.0;
/// Of some reversed spins, torques about the yaw axis are as large as those about the others by the vehicle file, within this factor. Else it is other
/// torques that come with roll and pitch: reversed spins mix the rotors' large differences for these into yaw.
const SIZE_TOLERANCE: f64 = 3.0;
/// Arrangements whose gains differ by less cannot be told apart.
const ALIKE: f64 = 0.02;

/// A channel with a number for each rotor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drive {
    /// Motor commands.
    Command,
    /// Measured speeds.
    RotorSpeed,
}

impl Drive {
    fn name(self) -> &'static str {
        if self == Drive::Command { "command" } else { "rotor_speed" }
    }

    fn part(self) -> Part {
        if self == Drive::Command { Part::Command } else { Part::RotorSpeed }
    }

    /// Advice for a channel on another clock.
    fn clock_advice(self) -> &'static str {
        match self {
            Drive::Command => {
                "give that time as `delay_s = { command = … }` of the flight, or log all channels on one clock"
            }
            Drive::RotorSpeed => {
                "give that time as `delay_s = { rotor_speed = … }` of the flight, or log all channels on one clock"
            }
        }
    }

    fn advice(self) -> &'static str {
        match self {
            Drive::Command => {
                "name the columns of `command` in the order of the vehicle file's rotors, and check their `spin`"
            }
            Drive::RotorSpeed => {
                "name the columns of `rotor_speed` in the order of the vehicle file's rotors, and check their `spin`"
            }
        }
    }
}

/// An order of the rotors, with the spins of some of them reversed.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Arrangement {
    /// For each rotor of the vehicle file, the number of the channel that belongs to it.
    order: Vec<usize>,
    /// For each rotor of the vehicle file, true if it turns the other way than the file says.
    is_reversed: Vec<bool>,
}

impl Arrangement {
    /// Returns the arrangements of so many rotors that are tried, the declared one first.
    fn all(rotors: usize) -> Vec<Self> {
        let spins = spins(rotors);
        let of_order = |order: Vec<usize>| {
            spins.iter().map(move |spins| Self { order: order.clone(), is_reversed: spins.clone() })
        };
        orders(rotors).into_iter().flat_map(of_order).collect()
    }

    /// Rotors of the vehicle file with another channel than their own, counted from 1.
    fn moved(&self) -> Vec<String> {
        let moved = self.order.iter().enumerate().filter(|(rotor, at)| rotor != *at);
        moved.map(|(rotor, _)| (rotor + 1).to_string()).collect()
    }

    /// Number of rotors that are elsewhere or turn the other way. Reversing all spins is one change: of the yaw axis.
    fn changes(&self) -> usize {
        let reversed = self.is_reversed.iter().filter(|is_reversed| **is_reversed).count();
        self.moved().len() + if reversed == self.order.len() { 1 } else { reversed }
    }

    fn text(&self, rotors: &[Rotor]) -> String {
        let names: Vec<String> = self.order.iter().map(|rotor| (rotor + 1).to_string()).collect();
        format!("the order {} of the logged ones{}", names.join(", "), self.spins_text(rotors))
    }

    /// The reversed spins, and all spins as they would be right.
    fn spins_text(&self, rotors: &[Rotor]) -> String {
        let reversed: Vec<String> = (0..rotors.len())
            .filter(|rotor| self.is_reversed[*rotor])
            .map(|rotor| (rotor + 1).to_string())
            .collect();
        let name = |(rotor, is_reversed): (&Rotor, &bool)| {
            if (rotor.spin > 0.0) == *is_reversed { "clockwise" } else { "counter-clockwise" }
        };
        let right: Vec<&str> = rotors.iter().zip(&self.is_reversed).map(name).collect();
        match reversed.len() {
            0 => String::new(),
            all if all == rotors.len() => " with all spins reversed".to_owned(),
            count => format!(
                " with the {} {} reversed (in the order of the file: {})",
                if count == 1 { "spin of rotor" } else { "spins of rotors" },
                reversed.join(", "),
                right.join(", ")
            ),
        }
    }
}

/// Faults of flights whose `drive` explains the angular accelerations in another arrangement of the rotors. Spins belong to the
/// vehicle: those that one flight shows most clearly are doubted in all in which they explain more than the declared ones.
pub fn swapped(flights: &[Evidence], drive: Drive) -> Vec<Option<Fault>> {
    let all: Vec<Option<Scores>> = flights.iter().map(|evidence| Scores::of(evidence, drive)).collect();
    let apart: Vec<Option<Fault>> =
        flights.iter().zip(&all).map(|(evidence, scores)| scores.as_ref()?.apart(evidence, drive)).collect();
    let is_judged = |(scores, apart): (Option<Scores>, &Option<Fault>)| scores.filter(|_| apart.is_none());
    let scores: Vec<Option<Scores>> = all.into_iter().zip(&apart).map(is_judged).collect();
    let found: Vec<Option<usize>> = scores.iter().map(|scores| scores.as_ref()?.clearly_better()).collect();
    let clear_spins = scores.iter().zip(&found).filter_map(|(scores, found)| {
        let (scores, found) = (scores.as_ref()?, (*found)?);
        scores.all[found].1.moved().is_empty().then(|| (scores.gain(found), found))
    });
    let spins = clear_spins.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, found)| found);
    let others = scores.iter().zip(&found).filter(|(_, found)| found.is_none());
    let in_all = better_in_all(&others.filter_map(|(scores, _)| scores.as_ref()).collect::<Vec<_>>());
    let of_flight = |((evidence, scores), found): ((&Evidence, &Option<Scores>), Option<usize>)| {
        let scores = scores.as_ref()?;
        let as_others = || spins.filter(|at| scores.gain(*at) > MORE_AS_OTHERS);
        Some(scores.fault(evidence, drive, found.or_else(as_others).or(in_all)?))
    };
    let swapped = flights.iter().zip(&scores).zip(found).map(of_flight);
    swapped.zip(apart).map(|(swapped, apart)| apart.or(swapped)).collect()
}

/// The order that explains more than the declared one over these flights, [`TIMES`] as much, and no less in any part of any.
fn better_in_all(flights: &[&Scores]) -> Option<usize> {
    let arrangements = &flights.first()?.all;
    let of_all = |at: usize| flights.iter().map(|scores| scores.all[at].0).sum::<f64>();
    let sums = (0..arrangements.len()).map(|at| (of_all(at), &arrangements[at].1));
    let best = simplest_of_best(&sums.collect::<Vec<_>>(), ALIKE * flights.len() as f64)?;
    let directed = |at: usize| flights.iter().map(|scores| scores.directed[at].whole).sum::<f64>();
    let is_no_worse = |scores: &&Scores| {
        let [best, declared] = [best, 0].map(|at| scores.directed[at].parts);
        best.iter().zip(&declared).all(|(best, declared)| best >= declared)
    };
    let least = MORE_IN_ALL * flights.len() as f64;
    let is_clear = directed(best) > (TIMES * directed(0)).max(least)
        && directed(best) - directed(0) > least
        && flights.iter().all(is_no_worse);
    // Spins alone turn nothing but yaw, where other torques are as large.
    (is_clear && !arrangements[best].1.moved().is_empty()).then_some(best)
}

/// The best of arrangements with their scores; of several within `alike` of it, the one with the fewest changes.
fn simplest_of_best(all: &[(f64, &Arrangement)], alike: f64) -> Option<usize> {
    let best = all.iter().map(|(score, _)| *score).max_by(f64::total_cmp)?;
    let as_good = (0..all.len()).filter(|at| all[*at].0 > best - alike);
    as_good.min_by(|a, b| {
        let [one, other] = [&all[*a], &all[*b]];
        one.1.changes().cmp(&other.1.changes()).then(other.0.total_cmp(&one.0))
    })
}

/// Shares of the angular accelerations of one flight that each arrangement explains, the declared one first.
struct Scores {
    all: Vec<(f64, Arrangement)>,
    /// The same at the delay that is best for each, less the shares of axes that turn the other way; 0 where all axes do.
    directed: Vec<Directed>,
}

/// Share of the angular accelerations that an arrangement explains, less that of axes that turn the other way.
#[derive(Clone, Copy, Default)]
struct Directed {
    whole: f64,
    parts: [f64; PARTS],
}

impl Scores {
    /// `None` if the flight does not have what it takes.
    fn of(evidence: &Evidence, drive: Drive) -> Option<Self> {
        let products = products(evidence, drive)?;
        let effects = [1.0, -1.0].map(|spin| effects_of_squares(evidence, spin));
        let score = |arrangement: &Arrangement| {
            let reversed = arrangement.is_reversed.iter().enumerate();
            let effect: Vec<_> =
                reversed.map(|(rotor, is_reversed)| effects[usize::from(*is_reversed)][rotor]).collect();
            let is_mixed =
                arrangement.is_reversed.contains(&true) && arrangement.is_reversed.contains(&false);
            let order = &arrangement.order;
            let of = |products: &Delayed| {
                let is_yaw = !is_mixed || products.parts.iter().all(|part| part.are_torques(&effect, order));
                let shares = |part: &Products| part.shares(&effect, order, is_yaw);
                let directed = |part: &Products| shares(part).iter().sum();
                let parts = products.parts.each_ref().map(directed);
                // The opposite direction explains nothing.
                let explained = shares(&products.whole).iter().map(|share| share.max(0.0)).sum::<f64>();
                (explained, Directed { whole: directed(&products.whole), parts })
            };
            let none = (0.0, Directed::default());
            products.iter().map(of).fold(none, |best, found| if found.0 > best.0 { found } else { best })
        };
        let arrangements = Arrangement::all(evidence.model.vehicle.rotors.len()).into_iter();
        let (all, directed) = arrangements
            .map(|one| {
                let (whole, directed) = score(&one);
                ((whole, one), directed)
            })
            .unzip();
        Some(Self { all, directed })
    }

    /// The fault of a channel that stands on another clock than the motion, by more than [`LATE_S`].
    fn apart(&self, evidence: &Evidence, drive: Drive) -> Option<Fault> {
        let within = self.all.iter().map(|(score, _)| *score).fold(0.0, f64::max);
        let turning = evidence.measured(Equation::AngularAcceleration)?;
        let effect = effects_of_squares(evidence, 1.0);
        let order: Vec<usize> = (0..effect.len()).collect();
        let step_s = evidence.flight.layout.clock.step_s;
        let [late_max, far] = [LATE_S, APART_S].map(|time_s| (time_s / step_s).round() as isize);
        let shares = |late: isize| {
            let products = products_of(&rows_at(evidence, drive, &turning, late), effect.len());
            products.shares(&effect, &order, true).map(|share| share.max(0.0))
        };
        let sum = |shares: &[f64; 3]| shares.iter().sum::<f64>();
        let best_of = |lates: RangeInclusive<isize>| {
            lates.map(|late| (late, shares(late))).max_by(|a, b| sum(&a.1).total_cmp(&sum(&b.1)))
        };
        // Where the declared order explains most, and less just outside, nothing is to be looked for far away.
        let near = best_of(-ASIDE..=late_max + ASIDE)?;
        if (0..=late_max).contains(&near.0) && sum(&near.1) > within - ALIKE {
            return None;
        }
        let (late, explained) = best_of(-far..=far)?;
        let best = sum(&explained);
        if best < APART_SHARE * AXES {
            return None;
        }
        let changed = |late: isize| {
            let products = products_of(&changes(&rows_at(evidence, drive, &turning, late)), effect.len());
            products.shares(&effect, &order, true).map(|share| share.max(0.0))
        };
        let level_late = summit(late, |late| level(&changed(late), &explained));
        let is_outside = is_outside([late as f64, level_late], late_max);
        let is_all_tried = effect.len() <= ALL_MAX;
        let is_clear = best > within + MORE || (is_outside && is_all_tried && best > within + MORE_OUTSIDE);
        if !is_clear {
            return None;
        }
        let late_s = step_s * level_late;
        let percent = |score: f64| 100.0 * score / AXES;
        Some(Fault {
            flight: evidence.flight.flight.name.clone(),
            channel: drive.name().to_owned(),
            kind: "other-clock",
            expected: format!(
                "the motion to follow within {LATE_S} s, where no order of the rotors explains more than {:.0} % of the angular \
                 accelerations",
                percent(within)
            ),
            found: format!(
                "that the declared one explains {:.0} % if its times are {:.3} s {}: `delay_s` of about {:.3}",
                percent(best),
                late_s.abs(),
                if late_s < 0.0 { "earlier" } else { "later" },
                -late_s
            ),
            consequence: drive.part().consequence(),
            advice: drive.clock_advice(),
        })
    }

    /// Gain of an arrangement over the declared one.
    fn gain(&self, at: usize) -> f64 {
        self.all[at].0 - self.all[0].0
    }

    /// The arrangement that is clearly better than the declared one.
    fn clearly_better(&self) -> Option<usize> {
        let all: Vec<_> = self.all.iter().map(|(score, arrangement)| (*score, arrangement)).collect();
        let best = simplest_of_best(&all, ALIKE)?;
        let left = |at: usize| AXES - self.all[at].0;
        let is_clear =
            self.gain(best) > MORE || (self.gain(best) > MORE_OF_LITTLE && left(best) < LEFT * left(0));
        is_clear.then_some(best)
    }

    fn fault(&self, evidence: &Evidence, drive: Drive, at: usize) -> Fault {
        let (declared, (best, found)) = (self.all[0].0, &self.all[at]);
        // Of more rotors the right order may be none of those that were tried.
        let is_named = found.order.len() <= ALL_MAX || AXES - best < LEFT_UNTRIED * AXES;
        let (channel, kind) = match &found.moved()[..] {
            [] => (drive.name().to_owned(), "reversed-spins"),
            _ if !is_named => (drive.name().to_owned(), "swapped"),
            moved => (format!("{}.{}", drive.name(), moved.join("+")), "swapped"),
        };
        let percent = |score: f64| 100.0 * score / AXES;
        let rotors = &evidence.model.vehicle.rotors;
        let found = if is_named {
            format!("that {} explains {:.0} %", found.text(rotors), percent(*best))
        } else {
            format!(
                "that none of those that were tried (two exchanged, or begun at another rotor) explains more than {:.0} %",
                percent(*best)
            )
        };
        Fault {
            flight: evidence.flight.flight.name.clone(),
            channel,
            kind,
            expected: format!(
                "the order and the spins of the vehicle file's rotors, which explain {:.0} % of the angular accelerations",
                percent(declared)
            ),
            found,
            consequence: drive.part().consequence(),
            advice: drive.advice(),
        }
    }
}

/// Share of the angular accelerations that shows the time: about roll and pitch, where these explain something. Yaw is left out, as the torque
/// that speeds a rotor up is not in the regression. In simulated flights all three axes gave times 0.03 s too great, roll and pitch 0.016 s too small.
fn level(shares: &[f64; 3], at_best: &[f64; 3]) -> f64 {
    let is_level = at_best[0] + at_best[1] > at_best[2];
    if is_level { shares[0] + shares[1] } else { shares.iter().sum() }
}

/// True if one of these times, in steps, lies beyond the delays that are tried. All axes together show times that are too near for early commands,
/// roll and pitch show nearer to the right ones.
fn is_outside(lates: [f64; 2], late_max: isize) -> bool {
    let farthest = (late_max + ASIDE) as f64;
    lates.iter().any(|late| late.abs() > farthest)
}

/// Changes from each row to the next, in which slow torques that no rotor makes count little. In simulated flights the times of roll and
/// pitch are 0.011 s too small by them, 0.016 s by the rows themselves; the cause of the rest is not known.
fn changes(rows: &[Row]) -> Vec<Row> {
    let change = |pair: &[Row]| {
        let [(turned, squares), (next_turned, next_squares)] = [pair[0], pair[1]];
        let turning = std::array::from_fn(|axis| next_turned[axis] - turned[axis]);
        (turning, std::array::from_fn(|rotor| next_squares[rotor] - squares[rotor]))
    };
    rows.windows(2).map(change).collect()
}

/// The place of the summit of `height` next to `from`, between whole numbers by the parabola through three of them.
fn summit(from: isize, height: impl Fn(isize) -> f64) -> f64 {
    let mut at = from;
    for _ in 0..SUMMIT_STEPS {
        let [below, here, above] = [height(at - 1), height(at), height(at + 1)];
        if here >= below && here >= above {
            let bend = below - 2.0 * here + above;
            return at as f64 + if bend < 0.0 { (below - above) / (2.0 * bend) } else { 0.0 };
        }
        at += if above > below { 1 } else { -1 };
    }
    at as f64
}

/// Most rotors of which all orders and all spins are tried.
const ALL_MAX: usize = 4;
/// Most spins of more rotors that are reversed together, but for all of them.
const REVERSED_MAX: u32 = 2;

/// The spins that are tried, true for a reversed one; the declared ones first.
fn spins(rotors: usize) -> Vec<Vec<bool>> {
    let is_tried = |code: &u32| {
        let reversed = code.count_ones();
        rotors <= ALL_MAX || reversed <= REVERSED_MAX || reversed as usize == rotors
    };
    let codes = (0..1_u32 << rotors).filter(is_tried);
    codes.map(|code| (0..rotors).map(|rotor| code >> rotor & 1 == 1).collect()).collect()
}

/// The orders that are tried, the declared one first.
fn orders(rotors: usize) -> Vec<Vec<usize>> {
    let declared: Vec<usize> = (0..rotors).collect();
    if rotors <= ALL_MAX {
        let code =
            |code: usize| (0..rotors).rev().map(move |at| code / rotors.pow(at as u32) % rotors).collect();
        let all = (0..rotors.pow(rotors as u32)).map(code);
        return all.filter(|order: &Vec<usize>| declared.iter().all(|rotor| order.contains(rotor))).collect();
    }
    let begun_later = (0..rotors).map(|by| {
        let mut order = declared.clone();
        order.rotate_left(by);
        order
    });
    let exchanged = (0..rotors).flat_map(|b| (0..b).map(move |a| (a, b))).map(|(a, b)| {
        let mut order = declared.clone();
        order.swap(a, b);
        order
    });
    begun_later.chain(exchanged).collect()
}

/// Angular acceleration per squared speed, one vector for each rotor; `spins` of -1 reverses them.
fn effects_of_squares(evidence: &Evidence, spins: f64) -> Vec<Vector3<f64>> {
    let vehicle = &evidence.model.vehicle;
    let inverse = vehicle.inertia_kg_m2.try_inverse().unwrap_or_else(nalgebra::Matrix3::identity);
    let of_rotor = |rotor: &Rotor| {
        let thrust = vehicle.thrust_coefficient * rotor.axis;
        let drag = spins * rotor.spin * rotor.torque_scale * vehicle.torque_coefficient * rotor.axis;
        inverse * (rotor.position_m.cross(&thrust) - drag)
    };
    vehicle.rotors.iter().map(of_rotor).collect()
}

/// Sums of products of angular accelerations and squared speeds, without their means.
struct Products {
    turning: [f64; 3],
    both: [EachRotor; 3],
    squares: [EachRotor; ROTORS_MAX],
}

impl Products {
    /// Shares of the angular accelerations about each axis that the commands in `order` explain, negative where they ask for the
    /// opposite direction; 0 for yaw without it.
    fn shares(&self, effect: &[Vector3<f64>], order: &[usize], with_yaw: bool) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let (both, size) = self.regression(effect, order, axis);
            let whole = size * self.turning[axis];
            if whole > 0.0 && (axis < 2 || with_yaw) { both * both.abs() / whole } else { 0.0 }
        })
    }

    /// True if the angular accelerations about yaw are as large as the torques by the vehicle file make them, beside those about roll and pitch.
    fn are_torques(&self, effect: &[Vector3<f64>], order: &[usize]) -> bool {
        let [(x, of_x), (y, of_y), (yaw, of_yaw)] =
            [0, 1, 2].map(|axis| self.regression(effect, order, axis));
        let larger = yaw / of_yaw * (of_x + of_y) / (x + y);
        (1.0 / SIZE_TOLERANCE..SIZE_TOLERANCE).contains(&larger)
    }

    /// Products of the angular accelerations about an axis with what the commands in `order` ask for, and of that with itself.
    fn regression(&self, effect: &[Vector3<f64>], order: &[usize], axis: usize) -> (f64, f64) {
        let rotors = || 0..order.len();
        let by = |rotor: usize| effect[rotor][axis];
        let both: f64 = rotors().map(|rotor| by(rotor) * self.both[axis][order[rotor]]).sum();
        let size: f64 = rotors()
            .flat_map(|a| rotors().map(move |b| (a, b)))
            .map(|(a, b)| by(a) * by(b) * self.squares[order[a]][order[b]])
            .sum();
        (both, size)
    }
}

/// Angular accelerations and squared speeds at a knot.
type Row = ([f64; 3], EachRotor);

/// Products at one delay of the commands: of the whole flight, and of its parts.
struct Delayed {
    whole: Products,
    parts: [Products; PARTS],
}

/// Parts of a flight in each of which some reversed spins have to make torques of the right size.
const PARTS: usize = 3;

/// Products for every delay of the commands.
fn products(evidence: &Evidence, drive: Drive) -> Option<Vec<Delayed>> {
    let turning = evidence.measured(Equation::AngularAcceleration)?;
    let flight = &*evidence.flight.flight;
    let is_absent =
        if drive == Drive::Command { flight.command.is_empty() } else { flight.rotor_speed.is_empty() };
    if is_absent || evidence.flight.is_assumed() {
        return None;
    }
    let late_max = (LATE_S / evidence.flight.layout.clock.step_s).round() as isize;
    Some((0..=late_max).map(|late| products_at(evidence, drive, &turning, late)).collect())
}

/// Angular accelerations and the squared speeds `late` instants before them.
fn rows_at(evidence: &Evidence, drive: Drive, turning: &[Vec<f64>], late: isize) -> Vec<Row> {
    let knots = evidence.flight.layout.knots.iter().enumerate();
    knots
        .filter_map(|(at, knot)| {
            let turned = std::array::from_fn(|axis| turning[axis][at]);
            let squares = match drive {
                Drive::Command => evidence.commanded_squares(*knot, late)?,
                Drive::RotorSpeed => evidence.measured_squares(*knot, late)?,
            };
            Some((turned, squares))
        })
        .collect()
}

fn products_at(evidence: &Evidence, drive: Drive, turning: &[Vec<f64>], late: isize) -> Delayed {
    let rows = rows_at(evidence, drive, turning, late);
    let rotors = evidence.model.vehicle.rotors.len();
    let part = |number: usize| &rows[number * rows.len() / PARTS..(number + 1) * rows.len() / PARTS];
    Delayed {
        whole: products_of(&rows, rotors),
        parts: std::array::from_fn(|number| products_of(part(number), rotors)),
    }
}

fn products_of(rows: &[Row], rotors: usize) -> Products {
    let count = rows.len().max(1) as f64;
    let middle = |of: &dyn Fn(&Row) -> f64| rows.iter().map(of).sum::<f64>() / count;
    let turned: [f64; 3] = std::array::from_fn(|axis| middle(&|row| row.0[axis]));
    let speeds: EachRotor = std::array::from_fn(|rotor| middle(&|row| row.1[rotor]));
    let mut sums = Products {
        turning: [0.0; 3],
        both: [[0.0; ROTORS_MAX]; 3],
        squares: [[0.0; ROTORS_MAX]; ROTORS_MAX],
    };
    for (turning, squares) in rows {
        let a: [f64; 3] = std::array::from_fn(|axis| turning[axis] - turned[axis]);
        let s: EachRotor = std::array::from_fn(|rotor| squares[rotor] - speeds[rotor]);
        for (axis, turned) in a.iter().enumerate() {
            sums.turning[axis] += turned * turned;
            (0..rotors).for_each(|rotor| sums.both[axis][rotor] += turned * s[rotor]);
        }
        (0..rotors).for_each(|i| (0..rotors).for_each(|j| sums.squares[i][j] += s[i] * s[j]));
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::{Arrangement, is_outside};

    /// Steps of 6 ms: commands that are early by 0.25 s agree best at 0.22 s about all axes together.
    #[test]
    fn one_of_two_times_lies_outside() {
        assert!(
            is_outside([37.0, 41.5], 33) && is_outside([-41.0, -36.0], 33) && is_outside([50.0, 50.0], 33)
        );
        assert!(
            !is_outside([37.0, 36.5], 33) && !is_outside([-37.0, 37.0], 33) && !is_outside([0.0, 2.5], 33)
        );
    }

    #[test]
    fn all_arrangements_of_four_rotors_and_some_of_more() {
        let of_more = |rotors: usize| {
            let pairs = rotors * (rotors - 1) / 2;
            (rotors + pairs) * (1 + rotors + pairs + 1)
        };
        for (rotors, count) in [(1, 2), (3, 48), (4, 384), (6, of_more(6)), (12, of_more(12))] {
            let all = Arrangement::all(rotors);
            assert_eq!(all.len(), count);
            assert_eq!(all[0].order, (0..rotors).collect::<Vec<_>>());
            assert_eq!(all[0].is_reversed, vec![false; rotors]);
            for one in &all {
                let mut sorted = one.order.clone();
                sorted.sort_unstable();
                assert_eq!(sorted, all[0].order);
            }
        }
    }

    #[test]
    fn the_fewest_changes_say_what_is_wrong() {
        let changes = |order: [usize; 4], is_reversed: [bool; 4]| {
            Arrangement { order: order.to_vec(), is_reversed: is_reversed.to_vec() }.changes()
        };
        assert_eq!(changes([0, 1, 2, 3], [false; 4]), 0);
        assert_eq!(changes([0, 1, 2, 3], [true; 4]), 1);
        assert_eq!(changes([0, 1, 2, 3], [true, false, true, false]), 2);
        assert_eq!(changes([1, 0, 2, 3], [true, false, false, false]), 3);
    }
}
