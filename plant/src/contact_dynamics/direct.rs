//! The impulses of contacts that push each other, found together where the sweeps of `solver` do not converge.
//!
//! Friction cones are scaled to be their own duals, and each rate is shifted along its normal by μ times the
//! slip. Then Coulomb's and Signorini's laws say that impulse and shifted rate lie in the cone and are
//! orthogonal (G. De Saxcé and Z.-Q. Feng, The bipotential method, 1998). For a given shift that is a convex
//! problem. An interior-point method solves it for any ratio of the masses (Mehrotra's predictor and corrector,
//! in the scaling of Nesterov and Todd). The shift is then found by fixed-point iteration (F. Cadoux, An
//! optimization-based algorithm for Coulomb's frictional contact, 2009). The impulses make no energy at any
//! shift.
//!
//! Unknowns are the bodies' twists in units of the square root of energy. So a matrix has six rows for each body, and
//! masses do not show in it.

use super::cholesky::{factorise, substitute};
use super::cone::{self, Scaling};
use super::solver::{Bilateral, Body, Row, Unilateral};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// No place among the unknowns: a body that nothing moves.
const FIXED: usize = usize::MAX;

/// A coefficient of friction below this counts as zero.
const FRICTIONLESS: f64 = 1e-6;

/// Steps of the interior-point method for one shift. Tuned, no source.
const STEPS_MAX: usize = 60;

/// Times that the shift is found anew. Tuned, no source.
const SHIFTS_MAX: usize = 60;

/// Part of the way to the cone's surface that a step goes.
const SHORT_OF_SURFACE: f64 = 0.99;

/// Weight that keeps the impulses of redundant contacts from drifting, against the inverse mass of a contact. Tuned, no source.
const PROXIMAL: f64 = 1e-11;

/// Bound of the residuals, against the greatest rate or impulse. Tuned, no source.
const EXACT: f64 = 1e-12;

/// Bound of the residuals where rounding lets them come no nearer: several contacts between two faces may share a load in
/// any way, and then the matrix is nearly singular. Tuned, no source.
const NEARLY_EXACT: f64 = 1e-9;

/// Steps without half the residual after which only rounding is left. Tuned, no source.
const STALLED_STEPS: usize = 5;

/// Bound of the error of the shifts. Tuned, no source.
const SHIFT_EXACT_M_S: f64 = 1e-9;

/// Number of rounds from which the next shifts are extrapolated.
const DEPTH: usize = 3;

/// Factors of the damping where shifts come nearer and where they do not, and its bound. Tuned, no source.
const DAMPING_GROWS: f64 = 1.5;
const DAMPING_FALLS: f64 = 0.5;
const DAMPING_MIN: f64 = 0.05;

/// Part of the greatest change that regularises the extrapolation. Tuned, no source.
const REGULAR: f64 = 1e-9;

/// The buffers of the solution.
#[derive(Default)]
pub(super) struct Direct {
    /// Place of each body among the unknowns.
    places: Vec<usize>,
    /// For each place the lower triangular root of the body's mobility.
    roots: Vec<Matrix6<f64>>,
    cones: Vec<Cone>,
    ties: Vec<Tie>,
    matrix: Vec<f64>,
    /// The change of the twists by impulses, in units of the square root of energy, and its last step.
    change: Vec<f64>,
    step: Vec<f64>,
    /// Difference between the change that the impulses make and the change.
    off: Vec<f64>,
}

/// A row of a contact or a joint.
#[derive(Debug, Clone, Copy)]
struct Line {
    places: [usize; 2],
    ways: [Vector6<f64>; 2],
}

impl Line {
    fn rate(&self, change: &[f64]) -> f64 {
        let mut rate = 0.0;
        for (place, way) in self.places.iter().zip(&self.ways).filter(|(place, _)| **place != FIXED) {
            rate += (0..6).map(|at| way[at] * change[6 * place + at]).sum::<f64>();
        }
        rate
    }

    fn push(&self, change: &mut [f64], impulse: f64) {
        for (place, way) in self.places.iter().zip(&self.ways).filter(|(place, _)| **place != FIXED) {
            (0..6).for_each(|at| change[6 * place + at] += way[at] * impulse);
        }
    }

    /// Adds `weight` times this row's square to the lower triangle of the matrix.
    fn add_square(&self, weight: f64, matrix: &mut [f64], count: usize) {
        for (place, way) in self.places.iter().zip(&self.ways).filter(|(place, _)| **place != FIXED) {
            let others = self.places.iter().zip(&self.ways);
            for (other_place, other_way) in others.filter(|(other, _)| *other <= place) {
                for row in 0..6 {
                    let start = (6 * place + row) * count + 6 * other_place;
                    let cells = matrix[start..start + 6].iter_mut();
                    cells.zip(other_way.iter()).for_each(|(cell, other)| *cell += weight * way[row] * other);
                }
            }
        }
    }
}

