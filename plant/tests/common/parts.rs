//! Texts of scene files, part by part.

/// A number of a scene file.
pub fn given(value: &str, unit: &str) -> String {
    format!("{{ value = {value}, unit = \"{unit}\", source = \"test\", uncertainty = \"exact\" }}")
}

/// Keys with their values and units, a line each.
pub fn keys(keys: &[(&str, &str, &str)]) -> String {
    keys.iter().map(|(key, value, unit)| format!("{key} = {}\n", given(value, unit))).collect()
}

/// A thing of an array such as `balls`.
pub fn body(kind: &str, name: &str, more: &[(&str, &str, &str)]) -> String {
    format!("[[{kind}]]\nname = \"{name}\"\n{}", keys(more))
}

/// A joint called `joint`.
pub fn joint(kind: &str, [parent, child]: [&str; 2], more: &[(&str, &str, &str)]) -> String {
    format!(
        "[[joints]]\nname = \"joint\"\nkind = \"{kind}\"\nparent = \"{parent}\"\nchild = \"{child}\"\n{}",
        keys(more)
    )
}
