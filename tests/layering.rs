//! No two files of a crate need each other: what a file names lies in files below it, all the way down. And no public
//! function of the library has an error of another project in its signature. The launcher knows no crate of vehicles or scenes.
//! Components know no transport, and hide nothing that changes from their states. The library needs no terminal and no plots.
//! A room of the crate `identify` needs those below it alone.
//!
//! A file needs another where it names something that the other defines, whatever path or re-export it takes; a
//! module that is declared or re-exported is not yet needed. Tests may look at everything, and are left out.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use quote::ToTokens;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syn::{Attribute, Item, UseTree, Visibility};

type Names = Vec<String>;

/// A module of a crate, in a file of its own or within one.
#[derive(Default)]
struct Module {
    file: PathBuf,
    /// Names that it defines, but for modules.
    defined: BTreeSet<String>,
    children: BTreeSet<String>,
    public_children: Vec<String>,
    /// Imported names with their paths.
    imports: BTreeMap<String, Names>,
    /// Names that are imported for others, and so are not yet needed here.
    reexported: BTreeSet<String>,
    globs: Vec<Names>,
    code: Vec<Token>,
    /// True if other crates can name it.
    is_public: bool,
    /// Names that it defines and declares `pub`.
    public_names: BTreeSet<String>,
    signatures: Vec<Signature>,
}

/// A function that is public within its module, or a method of a type.
struct Signature {
    name: String,
    /// The type or trait of a method, or the function itself: the name that leads there.
    owner: String,
    /// All names in it.
    names: BTreeSet<String>,
}

/// A token without what groups them.
enum Token {
    Name(String),
    /// `::`
    Path,
    /// `.`, behind which a field or a method stands.
    Dot,
    /// A bracket that opens.
    Open,
    Other,
}

/// The modules of a crate by their paths.
#[derive(Default)]
struct Crate {
    modules: BTreeMap<Names, Module>,
}

impl Crate {
    /// Reads the crate whose root is the file `root`.
    fn read(root: &Path) -> Self {
        let mut read = Self::default();
        read.add_file(Vec::new(), root, root.parent().unwrap());
        read.note_public(Vec::new());
        read
    }