/// A joint's row.
struct Tie {
    line: Line,
    free: f64,
    impulse: f64,
}

/// A contact or a stop, scaled: its cone is its own dual, and its inverse mass about 1.
struct Cone {
    /// Its place among the constraints.
    constraint: usize,
    /// Normal and friction; zero where there is none.
    lines: [Line; 3],
    /// Takes scaled impulses to impulses, and rates to scaled rates.
    scale: Vector3<f64>,
    /// The rate less the bound, without impulses; along the normal without the shift.
    free: Vector3<f64>,
    shift: f64,
    /// The shift that came nearest to the slip that it led to.
    nearest: f64,
    history: History,
    z: Vector3<f64>,
    s: Vector3<f64>,
    /// Difference between `s` and the value that the twists make.
    off: Vector3<f64>,
    scaling: Scaling,
    /// The eigenvectors of the scaling's square, and the inverses of what it is in the matrix.
    ways: [Vector3<f64>; 3],
    weights: [f64; 3],
    scaled: Vector3<f64>,
    wanted: Vector3<f64>,
    step_z: Vector3<f64>,
    step_s: Vector3<f64>,
}

/// A shift in the last rounds, the newest first.
#[derive(Debug, Clone, Copy, Default)]
struct History {
    shift: f64,
    /// Slip that it led to, less the shift.
    off: f64,
    /// Changes of both in each round.
    by: [f64; DEPTH],
    off_by: [f64; DEPTH],
}

impl History {
    fn note(&mut self, shift: f64, off: f64) {
        self.by.rotate_right(1);
        self.off_by.rotate_right(1);
        (self.by[0], self.off_by[0]) = (shift - self.shift, off - self.off);
        (self.shift, self.off) = (shift, off);
    }
}

impl Cone {
    fn rates(&self, change: &[f64]) -> Vector3<f64> {
        Vector3::from(self.lines.each_ref().map(|line| line.rate(change)))
    }

    fn push(&self, change: &mut [f64], impulse: &Vector3<f64>) {
        for (line, impulse) in self.lines.iter().zip(impulse) {
            line.push(change, *impulse);
        }
    }

    /// `wanted` divided by the scaling's square.
    fn weigh(&self, wanted: &Vector3<f64>) -> Vector3<f64> {
        self.ways.iter().zip(self.weights).map(|(way, weight)| way * (weight * way.dot(wanted))).sum()
    }

    /// The row along `way` between its three rows.
    fn line_along(&self, way: &Vector3<f64>) -> Line {
        let along = |at: usize| (0..3).map(|row| self.lines[row].ways[at] * way[row]).sum();
        Line { ways: [along(0), along(1)], ..self.lines[0] }
    }

    /// Speed of the slip with this change of the twists, scaled.
    fn slip(&self, change: &[f64]) -> f64 {
        (self.rates(change) + self.free).yz().norm()
    }
}

impl Direct {
    /// Finds the impulses of an island, whose bodies are those that `is_in`: they move as `all` without impulses, and have
    /// the mobilities of `mobile`. The search begins with `slips_m_s`, guesses of how fast each constraint slips.
    pub(super) fn solve(
        &mut self,
        all: &mut [Body],
        mobile: &[Body],
        constraints: &mut [Unilateral],
        joints: &[Bilateral],
        slips_m_s: &[f64],
        is_in: impl Fn(usize) -> bool,
    ) {
        self.places.clear();
        self.roots.clear();
        for (number, body) in mobile.iter().enumerate() {
            let place = if is_in(number) { self.roots.len() } else { FIXED };
            self.places.push(place);
            if place != FIXED {
                self.roots.push(root(&body.mobility));
            }
        }
        self.lay(all, constraints, joints, slips_m_s);
        self.find();
        self.hand_out(all, constraints);
    }

    fn line(&self, row: &Row, scale: f64) -> Line {
        let places = row.bodies.map(|body| self.places[body]);
        let way = |at: usize| match places[at] {
            FIXED => Vector6::zeros(),
            place => self.roots[place].tr_mul(&row.jacobian[at]) * scale,
        };
        Line { places, ways: [way(0), way(1)] }
    }

