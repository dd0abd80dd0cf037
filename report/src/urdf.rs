//! A vehicle in the Unified Robot Description Format, which robotics tools show and simulate.
//!
//! One link, whose name is that of the frame that recordings move: nothing of the vehicle moves against it. Its origin is the
//! centre of mass, its axes are the body's.

use crate::airframe::{Body, Paint, Part, Shape};
use diagnostics::is_printable;
use std::fmt::Write as _;

/// Mark within the first bytes of every such file: a file without it is not replaced.
pub const MARK: &str = "<!-- A vehicle of hummingbus";

/// The names of the colours, and red, green, blue and opacity. The colours are those of Okabe and Ito,
/// distinguishable without colour vision. Their assignment and the opacity of a propeller are tuned, no source.
const COLOURS: [(Paint, &str, &str); 4] = [
    (Paint::Frame, "frame", "0.25 0.25 0.25 1"),
    (Paint::Front, "front", "0.835 0.369 0 1"),
    (Paint::CounterClockwise, "counter-clockwise", "0 0.447 0.698 0.4"),
    (Paint::Clockwise, "clockwise", "0 0.62 0.451 0.4"),
];

/// The text of the file: `body`, in a link that is called `frame`.
///
/// ```
/// let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
/// let body = report::airframe::Body::of(&plant::Airframe::new(vehicle)).unwrap();
/// let text = report::urdf::text(&body, "hb_body");
/// assert!(text.contains("<link name=\"hb_body\">") && text.contains("<mass value=\"0.48\"/>"), "{text}");
/// ```
#[must_use]
pub fn text(body: &Body, frame: &str) -> String {
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    text += MARK;
    text += ": x forward, y left, z up, from the centre of mass; m, kg, rad. -->\n";
    // Writing to a string does not fail.
    let _ = writeln!(text, "<robot name=\"{}\">", escaped(&body.name));
    for (_, name, rgba) in COLOURS {
        let _ = writeln!(text, "  <material name=\"{name}\"><color rgba=\"{rgba}\"/></material>");
    }
    let _ = writeln!(text, "  <link name=\"{}\">", escaped(frame));
    text += &inertial(body);
    for part in &body.seen {
        let colour =
            COLOURS.iter().find(|(paint, _, _)| *paint == part.paint).map_or("", |(_, name, _)| name);
        text += &element("visual", part, &format!("<material name=\"{colour}\"/>"));
    }
    body.touching.iter().for_each(|part| text += &element("collision", part, ""));
    text + "  </link>\n</robot>\n"
}

fn inertial(body: &Body) -> String {
    let j = &body.inertia_B_kg_m2;
    format!(
        "    <inertial><origin xyz=\"0 0 0\" rpy=\"0 0 0\"/><mass value=\"{}\"/><inertia ixx=\"{}\" ixy=\"{}\" \
         ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/></inertial>\n",
        body.mass_kg,
        j[(0, 0)],
        j[(0, 1)],
        j[(0, 2)],
        j[(1, 1)],
        j[(1, 2)],
        j[(2, 2)],
    )
}

fn element(kind: &str, part: &Part, material: &str) -> String {
    let geometry = match part.shape {
        Shape::Box(edges_m) => format!("<box size=\"{}\"/>", numbers(edges_m)),
        Shape::Cylinder { radius_m, length_m } => {
            format!("<cylinder radius=\"{radius_m}\" length=\"{length_m}\"/>")
        }
        Shape::Ball(radius_m) => format!("<sphere radius=\"{radius_m}\"/>"),
    };
    format!(
        "    <{kind} name=\"{}\"><origin xyz=\"{}\" rpy=\"{}\"/><geometry>{geometry}</geometry>{material}</{kind}>\n",
        escaped(&part.name),
        numbers(part.centre_B_m.into()),
        numbers(part.roll_pitch_yaw_rad),
    )
}

/// Numbers with all their digits. A zero has no sign.
fn numbers(values: [f64; 3]) -> String {
    values.map(|value| (value + 0.0).to_string()).join(" ")
}

/// A name as the value of an attribute. Characters that XML cannot hold are replaced.
fn escaped(name: &str) -> String {
    name.chars().fold(String::new(), |mut text, letter| {
        match letter {
            '&' => text += "&amp;",
            '<' => text += "&lt;",
            '>' => text += "&gt;",
            '"' => text += "&quot;",
            '\t' | '\n' | '\r' => text.push(' '),
            '\u{0}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => text.push(char::REPLACEMENT_CHARACTER),
            // Characters that turn or hide the text beside them stand as their numbers.
            _ if !is_printable(letter) => text += &format!("&#{};", u32::from(letter)),
            _ => text.push(letter),
        }
        text
    })
}

#[cfg(test)]
mod tests {
    use super::{escaped, numbers};

    #[test]
    fn names_are_escaped_and_zeros_have_no_sign() {
        assert_eq!(escaped("a \"<b>\" & \u{7}c\n"), "a &quot;&lt;b&gt;&quot; &amp; \u{fffd}c ");
        assert_eq!(escaped("a\u{202e}b\u{200b}é"), "a&#8238;b&#8203;é");
        assert_eq!(numbers([-0.0, 1e-7, -2.5]), "0 0.0000001 -2.5");
    }
}