    /// Adds the module `path` in `file`, whose children have files in `folder`.
    fn add_file(&mut self, path: Names, file: &Path, folder: &Path) {
        let text = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let items =
            syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display())).items;
        self.add(path, file, folder, items);
    }

    fn add(&mut self, path: Names, file: &Path, folder: &Path, items: Vec<Item>) {
        let mut module = Module { file: file.to_owned(), ..Module::default() };
        for item in items.into_iter().filter(|item| !is_for_tests(attributes(item))) {
            match item {
                Item::Mod(child) => {
                    let name = child.ident.to_string();
                    let inner = [&path[..], std::slice::from_ref(&name)].concat();
                    let below = folder.join(&name);
                    match child.content {
                        Some((_, items)) => self.add(inner, file, &below, items),
                        None => self.add_file(inner, &file_of(folder, &name), &below),
                    }
                    if matches!(child.vis, Visibility::Public(_)) {
                        module.public_children.push(name.clone());
                    }
                    module.children.insert(name);
                }
                Item::Use(item) => {
                    let is_for_others = !matches!(item.vis, Visibility::Inherited);
                    module.import(&item.tree, &mut Vec::new(), is_for_others);
                }
                item => {
                    module.defined.extend(defined(&item));
                    module.signatures.extend(signatures(&item));
                    module.public_names.extend(defined(&item).filter(|_| is_public(&item)));
                    flatten(item.to_token_stream(), &mut module.code);
                }
            }
        }
        self.modules.insert(path, module);
    }

    /// Notes that the module `path` is public, and so are its public children.
    fn note_public(&mut self, path: Names) {
        let Some(module) = self.modules.get_mut(&path) else { return };
        module.is_public = true;
        for child in module.public_children.clone() {
            self.note_public([&path[..], &[child]].concat());
        }
    }

    /// The names that other crates can use, each with the file that defines it.
    fn public(&self) -> BTreeSet<(&Path, &String)> {
        let modules = || self.modules.iter().filter(|(_, module)| module.is_public);
        let declared = modules()
            .flat_map(|(_, module)| module.public_names.iter().map(|name| (module.file.as_path(), name)));
        let passed_on = modules().flat_map(|(path, module)| {
            module.reexported.iter().filter_map(|name| {
                let names = module.imports.get(name)?;
                Some((self.file(path, names, 0)?, names.last()?))
            })
        });
        declared.chain(passed_on).collect()
    }

    /// The functions that other crates can call and that have a name of the crate `other` in their signatures.
    fn public_with(&self, other: &str) -> Vec<String> {
        let public = self.public();
        let mut found = Vec::new();
        for (path, module) in &self.modules {
            let is_of_other = |name: &String| {
                name == other || module.imports.get(name).is_some_and(|path| path.first().unwrap() == other)
            };
            for Signature { name, owner, names } in &module.signatures {
                let defined_in = self.file(path, std::slice::from_ref(owner), 0).unwrap_or(&module.file);
                if public.contains(&(defined_in, owner)) && names.iter().any(is_of_other) {
                    let owner = if owner == name { String::new() } else { format!("{owner}::") };
                    let path: String = path.iter().map(|part| format!("{part}::")).collect();
                    found.push(format!("{path}{owner}{name}"));
                }
            }
        }
        found
    }

    /// The file that defines what `names` lead to from the module `at`; `None` where that is outside of the crate.
    fn file(&self, at: &[String], names: &[String], depth: usize) -> Option<&Path> {
        let (first, rest) = names.split_first()?;
        let module = self.modules.get(at)?;
        match first.as_str() {
            // Imports that lead to themselves do not compile; a limit all the same.
            _ if depth > 20 => None,
            "crate" => self.below(&[], rest, depth),
            "self" => self.below(at, rest, depth),
            "super" => self.below(at.split_last()?.1, rest, depth),
            name if module.children.contains(name) => self.below(at, names, depth),
            name => {
                let target = module.imports.get(name).filter(|target| *target != names)?;
                self.file(at, &[target, rest].concat(), depth + 1)
            }
        }
    }

    /// The same for names that are followed down from the module `at` alone.
    fn below(&self, at: &[String], names: &[String], depth: usize) -> Option<&Path> {
        let module = self.modules.get(at)?;
        let Some((first, rest)) = names.split_first() else { return Some(&module.file) };
        if first == "super" {
            return self.below(at.split_last()?.1, rest, depth);
        }
        if module.children.contains(first) {
            return self.below(&[at, std::slice::from_ref(first)].concat(), rest, depth);
        }
        if module.defined.contains(first) {
            return Some(&module.file);
        }
        if module.imports.contains_key(first) {
            return self.file(at, names, depth + 1);
        }
        let through = |glob: &Names| {
            let found = self.file(at, &[&glob[..], names].concat(), depth + 1)?;
            (found != module.file).then_some(found)
        };
        module.globs.iter().find_map(through).or(Some(&module.file))
    }

    /// The files that each file needs.
    fn needs(&self) -> BTreeMap<&Path, BTreeSet<&Path>> {
        let mut needs: BTreeMap<&Path, BTreeSet<&Path>> = BTreeMap::new();
        for (path, module) in &self.modules {
            let named = module.needed().into_iter().filter_map(|names| self.file(path, &names, 0));
            needs.entry(&module.file).or_default().extend(named.filter(|file| *file != module.file));
        }
        needs
    }
}

impl Module {
    fn import(&mut self, tree: &UseTree, prefix: &mut Names, is_for_others: bool) {
        let mut add = |name: String, path: Names| {
            if is_for_others {
                self.reexported.insert(name.clone());
            }
            self.imports.insert(name, path);
        };
        match tree {
            UseTree::Path(path) => {
                prefix.push(path.ident.to_string());
                self.import(&path.tree, prefix, is_for_others);
                prefix.pop();
            }
            UseTree::Name(name) if name.ident == "self" => {
                add(prefix.last().cloned().unwrap_or_default(), prefix.clone());
            }
            UseTree::Name(name) => {
                let name = name.ident.to_string();
                add(name.clone(), [&prefix[..], &[name]].concat());
            }
            UseTree::Rename(rename) => {
                add(rename.rename.to_string(), [&prefix[..], &[rename.ident.to_string()]].concat());
            }
            UseTree::Glob(_) => self.globs.push(prefix.clone()),
            UseTree::Group(group) => {
                group.items.iter().for_each(|tree| self.import(tree, prefix, is_for_others));
            }
        }
    }