    fn lay(&mut self, all: &[Body], constraints: &[Unilateral], joints: &[Bilateral], slips_m_s: &[f64]) {
        let (mut cones, mut ties) = (std::mem::take(&mut self.cones), std::mem::take(&mut self.ties));
        cones.clear();
        let numbered = constraints.iter().zip(slips_m_s).enumerate();
        let asked = numbered.filter(|(_, (it, _))| it.bound_m_s > f64::NEG_INFINITY);
        cones.extend(asked.filter_map(|(number, (it, slip_m_s))| self.cone(all, number, it, *slip_m_s)));
        ties.clear();
        let rows = joints.iter().flat_map(|joint| &joint.rows[..joint.count]);
        ties.extend(rows.filter_map(|row| {
            let inverse_mass = inverse_mass(&self.line(row, 1.0));
            let scale = if inverse_mass > 0.0 { inverse_mass.sqrt().recip() } else { return None };
            Some(Tie { line: self.line(row, scale), free: row.rate(all) * scale, impulse: 0.0 })
        }));
        (self.cones, self.ties) = (cones, ties);
    }

    /// The cone of a constraint; none where it moves no body of the island.
    fn cone(&self, all: &[Body], number: usize, constraint: &Unilateral, slip_m_s: f64) -> Option<Cone> {
        let normal = &constraint.normal;
        let friction = constraint.friction.as_ref().filter(|it| it.coefficient > FRICTIONLESS);
        let rows = friction.map_or([normal; 3], |friction| [normal, &friction.slips[0], &friction.slips[1]]);
        let coefficient = friction.map_or(1.0, |friction| friction.coefficient);
        let has = if friction.is_some() { 1.0 } else { 0.0 };
        let weights = Vector3::new(coefficient.recip(), has, has);
        let inverse_masses = [0, 1, 2].map(|at| inverse_mass(&self.line(rows[at], weights[at])));
        let inverse_mass = inverse_masses.into_iter().fold(0.0, f64::max);
        if inverse_mass <= 0.0 {
            return None;
        }
        let scale = weights / inverse_mass.sqrt();
        let bounds = Vector3::x() * constraint.bound_m_s;
        let rates = Vector3::from(rows.map(|row| row.rate(all))) - bounds;
        let zeros = Vector3::zeros();
        Some(Cone {
            constraint: number,
            lines: [0, 1, 2].map(|at| self.line(rows[at], scale[at])),
            scale,
            free: rates.component_mul(&scale),
            shift: scale.y * slip_m_s,
            nearest: 0.0,
            history: History::default(),
            z: zeros,
            s: zeros,
            off: zeros,
            scaling: Scaling::new(&cone::unit(), &cone::unit())?,
            ways: [zeros; 3],
            weights: [0.0; 3],
            scaled: zeros,
            wanted: zeros,
            step_z: zeros,
            step_s: zeros,
        })
    }

    /// Finds shifts that lead to themselves, by Anderson's acceleration (D. Anderson, Iterative procedures for
    /// nonlinear integral equations, 1965), damped where they go to and fro: a contact that comes to stick or to slip
    /// bends their map. Where none are found, the nearest are taken.
    fn find(&mut self) {
        let (mut known, mut damping) = (0, 1.0_f64);
        let (mut before_m_s, mut least_m_s) = (f64::INFINITY, f64::INFINITY);
        for round in 0..SHIFTS_MAX {
            self.find_shifted();
            let most_m_s = self.note_shifts();
            if most_m_s <= SHIFT_EXACT_M_S {
                return;
            }
            if most_m_s < least_m_s {
                least_m_s = most_m_s;
                self.cones.iter_mut().for_each(|cone| cone.nearest = cone.shift);
            }
            // An extrapolation that made it worse is forgotten. Without one, what made it worse tells the next shift.
            (known, damping) = match (most_m_s < before_m_s, known) {
                (true, _) => ((known + 1).min(round).min(DEPTH), (DAMPING_GROWS * damping).min(1.0)),
                (false, 0) => (1, (DAMPING_FALLS * damping).max(DAMPING_MIN)),
                (false, _) => (0, damping),
            };
            before_m_s = most_m_s;
            self.change_shifts(known, damping);
        }
        self.cones.iter_mut().for_each(|cone| cone.shift = cone.nearest);
        self.find_shifted();
    }

    /// Notes the shifts and the slips that they led to; returns by how much one is off at most.
    fn note_shifts(&mut self) -> f64 {
        let Self { cones, change, .. } = self;
        let off_m_s = cones.iter_mut().map(|cone| {
            let off = cone.slip(change) - cone.shift;
            cone.history.note(cone.shift, off);
            off.abs() / cone.scale.y.max(f64::MIN_POSITIVE)
        });
        off_m_s.fold(0.0, f64::max)
    }

