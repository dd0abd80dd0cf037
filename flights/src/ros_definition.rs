//! Makes any ROS 2 message definition plain: without constants, defaults, bounds and shortened names of types.

/// Types that are no messages.
const PRIMITIVE: &[&str] = &[
    "bool", "byte", "char", "float32", "float64", "int8", "uint8", "int16", "uint16", "int32", "uint32",
    "int64", "uint64", "string", "wstring",
];

/// The definition of the type `name` in the plain form that recordings of this project have.
#[must_use]
pub fn plain(name: &str, text: &str) -> String {
    let rule = "=".repeat(80);
    let mut package = name.split('/').next().unwrap_or_default().to_owned();
    let mut plain = String::new();
    for line in text.lines().map(str::trim_end) {
        let kept = if line.len() > 8 && line.bytes().all(|byte| byte == b'=') {
            Some(rule.clone())
        } else if let Some(name) = line.strip_prefix("MSG: ") {
            package = name.split('/').next().unwrap_or_default().to_owned();
            Some(format!("MSG: {}", two_part(name.trim())))
        } else {
            field(line, &package)
        };
        if let Some(kept) = kept {
            plain += &kept;
            plain.push('\n');
        }
    }
    plain
}

/// A field without default and bounds, its comment kept for the unit in it; `None` for a constant or no field.
fn field(line: &str, package: &str) -> Option<String> {
    let (code, comment) = line.split_once('#').unwrap_or((line, ""));
    let (kind, rest) = code.trim().split_once(char::is_whitespace)?;
    if rest.contains('=') {
        return None;
    }
    let name = rest.split_whitespace().next()?;
    Some(format!("{} {name}  #{comment}", kind_of(kind, package)))
}

/// The type without bounds and with its package.
fn kind_of(kind: &str, package: &str) -> String {
    let (base, array) = kind.split_once('[').map_or((kind, None), |(base, array)| (base, Some(array)));
    let base = base.split_once("<=").map_or(base, |(base, _)| base);
    let base = match base {
        "char" => "uint8".to_owned(),
        "Header" => "std_msgs/Header".to_owned(),
        _ if PRIMITIVE.contains(&base) => base.to_owned(),
        _ if base.contains('/') => two_part(base),
        _ => format!("{package}/{base}"),
    };
    match array {
        None => base,
        Some(bounded) if bounded.starts_with("<=") => format!("{base}[]"),
        Some(array) => format!("{base}[{array}"),
    }
}

/// `package/Type` of `package/msg/Type`.
fn two_part(name: &str) -> String {
    name.replace("/msg/", "/")
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn constants_defaults_bounds_and_short_names_are_made_plain() {
        let text = "Header header\nuint8 STATUS_FULL = 4 # full\nPose[<=3] poses\nstring<=8 name \"x\"\n\
                    float32 voltage  # [V]\n========================================\nMSG: std_msgs/msg/Header\n\
                    builtin_interfaces/Time stamp\n";
        let expected = format!(
            "std_msgs/Header header  #\ngeometry_msgs/Pose[] poses  #\nstring name  #\nfloat32 voltage  # [V]\n{}\n\
             MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp  #\n",
            "=".repeat(80)
        );
        assert_eq!(plain("geometry_msgs/msg/Poses", text), expected);
    }
}
