//! The state of an airframe's effects: commands under way, charge drawn, gusts, random streams.
//!
//! It belongs to whoever moves the vehicle, beside its [`State`](crate::State). Written down and read back it goes
//! on to the same bits, random numbers included: a stream is written as its key and its position.

use crate::actuation::Actuation;
use crate::saved::{Reader, Saved, Unfit, Writer, saved_fields};
use crate::state::{PerRotor, paired};
use bus::random::{Stream, normal};

/// State of an airframe's effects from tick to tick; made by
/// [`Airframe::initial_state`](crate::Airframe::initial_state). Only its making allocates.
#[derive(Debug, Clone, PartialEq)]
pub struct AirframeState {
    /// Actuation over the tick that began last.
    pub actuation: Actuation,
    pub(crate) commands: DelayLine,
    /// One for each effect, in their order.
    pub(crate) effects: Vec<EffectState>,
}

saved_fields!(AirframeState { actuation, commands, effects });

/// State of one effect from tick to tick.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectState {
    /// The effect's own numbers, zeros at the start.
    pub numbers: [f64; 4],
    /// A number for each rotor, zeros at the start.
    pub rotors: PerRotor<f64>,
    random: Stream,
}

saved_fields!(EffectState { numbers, rotors, random });

impl EffectState {
    pub(crate) fn new(random: Stream, rotors: usize) -> Self {
        Self { numbers: [0.0; 4], rotors: PerRotor::filled(rotors, 0.0), random }
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
        self.newest = newest.ok_or(Unfit::Value("the newest command is outside the delay line"))?;
        Ok(())
    }
}

impl DelayLine {
    /// A line that holds commands of `rotors` motors for up to `ticks`.
    pub(crate) fn new(ticks: f64, rotors: usize) -> Self {
        let none = PerRotor::filled(rotors, 0.0);
        Self { ring: vec![none; ticks.ceil() as usize + 2], newest: 0, is_empty: true }
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
    fn no_delay_passes_commands_through() {
        let mut line = DelayLine::new(0.0, 4);
        for k in 0..5 {
            assert_eq!(line.pass(&[f64::from(k); 4], 0.0), [f64::from(k); 4]);
        }
    }
}
