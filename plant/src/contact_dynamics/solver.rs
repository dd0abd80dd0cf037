//! The impulses that unilateral constraints need: contacts and stops.
//!
//! Moreau's time stepping, at the level of velocities (J. J. Moreau, Unilateral contact and dry friction in finite
//! freedom dynamics, 1988): a constraint pushes only as far as its rate would otherwise be below its bound
//! (Signorini's condition). Friction pushes against the slip, at most μ times as hard as the normal
//! (Coulomb's law). Found by projected Gauss-Seidel iteration over the constraints, until nothing changes any
//! more. It relaxes the normal of a contact and then its friction. This is quick, but goes to and fro where
//! friction is about 1 and the arm couples the two. Where that does not settle, each contact's own problem of
//! three impulses is solved as a whole, stick or slip (block Gauss-Seidel: M. Jean, The non-smooth contact
//! dynamics method, 1999).

use nalgebra::{Matrix2, Matrix3, Matrix6, Vector2, Vector3, Vector6};

/// Iterations end when none changes a velocity by more: far below anything measurable, far above rounding.
const SETTLED_M_S: f64 = 1e-11;

/// Iterations that relax normal and friction of a contact one after the other: four feet that slide take about 60.
/// Tuned, no source.
const QUICK_ITERATIONS: usize = 400;

/// A rate that is this far below its bound after those does not come nearer. Tuned, no source.
const TO_AND_FRO_M_S: f64 = 1e-4;

/// Iterations after those, which solve a contact as a whole. Tuned, no source.
const ITERATIONS_MAX: usize = 200;

/// Steps towards the direction in which a contact slips, in one iteration. Tuned, no source.
const SLIP_STEPS: usize = 20;

/// A body as impulses see it, in the world frame. [`Body::default`] is one that nothing moves, such as the world.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Body {
    /// Of the centre of mass, m/s; then the angular velocity, rad/s.
    pub twist: Vector6<f64>,
    /// Takes an impulse at the centre of mass, N s, and an angular one, N m s, to the change of the twist.
    pub mobility: Matrix6<f64>,
}

/// A twist, or an impulse with an angular one.
pub(super) fn join(linear: &Vector3<f64>, angular: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

/// The two parts of what [`join`] made.
pub(super) fn part(joined: &Vector6<f64>) -> [Vector3<f64>; 2] {
    [joined.fixed_rows::<3>(0).into_owned(), joined.fixed_rows::<3>(3).into_owned()]
}

/// One direction in which two bodies push each other: a positive impulse drives the second along it and the first
/// the other way. Its rate is how fast the second leaves the first along it, in m/s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    pub bodies: [usize; 2],
    pub jacobian: [Vector6<f64>; 2],
    /// Change of each body's twist by an impulse of 1 N s.
    answer: [Vector6<f64>; 2],
    /// Change of the rate by that impulse, 1/kg.
    inverse_mass_per_kg: f64,
}

impl Row {
    /// Between the points of two bodies that are `arms_W_m` from their centres of mass.
    pub(super) fn at(
        all: &[Body],
        bodies: [usize; 2],
        arms_W_m: [Vector3<f64>; 2],
        along_W: &Vector3<f64>,
    ) -> Self {
        let [first, second] = arms_W_m.map(|arm_W_m| join(along_W, &arm_W_m.cross(along_W)));
        Self::new(all, bodies, [-first, second])
    }

    /// On one body alone: its rate is the product of `jacobian` with the twist.
    pub(super) fn on(all: &[Body], body: usize, jacobian: Vector6<f64>) -> Self {
        Self::new(all, [0, body], [Vector6::zeros(), jacobian])
    }

    /// Its rate is the sum of the products of each `jacobian` with its body's twist.
    pub(super) fn new(all: &[Body], bodies: [usize; 2], jacobian: [Vector6<f64>; 2]) -> Self {
        let answer = [0, 1].map(|of| all[bodies[of]].mobility * jacobian[of]);
        let inverse_mass_per_kg = jacobian[0].dot(&answer[0]) + jacobian[1].dot(&answer[1]);
        Self { bodies, jacobian, answer, inverse_mass_per_kg }
    }

