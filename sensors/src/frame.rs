//! Frames of the standard messages that sensors send.

use component::context::NodeContext;
use component::messages::{FRAME_BYTES_MAX, FrameName, body_frame};
use diagnostics::ParameterError;

/// Name of the frame of the body that carries the sensor `node`: that of its vehicle.
pub(crate) fn body_frame_of(node: &str) -> String {
    body_frame(node.rsplit_once('/').map_or("", |(vehicle, _)| vehicle))
}

/// The frame `name` of the messages of the output `port`; `None` if the name is too long and `run` does not name the output.
///
/// # Errors
/// `run` names the output, and the name is too long.
pub(crate) fn frame(
    run: &NodeContext<'_>,
    port: &str,
    name: &str,
) -> Result<Option<FrameName>, ParameterError> {
    let frame = FrameName::new(name);
    if frame.is_some() || !run.outputs.contains(&port) {
        return Ok(frame);
    }
    let (length, most) = (name.len(), FRAME_BYTES_MAX - 1);
    Err(ParameterError::conflict(
        "",
        format!(
            "the frame of the output `{port}` would be `{name}`, of {length} characters, expected at most {most}; give the \
             process or its vehicle a shorter name"
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_is_in_the_frame_of_its_vehicle() {
        let cases = [("imu", "hb_body"), ("h1/imu", "h1/body"), ("h1/second-imu", "h1/body")];
        for (node, expected) in cases {
            assert_eq!(body_frame_of(node), expected);
        }
    }

    #[test]
    fn a_name_that_is_too_long_is_refused_where_the_output_is_named() {
        let name = "r".repeat(60);
        let long = format!("{name}/front");
        let run = NodeContext::new(&name, &[]);
        assert_eq!(frame(&run, "front", &long), Ok(None));
        let run = run.naming(&["front"]);
        let error = frame(&run, "front", &long).unwrap_err().to_string();
        assert!(
            error.contains("`front`") && error.contains("of 66 characters, expected at most 63"),
            "{error}"
        );
        let short = frame(&run, "front", "range/front").unwrap().unwrap();
        assert_eq!(short.as_str(), "range/front");
    }
}