    /// The paths that are named: those that are imported for this module, and those in its code.
    fn needed(&self) -> Vec<Names> {
        let imports = self.imports.iter().filter(|(name, _)| !self.reexported.contains(*name));
        let mut needed: Vec<Names> =
            imports.map(|(_, path)| path.clone()).chain(self.globs.clone()).collect();
        let mut at = 0;
        while at < self.code.len() {
            let is_field = at > 0 && matches!(self.code[at - 1], Token::Dot);
            let mut names = Vec::new();
            while let Some(Token::Name(name)) = self.code.get(at) {
                names.push(name.clone());
                at += 1;
                match self.code.get(at) {
                    Some(Token::Path) => at += 1,
                    _ => break,
                }
            }
            // One name alone may be a variable: it counts where it is called, or is a type or a constant.
            let is_called = matches!(self.code.get(at), Some(Token::Open));
            let is_large = names.first().is_some_and(|name| name.starts_with(char::is_uppercase));
            if names.is_empty() {
                at += 1;
            } else if !is_field && (names.len() > 1 || is_called || is_large) {
                needed.push(names);
            }
        }
        needed
    }
}

fn file_of(folder: &Path, name: &str) -> PathBuf {
    let file = folder.join(format!("{name}.rs"));
    if file.exists() { file } else { folder.join(name).join("mod.rs") }
}

fn flatten(stream: TokenStream, tokens: &mut Vec<Token>) {
    let mut last_colon = false;
    for tree in stream {
        let is_colon = matches!(&tree, TokenTree::Punct(punct) if punct.as_char() == ':');
        match tree {
            TokenTree::Ident(name) => tokens.push(Token::Name(name.to_string())),
            TokenTree::Punct(_) if is_colon && last_colon => {
                tokens.pop();
                tokens.push(Token::Path);
            }
            TokenTree::Punct(punct) => {
                tokens.push(if punct.as_char() == '.' { Token::Dot } else { Token::Other });
            }
            TokenTree::Group(group) => {
                let is_open = group.delimiter() == Delimiter::Parenthesis;
                tokens.push(if is_open { Token::Open } else { Token::Other });
                flatten(group.stream(), tokens);
                tokens.push(Token::Other);
            }
            TokenTree::Literal(_) => tokens.push(Token::Other),
        }
        last_colon = is_colon && !last_colon;
    }
}

fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg") && attribute.meta.to_token_stream().to_string().contains("test")
    })
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

fn defined(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        _ => return None,
    };
    Some(name.to_string())
}

/// The public functions that an item declares; those of another crate's trait have the signatures of that trait.
fn signatures(item: &Item) -> Vec<Signature> {
    let public = |visibility: &Visibility| matches!(visibility, Visibility::Public(_));
    let signature = |owner: &str, signature: &syn::Signature| Signature {
        name: signature.ident.to_string(),
        owner: owner.to_owned(),
        names: names(signature.to_token_stream()),
    };
    match item {
        Item::Fn(item) if public(&item.vis) => vec![signature(&item.sig.ident.to_string(), &item.sig)],
        Item::Impl(item) if item.trait_.is_none() => {
            let syn::Type::Path(of) = &*item.self_ty else { return Vec::new() };
            let owner = of.path.segments.last().unwrap().ident.to_string();
            let methods = item.items.iter().filter_map(|inner| match inner {
                syn::ImplItem::Fn(method) if public(&method.vis) => Some(&method.sig),
                _ => None,
            });
            methods.map(|method| signature(&owner, method)).collect()
        }
        Item::Trait(item) if public(&item.vis) => {
            let methods = item.items.iter().filter_map(|inner| match inner {
                syn::TraitItem::Fn(method) => Some(&method.sig),
                _ => None,
            });
            methods.map(|method| signature(&item.ident.to_string(), method)).collect()
        }
        _ => Vec::new(),
    }
}

fn is_public(item: &Item) -> bool {
    let (Item::Enum(syn::ItemEnum { vis, .. })
    | Item::Fn(syn::ItemFn { vis, .. })
    | Item::Struct(syn::ItemStruct { vis, .. })
    | Item::Trait(syn::ItemTrait { vis, .. })
    | Item::Type(syn::ItemType { vis, .. })
    | Item::Union(syn::ItemUnion { vis, .. })) = item
    else {
        return false;
    };
    matches!(vis, Visibility::Public(_))
}

fn names(stream: TokenStream) -> BTreeSet<String> {
    let mut tokens = Vec::new();
    flatten(stream, &mut tokens);
    let name = |token| if let Token::Name(name) = token { Some(name) } else { None };
    tokens.into_iter().filter_map(name).collect()
}

