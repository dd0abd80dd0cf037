//! The impulses of contacts that push each other, found together: what the sweeps of `solver` need too long for.
//!
//! With friction cones scaled to be their own duals, and a shift of each rate along its normal by μ times the slip, Coulomb's
//! and Signorini's laws say that impulse and shifted rate lie in the cone and are orthogonal (G. De Saxcé and Z.-Q. Feng, The
//! bipotential method, 1998). For a given shift that is a convex problem, which an interior-point method solves however far
//! apart the masses are (Mehrotra's predictor and corrector, in the scaling of Nesterov and Todd); the shift is then found by
//! fixed-point iteration (F. Cadoux, An optimization-based algorithm for Coulomb's frictional contact, 2009). Whatever the
//! shift, the impulses make no energy.
//!
//! Unknowns are the bodies' twists in units of the square root of energy, so that a matrix has six rows for each body, and
//! masses do not show in it.

use super::cholesky::{factorise, substitute};
use super::cone::{self, Scaling};
use super::solver::{Bilateral, Body, Row, Unilateral};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// No place among the unknowns: a body that nothing moves.
const FIXED: usize = usize::MAX;

/// A coefficient of friction below this is none.
const FRICTIONLESS: f64 = 1e-6;

/// Steps of the interior-point method for one shift. Tuned, no source.
const STEPS_MAX: usize = 60;

/// Times that the shift is found anew. Tuned, no source.
const SHIFTS_MAX: usize = 60;

/// Part of the way to the cone's surface that a step goes.
const SHORT_OF_SURFACE: f64 = 0.99;

/// What keeps the impulses of redundant contacts from drifting, against the inverse mass of a contact. Tuned, no source.
const PROXIMAL: f64 = 1e-11;

