//! The state of an airframe's effects: commands under way, charge drawn, gusts, random streams.
//!
//! It belongs to whoever moves the vehicle, beside its [`State`](crate::State). Written down and read back it goes
//! on to the same bits, random numbers included: a stream is written as its key and its position.

use crate::actuation::Actuation;
use crate::saved::{Fingerprint, Reader, STREAM_BYTES, Saved, Unfit, Writer, saved_fields};
use crate::state::{PerRotor, paired};
use component::random::{Stream, normal};

/// State of an airframe's effects from tick to tick; made by
/// [`Airframe::initial_state`](crate::Airframe::initial_state). Only its making allocates.
#[derive(Debug, Clone, PartialEq)]
pub struct AirframeState {
    /// Actuation over the tick that began last.
    pub actuation: Actuation,
    /// Voltage of the battery over the tick that begins next, if it is measured: the motors then follow it in place of the model's. It is an input
    /// from outside, set before each tick, and not written down.
    pub measured_voltage_V: Option<f64>,
    pub(crate) commands: DelayLine,
    /// One for each effect, in their order.
    pub(crate) effects: Vec<EffectState>,
}

/// The numbers of the delay line's places and of effects stand in front, so that a vehicle with others can read it.
impl Saved for AirframeState {
    fn size(&self) -> usize {
        self.counts().size() + self.actuation.size() + self.commands.size() + self.effects.size()
    }

    fn save(&self, to: &mut Writer<'_>) {
        self.counts().save(to);
        self.actuation.save(to);
        self.commands.save(to);
        self.effects.save(to);
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        if counts(from)? != self.counts() {
            return Err(Unfit::Value("it is of other effects or another delay"));
        }
        self.actuation.load(from)?;
        self.commands.load(from)?;
        self.effects.load(from)
    }

    /// Effects that the other vehicle lacks keep their states, and states of effects that this vehicle lacks are left out.
    fn adopt(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        let [places, effects] = counts(from)?;
        self.actuation.load(from)?;
        self.commands.adopt(places, self.actuation.targets_rad_s.len(), from)?;
        (0..effects).try_for_each(|_| self.adopt_effect(from))
    }
}

/// The numbers in front of a state: see [`AirframeState::counts`].
fn counts(from: &mut Reader<'_>) -> Result<[u64; 2], Unfit> {
    let mut counts = [0_u64; 2];
    counts.load(from)?;
    Ok(counts)
}

impl AirframeState {
    /// Number of places in the delay line, and number of effects.
    fn counts(&self) -> [u64; 2] {
        [self.commands.ring.len() as u64, self.effects.len() as u64]
    }

    /// Reads the state of an effect of another vehicle.
    fn adopt_effect(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        let mut kind = 0_u64;
        kind.load(from)?;
        match self.effects.iter_mut().find(|effect| effect.kind.number() == kind) {
            Some(effect) => effect.load_values(from),
            None => from.skip(EffectState::value_bytes(self.actuation.targets_rad_s.len())),
        }
    }
}

/// State of one effect from tick to tick.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectState {
    /// The effect's kind.
    kind: Fingerprint,
    /// The effect's own numbers, zeros at the start.
    pub numbers: [f64; 4],
    /// A number for each rotor, zeros at the start.
    pub rotors: PerRotor<f64>,
    random: Stream,
}

saved_fields!(EffectState { kind, numbers, rotors, random });

impl EffectState {
    pub(crate) fn new(kind: &str, random: Stream, rotors: usize) -> Self {
        let kind = Fingerprint::of(std::iter::once(kind));
        Self { kind, numbers: [0.0; 4], rotors: PerRotor::filled(rotors, 0.0), random }
    }

    /// Bytes behind the kind, of a vehicle of `rotors` rotors.
    const fn value_bytes(rotors: usize) -> usize {
        size_of::<[f64; 4]>() + rotors * size_of::<f64>() + STREAM_BYTES
    }

    /// Reads all but the kind.
    fn load_values(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        self.numbers.load(from)?;
        self.rotors.load(from)?;
        self.random.load(from)
    }

    /// The next draw from the normal distribution of mean 0 and variance 1.
    pub fn normal(&mut self) -> f64 {
        normal(&mut self.random)
    }

    /// The next four draws from the normal distribution of mean 0 and variance 1.
    pub fn normals(&mut self) -> [f64; 4] {
        std::array::from_fn(|_| self.normal())
    }
}

/// Reason why a delay line does not fit.
const OUTSIDE: Unfit = Unfit::Value("the newest command is outside the delay line");

/// The commands of the last ticks, in a ring.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DelayLine {
    ring: Vec<PerRotor<f64>>,
    newest: usize,
    is_empty: bool,
}

impl Saved for DelayLine {
    fn size(&self) -> usize {
        self.ring.size() + size_of::<u64>() + self.is_empty.size()
    }

    fn save(&self, to: &mut Writer<'_>) {
        self.ring.save(to);
        (self.newest as u64).save(to);
        self.is_empty.save(to);
    }