    /// True if it acts on the body with this number.
    pub(super) fn is_on(&self, body: usize) -> bool {
        self.bodies.contains(&body)
    }

    pub(super) fn rate(&self, all: &[Body]) -> f64 {
        let [first, second] = [0, 1].map(|of| self.jacobian[of].dot(&all[self.bodies[of]].twist));
        first + second
    }

    pub(super) fn push(&self, all: &mut [Body], impulse_N_s: f64) {
        for (body, answer) in self.bodies.iter().zip(&self.answer) {
            all[*body].twist += answer * impulse_N_s;
        }
    }

    /// Returns the change of the rate of `other`, between the same bodies, by a unit impulse along this row.
    fn coupling(&self, other: &Self) -> f64 {
        other.jacobian[0].dot(&self.answer[0]) + other.jacobian[1].dot(&self.answer[1])
    }
}

/// A unilateral constraint, a contact or a stop: it keeps two bodies from coming nearer than they may.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unilateral {
    /// Its rate is that of the gap.
    pub normal: Row,
    /// Distance by which the two may still come nearer.
    pub gap_m: f64,
    /// Newton's coefficient: the fraction of the rate of approach that an impact leaves.
    pub restitution: f64,
    pub friction: Option<Friction>,
    /// Lower bound of the rate; minus infinity where the constraint is not asked.
    pub bound_m_s: f64,
    /// Impulse of the constraint.
    pub impulse_N_s: f64,
}

/// A stop: inelastic, and without friction.
pub(super) fn stop(normal: Row, gap_m: f64) -> Unilateral {
    let (bound_m_s, impulse_N_s) = (f64::NEG_INFINITY, 0.0);
    Unilateral { normal, gap_m, restitution: 0.0, friction: None, bound_m_s, impulse_N_s }
}

/// A joint, which keeps the rates of up to six rows between two bodies at zero: they are solved as a whole.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bilateral {
    pub rows: [Row; 6],
    pub count: usize,
    /// Takes the rates of the rows to the impulses that end them; of the rows that there are.
    inverse_kg: Matrix6<f64>,
}

impl Bilateral {
    /// The joint with these rows, from one to six between the same two bodies; none where they contradict each other.
    pub(super) fn new(rows: &[Row]) -> Option<Self> {
        let first = *rows.first()?;
        let mut all = [first; 6];
        let count = rows.len().min(6);
        all[..count].copy_from_slice(&rows[..count]);
        let delassus_per_kg = Matrix6::from_fn(|row, column| match row.max(column) < count {
            true => all[column].coupling(&all[row]),
            false => f64::from(u8::from(row == column)),
        });
        Some(Self { rows: all, count, inverse_kg: delassus_per_kg.try_inverse()? })
    }

    /// The greatest rate of its rows, which have to be zero.
    pub(super) fn off_m_s(&self, all: &[Body]) -> f64 {
        self.rows[..self.count].iter().map(|row| row.rate(all).abs()).fold(0.0, f64::max)
    }

    /// Ends the rates of all rows; returns by how much that changed one at most.
    fn relax(&self, all: &mut [Body]) -> f64 {
        let mut rates_m_s = Vector6::zeros();
        for (rate_m_s, row) in rates_m_s.iter_mut().zip(&self.rows[..self.count]) {
            *rate_m_s = row.rate(all);
        }
        let impulses_N_s = self.inverse_kg * -rates_m_s;
        for (impulse_N_s, row) in impulses_N_s.iter().zip(&self.rows[..self.count]) {
            row.push(all, *impulse_N_s);
        }
        rates_m_s.amax()
    }
}