/// The groups of files of which each needs, over others, all of its group.
fn circles<'a>(needs: &BTreeMap<&'a Path, BTreeSet<&'a Path>>) -> BTreeSet<Vec<&'a Path>> {
    let reached = |from: &'a Path| {
        let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(file) = open.pop() {
            open.extend(needs.get(file).into_iter().flatten().filter(|next| reached.insert(**next)));
        }
        reached
    };
    let reached: BTreeMap<&Path, BTreeSet<&Path>> = needs.keys().map(|file| (*file, reached(file))).collect();
    let circle = |(file, others): (&&'a Path, &BTreeSet<&'a Path>)| -> Vec<&'a Path> {
        others
            .iter()
            .copied()
            .filter(|other| reached.get(other).is_some_and(|back| back.contains(file)))
            .collect()
    };
    reached.iter().map(circle).filter(|circle| !circle.is_empty()).collect()
}

/// The roots of all crates of the workspace.
fn roots() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest: toml::Table = fs::read_to_string(root.join("Cargo.toml")).unwrap().parse().unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap().iter();
    let members = members.map(|member| root.join(member.as_str().unwrap()));
    let roots: Vec<PathBuf> = members.chain([root.to_owned()]).map(|path| path.join("src/lib.rs")).collect();
    assert!(roots.len() > 10, "{roots:?}");
    roots
}

#[test]
fn no_files_need_each_other() {
    let mut found = String::new();
    for root in roots() {
        let read = Crate::read(&root);
        let needs = read.needs();
        for circle in circles(&needs) {
            let short =
                |file: &Path| file.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap().display().to_string();
            found += &format!("circle of {} files:\n", circle.len());
            for file in &circle {
                let others = needs[file].iter().filter(|other| circle.contains(other));
                let others: Vec<String> = others.map(|other| short(other)).collect();
                found += &format!("  {} needs {}\n", short(file), others.join(", "));
            }
        }
    }
    assert!(found.is_empty(), "move types down, to where all who need them look:\n{found}");
}

/// Rooms of the crate `identify`, each with those that its files may need.
const ROOMS_OF_IDENTIFY: [(&str, &[&str]); 6] = [
    ("numbers", &[]),
    ("data", &["numbers"]),
    ("model", &["numbers", "data"]),
    ("search", &["numbers", "data", "model"]),
    ("report", &["numbers", "data", "model", "search"]),
    ("rotor", &["numbers", "data", "model"]),
];

/// Files of it that lead through all rooms.
const ABOVE_THE_ROOMS: [&str; 3] = ["lib", "run", "error"];

/// A flight is data, a model is held against it, a search finds effects, and a report says which.
#[test]
fn rooms_of_identify_need_those_below_alone() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("identify/src");
    let found = upward_needs(&folder);
    assert!(found.is_empty(), "move it down, or what it needs:\n{}", found.join("\n"));
}

/// Files of the rooms in `folder` that need one of another room than they may, and those that are in no room.
fn upward_needs(folder: &Path) -> Vec<String> {
    let room = |file: &Path| {
        let first = file.strip_prefix(folder).unwrap().iter().next().unwrap();
        Path::new(first).file_stem().unwrap().to_str().unwrap().to_owned()
    };
    let short = |file: &Path| file.strip_prefix(folder).unwrap().display().to_string();
    let read = Crate::read(&folder.join("lib.rs"));
    let mut found = Vec::new();
    for (file, needed) in read.needs() {
        let of = room(file);
        if ABOVE_THE_ROOMS.contains(&of.as_str()) {
            continue;
        }
        let Some((_, may)) = ROOMS_OF_IDENTIFY.iter().find(|(name, _)| *name == of) else {
            found.push(format!("{} is in no room", short(file)));
            continue;
        };
        let is_upward = |other: &&Path| room(other) != of && !may.contains(&room(other).as_str());
        let upward = needed.into_iter().filter(is_upward);
        found.extend(upward.map(|other| format!("{} needs {}", short(file), short(other))));
    }
    found
}

