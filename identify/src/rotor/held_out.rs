//! Check that the logs to test on are held out: none is a log that is fitted on, a copy of one, or a part of one.

use diagnostics::unit::SPEED;
use flights::{Channel, Comparison, Role, same_file, twin};

use super::error::RotorError;
use super::stand::{Column, Source, Stand};
use super::table::LogTable;

/// A log with the columns that distinguish its rows from another's, each with the factor of its numbers.
struct Log<'s> {
    role: Role,
    source: Source<'s>,
    columns: [Option<(&'s Column, f64)>; 3],
}

/// Refuses a stand whose logs to test on hold rows that are fitted on. Fits of static logs are tested on static
/// logs, and fits of dynamic logs on dynamic ones.
pub fn check(stand: &Stand) -> Result<(), RotorError> {
    let speed = |column| Some((column, Column::factor(column, SPEED)));
    check_pairs(stand.statics.iter().map(|log| {
        let [thrust, torque] =
            [&log.thrust, &log.torque].map(|force| force.as_ref().map(|force| (force, 1.0)));
        Log { role: log.role, source: log.source(), columns: [speed(&log.speed), thrust, torque] }
    }))?;
    check_pairs(stand.dynamics.iter().map(|log| {
        let columns = [speed(&log.speed), Some((&log.command, log.command_factor())), None];
        Log { role: log.role, source: log.source(), columns }
    }))
}

fn check_pairs<'s>(logs: impl Iterator<Item = Log<'s>>) -> Result<(), RotorError> {
    let (tests, fits): (Vec<_>, Vec<_>) = logs.partition(|log| log.role == Role::Test);
    if tests.is_empty() {
        return Ok(());
    }
    // Each log is read once, however many it is held against.
    let of_fits = fits.iter().map(Log::rows).collect::<Result<Vec<_>, _>>()?;
    for test in tests {
        let of_test = test.rows()?;
        for (fit, of_fit) in fits.iter().zip(&of_fits) {
            let reason = match (fit.same_file(&test), twin(of_fit, &of_test)) {
                (Some(how), _) => format!("they are {how}"),
                (None, Comparison::Same(twin)) => {
                    format!("{} of {} rows are the same", twin.same, twin.compared)
                }
                (None, Comparison::Other | Comparison::Unknown) => continue,
            };
            let [test, fit] = [&test, fit].map(|log| log.source.file.display().to_string());
            return Err(RotorError::NotHeldOut { test, fit, reason });
        }
    }
    Ok(())
}

impl Log<'_> {
    /// Returns how the file of another log equals this log's file; two topics of a recording are two logs.
    fn same_file(&self, other: &Self) -> Option<&'static str> {
        let (one, other) = (&self.source, &other.source);
        let have_same_bytes = || {
            let bytes = [one, other].map(|source| source.files.bytes(source.file).ok());
            bytes[0].is_some() && bytes[0] == bytes[1]
        };
        if one.topic == other.topic { same_file(one.file, other.file, have_same_bytes) } else { None }
    }

    /// The rows in which all columns have a number; one that the log does not have is zero.
    fn rows(&self) -> Result<Channel<3>, RotorError> {
        let table = LogTable::read(&self.source)?;
        let time_s = table.times();
        let read = |column: Option<(&Column, f64)>| match column {
            Some((column, factor)) => table.column(column, factor),
            None => Ok(vec![0.0; time_s.len()]),
        };
        let [a, b, c] = self.columns;
        let columns = [read(a)?, read(b)?, read(c)?];
        let rows = time_s.iter().enumerate();
        let rows = rows.map(|(row, time_s)| (*time_s, columns.each_ref().map(|column| column[row])));
        let (time_s, values) = rows.filter(|(_, row)| row.iter().all(|number| number.is_finite())).unzip();
        Ok(Channel { time_s, values })
    }
}
