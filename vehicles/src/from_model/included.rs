//! Models in other files, put in the place of `<include>` elements.

use diagnostics::Diagnostic;
use roxmltree::Node;

use super::xml::{Source, child, children, start_of, text_of};

/// Models within models at most.
const DEPTH_MAX: usize = 8;
/// Bytes of the whole text at most.
const BYTES_MAX: usize = 16 << 20;

/// Text of the model that a URI such as `model://gps` names, or the reason why it cannot be read; `None` if there is none.
pub type Read<'r> = dyn Fn(&str) -> Option<Result<String, String>> + 'r;

/// The text of `source` with the models that it includes, as `<model>` elements. Each stands on one line, so that the lines of
/// the file keep their numbers. An `<include>` whose model is not found stays.
///
/// # Errors
/// If a model cannot be read, is not SDF, or the models include each other without an end.
pub fn expand(source: Source, read: &Read) -> Result<String, Diagnostic> {
    let mut text = source.text.to_owned();
    for _ in 0..DEPTH_MAX {
        let expanded = expand_once(Source { file: source.file, text: &text }, read)?;
        if expanded == text {
            return Ok(text);
        }
        text = expanded;
    }
    let message =
        format!("expected models that include each other at most {DEPTH_MAX} deep, found a deeper one");
    Err(source.whole(message).help("remove the `<include>` that leads back to its own model"))
}

fn expand_once(source: Source, read: &Read) -> Result<String, Diagnostic> {
    let document = source.parse()?;
    let is_of_model = |node: &Node| node.parent_element().is_some_and(|parent| parent.has_tag_name("model"));
    let includes = document.descendants().filter(|node| node.has_tag_name("include")).filter(is_of_model);
    let (mut text, mut end) = (String::new(), 0);
    for include in includes {
        let Some(model) = included(source, include, read)? else { continue };
        require_room(source, text.len() + model.len())?;
        let place = include.range();
        text += &source.text[end..place.start];
        text += &model;
        // The lines of the element itself.
        text.extend(source.text[place.clone()].matches('\n'));
        end = place.end;
    }
    Ok(text + &source.text[end..])
}

fn require_room(source: Source, bytes: usize) -> Result<(), Diagnostic> {
    if bytes <= BYTES_MAX {
        return Ok(());
    }
    let message = format!("expected at most {} MB with all included models, found more", BYTES_MAX >> 20);
    Err(source.whole(message).help("remove the models without mass"))
}

/// The `<model>` in the place of `include`, on one line; `None` if its model is not found.
fn included(source: Source, include: Node, read: &Read) -> Result<Option<String>, Diagnostic> {
    let Some(uri) = text_of(include, "uri") else { return Ok(None) };
    let refused = |message: String| {
        let message = format!("expected the model `{uri}`: {message}");
        source.fault(start_of(include), message).help("correct the included file, or remove the <include>")
    };
    let Some(text) = read(&uri).transpose().map_err(refused)? else { return Ok(None) };
    let inner = Source { file: &uri, text: &text };
    let document = inner.parse().map_err(|error| refused(error.to_string()))?;
    let model = children(document.root_element(), "model").next();
    let model = model.ok_or_else(|| refused("its file has no <model>".to_owned()))?;
    let name = text_of(include, "name").or_else(|| model.attribute("name").map(str::to_owned));
    let name = name.ok_or_else(|| refused("it has no name".to_owned()))?;
    if child(include, "placement_frame").is_some() {
        return Err(refused("<placement_frame> is not read".to_owned()));
    }
    // Plugins of the element act on the model, such as motors.
    let plugins: String = children(include, "plugin").map(|plugin| &source.text[plugin.range()]).collect();
    // The pose of the element counts before that of the model.
    let pose = child(include, "pose").map(|pose| &source.text[pose.range()]);
    let pose_of_model = child(model, "pose").map(|pose| &text[pose.range()]);
    let parts = model.children().filter(|part| part.is_element() && !part.has_tag_name("pose"));
    let parts = parts.map(|part| &text[part.range()]).collect::<String>();
    let name = name.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;");
    let model = format!(
        "<model name=\"{name}\">{}{parts}{plugins}</model>",
        pose.or(pose_of_model).unwrap_or_default()
    );
    Ok(Some(model.replace(['\n', '\r'], " ")))
}