/// Coulomb friction of a contact.
#[derive(Debug, Clone, Copy)]
pub(super) struct Friction {
    pub coefficient: f64,
    pub slips: [Row; 2],
    pub impulses_N_s: Vector2<f64>,
    /// Direction of the slip, where it slips: a unit vector.
    direction: Vector2<f64>,
    /// The contact's Delassus matrix, which takes its impulses (normal, and along the two) to its rates; and its
    /// inverse.
    delassus_per_kg: Matrix3<f64>,
    inverse_kg: Matrix3<f64>,
    /// The largest eigenvalue of its part that takes friction to slip.
    largest_per_kg: f64,
}

impl Friction {
    /// Friction between the same bodies and points as those of a contact with this `normal` along `normal_W`.
    pub(super) fn new(
        all: &[Body],
        bodies: [usize; 2],
        arms_W_m: [Vector3<f64>; 2],
        (normal, normal_W): (&Row, &Vector3<f64>),
        coefficient: f64,
    ) -> Self {
        let aside_W = normal_W.cross(&Vector3::ith(normal_W.iamin(), 1.0)).normalize();
        let slips = [aside_W, normal_W.cross(&aside_W)].map(|along| Row::at(all, bodies, arms_W_m, &along));
        let rows = [normal, &slips[0], &slips[1]];
        let delassus_per_kg = Matrix3::from_fn(|row, column| rows[column].coupling(rows[row]));
        let [a, b, c] = [(1, 1), (2, 2), (1, 2)].map(|place| delassus_per_kg[place]);
        Self {
            largest_per_kg: 0.5 * (a + b) + (0.25 * (a - b) * (a - b) + c * c).sqrt(),
            coefficient,
            slips,
            impulses_N_s: Vector2::zeros(),
            direction: Vector2::zeros(),
            delassus_per_kg,
            inverse_kg: delassus_per_kg.try_inverse().unwrap_or_else(Matrix3::zeros),
        }
    }

    /// Warm starts with the impulse of a step before.
    pub(super) fn warm_start(&mut self, impulse_W_N_s: &Vector3<f64>) {
        let along = self.slips.each_ref().map(|row| row.jacobian[1].fixed_rows::<3>(0).dot(impulse_W_N_s));
        self.impulses_N_s = along.into();
    }

    /// Returns its impulse on the second body.
    pub(super) fn impulse_W_N_s(&self) -> Vector3<f64> {
        let [first, second] =
            self.slips.each_ref().map(|row| row.jacobian[1].fixed_rows::<3>(0).into_owned());
        first * self.impulses_N_s.x + second * self.impulses_N_s.y
    }

    fn push(&self, all: &mut [Body], impulses_N_s: &Vector2<f64>) {
        self.slips[0].push(all, impulses_N_s.x);
        self.slips[1].push(all, impulses_N_s.y);
    }

    /// A step against the slip, as far as friction goes.
    fn change_N_s(&self, all: &[Body], normal_N_s: f64) -> Vector2<f64> {
        if self.largest_per_kg <= 0.0 {
            return Vector2::zeros();
        }
        let slip_m_s = Vector2::new(self.slips[0].rate(all), self.slips[1].rate(all));
        let wanted_N_s = self.impulses_N_s - slip_m_s / self.largest_per_kg;
        let (most_N_s, size_N_s) = (self.coefficient * normal_N_s, wanted_N_s.norm());
        let scale = if size_N_s > most_N_s { most_N_s / size_N_s } else { 1.0 };
        wanted_N_s * scale - self.impulses_N_s
    }

    /// Steps against the slip, equally far along both axes: only so does the iteration end with a force that is
    /// opposite to the slip at any inertia of the bodies. Returns the greatest change of the slip.
    fn relax(&mut self, all: &mut [Body], normal_N_s: f64) -> f64 {
        let change_N_s = self.change_N_s(all, normal_N_s);
        self.push(all, &change_N_s);
        self.impulses_N_s += change_N_s;
        change_N_s.amax() * self.largest_per_kg
    }

