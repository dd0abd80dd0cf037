//! Compares measured values with physics: values that look like another unit, frame or order are reported.
//!
//! A mismatch is clear where a known factor, frame or order explains it; otherwise it is only worth a note.

use nalgebra::Vector3;
use vehicles::bearing::Bearing;
use vehicles::{ROTORS_MAX, Vehicle};

use crate::agreement::{Agreement, Pairs};
use crate::declaration::{ChannelMap, Frame};
use crate::finding::Finding;
use crate::flight::{Channel, Flight, median};
use crate::force_doubt::{ForceDoubt, Kind};
use crate::frame;
use crate::quantity::{FRACTION, PERCENT, Quantity};
use crate::rig::{Hold, hold, turns_about};
use crate::spikes::usual_greatest;
use crate::still;
use crate::units::{HUNDREDS, Units, finding, is_gross, of_hundreds, of_unit, short};
use diagnostics::digits;
use diagnostics::unit::{ANGLE, ROTOR_SPEED};

/// Above this correlation a logged and a derived vector are the same but for a factor.
pub const SAME: f64 = 0.7;
/// A vehicle in gusts accelerates as it leans with this correlation at least (real flights in a wind of 12 m/s: 0.65 to 0.72).
pub const GUSTY: f64 = 0.6;
/// Below this one of them is late or noisy.
const IN_TIME: f64 = 0.9;
/// Windows over which vectors are derived, in s: long against the jitter between channels.
const VELOCITY_WINDOW_S: f64 = 0.2;
const LEANING_WINDOW_S: f64 = 0.4;
/// Below these the vehicle hardly moves, and noise is compared with noise.
const QUIET_SPEED_M_S: f64 = 0.05;
pub const QUIET_ACCELERATION_M_S2: f64 = 0.2;
/// A vehicle accelerates as it leans, but for the drag, within this factor.
const LEANING_TOLERANCE: f64 = 3.0;
/// Beyond this factor a scale is as likely as a unit.
const LEANING_EXACT: f64 = 1.5;
/// And a vector is its twin's derivative within this one.
pub const DERIVATIVE_TOLERANCE: f64 = 1.3;
/// No multirotor flies faster, in m/s.
const SPEED_MAX_M_S: f64 = 100.0;
/// Loggers sample at 4 Hz to 5 kHz, and vehicles fly for a second to an hour.
const PERIOD_RANGE_S: (f64, f64) = (2e-4, 0.25);
const SPAN_RANGE_S: (f64, f64) = (1.0, 3600.0);
/// Below this correlation a vector does not follow its twin at all.
const AGAINST: f64 = 0.3;
/// It follows another kind clearly better if the correlation grows by this much.
pub const CLEARLY: f64 = 0.3;
/// In gusts it has to grow by this much.
const CLEARLY_IN_GUSTS: f64 = 0.5;
/// And two that are nearer than this cannot be told apart.
pub const ALIKE: f64 = 0.1;
/// Correction that would make it good, as text and in numbers.
type Mistake<T> = (&'static str, fn(T) -> T);
/// Possible mistakes about the Euler angles roll and pitch.
const ANGLE_MISTAKES: [Mistake<(f64, f64)>; 5] = [
    ("a `-` before the pitch", |(roll, pitch)| (roll, -pitch)),
    ("a `-` before the roll", |(roll, pitch)| (-roll, pitch)),
    ("a `-` before roll and pitch", |(roll, pitch)| (-roll, -pitch)),
    ("roll and pitch in each other's place", |(roll, pitch)| (pitch, roll)),
    ("roll and pitch in each other's place, a `-` before the new pitch", |(roll, pitch)| (pitch, -roll)),
];
/// And about a position.
const POSITION_MISTAKES: [Mistake<[f64; 3]>; 4] = [
    ("x and y of the position in each other's place", |[x, y, z]| [y, x, z]),
    ("a `-` before x of the position", |[x, y, z]| [-x, y, z]),
    ("a `-` before y of the position", |[x, y, z]| [x, -y, z]),
    ("a `-` before x and y of the position", |[x, y, z]| [-x, -y, z]),
];
/// Speeds are those that hover needs within this factor: it is the root of the one within which thrust and mass are known.
const ROTOR_SPEED_TOLERANCE: f64 = 1.25;
/// Thrust of the commands in flight over the weight. A battery that is nearly empty asks for twice the commands of a full one (real
/// logs of a Crazyflie: 2.03), and nothing makes motors stronger.
const LIFT_RANGE: std::ops::RangeInclusive<f64> = 0.5..=3.0;
/// Part of the usual greatest thrust below which motors idle.
const AIRBORNE: f64 = 0.3;
/// Numbers of pole pairs that motors of vehicles have.
const POLE_PAIRS: std::ops::RangeInclusive<f64> = 2.0..=24.0;
/// Voltages that a battery of a vehicle can have, from one cell to fourteen.
const VOLTAGE_RANGE_V: (f64, f64) = (2.0, 62.0);

/// Compares the channels of a flight with each other, with gravity and with the vehicle.
pub fn judge(flight: &Flight, vehicle: &Vehicle, channels: &ChannelMap) -> Vec<Finding> {
    let judge = Judge { flight, vehicle, units: Units { channels } };
    let findings = [
        judge.force().or_else(|| judge.gravity()),
        judge.upright(),
        judge.rates(),
        judge.still(),
        judge.velocity(),
        judge.place().or_else(|| judge.speed()),
        judge.commands(),
        judge.rotor_speed(),
        judge.voltage(),
    ];
    findings.into_iter().flatten().collect()
}

/// Compares the times of a CSV file, before anything is cut off, with those of logs of flights: wrong are samples that come
/// as no logger's do over a time that no vehicle flies, where both are right in another unit. A first row of zeros, which
/// some loggers write before their clock runs, hides no wrong unit.
pub fn judge_time(flight: &Flight, vehicle: &Vehicle, channels: &ChannelMap) -> Option<Finding> {
    let judge = Judge { flight, vehicle, units: Units { channels } };
    judge.units.declared(Quantity::Time)?;
    let times =
        [&flight.attitude.time_s, &flight.command.time_s].into_iter().find(|times| !times.is_empty())?;
    judge.time(times).or_else(|| judge.time(&times[1..]))
}

/// A flight, with what its channels are compared with.
pub struct Judge<'a> {
    /// The flight.
    pub flight: &'a Flight,
    /// The vehicle.
    pub vehicle: &'a Vehicle,
    /// The declared units.
    pub units: Units<'a>,
}

