//! First vehicle files from descriptions of robots: URDF and SDF.
//!
//! | room | content |
//! |---|---|
//! | `xml` | XML within bounds, whose errors have places |
//! | `model` | links, joints and motors, whatever the format |
//! | `tree` | the order of links from the root |
//! | `urdf`, `sdf`, `sdf_notes` | the formats; properties of SDF that a vehicle file does not have |
//! | `included` | models in other files that an SDF model includes |
//! | `plugins` | plugins of Gazebo that drive rotors |
//! | `body` | mass, centre of mass and inertia of all links |
//! | `rotors` | the rotors among the joints |
//! | `vehicle` | the numbers of the vehicle file |
//! | `parts` | the parts that a vehicle file is written from |
//! | `notes` | notes on the model |
//! | `text` | its text |

mod body;
mod included;
mod model;
mod notes;
mod parts;
mod plugins;
mod rotors;
mod sdf;
mod sdf_notes;
mod text;
mod tree;
mod urdf;
mod vehicle;
mod xml;

use diagnostics::Diagnostic;
use std::path::Path;

use crate::reference::HUMMINGBIRD;
use crate::vehicle::Vehicle;
use xml::Source;

pub use included::Read;
pub use text::MARK;

/// A vehicle file that was made from a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Converted {
    /// Text of the vehicle file.
    pub text: String,
    /// Numbers that the model does not have: key and origin of each.
    pub assumed: Vec<String>,
    /// Properties of the model that the vehicle file does not show, or that are unlikely.
    pub notes: Vec<String>,
    /// The vehicle of the file.
    pub vehicle: Vehicle,
}

/// Makes a vehicle file of the `text` of a model in URDF or SDF; `file` is its name. Missing numbers are those of the
/// Hummingbird. Models in other files are refused: [`convert_with`] reads them.
///
/// # Errors
/// If the text is not such a model, is not physical, or does not have 1 to 12 rotors.
pub fn convert(text: &str, file: &str) -> Result<Converted, Diagnostic> {
    convert_with(text, file, &|_| None)
}

/// As [`convert`]; `read` returns the text of the model that an `<include>` of SDF names by its URI, such as `model://gps`.
///
/// # Errors
/// As [`convert`], and if an included model cannot be read.
pub fn convert_with(text: &str, file: &str, read: &Read<'_>) -> Result<Converted, Diagnostic> {
    let text = included::expand(Source { file, text }, read)?;
    let source = Source { file, text: &text };
    let document = source.parse()?;
    let root = document.root_element();
    let model = match root.tag_name().name() {
        "robot" => urdf::read(source, root)?,
        "sdf" => sdf::read(source, root)?,
        other => {
            let message = format!("expected <robot> (URDF) or <sdf> (SDF), found <{other}>");
            return Err(source
                .fault(xml::start_of(root), message)
                .help("convert the model to URDF or SDF in the program that it is for"));
        }
    };
    let body = body::of(&model)?;
    let rotors = rotors::find(&model, &body.centre)?;
    let reference = Vehicle::parse(HUMMINGBIRD, "hummingbird.toml")?;
    let name = Path::new(file).file_name().map_or(file.into(), |name| name.to_string_lossy());
    let (written, notes) = parts::Parts { model: &model, body, rotors, reference }.write(&name)?;
    let vehicle = Vehicle::parse(&written.text, file).map_err(|error| unlikely(source, &error))?;
    Ok(Converted { text: written.text, assumed: written.assumed, notes, vehicle })
}

/// The error for a number that no vehicle has, and that follows from several of the model.
fn unlikely(source: Source, error: &Diagnostic) -> Diagnostic {
    source
        .whole(format!("expected the numbers of a vehicle; of the vehicle file: {}", error.error))
        .help("correct the masses, places and plugins of the model from which this number follows")
}
