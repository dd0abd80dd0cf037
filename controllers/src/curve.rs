//! Closed curves that are flown from rest to rest: the circle and the figure eight, and the clock that starts and
//! stops them.
//!
//! A curve is a function of a phase θ, and θ of time: θ′ rises from 0 to the cruising rate, keeps it, and falls back to
//! 0. Its rise is the polynomial whose first four derivatives vanish at both ends. So the position's first
//! five derivatives are continuous, at rest and on the move. The derivatives of the position by time
//! follow from those by phase with the formula of Faà di Bruno (M. Abramowitz and I. A. Stegun, "Handbook
//! of Mathematical Functions", 24.1.2): nothing is differenced.

use nalgebra::Vector3;
use std::f64::consts::TAU;

/// A quantity and its first four derivatives by time.
pub type Derivatives = [f64; 5];

/// A point that moves, and its first four derivatives by time, in the world: m, m/s, m/s², m/s³, m/s⁴.
pub type Path = [Vector3<f64>; 5];

/// The shape of a curve in its own plane: it starts in the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A circle that starts along its x; the centre lies on its left where the radius is positive.
    Circle {
        /// Signed radius, m.
        radius_m: f64,
    },
    /// The lemniscate of Gerono, (a·sin θ, a·sin θ·cos θ), crossed at its start along x = y. It is as long as 2a and as
    /// wide as a.
    FigureEight {
        /// a, m: half of its length.
        half_length_m: f64,
    },
}

/// A shape, laid into the world and timed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curve {
    /// The shape.
    pub shape: Shape,
    /// Point at which it starts and ends.
    pub start_W_m: Vector3<f64>,
    /// Direction of its x axis, counter-clockwise from the world's x seen from above.
    pub direction_rad: f64,
    /// The clock.
    pub clock: PhaseClock,
}

/// A phase that starts from rest, goes at a constant rate and comes to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseClock {
    /// θ′ between the ramps, rad/s.
    pub rate_rad_s: f64,
    /// Duration of the rise of θ′, and of its fall, s.
    pub ramp_s: f64,
    /// Duration of the whole, s.
    pub duration_s: f64,
}

impl Shape {
    /// The greatest speed, m/s, at a phase rate of 1 rad/s. The figure eight has it where it crosses itself:
    /// |dr/dθ|² = a²·(cos² θ + cos² 2θ).
    pub fn speed_max_m_rad(&self) -> f64 {
        match *self {
            Self::Circle { radius_m } => radius_m.abs(),
            Self::FigureEight { half_length_m } => half_length_m * std::f64::consts::SQRT_2,
        }
    }

    /// The point at `phase_rad` and its first four derivatives by phase, in the curve's own level axes.
    fn by_phase(&self, phase_rad: f64) -> [(f64, f64); 5] {
        match *self {
            Self::Circle { radius_m } => {
                let sine = sine_derivatives(1.0, phase_rad);
                let cosine = sine_derivatives(1.0, phase_rad + TAU / 4.0);
                let y = |n: usize| if n == 0 { radius_m * (1.0 - cosine[0]) } else { -radius_m * cosine[n] };
                std::array::from_fn(|n| (radius_m.abs() * sine[n], y(n)))
            }
            // sin θ·cos θ = ½·sin 2θ.
            Self::FigureEight { half_length_m } => {
                let (slow, fast) = (sine_derivatives(1.0, phase_rad), sine_derivatives(2.0, phase_rad));
                std::array::from_fn(|n| (half_length_m * slow[n], half_length_m / 2.0 * fast[n]))
            }
        }
    }
}

/// sin(mθ) and its first four derivatives by θ.
fn sine_derivatives(multiple: f64, phase_rad: f64) -> Derivatives {
    let (sin, cos) = libm::sincos(multiple * phase_rad);
    let m = multiple;
    [sin, m * cos, -m * m * sin, -m.powi(3) * cos, m.powi(4) * sin]
}