    /// The contact's impulses that its rates need which would be `free_m_s` without them: none where they would part;
    /// those that stick where friction allows; otherwise those that slip.
    fn impulses_N_s(&mut self, free_m_s: &Vector3<f64>, bound_m_s: f64) -> Vector3<f64> {
        if free_m_s.x >= bound_m_s {
            return Vector3::zeros();
        }
        let sticking = self.inverse_kg * (Vector3::x() * bound_m_s - free_m_s);
        let most = self.coefficient * sticking.x;
        let aside = sticking.yz().norm();
        if sticking.x >= 0.0 && aside <= most {
            return sticking;
        }
        self.slipping_N_s(free_m_s, bound_m_s).unwrap_or_else(|| {
            // Friction that would have to pull the two apart, as jammed chalk does (Painlevé): as near to sticking as
            // it may.
            let normal = sticking.x.max(0.0);
            let share = if aside > 0.0 { (self.coefficient * normal / aside).min(1.0) } else { 0.0 };
            Vector3::new(normal, sticking.y * share, sticking.z * share)
        })
    }

    /// The impulses of a contact that slips: along its bound, and opposite to the slip that they leave, whose
    /// direction is looked for from that of before.
    fn slipping_N_s(&mut self, free_m_s: &Vector3<f64>, bound_m_s: f64) -> Option<Vector3<f64>> {
        let aside_m_s = free_m_s.yz();
        let to_sides = self.delassus_per_kg.fixed_view::<2, 1>(1, 0).into_owned();
        let sides: Matrix2<f64> = self.delassus_per_kg.fixed_view::<2, 2>(1, 1).into_owned();
        if self.direction == Vector2::zeros() {
            self.direction = aside_m_s.try_normalize(0.0)?;
        }
        let mut normal_N_s = 0.0;
        for _ in 0..SLIP_STEPS {
            let pushed = self.direction * -self.coefficient;
            let yields_per_kg = self.delassus_per_kg.m11 + to_sides.dot(&pushed);
            if yields_per_kg <= 0.0 {
                return None;
            }
            normal_N_s = (bound_m_s - free_m_s.x) / yields_per_kg;
            let slip_m_s = aside_m_s + (to_sides + sides * pushed) * normal_N_s;
            // Half way, so that it cannot go to and fro.
            let Some(wanted) = slip_m_s.try_normalize(0.0) else { break };
            let Some(next) = (self.direction + wanted).try_normalize(1e-6) else { break };
            let is_found = (next - self.direction).amax() < 1e-15;
            self.direction = next;
            if is_found {
                break;
            }
        }
        let aside_N_s = self.direction * (-self.coefficient * normal_N_s);
        Some(Vector3::new(normal_N_s, aside_N_s.x, aside_N_s.y))
    }
}

/// Finds the impulses that `constraints` and `joints` need, from those that the former hold already, and gives them to the
/// bodies. Where a light body carries a heavy one, or two bounds contradict each other, they are not found.
pub(super) fn solve(all: &mut [Body], constraints: &mut [Unilateral], joints: &[Bilateral]) {
    for constraint in constraints.iter() {
        constraint.normal.push(all, constraint.impulse_N_s);
        if let Some(friction) = &constraint.friction {
            friction.push(all, &friction.impulses_N_s);
        }
    }
    sweep(all, constraints, joints);
}

/// Goes on from impulses that the bodies have already.
pub(super) fn sweep(all: &mut [Body], constraints: &mut [Unilateral], joints: &[Bilateral]) {
    iterate(all, constraints, joints, QUICK_ITERATIONS, Unilateral::relax);
    if unmet_m_s(all, constraints) > TO_AND_FRO_M_S {
        iterate(all, constraints, joints, ITERATIONS_MAX, Unilateral::relax_whole);
    }
}