    /// The next shifts, from the changes of the shifts and of their images in the last `known` rounds: the part `damping` of
    /// the way to these.
    fn change_shifts(&mut self, known: usize, damping: f64) {
        let (mut products, mut right) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
        for history in self.cones.iter().map(|cone| &cone.history) {
            for row in 0..known {
                right[row] += history.off_by[row] * history.off;
                (0..known).for_each(|at| products[(row, at)] += history.off_by[row] * history.off_by[at]);
            }
        }
        // Changes in one direction tell nothing new.
        let size = products.diagonal().max().max(f64::MIN_POSITIVE);
        let regular = products / size + Matrix3::identity() * REGULAR;
        let parts = regular.try_inverse().map_or(Vector3::zeros(), |inverse| inverse * (right / size));
        for cone in &mut self.cones {
            let history = &cone.history;
            let back =
                (0..known).map(|at| parts[at] * (history.by[at] + damping * history.off_by[at])).sum::<f64>();
            cone.shift = (cone.shift + damping * history.off - back).max(0.0);
        }
    }

    /// The greatest of the rates and impulses, of contacts and joints.
    fn greatest(&self) -> f64 {
        let touching = self.cones.iter().map(|cone| cone.free.amax().max(cone.z.x));
        let tied = self.ties.iter().map(|tie| tie.free.abs().max(tie.impulse.abs()));
        touching.chain(tied).fold(f64::MIN_POSITIVE, f64::max)
    }

    /// The interior-point method for the shifts as they are.
    fn find_shifted(&mut self) -> usize {
        let count = 6 * self.roots.len();
        for buffer in [&mut self.change, &mut self.step, &mut self.off] {
            buffer.clear();
            buffer.resize(count, 0.0);
        }
        self.cones.iter_mut().for_each(|cone| cone.z = Vector3::zeros());
        let start = cone::unit() * self.greatest();
        self.cones.iter_mut().for_each(|cone| (cone.z, cone.s) = (start, start));
        self.ties.iter_mut().for_each(|tie| tie.impulse = 0.0);
        let (mut least, mut stalled) = (f64::INFINITY, 0);
        for steps in 0..STEPS_MAX {
            let (residual, gap) = self.residuals();
            let left = residual.max(gap.max(0.0).sqrt()) / self.greatest();
            stalled = if left < 0.5 * least { 0 } else { stalled + 1 };
            least = least.min(left);
            let is_stalled = stalled >= STALLED_STEPS && left <= NEARLY_EXACT;
            if left <= EXACT || is_stalled || !self.scale() {
                return steps;
            }
            self.factorise(count);
            for cone in &mut self.cones {
                cone.wanted = -cone.scaled;
            }
            self.newton();
            let most = self.longest_step().min(1.0);
            let centring = (1.0 - most) * (1.0 - most) * (1.0 - most) * gap;
            for cone in &mut self.cones {
                let bent =
                    cone::product(&cone.scaling.divides(&cone.step_s), &cone.scaling.times(&cone.step_z));
                let wanted = cone::unit() * centring - bent - cone::product(&cone.scaled, &cone.scaled);
                cone.wanted = cone::quotient(&wanted, &cone.scaled);
            }
            self.newton();
            let length = (SHORT_OF_SURFACE * self.longest_step()).min(1.0);
            if !length.is_finite() || self.step.iter().any(|step| !step.is_finite()) {
                // A point on the cone's surface by rounding has no scaling: what was found before is as near as it gets.
                return steps;
            }
            self.advance(length);
        }
        STEPS_MAX
    }

    /// Residuals of the equations, and the mean gap of complementarity.
    fn residuals(&mut self) -> (f64, f64) {
        let (mut most, mut gap) = (0.0_f64, 0.0);
        self.off.iter_mut().zip(&self.change).for_each(|(off, change)| *off = -change);
        for cone in &mut self.cones {
            cone.push(&mut self.off, &cone.z);
            cone.off = cone.rates(&self.change) + cone.free + Vector3::x() * cone.shift - cone.s;
            most = most.max(cone.off.amax());
            gap += cone.z.dot(&cone.s);
        }
        for tie in &self.ties {
            tie.line.push(&mut self.off, tie.impulse);
            most = most.max((tie.line.rate(&self.change) + tie.free).abs());
        }
        (self.off.iter().fold(most, |most, off| most.max(off.abs())), gap / self.cones.len().max(1) as f64)
    }

