//! Proof of a saved state: the FMU steps, and a replay from the state has to give the same values.
//!
//! Several tools export FMUs that say they save their state and leave part of it out. A controller that is swapped in, or a run
//! that goes on from a checkpoint, would then differ without a word.

use crate::instance::Instance;
use crate::values::{Number, Values};

/// Steps before the state is saved, and steps that are replayed.
const STEPS: usize = 200;

/// A variable of the proof: handle, name, and room for its value.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Its handle.
    pub reference: u32,
    /// Its name.
    pub name: String,
    /// Its values.
    pub values: Values,
}

/// Steps `first`, saves its state and replays it: on the instance itself, and on another one of `make`.
/// `inputs` are set to different values at each step, `outputs` are compared. Returns the number of bytes of the state.
///
/// # Errors
/// Reason why the state is not to be trusted, with what was found.
pub fn replay(
    first: Box<dyn Instance>,
    make: &dyn Fn() -> Result<Box<dyn Instance>, String>,
    period_s: f64,
    inputs: &[Probe],
    outputs: &[Probe],
) -> Result<usize, String> {
    let flown = |reason| format!("it fails when it is stepped from its start values: {reason}");
    let inputs = &started(&*first, inputs).map_err(flown)?;
    run(&*first, period_s, 0, inputs, outputs).map_err(flown)?;
    let state = first.save()?;
    let after = run(&*first, period_s, STEPS, inputs, outputs).map_err(flown)?;
    first.restore(&state)?;
    same(&after, &run(&*first, period_s, STEPS, inputs, outputs)?, "the same instance")?;
    let second = make()?;
    second.restore(&state)?;
    same(&after, &run(&*second, period_s, STEPS, inputs, outputs)?, "another instance")?;
    Ok(state.len())
}

/// The inputs with the values that the FMU has given them.
fn started(instance: &dyn Instance, inputs: &[Probe]) -> Result<Vec<Probe>, String> {
    let mut inputs = inputs.to_vec();
    for input in &mut inputs {
        instance.get(&[input.reference], &mut input.values)?;
    }
    Ok(inputs)
}

/// Values of the outputs after each step.
type Course = Vec<(usize, String, Values)>;

fn run(
    instance: &dyn Instance,
    period_s: f64,
    from: usize,
    inputs: &[Probe],
    outputs: &[Probe],
) -> Result<Course, String> {
    let mut course = Vec::new();
    for step in from..from + STEPS {
        for (index, input) in inputs.iter().enumerate() {
            let mut values = input.values.clone();
            for element in 0..values.len() {
                // A small change, another at each step and for each input; integers and booleans stay as they are.
                let number = match values.get(element) {
                    Number::Float(start) => {
                        let part = 1e-3 * ((step * 7 + index * 3 + element) % 11) as f64;
                        Number::Float(if start == 0.0 { part } else { start * (1.0 + part) })
                    }
                    integer => integer,
                };
                values.set(element, number);
            }
            instance.set(&[input.reference], &values)?;
        }
        instance.step(step as f64 * period_s, period_s)?;
        for output in outputs {
            let mut values = output.values.clone();
            instance.get(&[output.reference], &mut values)?;
            course.push((step, output.name.clone(), values));
        }
    }
    Ok(course)
}

fn same(first: &Course, replayed: &Course, who: &str) -> Result<(), String> {
    for ((step, name, values), (_, _, again)) in first.iter().zip(replayed) {
        for element in 0..values.len() {
            let (before, after) = (values.get(element), again.get(element));
            if !is_same(before, after) {
                return Err(format!(
                    "after its state was restored in {who}, `{name}` is {after} at step {step}, and was {before}"
                ));
            }
        }
    }
    Ok(())
}

/// Bit for bit.
fn is_same(one: Number, other: Number) -> bool {
    match (one, other) {
        (Number::Float(one), Number::Float(other)) => one.to_bits() == other.to_bits(),
        (one, other) => one == other,
    }
}

#[cfg(test)]
mod tests {
    use super::{Probe, replay};
    use crate::functions::{Component, StateFunctions};
    use crate::instance::Instance;
    use crate::values::{Number, ValueType, Values};
    use std::cell::Cell;
    use std::ffi::CStr;

    /// An integrator; a forgetful one leaves its sum out of the state.
    struct Integrator {
        input: Cell<f64>,
        sum: Cell<f64>,
        is_forgetful: bool,
    }

    impl Instance for Integrator {
        fn set(&self, _: &[u32], values: &Values) -> Result<(), String> {
            self.input.set(values.get(0).float());
            Ok(())
        }

        fn set_text(&self, _: u32, _: &CStr) -> Result<(), String> {
            Ok(())
        }

        fn get(&self, _: &[u32], values: &mut Values) -> Result<(), String> {
            values.set(0, Number::Float(self.sum.get())).ok_or_else(String::new)
        }

        fn initialize(&self) -> Result<(), String> {
            Ok(())
        }

        fn step(&self, _: f64, period_s: f64) -> Result<(), String> {
            self.sum.set(self.sum.get() + period_s * self.input.get());
            Ok(())
        }

        fn states(&self) -> Option<(&StateFunctions, Component)> {
            None
        }

        fn save(&self) -> Result<Vec<u8>, String> {
            let sum = if self.is_forgetful { 0.0 } else { self.sum.get() };
            Ok(sum.to_le_bytes().to_vec())
        }

        fn restore(&self, state: &[u8]) -> Result<(), String> {
            self.sum.set(f64::from_le_bytes(state.try_into().map_err(|_| "eight bytes")?));
            Ok(())
        }
    }

    fn proved(is_forgetful: bool) -> Result<usize, String> {
        let probe = |name: &str| Probe {
            reference: 1,
            name: name.to_owned(),
            values: Values::zeros(ValueType::Float64, 1, false).unwrap(),
        };
        let make = || -> Result<Box<dyn Instance>, String> {
            let integrator = Integrator { input: Cell::new(0.0), sum: Cell::new(0.0), is_forgetful };
            Ok(Box::new(integrator))
        };
        replay(make().unwrap(), &make, 0.001, &[probe("u")], &[probe("y")])
    }

    #[test]
    fn a_state_that_leaves_something_out_is_found() {
        assert_eq!(proved(false), Ok(8), "bytes of the state");
        let reason = proved(true).unwrap_err();
        assert!(
            reason.contains("in the same instance, `y` is ") && reason.contains("at step 200"),
            "{reason}"
        );
    }
}
