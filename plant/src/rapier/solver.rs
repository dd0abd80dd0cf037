//! The impulses that keep contacts, stops and joints.
//!
//! Moreau's time stepping, at the level of velocities (J. J. Moreau, Unilateral contact and dry friction in finite
//! freedom dynamics, 1988): a limit pushes only as far as its rate would otherwise be below what is asked of it
//! (Signorini's condition; Newton's law of restitution gives what is asked), and friction pushes against the slip,
//! at most μ times as hard as the normal (Coulomb's law). The impulses are found by projected Gauss-Seidel
//! iteration (M. Jean, The non-smooth contact dynamics method, 1999) until nothing changes any more.

use nalgebra::{Matrix3, Vector3};

/// Iterations end when none changes a velocity by more: far below what anybody measures, far above rounding.
const SETTLED_M_S: f64 = 1e-11;

/// Iterations end after this many: four feet that slide take about 60, bodies wedged between walls more. Tuned, no source.
const ITERATIONS_MAX: usize = 400;

/// A body as impulses see it. [`Body::default`] is one that nothing moves, such as the world.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Body {
    pub velocity_W_m_s: Vector3<f64>,
    pub spin_W_rad_s: Vector3<f64>,
    /// 1 over the mass, along each axis of the world; 0 where the body is held.
    pub inverse_mass_per_kg: Vector3<f64>,
    pub inverse_inertia_W: Matrix3<f64>,
}

impl Body {
    pub(super) fn push(&mut self, impulse_W_N_s: &Vector3<f64>, turn_W_N_m_s: &Vector3<f64>) {
        self.velocity_W_m_s += self.inverse_mass_per_kg.component_mul(impulse_W_N_s);
        self.spin_W_rad_s += self.inverse_inertia_W * turn_W_N_m_s;
    }

    /// The same at rest.
    pub(super) fn still(&self) -> Self {
        Self { velocity_W_m_s: Vector3::zeros(), spin_W_rad_s: Vector3::zeros(), ..*self }
    }

    fn velocity_at(&self, arm_W_m: &Vector3<f64>) -> Vector3<f64> {
        self.velocity_W_m_s + self.spin_W_rad_s.cross(arm_W_m)
    }
}

/// One direction in which two bodies push each other: a positive impulse drives the second along it and the first
/// the other way. Its rate is how fast the second leaves the first along it, in m/s, or in rad/s where it turns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    bodies: [usize; 2],
    /// Along which the bodies push; zero where the row only turns them.
    along_W: Vector3<f64>,
    /// What a unit of impulse turns each body with.
    turns_W: [Vector3<f64>; 2],
    /// The mass, or the moment of inertia, that a change of the rate has to move.
    mass: f64,
}

impl Row {
    /// Between the points of two bodies that are `arms_W_m` from their centres of mass.
    pub(super) fn at(
        all: &[Body],
        bodies: [usize; 2],
        arms_W_m: [Vector3<f64>; 2],
        along_W: Vector3<f64>,
    ) -> Self {
        Self::new(all, bodies, along_W, [arms_W_m[0].cross(&-along_W), arms_W_m[1].cross(&along_W)])
    }

    /// Between the angles of two bodies about an axis.
    pub(super) fn about(all: &[Body], bodies: [usize; 2], axis_W: Vector3<f64>) -> Self {
        Self::new(all, bodies, Vector3::zeros(), [-axis_W, axis_W])
    }

    fn new(all: &[Body], bodies: [usize; 2], along_W: Vector3<f64>, turns_W: [Vector3<f64>; 2]) -> Self {
        let yields = |of: usize| {
            let body = &all[bodies[of]];
            let turned = turns_W[of].dot(&(body.inverse_inertia_W * turns_W[of]));
            along_W.dot(&body.inverse_mass_per_kg.component_mul(&along_W)) + turned
        };
        let sum = yields(0) + yields(1);
        Self { bodies, along_W, turns_W, mass: if sum > 0.0 { 1.0 / sum } else { 0.0 } }
    }

