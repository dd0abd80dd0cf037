//! A file of a firmware's parameters: a name and a number a line.

use diagnostics::ParameterError;

/// Longest name, in ArduPilot (`AP_MAX_NAME_SIZE`) and in PX4.
const NAME_LENGTH_MAX: usize = 16;
/// Characters between a name and its value.
const SEPARATORS: [char; 5] = [' ', ',', '=', '\t', '\r'];
/// Number of faulty lines that are reported at most: a file of another format has a fault in each line.
const TOLD_MAX: usize = 20;

/// Names and values of `text`, the parameter `configuration`, in its order.
///
/// # Errors
/// The first lines that are not a name and a number.
pub fn read(text: &str) -> Result<Vec<(&str, &str)>, ParameterError> {
    let (mut passed, mut faulty) = (Vec::new(), Vec::new());
    for (at, line) in text.lines().enumerate() {
        match read_line(line) {
            Ok(read) => passed.extend(read),
            Err(reason) => {
                let fault = ParameterError::conflict("configuration", format!("line {}: {reason}", at + 1));
                faulty.push(Err::<(), _>(fault));
            }
        }
        if faulty.len() == TOLD_MAX {
            break;
        }
    }
    ParameterError::gather(faulty)?;
    Ok(passed)
}

/// Passes a text whose lines are names and numbers.
///
/// # Errors
/// As [`read`].
pub fn checked(text: String) -> Result<String, ParameterError> {
    read(&text)?;
    Ok(text)
}

/// Name and value of a line; none of an empty line or a comment.
fn read_line(line: &str) -> Result<Option<(&str, &str)>, String> {
    let mut words = line.split(SEPARATORS).filter(|word| !word.is_empty());
    let Some(name) = words.next().filter(|name| !name.starts_with('#')) else { return Ok(None) };
    let value = words.next().filter(|value| value.parse::<f64>().is_ok_and(f64::is_finite));
    // Ground stations export tables, whose first columns are the vehicle's and the component's numbers.
    let is_last = words.next().is_none_or(|word| word.starts_with('#'));
    match value {
        Some(value) if is_name(name) && is_last => Ok(Some((name, value))),
        _ => Err(format!(
            "expected a name of at most {NAME_LENGTH_MAX} letters, digits and underscores, and a number (`FS_THR_ENABLE 0`), \
             found `{line}`"
        )),
    }
}

/// True for letters, digits and underscores behind a first letter: a name becomes a part of PX4's start-up script.
fn is_name(name: &str) -> bool {
    name.len() <= NAME_LENGTH_MAX
        && name.starts_with(|first: char| first.is_ascii_alphabetic())
        && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_values_are_read_in_order() {
        let text =
            "# Hummingbird\n\nRC5_OPTION 153\nFRAME_TYPE,1\nSERVO2_FUNCTION=0\r\nPSC_X\t-1.5e-1  # why\n";
        let expected =
            [("RC5_OPTION", "153"), ("FRAME_TYPE", "1"), ("SERVO2_FUNCTION", "0"), ("PSC_X", "-1.5e-1")];
        assert_eq!(read(text).unwrap(), expected);
    }

    #[test]
    fn lines_that_are_no_parameters_are_named() {
        for line in [
            "RC5_OPTION",
            "RC5_OPTION on",
            "RC5_OPTION nan",
            "A_NAME_THAT_IS_TOO_LONG 1",
            "A;reboot 1",
            "$(A) 1",
            "1\t1\tMC_ROLL_P\t6.5\t9",
            "MC_ROLL_P 3.5 4.5",
        ] {
            let error = read(&format!("RC5_OPTION 153\n{line}\n")).unwrap_err().to_string();
            assert!(error.starts_with("line 2: ") && error.contains(line), "{error}");
        }
    }

    #[test]
    fn all_faulty_lines_are_told_but_of_a_file_of_another_format() {
        let told = |text: &str| {
            let errors = read(text).unwrap_err().into_each();
            errors.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        let both = told("A x\nB 1\n\n# a comment\nC\n");
        assert_eq!(both.len(), 2, "{both:?}");
        assert!(both[0].starts_with("line 1: ") && both[1].starts_with("line 5: "), "{both:?}");
        assert_eq!(told(&"<xml>\n".repeat(1000)).len(), TOLD_MAX);
    }
}