impl Judge<'_> {
    /// Samples come as a logger's do, and for as long as a vehicle flies.
    fn time(&self, times: &[f64]) -> Option<Finding> {
        let quantity = Quantity::Time;
        let period_s = median(times.windows(2).map(|pair| pair[1] - pair[0]))?;
        let span_s = times.last()? - times.first()?;
        let is_wrong = |value: f64, (low, high): (f64, f64)| !(low..=high).contains(&value);
        let factor = self.units.factor(quantity);
        let fits = |size: f64| {
            let scale = size / factor;
            !is_wrong(scale * period_s, PERIOD_RANGE_S) && !is_wrong(scale * span_s, SPAN_RANGE_S)
        };
        let unit = quantity.dimension().units.iter().find(|(_, size)| fits(*size));
        let fits = unit.map(|(unit, _)| of_unit(unit)).or_else(|| self.units.long_times(fits))?;
        let declared = self.units.unit(quantity);
        let what = format!(
            "declared in {declared}, its samples are {} s apart, over {} s",
            digits(period_s),
            digits(span_s)
        );
        (is_wrong(period_s, PERIOD_RANGE_S) && is_wrong(span_s, SPAN_RANGE_S))
            .then(|| finding(quantity, Some(fits), &what))
    }

    /// The specific force is one, and in the body, as the vehicle accelerates.
    fn force(&self) -> Option<Finding> {
        let quantity = Quantity::SpecificForce;
        let force = ForceDoubt::of(self.flight, self.vehicle, self.units.declared(quantity)?)?;
        let Some(doubt) = force.doubt() else { return self.acceleration(&force) };
        let kinds: Vec<String> = doubt.fits.iter().map(|kind| of_kind(*kind, force.declared)).collect();
        let what = format!(
            "as {} it differs from the vehicle's acceleration by {:.2} m/s^2 (root mean square); read otherwise by {:.2} \
             m/s^2, with a correlation of {:.2}",
            force.declared.holds.name(),
            doubt.declared_m_s2,
            doubt.residual_m_s2,
            doubt.correlation
        );
        Some(finding(quantity, Some(kinds.join(" or ")), &what))
    }

    /// An acceleration without gravity, whose unit does not show by gravity, is that of the vehicle.
    fn acceleration(&self, force: &ForceDoubt<'_>) -> Option<Finding> {
        if !force.declared.holds.is_without_gravity() {
            return None;
        }
        let agreement = force.agreement().filter(|agreement| agreement.correlation > SAME)?;
        let what = format!("it is {:.4} times the acceleration of the vehicle", agreement.slope);
        self.units.by_unit_or_scale(Quantity::SpecificForce, agreement.slope, LEANING_TOLERANCE, &what)
    }

    /// The specific force is gravity's in the median, and up.
    fn gravity(&self) -> Option<Finding> {
        let quantity = Quantity::SpecificForce;
        let forces = &self.flight.specific_force.values;
        let norm = median(forces.iter().map(|f| Vector3::from(*f).norm()))?;
        let up = median(forces.iter().map(|f| f[2]))?;
        let factor = norm / self.vehicle.gravity_m_s2;
        let what = format!("its median magnitude is {norm:.4} m/s^2, {factor:.4} times gravity");
        let by_unit =
            self.units.by_unit(quantity, factor, 1.25, &what).filter(|finding| finding.fits.is_some());
        if by_unit.is_some() {
            return by_unit;
        }
        if is_gross(factor) && up > 0.7 * norm {
            return Some(self.units.by_scale(quantity, factor, &what));
        }
        if up < -0.7 * norm {
            let what = format!("its median along z is {up:.3} m/s^2, but up is positive in our body");
            return Some(finding(quantity, Some(self.other_frame(quantity)), &what));
        }
        let hint = if factor < 0.5 { "; gravity may have been taken off (`holds`)" } else { "" };
        (!(0.6..1.6).contains(&factor)).then(|| finding(quantity, None, &format!("{what}{hint}")))
    }

    /// The vehicle flies upright.
    fn upright(&self) -> Option<Finding> {
        let up = z_up(&self.flight.attitude)?;
        let reordered = self.w_first().and_then(|attitude| z_up(&attitude))?;
        let what = format!("the vehicle is upside down: its z axis points {up:.2} up in the median");
        let fits = (reordered > 0.8).then(|| {
            format!("the order w, x, y, z ({reordered:.2}): name the columns in the order x, y, z, w")
        });
        (up < 0.3).then(|| finding(Quantity::Attitude, fits, &what))
    }

    /// An attitude turns where the gyroscope does.
    fn still(&self) -> Option<Finding> {
        let still = still::turning(&self.flight.attitude, &self.flight.angular_velocity)?;
        let what = format!(
            "it stays the same from {:.3} s to {:.3} s, while the gyroscope turns by {:.1} degrees",
            still.from_s,
            still.to_s,
            still.turned_rad.to_degrees()
        );
        let fits = "a part without that by `from_s` and `to_s`, or a flight without `attitude`,";
        self.flight.assumed.is_empty().then(|| finding(Quantity::Attitude, Some(fits.to_owned()), &what))
    }

    /// The velocity is the position's derivative.
    fn velocity(&self) -> Option<Finding> {
        let quantity = Quantity::Velocity;
        let pairs = Pairs::velocities(&self.flight.position, &self.flight.velocity, VELOCITY_WINDOW_S);
        // A position in too large a unit makes everything look quiet: the share of noise decides then.
        let agreement = pairs.agreement(QUIET_SPEED_M_S * self.least_scale(Quantity::Position))?;
        let what = format!("it is {:.5} times the derivative of the position", agreement.slope);
        if agreement.correlation > SAME {
            let position =
                self.units.unit_that_fits(Quantity::Position, 1.0 / agreement.slope, DERIVATIVE_TOLERANCE);
            let Some(finding) =
                self.units.by_unit_or_scale(quantity, agreement.slope, DERIVATIVE_TOLERANCE, &what)
            else {
                return late(quantity, agreement);
            };
            return Some(match (position, &finding.fits) {
                (Some(position), Some(velocity)) => {
                    let both = format!("{velocity} here or {position} of `position`");
                    Finding { message: finding.message.replacen(velocity, &both, 1), ..finding }
                }
                _ => finding,
            });
        }
        let turned = pairs.turned(|v| Vector3::new(v.y, v.x, -v.z)).agreement(0.0);
        let fits = turned
            .filter(|turned| turned.correlation > SAME)
            .map(|_| format!("{} (x and y change places, z its sign)", self.other_frame(quantity)));
        let what = format!(
            "it has a correlation of {:.2} with the derivative of the position{}",
            agreement.correlation,
            if fits.is_some() { "" } else { "; it may be in the body, or late" }
        );
        Some(finding(quantity, fits, &what))
    }

    /// The position accelerates as and to where the vehicle leans, unless a rig holds it.
    fn place(&self) -> Option<Finding> {
        let is_held = matches!(hold(self.flight, self.vehicle.gravity_m_s2), Hold::Held(_));
        if is_held { None } else { self.leaning().or_else(|| self.axes()) }
    }

    /// The position, or else the velocity, accelerates as the vehicle leans.
    fn leaning(&self) -> Option<Finding> {
        if !self.flight.assumed.is_empty() {
            return None;
        }
        let (quantity, pairs) = self.leaning_pairs();
        let agreement = pairs.agreement(QUIET_ACCELERATION_M_S2 * self.least_scale(quantity))?;
        let factor = 1.0 / agreement.slope;
        if agreement.correlation <= GUSTY || libm::log(factor).abs() < tolerance_of_lean(agreement) {
            return None;
        }
        let what = format!("it accelerates {factor:.4} times as much as the vehicle leans");
        let declared = format!("declared in {}, {what}", self.units.unit(quantity));
        let unit = self.units.unit_that_fits(quantity, factor, LEANING_TOLERANCE);
        // Leaning against gusts is in the size of the lean, but not in its regression on the acceleration.
        let mut factors = [factor, factor / agreement.correlation].into_iter();
        let is_alone =
            factors.any(|factor| self.units.unit_that_fits(quantity, factor, LEANING_EXACT).is_some());
        if pairs.agreement(QUIET_ACCELERATION_M_S2).is_none() && !(is_alone && self.is_free(quantity)) {
            // Also what hangs on a rig leans and hardly moves.
            let hint = unit.map_or(String::new(), |unit| format!("; on a rig, or in another unit ({unit})"));
            return Some(finding(quantity, None, &(declared + &hint)));
        }
        let unit =
            unit.map(|unit| if is_alone { unit } else { self.units.scale_before(quantity, factor, &unit) });
        let fits = either(unit, self.angles_that_fit(factor));
        Some(match fits {
            None => self.units.by_scale(quantity, factor, &what),
            fits => finding(quantity, fits, &declared),
        })
    }

    /// True if what follows the lean, and by far too little, is on no rig: so it is declared, or the position is not that of a
    /// point that turns with the vehicle.
    fn is_free(&self, quantity: Quantity) -> bool {
        self.flight.on_rig == Some(false) || (quantity == Quantity::Position && !turns_about(self.flight))
    }

    /// The vehicle's leaning against the acceleration of its position, or else of its velocity. Without their means: a vehicle leans
    /// into a steady wind and stays where it is.
    fn leaning_pairs(&self) -> (Quantity, Pairs) {
        self.leaning_pairs_of(&self.flight.attitude)
    }

    /// The same with this attitude.
    pub fn leaning_pairs_of(&self, attitude: &Channel<4>) -> (Quantity, Pairs) {
        let (flight, gravity_m_s2) = (self.flight, self.vehicle.gravity_m_s2);
        if flight.position.is_empty() {
            let leaning = Pairs::leaning_of(attitude, gravity_m_s2);
            let pairs =
                Pairs::accelerations(&leaning, &flight.velocity, &flight.position, LEANING_WINDOW_S).level();
            return (Quantity::Velocity, pairs.without_means());
        }
        (Quantity::Position, self.leaning_pairs_with(attitude, &flight.position))
    }

    /// The lean of this attitude against the acceleration of this position.
    fn leaning_pairs_with(&self, attitude: &Channel<4>, position: &Channel<3>) -> Pairs {
        Pairs::leaning(attitude, position, self.vehicle.gravity_m_s2, LEANING_WINDOW_S).without_means()
    }

    /// The position accelerates to where the vehicle leans.
    fn axes(&self) -> Option<Finding> {
        let (attitude, position) = (&self.flight.attitude, &self.flight.position);
        let agreement = |attitude: &Channel<4>, position: &Channel<3>| {
            let agreement = self.leaning_pairs_with(attitude, position).agreement(QUIET_ACCELERATION_M_S2);
            agreement.filter(|_| self.flight.assumed.is_empty()).map(|agreement| agreement.correlation)
        };
        let declared = agreement(attitude, position).filter(|correlation| *correlation < SAME)?;
        let is_euler = self.units.declared(Quantity::Attitude)?.euler.is_some();
        let of_angles = ANGLE_MISTAKES.iter().filter(|_| is_euler).filter_map(|(advice, change)| {
            Some((*advice, agreement(&with_angles(attitude, *change), position)?))
        });
        let of_position = POSITION_MISTAKES.iter().filter_map(|(advice, change)| {
            let values = position.values.iter().map(|position| change(*position)).collect();
            let changed = Channel { time_s: position.time_s.clone(), values };
            Some((*advice, agreement(attitude, &changed)?))
        });
        let tried: Vec<(&str, f64)> = of_angles.chain(of_position).collect();
        let best = tried.iter().map(|(_, correlation)| *correlation).fold(-1.0, f64::max);
        let is_clear = is_clearly_better(best, declared);
        // With little yaw a pose tells not which of its halves is turned round.
        let alike = tried.iter().filter(|(_, correlation)| *correlation > GUSTY.max(best - ALIKE));
        let advice = alike.map(|(advice, _)| *advice).collect::<Vec<_>>().join(", or ");
        let what = of_lean(declared, best);
        let quantity = if is_euler { Quantity::Attitude } else { Quantity::Position };
        (is_clear || declared < AGAINST).then(|| finding(quantity, is_clear.then_some(advice), &what))
    }

    /// The unit of Euler angles in which a vehicle that leans or turns `factor` times too little would not.
    pub fn angles_that_fit(&self, factor: f64) -> Option<String> {
        let entry = self.units.declared(Quantity::Attitude)?;
        entry.euler.as_ref()?;
        let declared = entry.unit.as_deref()?;
        let (name, other) = ANGLE.units.iter().find(|unit| unit.0 != declared)?;
        let off = libm::log(other / ANGLE.factor(declared)? / factor).abs();
        (off < libm::log(LEANING_TOLERANCE)).then(|| format!("{} of `attitude`", of_unit(name)))
    }

    /// Returns the least ratio that the values as read may have to the true ones, if the log has another unit.
    fn least_scale(&self, quantity: Quantity) -> f64 {
        let declared = self.units.factor(quantity);
        let largest = quantity.dimension().units.iter().map(|unit| unit.1).fold(declared, f64::max);
        declared / largest
    }

    /// The position does not change faster than vehicles fly.
    fn speed(&self) -> Option<Finding> {
        let (quantity, position) = (Quantity::Position, &self.flight.position);
        let pairs = Pairs::velocities(position, position, VELOCITY_WINDOW_S);
        let speed = median(pairs.derived.iter().map(|velocity| velocity.norm()))?;
        let what = format!("its median speed is {speed:.1} m/s");
        let fits = self.units.units_within(quantity, speed, (0.0, SPEED_MAX_M_S));
        (speed > SPEED_MAX_M_S).then(|| finding(quantity, fits, &what))
    }

    /// Iterates over the numbers of the rotors that the vehicle has.
    fn of_rotors<'c>(&self, channel: &'c Channel<ROTORS_MAX>) -> impl Iterator<Item = f64> + Clone + use<'c> {
        let count = self.vehicle.rotors.len();
        channel.values.iter().flat_map(move |each| each.iter().take(count).copied())
    }

    /// The commands lie in the vehicle's range.
    fn commands(&self) -> Option<Finding> {
        let quantity = Quantity::Command;
        let map = self.vehicle.command;
        let (low, high) = range(self.of_rotors(&self.flight.command))?;
        let tolerance = 0.05 * (map.max - map.min);
        let constant =
            if low.total_cmp(&high).is_eq() { " and never change (motors that are not armed?)" } else { "" };
        let log = self.units.commands_in_log([low, high], map);
        let [log_low, log_high] = log.map(short);
        let read = match self.units.unit(quantity) {
            unit @ (FRACTION | PERCENT) => {
                format!(" in the log ({}), read as {} to {} counts", of_unit(unit), short(low), short(high))
            }
            _ if log != [low, high] => format!(" in the log, read as {} to {}", short(low), short(high)),
            _ => String::new(),
        };
        let what = format!(
            "its commands go from {log_low} to {log_high}{read}{constant}, the vehicle's from {} to {} (hover {:.1})",
            map.min,
            map.max,
            self.vehicle.hover_command()
        );
        let share = match self.units.unit(quantity) {
            "count" if high <= 1.001 && map.max > 50.0 => Some(FRACTION),
            "count" if high <= 100.1 && map.max > 1000.0 => Some(PERCENT),
            FRACTION | PERCENT if high > 20.0 * map.max => Some("count"),
            _ => None,
        };
        // A motor at rest is zero whatever the smallest command, and then no command says anything.
        if let Some(unit) = share.filter(|_| high > 0.0) {
            return Some(finding(quantity, Some(of_unit(unit)), &what));
        }
        let outside = high > map.max + tolerance || low < (map.min - tolerance).min(0.0);
        let far = high > 1.5 * map.max + tolerance;
        let fits = match self.units.unit(quantity) {
            // No share of a range is beyond it.
            FRACTION | PERCENT if outside => {
                Some("a `scale` by which full thrust is the whole range, or `unit = \"count\"`,".to_owned())
            }
            _ => far.then(|| "a vehicle file with their range in its `[command]`".to_owned()),
        };
        if outside || high < map.min {
            return Some(finding(quantity, fits, &what));
        }
        self.lift(&what)
    }

    /// The thrust of the commands bears the vehicle, if it moves freely.
    fn lift(&self, range: &str) -> Option<Finding> {
        let vehicle = self.vehicle;
        let thrust = |commands: &[f64; ROTORS_MAX]| vehicle.static_thrust_by(&vehicle.command, commands);
        let thrusts = || self.flight.command.values.iter().map(thrust);
        // On the ground motors idle.
        let high = usual_greatest(thrusts())?;
        let is_airborne = |commands: &&[f64; ROTORS_MAX]| thrust(commands) > AIRBORNE * high;
        let airborne: Vec<[f64; ROTORS_MAX]> =
            self.flight.command.values.iter().filter(is_airborne).copied().collect();
        let bearing = Bearing::of(vehicle, &airborne)?;
        let factor = bearing.share;
        let is_judged = factor.is_finite() && !LIFT_RANGE.contains(&factor);
        if !is_judged || hold(self.flight, vehicle.gravity_m_s2) != Hold::Free {
            return None;
        }
        let what = format!("{range}; in flight their thrust is {factor:.2} times the weight");
        let fits = format!(
            "a vehicle file with the `[command]`, thrust and mass of this vehicle, or another `scale` of the commands{},",
            bearing.fitting().map_or(String::new(), |fitting| format!(" ({fitting})"))
        );
        Some(finding(Quantity::Command, Some(fits), &what))
    }

    /// The rotors turn about as fast as hover needs.
    fn rotor_speed(&self) -> Option<Finding> {
        let speeds = self.of_rotors(&self.flight.rotor_speed);
        // One spike must not make all others look like rotors at rest.
        let high = usual_greatest(speeds.clone())?;
        let turning = median(speeds.filter(|speed| *speed > 0.3 * high))?;
        let hover = self.vehicle.hover_speed_rad_s();
        let factor = turning / hover;
        let what = format!("its median is {turning:.1} rad/s, hover needs {hover:.1} rad/s");
        if !(hover.is_finite() && hover > 0.0) {
            return None;
        }
        let quantity = Quantity::RotorSpeed;
        let found = self.units.by_unit(quantity, factor, ROTOR_SPEED_TOLERANCE, &what)?;
        if let Some(mechanical) = self.mechanical(factor) {
            return Some(finding(quantity, either(found.fits, Some(mechanical)), &what));
        }
        if found.fits.is_some() || (0.5..2.0).contains(&factor) {
            return found.fits.is_some().then_some(found);
        }
        if let Some(hundreds) = self.hundreds_of_electrical(factor) {
            return Some(finding(quantity, Some(hundreds), &what));
        }
        let poles = self.poles(factor);
        if !is_gross(factor) {
            let hint = poles.map_or(String::new(), |poles| format!("; electrical speeds need {poles}"));
            return Some(finding(quantity, None, &format!("{what}{hint}")));
        }
        Some(match poles {
            None => self.units.by_scale(quantity, factor, &what),
            Some(poles) => {
                finding(quantity, Some(format!("if these speeds are electrical, {poles},")), &what)
            }
        })
    }

    /// Note that the log has hundreds of electrical revolutions a minute, where they are not divided by pole pairs.
    fn hundreds_of_electrical(&self, factor: f64) -> Option<String> {
        let entry = self.units.declared(Quantity::RotorSpeed)?;
        let pairs = factor * HUNDREDS * ROTOR_SPEED.factor("rpm")? / self.units.factor(Quantity::RotorSpeed);
        let is_plain = entry.scale.is_none() && entry.pole_pairs.is_none();
        (is_plain && POLE_PAIRS.contains(&pairs))
            .then(|| format!("{} with the motor's `pole_pairs`, here about {pairs:.0},", of_hundreds()))
    }

    /// Returns the words for mechanical speeds, if the log's are divided by pole pairs and would be right without.
    fn mechanical(&self, factor: f64) -> Option<String> {
        let pairs = self.units.declared(Quantity::RotorSpeed)?.pole_pairs.filter(|pairs| *pairs > 1)?;
        let is_near = libm::log(factor * f64::from(pairs)).abs() < libm::log(ROTOR_SPEED_TOLERANCE);
        is_near.then(|| "mechanical speeds, without `pole_pairs`,".to_owned())
    }

    /// Returns advice of `pole_pairs`, where so many are possible. Their number is known from the motor; a hover shows it only
    /// roughly.
    fn poles(&self, factor: f64) -> Option<String> {
        let declared =
            self.units.declared(Quantity::RotorSpeed).and_then(|entry| entry.pole_pairs).unwrap_or(1);
        let pairs = factor * f64::from(declared);
        POLE_PAIRS
            .contains(&pairs)
            .then(|| format!("`pole_pairs`, half the number of a motor's magnets, here about {pairs:.0}"))
    }

    /// The voltage is one that batteries have.
    fn voltage(&self) -> Option<Finding> {
        let quantity = Quantity::BatteryVoltage;
        let volts = median(self.flight.battery_voltage.values.iter().map(|value| value[0]))?;
        let (low, high) = VOLTAGE_RANGE_V;
        let what = format!("its median is {volts} V, batteries have {low} to {high} V");
        let fits = self.units.units_within(quantity, volts, VOLTAGE_RANGE_V);
        (!(low..high).contains(&volts)).then(|| finding(quantity, fits, &what))
    }

    /// The key of the frame that the channel is not declared in.
    pub fn other_frame(&self, quantity: Quantity) -> String {
        let frame = self.units.declared(quantity).and_then(|entry| entry.frame);
        let other = if frame == Some(Frame::FrdNed) { "flu-enu" } else { "frd-ned" };
        format!("`frame = \"{other}\"`")
    }
}