    pub(super) fn rate(&self, all: &[Body]) -> f64 {
        let [first, second] = self.bodies.map(|body| &all[body]);
        self.along_W.dot(&(second.velocity_W_m_s - first.velocity_W_m_s))
            + self.turns_W[0].dot(&first.spin_W_rad_s)
            + self.turns_W[1].dot(&second.spin_W_rad_s)
    }

    fn push(&self, all: &mut [Body], impulse: f64) {
        let along_W = self.along_W * impulse;
        all[self.bodies[0]].push(&-along_W, &(self.turns_W[0] * impulse));
        all[self.bodies[1]].push(&along_W, &(self.turns_W[1] * impulse));
    }

    /// How much an impulse along this row changes the rate of `other`.
    fn coupling(&self, all: &[Body], other: &Self) -> f64 {
        let coupled = |of: usize| {
            let body = &all[self.bodies[of]];
            let turned = other.turns_W[of].dot(&(body.inverse_inertia_W * self.turns_W[of]));
            other.along_W.dot(&body.inverse_mass_per_kg.component_mul(&self.along_W)) + turned
        };
        coupled(0) + coupled(1)
    }
}

/// What keeps two bodies from coming nearer than they may: a contact, or a stop.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limit {
    /// Its rate is that of the gap.
    pub normal: Row,
    /// How far the two may still come nearer, in m or rad.
    pub gap: f64,
    /// Fraction of the rate of approach that an impact leaves.
    pub restitution: f64,
    pub friction: Option<Friction>,
    /// What the rate has to be at least.
    pub least: f64,
    /// What it pushed with.
    pub impulse: f64,
}

/// Coulomb friction on a contact.
#[derive(Debug, Clone, Copy)]
pub(super) struct Friction {
    coefficient: f64,
    slips: [Row; 2],
    /// What it pushed with, along the two.
    impulses: [f64; 2],
    /// The least mass that any slip of the contact moves.
    mass: f64,
}

impl Friction {
    /// Friction between the same bodies and points as those of a contact with this normal.
    pub(super) fn new(
        all: &[Body],
        bodies: [usize; 2],
        arms_W_m: [Vector3<f64>; 2],
        normal_W: &Vector3<f64>,
        coefficient: f64,
    ) -> Self {
        let aside_W = normal_W.cross(&least_axis(normal_W)).normalize();
        let slips = [aside_W, normal_W.cross(&aside_W)].map(|along| Row::at(all, bodies, arms_W_m, along));
        let [a, b] = [&slips[0], &slips[1]].map(|row| row.coupling(all, row));
        let c = slips[0].coupling(all, &slips[1]);
        // The larger eigenvalue of the two by two matrix that takes impulses to slips.
        let largest = 0.5 * (a + b) + (0.25 * (a - b) * (a - b) + c * c).sqrt();
        Self { coefficient, slips, impulses: [0.0; 2], mass: if largest > 0.0 { 1.0 / largest } else { 0.0 } }
    }

    /// Begins with an impulse.
    pub(super) fn take_up(&mut self, impulse_W_N_s: &Vector3<f64>) {
        self.impulses = self.slips.map(|row| row.along_W.dot(impulse_W_N_s));
    }

    pub(super) fn impulse_W_N_s(&self) -> Vector3<f64> {
        self.slips[0].along_W * self.impulses[0] + self.slips[1].along_W * self.impulses[1]
    }

    /// Steps against the slip, equally far along both axes: only so does the iteration end with a force that is
    /// opposite to the slip, as Coulomb's law says, whatever the bodies' inertia. Returns the change of velocity.
    fn relax(&mut self, all: &mut [Body], normal_impulse: f64) -> f64 {
        let slip_m_s = [self.slips[0].rate(all), self.slips[1].rate(all)];
        let wanted = [0, 1].map(|axis| self.impulses[axis] - self.mass * slip_m_s[axis]);
        let (most, size) =
            (self.coefficient * normal_impulse, (wanted[0] * wanted[0] + wanted[1] * wanted[1]).sqrt());
        let scale = if size > most { most / size } else { 1.0 };
        let changes = [0, 1].map(|axis| wanted[axis] * scale - self.impulses[axis]);
        for (axis, change) in changes.into_iter().enumerate() {
            self.slips[axis].push(all, change);
            self.impulses[axis] += change;
        }
        per_mass(changes[0].abs().max(changes[1].abs()), self.mass)
    }
}

