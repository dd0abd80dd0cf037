//! Modules that a script in Python imports from its own folder: those that its import statements name. No code is executed.
//!
//! The interpreter searches the folder of its script first (The Python Language Reference, 5). Modules of other folders, and modules that
//! code loads by other means than an import statement, are not found here. Text that only looks like an import statement, as in a
//! string, names a module all the same, if there is one.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Longest file that is searched for import statements, in bytes.
const SEARCHED_BYTES_MAX: u64 = 1024 * 1024;

/// Modules that a script imports, and those that these import.
#[derive(Debug)]
pub struct Modules {
    /// Folder of the script, links followed: the interpreter follows them, too.
    pub folder: PathBuf,
    /// Their files, from there.
    pub files: BTreeSet<PathBuf>,
}

/// A module that a statement names.
#[derive(Debug)]
struct Import<'a> {
    /// Dots in front of the name. Without dots the search begins in the script's folder, with one in the folder of the importing file,
    /// with two in the one above.
    dots: usize,
    name: Vec<&'a str>,
}

impl Modules {
    /// The modules of `script`; `None` if it is not a script in Python.
    pub fn of(script: &Path) -> Option<Self> {
        let script = script.canonicalize().ok()?;
        let text = text_of(&script).filter(|text| is_python(&script, text))?;
        let folder = script.parent()?.to_owned();
        let (mut files, mut unsearched) = (BTreeSet::new(), vec![(PathBuf::new(), text)]);
        while let Some((place, text)) = unsearched.pop() {
            for file in imports(&text).iter().flat_map(|import| named(&folder, import, &place)) {
                if !files.insert(file.clone()) {
                    continue;
                }
                if let Some(text) = text_of(&folder.join(&file)) {
                    unsearched.push((file.parent().unwrap_or(Path::new("")).to_owned(), text));
                }
            }
        }
        // A module may import the script.
        files.remove(Path::new(script.file_name()?));
        Some(Self { folder, files })
    }
}

/// The files within `folder` that `import` names, in a file of its folder `place`: a module, and the packages on the way to it.
fn named(folder: &Path, import: &Import<'_>, place: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let start = if import.dots == 0 { Some(Path::new("")) } else { place.ancestors().nth(import.dots - 1) };
    let Some(mut at) = start.map(Path::to_owned) else { return files };
    for part in &import.name {
        let (below, module) = (at.join(part), at.join(format!("{part}.py")));
        let package = below.join("__init__.py");
        if folder.join(&package).is_file() {
            files.push(package);
        } else if folder.join(&module).is_file() {
            files.push(module);
            break;
        } else if !folder.join(&below).is_dir() {
            break;
        }
        at = below;
    }
    files
}

/// Text of the file at `path`, without the byte order mark that some editors write. `None` if it is not a regular file, is long, or
/// cannot be read.
fn text_of(path: &Path) -> Option<String> {
    let is_short = path.metadata().is_ok_and(|file| file.is_file() && file.len() <= SEARCHED_BYTES_MAX);
    let bytes = is_short.then(|| std::fs::read(path).ok())??;
    Some(String::from_utf8_lossy(&bytes).trim_start_matches('\u{feff}').replace("\r\n", "\n"))
}

fn is_python(path: &Path, text: &str) -> bool {
    let first = text.lines().next().unwrap_or_default();
    path.extension().is_some_and(|ending| ending == "py")
        || (first.starts_with("#!") && first.contains("python"))
}

/// The modules that the import statements of `text` name.
fn imports(text: &str) -> Vec<Import<'_>> {
    let tokens = tokens(text);
    let mut all = Vec::new();
    let mut is_start = true;
    for (index, token) in tokens.iter().enumerate() {
        let rest = &tokens[index + 1..];
        match *token {
            "import" if is_start => all.extend(imported(rest)),
            "from" if is_start => all.extend(imported_from(rest)),
            _ => {}
        }
        is_start = matches!(*token, "\n" | ";" | ":");
    }
    all
}

/// The modules of `import a, b.c as d`, from behind the first word.
fn imported<'a>(tokens: &[&'a str]) -> Vec<Import<'a>> {
    let names = until(tokens, &["\n", ";"]).split(|token| *token == ",");
    names.map(|name| Import { dots: 0, name: dotted(name).0 }).collect()
}

/// The modules of `from .a import b as c, d`, from behind the first word: `b` and `d` may be modules, or names in `a`.
fn imported_from<'a>(tokens: &[&'a str]) -> Vec<Import<'a>> {
    let dots = tokens.iter().take_while(|token| **token == ".").count();
    let (from, rest) = dotted(&tokens[dots..]);
    let items = match rest {
        ["import", "(", items @ ..] => until(items, &[")"]),
        ["import", items @ ..] => until(items, &["\n", ";"]),
        _ => return Vec::new(),
    };
    let import = |item: &[&'a str]| {
        let word = item.iter().copied().find(|token| *token != "\n").filter(|token| is_word(token));
        Import { dots, name: from.iter().copied().chain(word).collect() }
    };
    items.split(|token| *token == ",").map(import).collect()
}