#[test]
fn a_room_that_needs_one_above_is_found() {
    let files = [
        ("lib.rs", "mod data; mod model; mod stray; pub mod run;"),
        ("data.rs", "pub mod low; pub struct Flight;"),
        ("data/low.rs", "use crate::model::Model; pub fn low(_: Model) {}"),
        ("model.rs", "use crate::data::Flight; pub struct Model(Flight);"),
        ("stray.rs", ""),
        ("run.rs", "use crate::model::Model; pub fn run(_: Model) {}"),
    ];
    let folder = folder_of(&files);
    assert_eq!(upward_needs(folder.path()), ["data/low.rs needs model.rs", "stray.rs is in no room"]);
}

/// Crates that know what flies, and where.
const OF_A_DOMAIN: [&str; 8] =
    ["autopilots", "controllers", "flights", "identify", "plant", "scenes", "sensors", "vehicles"];

/// A launcher reads in the declarations of the components what it has to know of them.
#[test]
fn what_launches_and_records_knows_no_domain() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for crate_ in ["bus", "bus/component", "recorder", "runtime"] {
        let text = fs::read_to_string(root.join(crate_).join("Cargo.toml")).unwrap();
        let manifest: toml::Table = text.parse().unwrap();
        let known = manifest["dependencies"].as_table().unwrap();
        let found: Vec<_> = OF_A_DOMAIN.iter().filter(|name| known.contains_key(**name)).collect();
        assert!(found.is_empty(), "{crate_} knows {found:?}: let the components declare it");
    }
}

/// Packages whose components are compiled and tested without a transport.
const WITHOUT_TRANSPORT: [&str; 4] =
    ["hummingbus-component", "hummingbus-controllers", "hummingbus-plant", "hummingbus-sensors"];
/// Packages of the transport, and what it needs of the system.
const TRANSPORT: [&str; 4] = ["hummingbus-bus", "iceoryx2", "memmap2", "signal-hook"];

#[test]
fn components_are_compiled_without_a_transport() {
    let lock = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.lock")).unwrap();
    let lock: toml::Table = lock.parse().unwrap();
    let mut needs: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for package in lock["package"].as_array().unwrap() {
        let named = package.get("dependencies").and_then(toml::Value::as_array).into_iter().flatten();
        // A version stands behind the name if the lock file has several.
        let names = named.filter_map(|name| name.as_str()?.split(' ').next());
        needs.entry(package["name"].as_str().unwrap()).or_default().extend(names);
    }
    let reached = |from: &'static str| {
        let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(package) = open.pop() {
            open.extend(needs[package].iter().filter(|next| reached.insert(**next)));
        }
        reached
    };
    assert!(
        TRANSPORT.iter().all(|name| reached("hummingbus").contains(name)),
        "{TRANSPORT:?} are other packages now"
    );
    for package in WITHOUT_TRANSPORT {
        let found: Vec<_> = reached(package).into_iter().filter(|name| TRANSPORT.contains(name)).collect();
        assert!(found.is_empty(), "{package} needs {found:?}: let it depend on hummingbus-component alone");
    }
}

/// Types that change behind a shared reference, and memory of a thread or a process.
const CHANGING: [&str; 9] =
    ["Cell", "RefCell", "OnceCell", "UnsafeCell", "Mutex", "RwLock", "OnceLock", "LazyLock", "thread_local"];
/// Files that may name them. Linux sends the positions of a gamepad anew whenever it is opened, and a reader of gains ends before a
/// component is made.
const WITHOUT_STATE: [&str; 2] = ["controllers/src/gains_file.rs", "controllers/src/gamepad.rs"];

/// A step takes its component by a shared reference, so that nothing else than these types could hide from its state.
#[test]
fn what_changes_in_a_component_is_in_its_state() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = BTreeSet::new();
    for crate_ in ["controllers", "plant", "sensors"] {
        for module in Crate::read(&root.join(crate_).join("src/lib.rs")).modules.into_values() {
            let imported = module.imports.values().flatten();
            let used = module.code.iter().filter_map(|token| match token {
                Token::Name(name) => Some(name),
                _ => None,
            });
            let is_changing = |name: &String| CHANGING.contains(&name.as_str()) || name.starts_with("Atomic");
            if imported.chain(used).any(is_changing) {
                found.insert(module.file.strip_prefix(root).unwrap().display().to_string());
            }
        }
    }
    assert_eq!(found.iter().collect::<Vec<_>>(), WITHOUT_STATE.iter().collect::<Vec<_>>());
}

/// Packages of the program's terminal and plots.
const OF_THE_PROGRAM_ALONE: [&str; 6] = ["clap", "ctrlc", "indicatif", "plotters", "ratatui", "resvg"];