impl PhaseClock {
    /// The clock that covers `phase_rad` at `rate_rad_s` with ramps of `ramp_s`; `None` where the ramps alone cover more.
    pub fn covering(phase_rad: f64, rate_rad_s: f64, ramp_s: f64) -> Option<Self> {
        // A ramp covers half of what cruising covers in its time, since the rise is symmetric.
        let duration_s = phase_rad / rate_rad_s + ramp_s;
        (duration_s >= 2.0 * ramp_s).then_some(Self { rate_rad_s, ramp_s, duration_s })
    }

    /// The phase and its first four derivatives `time_s` after the start.
    pub fn at(&self, time_s: f64) -> Derivatives {
        let time_s = time_s.clamp(0.0, self.duration_s);
        let left_s = self.duration_s - time_s;
        if left_s < self.ramp_s {
            // The fall mirrors the rise in time: even derivatives change their sign.
            let [phase, rate, second, third, fourth] = self.rise(left_s);
            return [self.total_rad() - phase, rate, -second, third, -fourth];
        }
        if time_s < self.ramp_s {
            return self.rise(time_s);
        }
        [self.rate_rad_s * (time_s - self.ramp_s / 2.0), self.rate_rad_s, 0.0, 0.0, 0.0]
    }

    fn total_rad(&self) -> f64 {
        self.rate_rad_s * (self.duration_s - self.ramp_s)
    }

    fn rise(&self, time_s: f64) -> Derivatives {
        let (t, span_s) = (time_s / self.ramp_s, self.ramp_s);
        let [step, first, second, third] = smooth_step(t);
        let integral = t.powi(6) * (21.0 + t * (-60.0 + t * (67.5 + t * (-35.0 + t * 7.0))));
        [
            self.rate_rad_s * span_s * integral,
            self.rate_rad_s * step,
            self.rate_rad_s * first / span_s,
            self.rate_rad_s * second / span_s.powi(2),
            self.rate_rad_s * third / span_s.powi(3),
        ]
    }
}

/// The polynomial that rises from 0 to 1 over 0…1 with four vanishing derivatives at both ends, and its first three
/// derivatives.
pub fn smooth_step(t: f64) -> [f64; 4] {
    let left = 1.0 - t;
    [
        t.powi(5) * (126.0 + t * (-420.0 + t * (540.0 + t * (-315.0 + t * 70.0)))),
        630.0 * (t * left).powi(4),
        2520.0 * (t * left).powi(3) * (1.0 - 2.0 * t),
        2520.0 * (t * left).powi(2) * (3.0 * (1.0 - 2.0 * t).powi(2) - 2.0 * t * left),
    ]
}

impl Curve {
    /// The point and its derivatives `time_s` after the start.
    pub fn at(&self, time_s: f64) -> Path {
        let phase = self.clock.at(time_s);
        let by_phase = self.shape.by_phase(phase[0]);
        let x = by_time(&by_phase.map(|(x, _)| x), &phase);
        let y = by_time(&by_phase.map(|(_, y)| y), &phase);
        let (sin, cos) = libm::sincos(self.direction_rad);
        let mut path: Path =
            std::array::from_fn(|n| Vector3::new(cos * x[n] - sin * y[n], sin * x[n] + cos * y[n], 0.0));
        path[0] += self.start_W_m;
        path
    }
}

/// The derivatives by time of a function whose derivatives by phase are `f`, under the phase's `p`.
fn by_time(f: &Derivatives, p: &Derivatives) -> Derivatives {
    let [_, p1, p2, p3, p4] = *p;
    [
        f[0],
        f[1] * p1,
        f[2] * p1 * p1 + f[1] * p2,
        f[3] * p1.powi(3) + 3.0 * f[2] * p1 * p2 + f[1] * p3,
        f[4] * p1.powi(4) + 6.0 * f[3] * p1 * p1 * p2 + f[2] * (3.0 * p2 * p2 + 4.0 * p1 * p3) + f[1] * p4,
    ]
}
