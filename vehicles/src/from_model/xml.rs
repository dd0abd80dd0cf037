//! XML documents within bounds, whose errors carry the line and the column.

use diagnostics::{Diagnostic, ParameterError, Place};
use roxmltree::{Document, Node, ParsingOptions, TextPos};
use std::ops::Range;

/// Largest number of elements, attributes and texts. The model of a vehicle has some hundred.
const NODES_MAX: u32 = 100_000;
/// Largest depth of elements within elements.
const DEPTH_MAX: usize = 64;

/// The text of a file, for messages about its places.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// Name of the file.
    pub file: &'a str,
    /// Content.
    pub text: &'a str,
}

impl<'a> Source<'a> {
    /// Parses the text.
    ///
    /// # Errors
    /// If the text is not XML, is too large or too deep, or holds expressions of xacro.
    pub fn parse(self) -> Result<Document<'a>, Diagnostic> {
        let options = ParsingOptions { nodes_limit: NODES_MAX, ..ParsingOptions::default() };
        let document = Document::parse_with_options(self.text, options).map_err(|error| match &error {
            roxmltree::Error::UnknownNamespace(name, at) if name == "xacro" => self.xacro(self.offset(*at)),
            roxmltree::Error::NodesLimitReached => self
                .whole(format!("expected at most {NODES_MAX} elements and attributes, found more"))
                .help("remove the parts without mass, such as meshes and sensors"),
            _ => {
                use roxmltree::Error::{UnclosedRootNode, UnexpectedEndOfStream};
                let is_cut = matches!(error, UnclosedRootNode | UnexpectedEndOfStream);
                let at = if is_cut { self.text.trim_end().len() } else { self.offset(error.pos()) };
                self.fault(at..at + 1, format!("expected XML; the reader says: {error}"))
                    .help("correct the XML here")
            }
        })?;
        self.require_plain(&document)?;
        Ok(document)
    }

    /// Refuses expressions of xacro and elements that stand too deep.
    fn require_plain(self, document: &Document) -> Result<(), Diagnostic> {
        let mut depth = 0;
        let mut last: Option<Node> = None;
        for node in document.descendants().filter(Node::is_element) {
            depth = match last {
                Some(last) if node.parent() == Some(last) => depth + 1,
                Some(last) => depth_of_sibling(depth, last, node),
                None => 1,
            };
            if depth > DEPTH_MAX {
                let message = format!("expected elements at most {DEPTH_MAX} deep, found deeper ones");
                return Err(self.fault(start_of(node), message).help("flatten the file"));
            }
            last = Some(node);
            if node.tag_name().namespace().is_some_and(|name| name.contains("xacro")) {
                return Err(self.xacro(node.range().start));
            }
            if let Some(attribute) = node.attributes().find(|attribute| is_expression(attribute.value())) {
                return Err(self.xacro(attribute.range().start));
            }
            if is_expression(&text_in(node)) {
                return Err(self.xacro(node.range().start));
            }
        }
        Ok(())
    }

    fn xacro(self, at: usize) -> Diagnostic {
        self.fault(at..at + 1, "expected numbers, found an expression of xacro")
            .help("run xacro first, and convert the file that it writes: `xacro FILE.xacro > FILE.urdf`")
    }

    /// Byte offset of a line and a column in characters.
    fn offset(self, at: TextPos) -> usize {
        let above = at.row.saturating_sub(1) as usize;
        let start: usize = self.text.split_inclusive('\n').take(above).map(str::len).sum();
        let columns = at.col.saturating_sub(1) as usize;
        let column = self.text[start..].char_indices().nth(columns);
        column.map_or(self.text.len(), |(byte, _)| start + byte)
    }

    /// An error at a place of the file.
    pub fn fault(self, at: Range<usize>, error: impl Into<ParameterError>) -> Diagnostic {
        Diagnostic::at(Place::of(self.file, self.text, &at), error)
    }

    /// An error of the whole file.
    pub fn whole(self, error: impl Into<ParameterError>) -> Diagnostic {
        Diagnostic::in_file(self.file, error)
    }

    /// An attribute that has to be there.
    ///
    /// # Errors
    /// If it is missing or empty.
    pub fn attribute<'d>(self, node: Node<'d, '_>, name: &str) -> Result<&'d str, Diagnostic> {
        let value = node.attribute(name).filter(|value| !value.trim().is_empty());
        value.ok_or_else(|| {
            let element = node.tag_name().name();
            self.fault(start_of(node), format!("expected `{name}=\"…\"` in <{element}>, found none"))
                .help(format!("add the attribute `{name}`"))
        })
    }

    /// `N` finite numbers, separated by blanks.
    ///
    /// # Errors
    /// If there are more or fewer, or one is not finite.
    pub fn numbers<const N: usize>(self, node: Node, key: &str, text: &str) -> Result<[f64; N], Diagnostic> {
        let read: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        let found = read.filter(|found| found.iter().all(|number: &f64| number.is_finite()));
        found.and_then(|found| found.try_into().ok()).ok_or_else(|| {
            let expected = if N == 1 { "a finite number".to_owned() } else { format!("{N} finite numbers") };
            self.fault(start_of(node), ParameterError::value(key, expected, format!("`{text}`")))
        })
    }

    /// The number in an attribute that has to be there.
    ///
    /// # Errors
    /// If it is missing or not a finite number.
    pub fn number_in(self, node: Node, name: &str) -> Result<f64, Diagnostic> {
        let [number] = self.numbers(node, name, self.attribute(node, name)?)?;
        Ok(number)
    }

    /// The number in the text of an element.
    ///
    /// # Errors
    /// If it is not a finite number.
    pub fn number_of(self, node: Node) -> Result<f64, Diagnostic> {
        let [number] = self.numbers(node, node.tag_name().name(), &text_in(node))?;
        Ok(number)
    }
}

/// Depth of `node`, which is not within `last` of depth `depth`.
fn depth_of_sibling(depth: usize, last: Node, node: Node) -> usize {
    let up = last.ancestors().position(|above| Some(above) == node.parent()).unwrap_or(depth);
    (depth + 1).saturating_sub(up)
}

fn is_expression(text: &str) -> bool {
    text.contains("${") || text.contains("$(")
}

/// Name of a model; `vehicle` if it has none.
pub fn name_of(model: Node) -> String {
    let name = model.attribute("name").filter(|name| !name.trim().is_empty());
    name.unwrap_or("vehicle").to_owned()
}

/// First child element with a name.
pub fn child<'d, 'i>(node: Node<'d, 'i>, name: &str) -> Option<Node<'d, 'i>> {
    children(node, name).next()
}

/// Child elements with a name.
pub fn children<'d, 'i>(node: Node<'d, 'i>, name: &str) -> impl Iterator<Item = Node<'d, 'i>> {
    node.children().filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// The text of the first child element with a name, without blanks around it.
pub fn text_of(node: Node, name: &str) -> Option<String> {
    let text = text_in(child(node, name)?);
    Some(text.trim().to_owned()).filter(|text| !text.is_empty())
}

/// The whole text of an element. Comments do not divide words; elements within do.
pub fn text_in(node: Node) -> String {
    let part = |child: Node<'_, '_>| match child.is_text() {
        true => child.text().unwrap_or_default().to_owned(),
        false if child.is_element() => " ".to_owned(),
        false => String::new(),
    };
    node.children().map(part).collect()
}

/// Bytes of the begin of an element: its name, and its angle bracket.
pub fn start_of(node: Node) -> Range<usize> {
    let start = node.range().start;
    start..start + 1 + node.tag_name().name().len()
}
