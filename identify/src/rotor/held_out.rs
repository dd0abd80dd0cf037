//! Whether the logs to test on are held out: none is a log that is fitted on, a copy of one, or a part of one.

use std::path::PathBuf;

use flights::{Channel, Comparison, same_file, twin};

use super::error::RotorError;
use super::stand::{Column, DynamicLog, Role, Stand, StaticLog};
use super::table::LogTable;

/// Refuses a stand whose logs to test on hold rows that are fitted on. What is fitted on static logs is tested on static
/// ones, and so with dynamic ones.
pub fn check(stand: &Stand) -> Result<(), RotorError> {
    pairs(&stand.statics, |log| (log.role, &log.file), of_static)?;
    pairs(&stand.dynamics, |log| (log.role, &log.file), of_dynamic)
}

fn pairs<L>(
    logs: &[L],
    of: impl Fn(&L) -> (Role, &PathBuf) + Copy,
    samples: impl Fn(&L) -> Result<Channel<3>, RotorError>,
) -> Result<(), RotorError> {
    let of_role = |role| logs.iter().filter(move |log| of(log).0 == role);
    // Each log is read once, however many it is held against.
    let mut fits: Vec<Option<Channel<3>>> = of_role(Role::Fit).map(|_| None).collect();
    for test in of_role(Role::Test) {
        let mut of_test = None;
        for (fit, other) in of_role(Role::Fit).zip(&mut fits) {
            let refused = |reason: String| RotorError::NotHeldOut {
                test: of(test).1.display().to_string(),
                fit: of(fit).1.display().to_string(),
                reason,
            };
            if let Some(how) = same_file(of(fit).1, of(test).1) {
                return Err(refused(format!("they are {how}")));
            }
            if let Comparison::Same(twin) =
                twin(once(other, || samples(fit))?, once(&mut of_test, || samples(test))?)
            {
                return Err(refused(format!("{} of {} rows are the same", twin.same, twin.compared)));
            }
        }
    }
    Ok(())
}

/// What `slot` holds, read into it if nothing was.
fn once(
    slot: &mut Option<Channel<3>>,
    read: impl FnOnce() -> Result<Channel<3>, RotorError>,
) -> Result<&Channel<3>, RotorError> {
    let channel = match slot.take() {
        Some(channel) => channel,
        None => read()?,
    };
    Ok(slot.insert(channel))
}

fn of_static(log: &StaticLog) -> Result<Channel<3>, RotorError> {
    let table = LogTable::read(&log.file)?;
    let speed = table.column(&log.speed.column, log.speed.speed())?;
    let optional = |column: &Option<Column>| match column {
        Some(column) => table.column(&column.column, column.raw()),
        None => Ok(vec![0.0; speed.len()]),
    };
    let (thrust, torque) = (optional(&log.thrust)?, optional(&log.torque)?);
    let time_s = table.times(&log.time.column, log.time.time())?;
    Ok(rows(&time_s, [&speed, &thrust, &torque]))
}

fn of_dynamic(log: &DynamicLog) -> Result<Channel<3>, RotorError> {
    let table = LogTable::read(&log.file)?;
    let speed = table.column(&log.speed.column, log.speed.speed())?;
    let command = table.column(&log.command.column, log.command.raw())?;
    let time_s = table.times(&log.time.column, log.time.time())?;
    Ok(rows(&time_s, [&speed, &command, &vec![0.0; time_s.len()]]))
}

/// The rows in which all columns have a number.
fn rows(time_s: &[f64], columns: [&Vec<f64>; 3]) -> Channel<3> {
    let mut channel = Channel::default();
    for (row, time_s) in time_s.iter().enumerate() {
        let value = columns.map(|column| column[row]);
        if value.iter().all(|number| number.is_finite()) {
            channel.time_s.push(*time_s);
            channel.values.push(value);
        }
    }
    channel
}