    fn load(&mut self, from: &mut Reader<'_>) -> Result<(), Unfit> {
        let mut newest = 0_u64;
        self.ring.load(from)?;
        newest.load(from)?;
        self.is_empty.load(from)?;
        let newest = usize::try_from(newest).ok().filter(|newest| *newest < self.ring.len());
        self.newest = newest.ok_or(OUTSIDE)?;
        Ok(())
    }
}

impl DelayLine {
    /// A line that holds commands of `rotors` motors for up to `ticks`.
    pub(crate) fn new(ticks: f64, rotors: usize) -> Self {
        let none = PerRotor::filled(rotors, 0.0);
        Self { ring: vec![none; ticks.ceil() as usize + 2], newest: 0, is_empty: true }
    }

    /// Goes on from the commands in a line of `places` for `rotors` motors. Commands before its oldest count as equal to it.
    fn adopt(&mut self, places: u64, rotors: usize, from: &mut Reader<'_>) -> Result<(), Unfit> {
        let mut other = Self { ring: Vec::new(), newest: 0, is_empty: true };
        for _ in 0..places {
            let mut commands = PerRotor::filled(rotors, 0.0);
            commands.load(from)?;
            other.ring.push(commands);
        }
        let mut newest = 0_u64;
        newest.load(from)?;
        other.is_empty.load(from)?;
        let newest = usize::try_from(newest).ok().filter(|newest| *newest < other.ring.len());
        other.newest = newest.ok_or(OUTSIDE)?;
        (self.newest, self.is_empty) = (0, other.is_empty);
        let (count, others) = (self.ring.len(), other.ring.len());
        for ticks in 0..count {
            self.ring[(count - ticks) % count] = other.back(ticks.min(others - 1));
        }
        Ok(())
    }

    /// Takes the commands of this tick and gives those of `ticks` before, linear between two ticks. The first
    /// commands count as held since ever. More ticks than the line was made for count as as many as it holds.
    pub(crate) fn pass(&mut self, commands: &[f64], ticks: f64) -> PerRotor<f64> {
        let commands = PerRotor::from_iter(commands.iter().copied());
        if self.is_empty {
            self.ring.fill(commands);
            self.is_empty = false;
        }
        self.newest = (self.newest + 1) % self.ring.len();
        self.ring[self.newest] = commands;
        let held = ticks.min((self.ring.len() - 2) as f64);
        let (whole, part) = (held.floor(), held.fract());
        let (late, later) = (self.back(whole as usize), self.back(whole as usize + 1));
        if part == 0.0 {
            late
        } else {
            paired(&late, &later, |late, later| late * (1.0 - part) + later * part)
        }
    }

    fn back(&self, ticks: usize) -> PerRotor<f64> {
        self.ring[(self.newest + self.ring.len() - ticks) % self.ring.len()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_of_whole_ticks_gives_the_very_numbers_back() {
        let mut line = DelayLine::new(3.0, 4);
        let given: Vec<_> = (0..10).map(|k| line.pass(&[f64::from(k) + 0.1; 4], 3.0)[0]).collect();
        assert_eq!(given, [0.1, 0.1, 0.1, 0.1, 1.1, 2.1, 3.1, 4.1, 5.1, 6.1]);
    }

    #[test]
    fn a_part_of_a_tick_lies_between_its_ends() {
        let mut line = DelayLine::new(1.25, 4);
        let given: Vec<_> = (0..5).map(|k| line.pass(&[f64::from(k); 4], 1.25)[2]).collect();
        assert_eq!(given, [0.0, 0.0, 0.75, 1.75, 2.75]);
    }

    #[test]
    fn a_longer_and_a_shorter_line_go_on_from_the_same_commands() {
        let mut line = DelayLine::new(3.0, 4);
        for k in 0..10 {
            line.pass(&[f64::from(k); 4], 3.0);
        }
        let mut bytes = vec![0; line.size()];
        line.save(&mut Writer::new(&mut bytes));
        let next = |ticks: f64| {
            let mut other = DelayLine::new(ticks, 4);
            other.adopt(5, 4, &mut Reader::new(&bytes)).unwrap();
            [10.0, 11.0].map(|command| other.pass(&[command; 4], ticks)[0])
        };
        assert_eq!((next(0.0), next(2.0), next(3.0)), ([10.0, 11.0], [8.0, 9.0], [7.0, 8.0]));
        // The oldest command that is known is that of tick 5.
        assert_eq!(next(8.0), [5.0, 5.0]);
        assert!(DelayLine::new(3.0, 4).adopt(6, 4, &mut Reader::new(&bytes)).is_err());
    }

    #[test]
    fn no_delay_passes_commands_through() {
        let mut line = DelayLine::new(0.0, 4);
        for k in 0..5 {
            assert_eq!(line.pass(&[f64::from(k); 4], 0.0), [f64::from(k); 4]);
        }
    }
}