/// The attitude with roll and pitch changed.
fn with_angles(attitude: &Channel<4>, change: fn((f64, f64)) -> (f64, f64)) -> Channel<4> {
    let changed = |wxyz: &[f64; 4]| {
        let (roll, pitch, yaw) = frame::rotation(*wxyz).euler_angles();
        let (roll, pitch) = change((roll, pitch));
        frame::euler([roll, pitch, yaw])
    };
    Channel { time_s: attitude.time_s.clone(), values: attitude.values.iter().map(changed).collect() }
}

/// Logarithm of the factor beyond which an acceleration is not that of the lean. Gusts make the lean larger, and noise the
/// acceleration: each by no more than the correlation falls.
fn tolerance_of_lean(agreement: Agreement) -> f64 {
    let loose = if agreement.correlation > SAME { 1.0 } else { agreement.correlation };
    libm::log(LEANING_TOLERANCE / loose)
}

/// Returns the words for the correlation with the lean as declared, and for the best with axes named otherwise.
fn of_lean(declared: f64, best: f64) -> String {
    let others = if best > declared + ALIKE {
        format!("; with axes named otherwise it is at best {best:.2}")
    } else {
        ", and no clearly higher one with axes named otherwise".to_owned()
    };
    format!(
        "the position's acceleration has a correlation of {declared:.2} with how the vehicle leans{others}"
    )
}