    fn scale(&mut self) -> bool {
        for cone in &mut self.cones {
            let Some(scaling) = Scaling::new(&cone.z, &cone.s) else { return false };
            cone.scaling = scaling;
            cone.scaled = scaling.times(&cone.z);
            let (ways, values) = scaling.square();
            (cone.ways, cone.weights) = (ways, values.map(|value| (value + PROXIMAL).recip()));
        }
        true
    }

    /// The matrix of Newton's step: 1 + Σ Aᵀ P A, whose eigenvalues are at least 1.
    fn factorise(&mut self, count: usize) {
        let matrix = &mut self.matrix;
        matrix.clear();
        matrix.resize(count * count, 0.0);
        (0..count).for_each(|at| matrix[at * count + at] = 1.0);
        for cone in &self.cones {
            for (way, weight) in cone.ways.iter().zip(cone.weights) {
                cone.line_along(way).add_square(weight, matrix, count);
            }
        }
        for tie in &self.ties {
            tie.line.add_square(PROXIMAL.recip(), matrix, count);
        }
        factorise(matrix, count, |left, _| left.max(1.0));
    }

    /// Newton's step to the wanted products.
    fn newton(&mut self) {
        self.step.clone_from(&self.off);
        for cone in &mut self.cones {
            cone.wanted = cone.scaling.times(&cone.wanted);
            let push = cone.weigh(&(cone.wanted - cone.off));
            cone.push(&mut self.step, &push);
        }
        for tie in &self.ties {
            let push = -(tie.line.rate(&self.change) + tie.free) / PROXIMAL;
            tie.line.push(&mut self.step, push);
        }
        substitute(&self.matrix, &mut self.step);
        for cone in &mut self.cones {
            let rates = cone.rates(&self.step);
            cone.step_z = cone.weigh(&(cone.wanted - cone.off - rates));
            cone.step_s = rates + cone.off + cone.step_z * PROXIMAL;
        }
    }

    fn longest_step(&self) -> f64 {
        let each = self.cones.iter().map(|cone| {
            let z = cone::longest_step(&cone.scaled, &cone.scaling.times(&cone.step_z));
            z.min(cone::longest_step(&cone.scaled, &cone.scaling.divides(&cone.step_s)))
        });
        each.fold(f64::INFINITY, f64::min)
    }

    fn advance(&mut self, length: f64) {
        for tie in &mut self.ties {
            let off = tie.line.rate(&self.change) + tie.free + tie.line.rate(&self.step);
            tie.impulse -= length * off / PROXIMAL;
        }
        self.change.iter_mut().zip(&self.step).for_each(|(change, step)| *change += length * step);
        for cone in &mut self.cones {
            cone.z += cone.step_z * length;
            cone.s += cone.step_s * length;
        }
    }

    /// Gives the impulses to the constraints, and their effect to the bodies.
    fn hand_out(&mut self, all: &mut [Body], constraints: &mut [Unilateral]) {
        let change = &mut self.off;
        change.iter_mut().for_each(|it| *it = 0.0);
        for cone in &self.cones {
            cone.push(change, &cone.z);
            let impulse_N_s = cone.z.component_mul(&cone.scale);
            let constraint = &mut constraints[cone.constraint];
            constraint.impulse_N_s = impulse_N_s.x;
            if let Some(friction) = &mut constraint.friction {
                friction.impulses_N_s = impulse_N_s.yz();
            }
        }
        self.ties.iter().for_each(|tie| tie.line.push(change, tie.impulse));
        for (body, place) in all.iter_mut().zip(&self.places).filter(|(_, place)| **place != FIXED) {
            let change = Vector6::from_column_slice(&change[6 * place..6 * place + 6]);
            body.twist += self.roots[*place] * change;
        }
    }
}

fn inverse_mass(line: &Line) -> f64 {
    line.ways[0].norm_squared() + line.ways[1].norm_squared()
}

/// The lower triangular root of a mobility, whose columns are zero where nothing moves.
fn root(mobility: &Matrix6<f64>) -> Matrix6<f64> {
    let mut root = Matrix6::zeros();
    let least = 1e-14 * mobility.amax();
    for column in 0..6 {
        let known = |row: usize| (0..column).map(|at| root[(row, at)] * root[(column, at)]).sum::<f64>();
        let left = mobility[(column, column)] - known(column);
        if left <= least {
            continue;
        }
        let diagonal = left.sqrt();
        let below: [f64; 6] = std::array::from_fn(|row| (mobility[(row, column)] - known(row)) / diagonal);
        (column..6).for_each(|row| root[(row, column)] = below[row]);
    }
    root
}

#[cfg(test)]
mod tests;