/// The axis of the world that is farthest from `direction`, or one of them.
fn least_axis(direction: &Vector3<f64>) -> Vector3<f64> {
    Vector3::ith(direction.iamin(), 1.0)
}

/// A ball joint: a point of one body stays on a point of the other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ball {
    bodies: [usize; 2],
    arms_W_m: [Vector3<f64>; 2],
    /// Takes a velocity to the impulse that makes it.
    mass_W: Matrix3<f64>,
    /// What the relative velocity of the points has to be.
    pub wanted_W_m_s: Vector3<f64>,
    pub impulse_W_N_s: Vector3<f64>,
}

impl Ball {
    pub(super) fn new(all: &[Body], bodies: [usize; 2], arms_W_m: [Vector3<f64>; 2]) -> Self {
        let yields = |of: usize| {
            let body = &all[bodies[of]];
            let lever = arms_W_m[of].cross_matrix();
            Matrix3::from_diagonal(&body.inverse_mass_per_kg) - lever * body.inverse_inertia_W * lever
        };
        let mass_W = (yields(0) + yields(1)).try_inverse().unwrap_or_else(Matrix3::zeros);
        Self { bodies, arms_W_m, mass_W, wanted_W_m_s: Vector3::zeros(), impulse_W_N_s: Vector3::zeros() }
    }

    fn push(&self, all: &mut [Body], impulse_W_N_s: &Vector3<f64>) {
        let back_W_N_s = -impulse_W_N_s;
        all[self.bodies[0]].push(&back_W_N_s, &self.arms_W_m[0].cross(&back_W_N_s));
        all[self.bodies[1]].push(impulse_W_N_s, &self.arms_W_m[1].cross(impulse_W_N_s));
    }

    fn relax(&mut self, all: &mut [Body]) -> f64 {
        let points = [0, 1].map(|of| all[self.bodies[of]].velocity_at(&self.arms_W_m[of]));
        let off_W_m_s = self.wanted_W_m_s - (points[1] - points[0]);
        let change_W_N_s = self.mass_W * off_W_m_s;
        self.push(all, &change_W_N_s);
        self.impulse_W_N_s += change_W_N_s;
        off_W_m_s.amax()
    }
}

/// Finds the impulses that `ball` and `limits` need, from those that they hold already, and gives them to the bodies.
/// A limit whose least rate is minus infinity pushes nothing.
pub(super) fn solve(all: &mut [Body], ball: &mut Option<Ball>, limits: &mut [Limit]) {
    if let Some(ball) = ball {
        ball.push(all, &ball.impulse_W_N_s);
    }
    for limit in limits.iter() {
        limit.normal.push(all, limit.impulse);
        let slips = limit.friction.iter().flat_map(|friction| friction.slips.iter().zip(friction.impulses));
        slips.for_each(|(row, impulse)| row.push(all, impulse));
    }
    for _ in 0..ITERATIONS_MAX {
        let mut change = ball.as_mut().map_or(0.0, |ball| ball.relax(all));
        for limit in limits.iter_mut().filter(|limit| limit.least > f64::NEG_INFINITY) {
            change = limit.relax(all).max(change);
        }
        if change < SETTLED_M_S {
            break;
        }
    }
}

impl Limit {
    fn relax(&mut self, all: &mut [Body]) -> f64 {
        let wanted = self.impulse + self.normal.mass * (self.least - self.normal.rate(all));
        let change = wanted.max(0.0) - self.impulse;
        self.normal.push(all, change);
        self.impulse += change;
        let slipped = self.friction.as_mut().map_or(0.0, |friction| friction.relax(all, self.impulse));
        per_mass(change.abs(), self.normal.mass).max(slipped)
    }
}

fn per_mass(impulse: f64, mass: f64) -> f64 {
    if mass > 0.0 { impulse / mass } else { 0.0 }
}