/// True if the first correlation is clearly higher than the second. In gusts the difference has to be larger.
pub fn is_clearly_better(best: f64, declared: f64) -> bool {
    let least = if best > SAME { CLEARLY } else { CLEARLY_IN_GUSTS };
    best > GUSTY && best > declared + least
}

/// Joins the fits of two as text; if only one has a fit, returns that.
pub fn either(here: Option<String>, there: Option<String>) -> Option<String> {
    match (here, there) {
        (Some(here), Some(there)) => Some(format!("{here} here or {there}")),
        (here, there) => here.or(there),
    }
}

/// The keys that declare the kind of a specific force.
fn of_kind(kind: Kind, declared: Kind) -> String {
    let holds = format!("`holds = \"{}\"`", kind.holds.name());
    let frame = if kind.frame == Frame::FrdNed { "frd-ned" } else { "flu-enu" };
    if kind.frame == declared.frame { holds } else { format!("{holds} with `frame = \"{frame}\"`") }
}

/// A note where a vector follows its derived twin but loosely.
pub fn late(channel: Quantity, agreement: Agreement) -> Option<Finding> {
    let what = format!(
        "it follows the derivative with a correlation of {:.2} only: noisy, or one is late (`delay_s`)",
        agreement.correlation
    );
    (agreement.correlation < IN_TIME).then(|| finding(channel, None, &what))
}