/// Packages of other projects that are compiled with the package `hummingbus`, by the manifests of the workspace.
fn compiled(with_default_features: bool) -> BTreeSet<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |folder: &str| -> toml::Table {
        fs::read_to_string(root.join(folder).join("Cargo.toml")).unwrap().parse().unwrap()
    };
    let workspace = read("")["workspace"]["dependencies"].as_table().unwrap().clone();
    let is_set = |options: &toml::Value, key: &str, default: bool| {
        options.get(key).and_then(toml::Value::as_bool).unwrap_or(default)
    };
    let (mut external, mut seen) = (BTreeSet::new(), BTreeSet::new());
    let mut open = vec![(String::new(), with_default_features)];
    while let Some((folder, is_default)) = open.pop() {
        if !seen.insert((folder.clone(), is_default)) {
            continue;
        }
        let manifest = read(&folder);
        let features = if is_default { default_features(&manifest) } else { BTreeSet::new() };
        for (name, options) in manifest["dependencies"].as_table().unwrap() {
            let is_enabled = !is_set(options, "optional", false) || features.contains(&format!("dep:{name}"));
            let shared = &workspace[name.as_str()];
            // A feature of another package, such as `report/plots`, counts as all of that package's features.
            let is_whole = is_set(shared, "default-features", true)
                || options.get("features").is_some()
                || features.iter().any(|feature| feature.starts_with(&format!("{name}/")));
            match shared.get("path").and_then(toml::Value::as_str) {
                _ if !is_enabled => {}
                Some(folder) => open.push((folder.to_owned(), is_whole)),
                None => {
                    external.insert(name.clone());
                }
            }
        }
    }
    external
}

/// The features of a package that are on by default, and those that they turn on.
fn default_features(manifest: &toml::Table) -> BTreeSet<String> {
    let declared = manifest.get("features").and_then(toml::Value::as_table);
    let (mut found, mut open) = (BTreeSet::new(), vec!["default".to_owned()]);
    while let Some(feature) = open.pop() {
        let more = declared.and_then(|declared| declared.get(&feature)?.as_array()).into_iter().flatten();
        open.extend(
            more.filter_map(|more| Some(more.as_str()?.to_owned())).filter(|more| !found.contains(more)),
        );
        found.insert(feature);
    }
    found
}

#[test]
fn the_library_is_compiled_without_a_terminal_and_without_plots() {
    let (library, program) = (compiled(false), compiled(true));
    let found: Vec<_> = OF_THE_PROGRAM_ALONE.iter().filter(|name| library.contains(**name)).collect();
    assert!(found.is_empty(), "the library needs {found:?}: make them part of the feature `cli`");
    let missing: Vec<_> = OF_THE_PROGRAM_ALONE.iter().filter(|name| !program.contains(**name)).collect();
    assert!(missing.is_empty(), "the program needs other packages than {missing:?} now");
}

/// Crates whose first lines say in which module each subject is.
const WITH_A_MAP: [&str; 4] = ["bus", "bus/component", "campaign", "runtime"];

#[test]
fn the_map_of_a_crate_has_all_its_modules() {
    for crate_ in WITH_A_MAP {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(crate_).join("src/lib.rs");
        let text = fs::read_to_string(root).unwrap();
        let map: String = text.lines().filter(|line| line.starts_with("//! | ")).collect();
        assert!(!map.is_empty(), "{crate_} has no map");
        let modules = syn::parse_file(&text).unwrap().items.into_iter().filter_map(|item| match item {
            Item::Mod(item) if !is_for_tests(&item.attrs) && item.ident != "__private" => {
                Some(item.ident.to_string())
            }
            _ => None,
        });
        let missing: Vec<_> = modules.filter(|name| !map.contains(&format!("`{name}`"))).collect();
        assert!(missing.is_empty(), "the map of {crate_} has no {missing:?}");
    }
}

/// Crates whose public functions may return `anyhow::Error`: they are compiled only for the program and its tools.
const OF_THE_PROGRAM: [&str; 3] = ["campaign/", "report/view/", "bindings/fmu/"];

#[test]
fn functions_of_the_library_return_its_own_errors() {
    let mut found = Vec::new();
    for root in roots() {
        let of = root.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap().display().to_string();
        if !OF_THE_PROGRAM.iter().any(|crate_| of.starts_with(crate_)) {
            found.extend(Crate::read(&root).public_with("anyhow").iter().map(|name| format!("{of}: {name}")));
        }
    }
    assert!(found.is_empty(), "return diagnostics::Error:\n{}", found.join("\n"));
}