/// The tokens in front of the first one of `ends`.
fn until<'t, 'a>(tokens: &'t [&'a str], ends: &[&str]) -> &'t [&'a str] {
    let end = tokens.iter().position(|token| ends.contains(token));
    &tokens[..end.unwrap_or(tokens.len())]
}

/// The name `a.b` in front, and the tokens behind it.
fn dotted<'t, 'a>(mut tokens: &'t [&'a str]) -> (Vec<&'a str>, &'t [&'a str]) {
    let mut name = Vec::new();
    while let [word, rest @ ..] = tokens {
        if !is_word(word) || *word == "import" {
            break;
        }
        name.push(*word);
        tokens = rest;
        match rest {
            [".", more @ ..] => tokens = more,
            _ => break,
        }
    }
    (name, tokens)
}

/// Words, signs and line ends of `text`, without comments and blanks. Lines that a backslash joins are one.
fn tokens(text: &str) -> Vec<&str> {
    let (mut tokens, mut rest) = (Vec::new(), text);
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '#' => rest.find('\n').unwrap_or(rest.len()),
            '\\' if rest[1..].starts_with('\n') => 2,
            _ if is_of_word(first) => rest.find(|sign: char| !is_of_word(sign)).unwrap_or(rest.len()),
            _ => first.len_utf8(),
        };
        let (token, more) = rest.split_at(length);
        let is_blank = first != '\n' && first.is_whitespace();
        if !is_blank && !token.starts_with(['#', '\\']) {
            tokens.push(token);
        }
        rest = more;
    }
    tokens
}

fn is_word(token: &str) -> bool {
    token.starts_with(is_of_word)
}

fn is_of_word(sign: char) -> bool {
    sign.is_alphanumeric() || sign == '_'
}

#[cfg(test)]
mod tests {
    use super::{Modules, imports};
    use std::fs;
    use std::path::Path;

    fn names(text: &str) -> Vec<String> {
        let dotted = |import: &super::Import<'_>| ".".repeat(import.dots) + &import.name.join(".");
        imports(text).iter().map(dotted).collect()
    }

    #[test]
    fn statements_of_every_form_name_modules() {
        assert_eq!(names("import a, b.c as d; import e  # import f\n"), ["a", "b.c", "e"]);
        assert_eq!(names("if x: import a\ntry:\n    import \\\n  b\nexcept ImportError: pass\n"), ["a", "b"]);
        assert_eq!(names("from a.b import c as d, e\n"), ["a.b.c", "a.b.e"]);
        assert_eq!(names("from .. import a\nfrom .b import *\n"), ["..a", ".b"]);
        assert_eq!(
            names("from a import (\n    b,  # one, two\n    c as d,\n)\nx = 1\n"),
            ["a.b", "a.c", "a"]
        );
        assert!(names("raise Error from cause\nimported = 1\n# import a\nyield from b\n").is_empty());
        assert_eq!(names("import"), [""]);
        assert!(names("from").is_empty() && names("from a").is_empty() && names("").is_empty());
    }

    /// A folder with these files.
    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        folder
    }

    fn modules(folder: &Path, script: &str) -> Option<Vec<String>> {
        let modules = Modules::of(&folder.join(script))?;
        assert_eq!(modules.folder, folder.canonicalize().unwrap());
        Some(modules.files.iter().map(|file| file.to_string_lossy().into_owned()).collect())
    }

    #[test]
    fn modules_are_found_in_the_folder_of_the_script_through_packages_and_circles() {
        let folder = folder(&[
            ("law.py", "import os, gains\nfrom pack import part, VALUE\nfrom space.deep import leaf\n"),
            ("gains.py", "import law, pack.other\n"),
            ("pack/__init__.py", "from .inner import thing\n"),
            ("pack/part.py", "from . import beside\nfrom .. import above\nfrom ... import outside\n"),
            ("pack/beside.py", "import inner\n"),
            ("pack/inner.py", ""),
            ("pack/other.py", "\u{feff}import marked\n"),
            ("marked.py", ""),
            ("space/deep/leaf.py", "from .leaf import again\n"),
            ("above.py", ""),
            ("inner.py", ""),
            ("unused.py", ""),
            ("outside.py", ""),
        ]);
        let expected = [
            "above.py",
            "gains.py",
            "inner.py",
            "marked.py",
            "pack/__init__.py",
            "pack/beside.py",
            "pack/inner.py",
            "pack/other.py",
            "pack/part.py",
            "space/deep/leaf.py",
        ];
        assert_eq!(modules(folder.path(), "law.py").unwrap(), expected);
    }

    #[test]
    fn a_link_is_followed_and_other_files_have_no_modules() {
        let text = "#!/usr/bin/env python3\r\nimport gains\r\n";
        let folder = folder(&[("law", text), ("law.sh", "import gains\n"), ("gains.py", "")]);
        assert_eq!(modules(folder.path(), "law").unwrap(), ["gains.py"]);
        assert_eq!(modules(folder.path(), "law.sh"), None);
        assert_eq!(modules(folder.path(), "missing.py"), None);
        let elsewhere = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink(folder.path().join("law"), elsewhere.path().join("link")).unwrap();
        let linked = Modules::of(&elsewhere.path().join("link")).unwrap();
        assert_eq!(linked.folder, folder.path().canonicalize().unwrap());
    }
}