fn iterate(
    all: &mut [Body],
    constraints: &mut [Unilateral],
    joints: &[Bilateral],
    most: usize,
    relax: fn(&mut Unilateral, &mut [Body]) -> f64,
) {
    for _ in 0..most {
        let asked = constraints.iter_mut().filter(|constraint| constraint.bound_m_s > f64::NEG_INFINITY);
        let changed_m_s = asked.map(|constraint| relax(constraint, all)).fold(0.0, f64::max);
        let tied_m_s = joints.iter().map(|joint| joint.relax(all)).fold(0.0, f64::max);
        if changed_m_s.max(tied_m_s) < SETTLED_M_S {
            break;
        }
    }
}

/// Returns the greatest amount by which a rate is below its bound; 0 if all are kept.
fn unmet_m_s(all: &[Body], constraints: &[Unilateral]) -> f64 {
    let asked = constraints.iter().filter(|constraint| constraint.bound_m_s > f64::NEG_INFINITY);
    asked.map(|constraint| constraint.bound_m_s - constraint.normal.rate(all)).fold(0.0, f64::max)
}

impl Unilateral {
    /// Error of its rates: the change of a rate by one step towards the laws of contact and friction.
    pub(super) fn off_m_s(&self, all: &[Body]) -> f64 {
        let inverse_mass_per_kg = self.normal.inverse_mass_per_kg;
        if self.bound_m_s == f64::NEG_INFINITY || inverse_mass_per_kg <= 0.0 {
            return 0.0;
        }
        let above_m_s = self.normal.rate(all) - self.bound_m_s;
        let normal_m_s = above_m_s.min(self.impulse_N_s * inverse_mass_per_kg).abs();
        self.friction.as_ref().map_or(normal_m_s, |friction| {
            normal_m_s.max(friction.change_N_s(all, self.impulse_N_s).amax() * friction.largest_per_kg)
        })
    }

    /// Speed of its slip; 0 without friction.
    pub(super) fn slip_m_s(&self, all: &[Body]) -> f64 {
        self.friction.map_or(0.0, |it| Vector2::new(it.slips[0].rate(all), it.slips[1].rate(all)).norm())
    }

    /// Relaxes the normal, and then friction; returns by how much that changed their rates.
    fn relax(&mut self, all: &mut [Body]) -> f64 {
        let slipped = |this: &mut Self, all: &mut [Body]| {
            let impulse_N_s = this.impulse_N_s;
            this.friction.as_mut().map_or(0.0, |friction| friction.relax(all, impulse_N_s))
        };
        let changed = self.relax_normal(all);
        changed.max(slipped(self, all))
    }

    fn relax_normal(&mut self, all: &mut [Body]) -> f64 {
        let inverse_mass_per_kg = self.normal.inverse_mass_per_kg;
        if inverse_mass_per_kg <= 0.0 {
            return 0.0;
        }
        let wanted_N_s = self.impulse_N_s + (self.bound_m_s - self.normal.rate(all)) / inverse_mass_per_kg;
        let change_N_s = wanted_N_s.max(0.0) - self.impulse_N_s;
        self.normal.push(all, change_N_s);
        self.impulse_N_s += change_N_s;
        change_N_s.abs() * inverse_mass_per_kg
    }

    /// Solves this one as a whole, with the others as they are; returns by how much that changed its rates.
    fn relax_whole(&mut self, all: &mut [Body]) -> f64 {
        let rate_m_s = self.normal.rate(all);
        let Some(friction) = &mut self.friction else { return self.relax_normal(all) };
        let held_N_s = Vector3::new(self.impulse_N_s, friction.impulses_N_s.x, friction.impulses_N_s.y);
        let rates_m_s = Vector3::new(rate_m_s, friction.slips[0].rate(all), friction.slips[1].rate(all));
        let free_m_s = rates_m_s - friction.delassus_per_kg * held_N_s;
        let wanted_N_s = friction.impulses_N_s(&free_m_s, self.bound_m_s);
        let change_N_s = wanted_N_s - held_N_s;
        self.normal.push(all, change_N_s.x);
        friction.push(all, &change_N_s.yz());
        (self.impulse_N_s, friction.impulses_N_s) = (wanted_N_s.x, wanted_N_s.yz());
        (friction.delassus_per_kg * change_N_s).amax()
    }
}