#[test]
fn a_foreign_error_in_a_public_signature_is_found_by_any_name() {
    let files = [
        ("lib.rs", "pub mod a; mod b; mod c; pub use b::{T, f as renamed};"),
        (
            "a.rs",
            "use anyhow::Result; use std::result::Result as R; pub fn named() -> Result<()> {} fn own() -> Result<()> {}
             pub(crate) fn inner() -> Result<()> {} pub fn fine() -> R<(), ()> {}
             pub fn whole(_: anyhow::Error) {} pub trait U { fn declared() -> Result<()>; }
             impl std::str::FromStr for T { fn from_str(_: &str) -> Result<()> {} }
             pub(crate) struct Inner; impl Inner { pub fn method() -> Result<()> {} }",
        ),
        ("b.rs", "use anyhow as x; pub struct T; impl T { pub fn method() -> x::Error {} } pub fn f() -> x::Error {}"),
        (
            "c.rs",
            "pub fn hidden() -> anyhow::Error {}
             pub struct T; impl T { pub fn namesake() -> anyhow::Error {} }",
        ),
    ];
    let folder = folder_of(&files);
    let found = Crate::read(&folder.path().join("lib.rs")).public_with("anyhow");
    assert_eq!(found, ["a::named", "a::whole", "a::U::declared", "b::T::method", "b::f"]);
}

/// A folder with these files.
fn folder_of(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    folder
}

/// The circles of a crate with these files.
fn circles_of(files: &[(&str, &str)]) -> Vec<Vec<String>> {
    let folder = folder_of(files);
    let read = Crate::read(&folder.path().join("lib.rs"));
    let short = |file: &&Path| file.strip_prefix(folder.path()).unwrap().to_string_lossy().into_owned();
    circles(&read.needs()).iter().map(|circle| circle.iter().map(short).collect()).collect()
}

#[test]
fn a_circle_is_found_whatever_path_it_takes() {
    let below = ("b.rs", "pub struct B; pub const N: u8 = 1;");
    let cases: [(&str, &[(&str, &str)]); 5] = [
        (
            "imports",
            &[("a.rs", "use crate::b::B; pub struct A(B);"), ("b.rs", "use crate::a::A; pub struct B(A);")],
        ),
        (
            "a path in code",
            &[("a.rs", "pub fn a() { crate::b::b() }"), ("b.rs", "pub fn b() { super::a::a() }")],
        ),
        (
            "a path in a macro",
            &[("a.rs", "pub fn a() { vec![crate::b::b()]; }"), ("b.rs", "pub fn b() { crate::a::a() }")],
        ),
        (
            "a re-export",
            &[("a.rs", "pub fn a() { crate::renamed() }"), ("b.rs", "use crate::a; pub fn b() { a::a() }")],
        ),
        (
            "a glob",
            &[
                ("a.rs", "use crate::b::*; pub struct A(B);"),
                ("b.rs", "pub struct B; pub fn b() -> crate::a::A { loop {} }"),
            ],
        ),
    ];
    for (what, files) in cases {
        let lib = ("lib.rs", "mod a; mod b; pub use b::b as renamed;");
        assert_eq!(circles_of(&[files, &[lib]].concat()), [["a.rs", "b.rs"]], "{what}");
    }
    let child = [
        ("lib.rs", "mod a;"),
        ("a.rs", "mod b; use b::B; pub struct A(B);"),
        ("a/b.rs", "pub struct B(super::A);"),
    ];
    assert_eq!(circles_of(&child), [["a/b.rs", "a.rs"]], "a parent and its child");
    let facade = [("lib.rs", "mod a; mod b; pub use a::A;"), ("a.rs", "pub struct A(crate::b::B);"), below];
    assert_eq!(circles_of(&facade), Vec::<Vec<String>>::new(), "a facade needs nothing");
    let tests = [
        ("lib.rs", "mod a; mod b;"),
        ("a.rs", "use crate::b::B; pub struct A(B);"),
        ("b.rs", "pub struct B; #[cfg(test)] mod tests { use crate::a::A; }"),
    ];
    assert_eq!(circles_of(&tests), Vec::<Vec<String>>::new(), "tests look at everything");
}