/// The median of how far the body's z axis points up, from -1 to 1.
fn z_up(attitude: &Channel<4>) -> Option<f64> {
    median(attitude.values.iter().map(|wxyz| (frame::rotation(*wxyz) * Vector3::z()).z))
}

fn range(numbers: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    numbers.map(|number| (number, number)).reduce(|a, b| (b.0.min(a.0), b.1.max(a.1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_better_order_of_axes_is_told_only_if_it_is_better() {
        assert!(
            of_lean(-0.16, 0.16).ends_with(
                "of -0.16 with how the vehicle leans; with axes named otherwise it is at best 0.16"
            )
        );
        assert!(of_lean(0.22, 0.21).ends_with(
            "of 0.22 with how the vehicle leans, and no clearly higher one with axes named otherwise"
        ));
    }

    #[test]
    fn in_gusts_the_lean_shows_axes_and_units_by_more() {
        assert!(
            is_clearly_better(0.75, 0.4) && !is_clearly_better(0.65, 0.3) && is_clearly_better(0.65, 0.1)
        );
        assert!(!is_clearly_better(0.55, -0.55));
        let tolerance = |correlation| libm::exp(tolerance_of_lean(Agreement { slope: 1.0, correlation }));
        assert!((tolerance(0.9) - 3.0).abs() < 1e-12 && (tolerance(0.65) - 3.0 / 0.65).abs() < 1e-12);
    }
}
