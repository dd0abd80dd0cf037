//! Properties of an SDF file that a vehicle file does not have: gravity of the world and of single links, other models of the
//! world.

use diagnostics::Diagnostic;
use roxmltree::Node;

use super::parts::GRAVITY_M_S2;
use super::text::plain;
use super::xml::{Source, child, children, name_of, text_in, text_of};

/// Difference of a world's gravity from standard gravity that is told, in m/s^2: worlds round it to 9.8, and the earth has
/// 9.76 to 9.83.
const TOLD_M_S2: f64 = 0.06;
/// Names in one note.
const NAMES_MAX: usize = 4;

/// Notes on the file `sdf` of `model`.
///
/// # Errors
/// If the gravity of a world is not three finite numbers.
pub fn of(source: Source, sdf: Node, model: Node) -> Result<Vec<String>, Diagnostic> {
    let mut notes = Vec::new();
    for world in children(sdf, "world") {
        notes.extend(gravity(source, world)?);
    }
    notes.extend(weightless(model));
    notes.extend(other_models(sdf));
    Ok(notes)
}

/// Gravity of a world that is not that of the vehicle file.
fn gravity(source: Source, world: Node) -> Result<Option<String>, Diagnostic> {
    let Some(node) = child(world, "gravity") else { return Ok(None) };
    let [x, y, z] = source.numbers(node, "gravity", &text_in(node))?;
    let is_standard = x.abs().max(y.abs()).max((z + GRAVITY_M_S2).abs()) <= TOLD_M_S2;
    Ok((!is_standard).then(|| {
        format!(
            "the world's <gravity> is [{x}, {y}, {z}] m/s^2; body.gravity is standard gravity, {GRAVITY_M_S2} m/s^2 \
             downwards: correct it for flights elsewhere"
        )
    }))
}

/// Links on which the simulator's gravity does not act, alone or as parts of the model.
fn weightless(model: Node) -> Option<String> {
    let is_off = |node: &Node| {
        ["gravity", "enable_gravity"].iter().any(|key| {
            text_of(*node, key).is_some_and(|text| matches!(text.to_lowercase().as_str(), "0" | "false"))
        })
    };
    let names: Vec<String> = children(model, "link").filter(is_off).map(name_of).collect();
    shown(&names).map(|names| {
        format!("<gravity> is off for {names}; in the vehicle file, gravity acts on the mass of all links")
    })
}

/// Models that the world includes beside the vehicle.
fn other_models(sdf: Node) -> Option<String> {
    let includes = children(sdf, "include")
        .chain(children(sdf, "world").flat_map(|world| children(world, "include")))
        .map(|include| text_of(include, "uri").unwrap_or_else(|| "a model without <uri>".to_owned()));
    shown(&includes.collect::<Vec<_>>())
        .map(|names| format!("the file includes {names} beside the vehicle; they are not part of it"))
}

/// Names in one note; none without names.
fn shown(names: &[String]) -> Option<String> {
    let first: Vec<String> = names.iter().take(NAMES_MAX).map(|name| plain(name)).collect();
    match names.len().saturating_sub(NAMES_MAX) {
        _ if first.is_empty() => None,
        0 => Some(first.join(", ")),
        more => Some(format!("{} and {more} more", first.join(", "))),
    }
}