/// What the residuals are to be below, against the greatest rate. Tuned, no source.
const EXACT: f64 = 1e-13;

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
    /// Where the change is not what the impulses make.
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

    /// Adds `weight` times the product of this row with `other` to the lower triangle of the matrix.
    fn add_product(&self, other: &Self, weight: f64, matrix: &mut [f64], count: usize) {
        for (place, way) in self.places.iter().zip(&self.ways).filter(|(place, _)| **place != FIXED) {
            let others = other.places.iter().zip(&other.ways);
            for (other_place, other_way) in others.filter(|(other, _)| *other <= place) {
                for row in 0..6 {
                    for column in 0..6 {
                        matrix[(6 * place + row) * count + 6 * other_place + column] +=
                            weight * way[row] * other_way[column];
                    }
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
    z: Vector3<f64>,
    s: Vector3<f64>,
    /// By how much `s` is not what the twists make.
    off: Vector3<f64>,
    scaling: Scaling,
    inverse: Matrix3<f64>,
    scaled: Vector3<f64>,
    wanted: Vector3<f64>,
    step_z: Vector3<f64>,
    step_s: Vector3<f64>,
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

    /// How fast it slips with this change of the twists.
    fn slip(&self, change: &[f64]) -> f64 {
        (self.rates(change) + self.free).yz().norm()
    }
}

impl Direct {
    /// Finds the impulses of the constraints that `is_asked` and of the joints between bodies that the former push, for
    /// bodies that move as `all` without impulses and have the mobilities of `mobile`. Returns whether they were found.
    pub(super) fn solve(
        &mut self,
        all: &mut [Body],
        mobile: &[Body],
        constraints: &mut [Unilateral],
        is_asked: impl Fn(&Unilateral) -> bool,
        joints: &[Bilateral],
    ) -> bool {
        self.place(mobile, constraints, &is_asked, joints);
        self.lay(all, constraints, &is_asked, joints);
        let is_found = self.find();
        if is_found {
            self.hand_out(all, constraints);
        }
        is_found
    }

    /// Gives a place to each body that one of the constraints moves, or a joint of such a body.
    fn place(
        &mut self,
        mobile: &[Body],
        constraints: &[Unilateral],
        is_asked: impl Fn(&Unilateral) -> bool,
        joints: &[Bilateral],
    ) {
        self.places.clear();
        self.places.resize(mobile.len(), FIXED);
        self.roots.clear();
        let mut add = |places: &mut Vec<usize>, body: usize| {
            if places[body] == FIXED && mobile[body].mobility != Matrix6::zeros() {
                places[body] = self.roots.len();
                self.roots.push(root(&mobile[body].mobility));
            }
        };
        for constraint in constraints.iter().filter(|constraint| is_asked(constraint)) {
            constraint.normal.bodies.iter().for_each(|body| add(&mut self.places, *body));
        }
        // Through chains of joints.
        loop {
            let before = self.places.iter().filter(|place| **place != FIXED).count();
            for joint in joints {
                let bodies = joint.rows[0].bodies;
                if bodies.iter().any(|body| self.places[*body] != FIXED) {
                    bodies.iter().for_each(|body| add(&mut self.places, *body));
                }
            }
            if self.places.iter().filter(|place| **place != FIXED).count() == before {
                break;
            }
        }
    }

    fn line(&self, row: &Row, scale: f64) -> Line {
        let places = row.bodies.map(|body| self.places[body]);
        let way = |at: usize| match places[at] {
            FIXED => Vector6::zeros(),
            place => self.roots[place].tr_mul(&row.jacobian[at]) * scale,
        };
        Line { places, ways: [way(0), way(1)] }
    }

    fn lay(
        &mut self,
        all: &[Body],
        constraints: &[Unilateral],
        is_asked: impl Fn(&Unilateral) -> bool,
        joints: &[Bilateral],
    ) {
        let mut cones = std::mem::take(&mut self.cones);
        cones.clear();
        let asked = constraints.iter().enumerate().filter(|(_, constraint)| is_asked(constraint));
        cones.extend(asked.filter_map(|(number, constraint)| self.cone(all, number, constraint)));
        self.cones = cones;
        let mut ties = std::mem::take(&mut self.ties);
        ties.clear();
        let rows = joints.iter().flat_map(|joint| &joint.rows[..joint.count]);
        let rows = rows.filter(|row| row.bodies.iter().any(|body| self.places[*body] != FIXED));
        ties.extend(rows.map(|row| {
            let line = self.line(row, 1.0);
            let scale = inverse_mass(&line).sqrt().recip();
            Tie { line: self.line(row, scale), free: row.rate(all) * scale, impulse: 0.0 }
        }));
        self.ties = ties;
    }

    fn cone(&self, all: &[Body], number: usize, constraint: &Unilateral) -> Option<Cone> {
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
            shift: 0.0,
            z: zeros,
            s: zeros,
            off: zeros,
            scaling: Scaling::new(&cone::unit(), &cone::unit())?,
            inverse: Matrix3::identity(),
            scaled: zeros,
            wanted: zeros,
            step_z: zeros,
            step_s: zeros,
        })
    }

    /// Finds shifts that are what they lead to.
    fn find(&mut self) -> bool {
        let mut before = f64::INFINITY;
        for round in 0..SHIFTS_MAX {
            let (is_found, steps) = self.find_shifted();
            let scale = self.greatest();
            let mut most = 0.0_f64;
            for cone in &mut self.cones {
                let slip = cone.slip(&self.change);
                most = most.max((slip - cone.shift).abs());
                cone.shift = slip;
            }
            if std::env::var("TRACE").is_ok() { eprintln!("round {round}: found {is_found} steps {steps} shift off {most:e} of {scale:e}"); }
            if !is_found { return false; }
            if most <= 1e-11 * scale { return true; }
            before = most;
        }
        let _ = before;
        false
    }

    fn greatest(&self) -> f64 {
        self.cones.iter().map(|cone| cone.free.amax()).fold(1e-9, f64::max)
    }

    /// The interior-point method for the shifts as they are.
    fn find_shifted(&mut self) -> (bool, usize) {
        let count = 6 * self.roots.len();
        let scale = self.greatest();
        for buffer in [&mut self.change, &mut self.step, &mut self.off] {
            buffer.clear();
            buffer.resize(count, 0.0);
        }
        for cone in &mut self.cones {
            (cone.z, cone.s) = (cone::unit() * scale, cone::unit() * scale);
        }
        self.ties.iter_mut().for_each(|tie| tie.impulse = 0.0);
        for steps in 0..STEPS_MAX {
            let (residual, gap) = self.residuals();
            if std::env::var("TRACE").is_ok_and(|it| it == "2") { eprintln!("   step {steps}: residual {residual:e} gap {gap:e} scale {scale:e}"); }
            if residual <= EXACT * scale * 10.0 && gap <= EXACT * EXACT * scale * scale {
                return (true, steps);
            }
            if !self.scale() {
                return (residual <= 1e-10 * scale && gap <= 1e-20 * scale * scale, steps);
            }
            self.factorise(count);
            for cone in &mut self.cones {
                cone.wanted = -cone.scaled;
            }
            self.newton();
            let most = self.longest_step().min(1.0);
            let centring = (1.0 - most) * (1.0 - most) * (1.0 - most) * gap;
            for cone in &mut self.cones {
                let bent = cone::product(
                    &cone.scaling.divides(&cone.step_s),
                    &cone.scaling.times(&cone.step_z),
                );
                let wanted = cone::unit() * centring - bent - cone::product(&cone.scaled, &cone.scaled);
                cone.wanted = cone::quotient(&wanted, &cone.scaled);
            }
            self.newton();
            let length = (SHORT_OF_SURFACE * self.longest_step()).min(1.0);
            self.advance(length);
        }
        (false, STEPS_MAX)
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
            cone.inverse = scaling.inverse_square(PROXIMAL);
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
            for (row, line) in cone.lines.iter().enumerate() {
                for (column, other) in cone.lines.iter().enumerate() {
                    line.add_product(other, cone.inverse[(row, column)], matrix, count);
                }
            }
        }
        for tie in &self.ties {
            tie.line.add_product(&tie.line, PROXIMAL.recip(), matrix, count);
        }
        factorise(matrix, count, |left, _| left.max(1.0));
    }

    /// Newton's step to the wanted products.
    fn newton(&mut self) {
        self.step.clone_from(&self.off);
        for cone in &mut self.cones {
            cone.wanted = cone.scaling.times(&cone.wanted);
            let push = cone.inverse * (cone.wanted - cone.off);
            cone.push(&mut self.step, &push);
        }
        for tie in &self.ties {
            let push = -(tie.line.rate(&self.change) + tie.free) / PROXIMAL;
            tie.line.push(&mut self.step, push);
        }
        substitute(&self.matrix, &mut self.step);
        for cone in &mut self.cones {
            let rates = cone.rates(&self.step);
            cone.step_z = cone.inverse * (cone.wanted - cone.off - rates);
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

    /// Gives the impulses to the constraints, and what they do to the bodies.
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
