//! Meaning, unit and default of the parameters of components, from the tables of docs/manifest.md and docs/firmware.md.

/// Pages whose tables describe the parameters.
const PAGES: [&str; 3] = [
    include_str!("../../docs/manifest.md"),
    include_str!("../../docs/firmware.md"),
    include_str!("../../docs/fmu.md"),
];

/// Description of a parameter: the cells of its row behind the name.
type Cells<'p> = Vec<&'p str>;

/// Lines about the `parameters` of the component `kind`: name, default and unit, and below it the meaning.
pub fn parameter_lines(kind: &str, parameters: &[&str]) -> Vec<String> {
    parameters.iter().flat_map(|name| of_parameter(kind, name)).collect()
}

/// Lines about a parameter; about each of its keys, where it is a table.
fn of_parameter(kind: &str, name: &str) -> Vec<String> {
    let keys = keys(kind, name);
    if keys.is_empty() {
        return lines(name, described(kind, name));
    }
    keys.iter().flat_map(|key| lines(key, described(kind, key))).collect()
}

/// The keys of the table `name` that the section of `kind` describes, such as `streams.INPUT.bytes`.
fn keys(kind: &str, name: &str) -> Vec<&'static str> {
    let (title, start) = (format!("### `{kind}`"), format!("| `{name}."));
    let section = PAGES.iter().find_map(|page| page.split_once(&title)).map_or("", |(_, section)| section);
    let section = section.split("\n### ").next().unwrap_or_default();
    let rows = section.lines().filter(|line| line.starts_with(&start));
    rows.filter_map(|row| row.split('`').nth(1)).collect()
}

fn lines(name: &str, cells: Option<Cells<'_>>) -> Vec<String> {
    let Some(cells) = cells else { return vec![name.to_owned()] };
    // Some tables have no column of units.
    let facts = match cells[..] {
        [_, unit, default, ..] => Some((unit, default)),
        [_, default] => Some(("", default)),
        _ => None,
    };
    let head = match facts {
        Some((unit, default)) => {
            let stated = |text: &str| Some(plain(text)).filter(|text| !["", "–"].contains(&&**text));
            let (unit, default) = (stated(unit), stated(default));
            let default = default.map(|default| match default.as_str() {
                "required" => default,
                _ => format!("default {default}"),
            });
            let facts: Vec<String> =
                [unit.map(|unit| format!("[{unit}]")), default].into_iter().flatten().collect();
            format!("{name}  {}", facts.join(" "))
        }
        None => name.to_owned(),
    };
    let meaning = cells.first().map(|meaning| format!("    {}", plain(meaning)));
    std::iter::once(head.trim_end().to_owned()).chain(meaning).collect()
}

/// The row of `name` in the section of `kind`, else in that which sensors share, else in any other.
fn described<'p>(kind: &str, name: &str) -> Option<Cells<'p>> {
    let is_own = |title: &str| title.trim_matches('`').eq_ignore_ascii_case(kind);
    let pages = || PAGES.iter().copied();
    let find = |is_meant: &dyn Fn(&str) -> bool| pages().find_map(|page| row(page, name, is_meant));
    find(&is_own).or_else(|| find(&|title| title == "Sensors")).or_else(|| find(&|_| true))
}

/// The cells behind `name` in the first table that has it, below a title that is meant.
fn row<'p>(page: &'p str, name: &str, is_meant: &dyn Fn(&str) -> bool) -> Option<Cells<'p>> {
    let names = [format!("`{name}`"), format!("`parameters.{name}`")];
    let (mut title, mut header, mut before) = ("", "", "");
    for line in page.lines() {
        if line.starts_with("|--") {
            header = before;
        }
        before = line;
        if let Some(found) = line.strip_prefix("## ").or(line.strip_prefix("### ")) {
            title = found.trim();
        }
        let Some(cells) = line.strip_prefix("| ").filter(|_| is_meant(title)) else { continue };
        let mut cells = cells.trim_end().trim_end_matches('|').split(" | ").map(str::trim);
        let is_named = cells
            .next()
            .is_some_and(|first| first.split(", ").any(|part| names.iter().any(|name| part == name)));
        if is_named {
            // An example is no default.
            let has_example = header.trim_end_matches([' ', '|']).ends_with("example");
            let cells = cells.collect::<Vec<_>>();
            return Some(cells[..cells.len() - usize::from(has_example)].to_vec());
        }
    }
    None
}

/// Markdown as plain text: links are their texts, code has no marks.
fn plain(markdown: &str) -> String {
    let (mut text, mut rest) = (String::new(), markdown);
    while let Some((before, after)) = rest.split_once("](") {
        let Some((start, end)) =
            before.rsplit_once('[').zip(after.split_once(')')).map(|(open, close)| (open, close.1))
        else {
            break;
        };
        text += start.0;
        text += start.1;
        rest = end;
    }
    (text + rest).replace(['`', '*'], "")
}

#[cfg(test)]
mod tests {
    use super::{of_parameter, parameter_lines, plain};
    use hummingbus::COMPONENTS;

    #[test]
    fn links_and_code_become_plain_text() {
        assert_eq!(
            plain("a `b` of [the page](x.md#y), **c**; `[0.0, 0.0]`"),
            "a b of the page, c; [0.0, 0.0]"
        );
    }

    #[test]
    fn a_parameter_has_its_meaning_unit_and_default() {
        let lines = parameter_lines("gps", &["position_drift_time_s", "rate_hz"]);
        assert_eq!(lines[0], "position_drift_time_s  [s] default 300.0");
        assert_eq!(lines[1], "    its time constant");
        assert_eq!(lines[3], "    measurements a second");
        // The section of the kind comes first, also of an autopilot; a table without units has defaults.
        let of_px4 = parameter_lines("px4", &["armed_by_channel", "rest_s"]);
        assert!(of_px4[1].contains("RC_MAP_ARM_SW"), "{of_px4:?}");
        assert!(of_px4[2].starts_with("rest_s  default "), "{of_px4:?}");
        assert!(parameter_lines("fmu", &["start"]).len() > 1);
        // A table that has examples has no defaults.
        assert_eq!(parameter_lines("pid", &["gains"])[0], "gains");
    }

    #[test]
    fn every_parameter_of_a_component_is_described() {
        let is_of_manifests = |name: &&str| !["judge", "recorder"].contains(name);
        for component in COMPONENTS.iter().filter(|component| is_of_manifests(&component.name)) {
            for name in component.parameters() {
                let is_told = of_parameter(component.name, name).len() > 1;
                assert!(is_told, "{}: {name}", component.name);
            }
        }
    }
}
