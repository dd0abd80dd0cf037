//! Keys of a vehicle file, their dimensions, and the values that are physical.

use nalgebra::{Matrix3, Vector3};
use std::io;
use std::path::{Path, PathBuf};

use crate::bounds;
use crate::command::CommandMap;
use crate::effects;
use crate::envelope;
use crate::foreign;
use crate::provenance::Uncertainty;
use crate::reader::{Document, Quantity, Section};
use crate::vehicle::{MotorModel, ROTORS_MAX, Rotor, Vehicle};
use diagnostics::unit::{
    ACCELERATION, INERTIA, LENGTH, MASS, PURE_NUMBER, SPEED, THRUST_COEFFICIENT, TIME, TORQUE_COEFFICIENT,
};
use diagnostics::{Diagnostic, Faults, ParameterError};
use inputs::{FileKind, FileRole, InputFiles};
use toml::de::DeTable;

/// Vehicle files, for parameters that name one.
pub const FILE: FileKind = FileKind {
    others: |files, path| Vehicle::base(files, path).into_iter().collect(),
    has_explaining_warnings: true,
    ..FileKind::of(FileRole::Model)
};

/// Part of its size by which a published tensor may miss the triangle inequality through rounding.
const TRIANGLE_SLACK: f64 = 1e-9;

impl Vehicle {
    /// Reads and checks a vehicle file, from the disk.
    pub fn load(path: &Path) -> Result<Self, Diagnostic> {
        Self::load_from(&InputFiles::default(), path)
    }

    /// Reads and checks a vehicle file of `files`: a component takes those of its context.
    ///
    /// # Errors
    /// The error in the file or its base, with its place.
    pub fn load_from(files: &InputFiles, path: &Path) -> Result<Self, Diagnostic> {
        let file = path.display().to_string();
        let read = |path: &Path| files.text(path);
        match read(path) {
            Ok(text) => Self::parse_with(&text, &file, &read),
            Err(cause) => Err(Diagnostic::unreadable(file, &cause)),
        }
    }

    /// Reads and checks the text of a vehicle file, whose layout `vehicles/hummingbird.toml` shows; `file_name` is for
    /// messages, and the path of its `base` is relative to it. A file with a `base` has that file's vehicle, and its effects
    /// before its own; keys of its tables `[body]`, `[rotor]`, `[motor]` and `[command]` replace those of its base, and its
    /// `[[rotors]]` all those of its base.
    pub fn parse(text: &str, file_name: &str) -> Result<Self, Diagnostic> {
        Self::parse_with(text, file_name, &|path| InputFiles::default().text(path))
    }

    /// As [`Vehicle::parse`], with the text of the file's `base` from `read`, which takes its path: for files that are not on
    /// the disk, as those that a recording has attached.
    ///
    /// # Errors
    /// As [`Vehicle::parse`].
    ///
    /// ```
    /// use vehicles::{Vehicle, reference::HUMMINGBIRD};
    /// let text = "name = \"another\"\nbase = \"hummingbird.toml\"";
    /// let vehicle = Vehicle::parse_with(text, "another.toml", &|_| Ok(HUMMINGBIRD.to_owned()))?;
    /// assert_eq!((&*vehicle.name, vehicle.mass_kg), ("another", 0.48));
    /// # Ok::<(), diagnostics::Diagnostic>(())
    /// ```
    pub fn parse_with(
        text: &str,
        file_name: &str,
        read: &dyn Fn(&Path) -> io::Result<String>,
    ) -> Result<Self, Diagnostic> {
        refuse_xml(text, file_name)?;
        let doc = Document::new(file_name, text);
        let tree = doc.tree()?;
        let root = Section::new(&doc, String::new(), 0..0, tree.get_ref());
        if root.has("base") {
            return on_base(&doc, tree.get_ref(), &beside(Path::new(file_name), root.text("base")?), read);
        }
        complete(&root, None)
    }

    /// The file that the vehicle file at `path` adds effects to, or replaces tables of, if it names one.
    pub fn base(files: &InputFiles, path: &Path) -> Option<PathBuf> {
        let text = files.text(path).ok()?;
        let table: toml::Table = text.parse().ok()?;
        Some(beside(path, table.get("base")?.as_str()?))
    }
}

/// Refuses the robot descriptions of other programs by their names.
fn refuse_xml(text: &str, file_name: &str) -> Result<(), Diagnostic> {
    if !text.trim_start_matches('\u{feff}').trim_start().starts_with('<') {
        return Ok(());
    }
    let found = foreign::robot(text.as_bytes()).unwrap_or("XML");
    let way = match found {
        name if foreign::is_converted(name) => {
            format!("make a vehicle file of it: `hummingbus new vehicle --from {file_name} -o NAME.toml`; ")
        }
        "XML" => String::new(),
        _ => "convert it to URDF or SDF, and run `hummingbus new vehicle --from FILE -o NAME.toml`; "
            .to_owned(),
    };
    let help = format!("{way}docs/vehicles.md has the keys of vehicle files");
    Err(Diagnostic::in_file(file_name, format!("expected a vehicle file, which is TOML, found {found}"))
        .help(help))
}

/// The path that a file at `path` calls `other`.
fn beside(path: &Path, other: &str) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(other)
}

fn on_base(
    upper: &Document,
    table: &DeTable,
    path: &Path,
    read: &dyn Fn(&Path) -> io::Result<String>,
) -> Result<Vehicle, Diagnostic> {
    let file = path.display().to_string();
    let root = Section::new(upper, String::new(), 0..0, table);
    let text = read(path).map_err(|cause| {
        let expected = "the path of a vehicle file, relative to this one";
        upper.bad(&root.at_of("base"), "base", expected, format!("{file}: {cause}"))
    })?;
    let doc = Document::new(&file, &text);
    let tree = doc.tree()?;
    let lower = Section::new(&doc, String::new(), 0..0, tree.get_ref());
    if lower.has("base") {
        // So no chain of files can bite its tail.
        let expected = "a complete vehicle file as a base";
        return Err(doc.bad(&lower.at_of("base"), "base", expected, "one that has a base itself"));
    }
    root.text("base")?;
    let (base, vehicle) = (complete(&lower, None), complete(&root, Some(&lower)));
    let (base, vehicle) = match (base, vehicle) {
        (Ok(base), vehicle) => (base, vehicle?),
        // The faults of the base, which this file may have inherited, and its own.
        (Err(of_base), vehicle) => {
            let faults = vehicle.err().into_iter().flat_map(|fault| fault.all().collect::<Vec<_>>());
            return Err(of_base.and(faults.filter(|fault| fault.file != file)));
        }
    };
    let effects = [base.effects, vehicle.effects].concat();
    let provenance = [doc.provenance.take(), vehicle.provenance].concat();
    Ok(Vehicle { effects, provenance, ..vehicle })
}

/// The table `name` of the file, on top of that of its base.
fn table<'d, 't>(
    root: &Section<'d, 't>,
    lower: Option<&Section<'d, 't>>,
    name: &'static str,
) -> Result<Section<'d, 't>, Diagnostic> {
    match (lower, root.has(name)) {
        (Some(lower), true) => Ok(root.section(name)?.above(lower.section(name)?)),
        (Some(lower), false) => lower.section(name),
        (None, _) => root.section(name),
    }
}

fn title(root: &Section) -> Result<String, Diagnostic> {
    if root.has("notes") {
        root.text("notes")?;
    }
    Ok(root.text("name")?.to_owned())
}

/// The vehicle of a file; what its tables have not is that of its base.
fn complete<'d, 't>(root: &Section<'d, 't>, lower: Option<&Section<'d, 't>>) -> Result<Vehicle, Diagnostic> {
    let mut faults = Faults::default();
    let name = faults.keep(title(root));
    let body = faults.keep(table(root, lower, "body").and_then(|section| body(&section)));
    let rotor = faults.keep(table(root, lower, "rotor").and_then(|section| rotor(&section)));
    let rotors = faults.keep(layout(if root.has("rotors") { root } else { lower.unwrap_or(root) }));
    let motor = faults.keep(table(root, lower, "motor").and_then(|section| motor(&section)));
    let command = faults.keep(table(root, lower, "command").and_then(|section| command(&section)));
    let effects = faults.keep(effects::read(root));
    let envelope = faults.keep(envelope::read(root));
    faults.keep(root.finish());
    let vehicle = (|| {
        let (mass_kg, inertia_kg_m2, gravity_m_s2) = body?;
        let [thrust_coefficient, torque_coefficient, rotor_inertia_kg_m2] = rotor?;
        Some(Vehicle {
            name: name?,
            mass_kg,
            inertia_kg_m2,
            gravity_m_s2,
            rotors: rotors?,
            thrust_coefficient,
            torque_coefficient,
            rotor_inertia_kg_m2,
            motor: motor?,
            command: command?,
            effects: effects?,
            envelope: envelope?,
            provenance: root.doc.provenance.take(),
        })
    })();
    faults.finish(vehicle)
}

fn body(section: &Section) -> Result<(f64, Matrix3<f64>, f64), Diagnostic> {
    // All keys are asked for before the first fault is told: a misspelt one is told beside the one that it should be.
    let mut faults = Faults::default();
    let mass = section.quantity("mass", MASS).and_then(|mass| mass.positive()?.within(&bounds::MASS));
    let mass = faults.keep(mass);
    let gravity_m_s2 = faults.keep(section.bounded("gravity", ACCELERATION, &bounds::GRAVITY));
    let inertia = faults.keep(inertia(section));
    faults.keep(section.finish());
    faults.finish((|| Some((mass?.si, inertia?, gravity_m_s2?)))())
}

/// The symmetric tensor J; `inertia_xy` and so on are the entries J_xy themselves, not their negatives.
fn inertia(section: &Section) -> Result<Matrix3<f64>, Diagnostic> {
    let mut faults = Faults::default();
    let [xx, yy, zz] =
        ["inertia_xx", "inertia_yy", "inertia_zz"].map(|name| faults.keep(moment(section, name)));
    let [xy, xz, yz] =
        ["inertia_xy", "inertia_xz", "inertia_yz"].map(|name| faults.keep(product(section, name)));
    let entries = (|| Some((xx?, yy?, zz?, xy?, xz?, yz?)))();
    let (xx, yy, zz, xy, xz, yz) = faults.finish(entries)?;
    let tensor = Matrix3::new(xx.si, xy, xz, xy, yy.si, yz, xz, yz, zz.si);
    let moments = principal_moments(&tensor);
    if is_physical(&moments) {
        return Ok(tensor);
    }
    let found = format!("{:.4e}, {:.4e}, {:.4e} kg*m^2", moments[0], moments[1], moments[2]);
    let expected = "a tensor whose principal moments are above 0, none larger than the sum of the other two";
    // The moment that is too large is to blame, else the first that the file states itself.
    let sum = xx.si + yy.si + zz.si;
    let mut stated = [&xx, &yy, &zz].into_iter().filter(|moment| section.is_own(moment)).peekable();
    let first = stated.peek().copied().unwrap_or(&xx);
    let wrong = stated.find(|moment| moment.si > sum - moment.si).unwrap_or(first);
    Err(wrong.doc.bad(&wrong.at, &section.key("inertia_xx, inertia_yy, inertia_zz"), expected, found))
}

fn moment<'d, 't>(section: &Section<'d, 't>, name: &'static str) -> Result<Quantity<'d, 't>, Diagnostic> {
    section.quantity(name, INERTIA)?.positive()?.within(&bounds::INERTIA)
}

fn product(section: &Section, name: &'static str) -> Result<f64, Diagnostic> {
    if section.has(name) { section.bounded(name, INERTIA, &bounds::INERTIA_PRODUCT) } else { Ok(0.0) }
}

/// True if a rigid body can have this tensor of inertia.
pub fn is_rigid(inertia_kg_m2: &Matrix3<f64>) -> bool {
    is_physical(&principal_moments(inertia_kg_m2))
}

/// A rigid body's principal moments are positive and satisfy the triangle inequality.
fn is_physical(moments: &Vector3<f64>) -> bool {
    let largest = moments.max();
    moments.min() > 0.0 && 2.0 * largest <= moments.sum() + TRIANGLE_SLACK * largest
}

/// Eigenvalues, computed on the tensor scaled to 1 so that no exponent in a file can overflow on the way.
fn principal_moments(tensor: &Matrix3<f64>) -> Vector3<f64> {
    let scale = tensor.amax();
    (tensor / scale).symmetric_eigenvalues() * scale
}

fn rotor(section: &Section) -> Result<[f64; 3], Diagnostic> {
    let mut faults = Faults::default();
    let [thrust, torque, inertia] = [
        section.bounded("thrust_coefficient", THRUST_COEFFICIENT, &bounds::THRUST_COEFFICIENT),
        section.bounded("torque_coefficient", TORQUE_COEFFICIENT, &bounds::TORQUE_COEFFICIENT),
        section.bounded("inertia", INERTIA, &bounds::ROTOR_INERTIA),
    ]
    .map(|number| faults.keep(number));
    faults.keep(section.finish());
    faults.finish((|| Some([thrust?, torque?, inertia?]))())
}

fn layout(root: &Section) -> Result<Vec<Rotor>, Diagnostic> {
    let sections = root.sections("rotors")?;
    let rotors = Diagnostic::gather(sections.iter().map(one_rotor))?;
    // The first table tells where; with none at all, the file's start does.
    let at = sections.first().map_or(0..0, |section| section.at.clone());
    match rotors.len() {
        1..=ROTORS_MAX => require_names(&sections).map(|()| rotors),
        count => Err(root.doc.bad(&at, "rotors", format!("1 to {ROTORS_MAX} rotors"), format!("{count}"))),
    }
}

/// Refuses two rotors of one name: messages and reports distinguish rotors by their names.
fn require_names(rotors: &[Section]) -> Result<(), Diagnostic> {
    let named = |section: &Section| section.text("name").map(str::to_owned);
    let names = Diagnostic::gather(rotors.iter().map(named))?;
    let twice = names.iter().enumerate().filter_map(|(second, name)| {
        let first = names[..second].iter().position(|other| other == name)?;
        let (section, at) = (&rotors[second], |rotor: usize| rotors[rotor].at_of("name"));
        let line = section.doc.place(&at(first)).line;
        let found = format!("\"{name}\", the name of `rotors.{first}` in line {line}");
        let error = ParameterError::value(section.key("name"), "a name that no other rotor has", found);
        Some(Err::<(), _>(Diagnostic::at(section.doc.place_after(&at(second), &at(first)), error)))
    });
    Diagnostic::gather(twice).map(drop)
}

fn one_rotor(section: &Section) -> Result<Rotor, Diagnostic> {
    let mut faults = Faults::default();
    let name = faults.keep(section.text("name"));
    let position_m = faults.keep(section.vector("position", LENGTH, &bounds::HUB));
    let axis = faults.keep(if section.has("axis") { axis(section) } else { Ok(Vector3::z()) });
    let spin = faults.keep(section.section("spin").and_then(|section| spin(&section)));
    let has_failed = faults.keep(flag_if_any(section, "failed"));
    let torque_scale = faults.keep(if section.has("torque_scale") {
        section.bounded("torque_scale", PURE_NUMBER, &bounds::TORQUE_SCALE)
    } else {
        Ok(1.0)
    });
    faults.keep(section.finish());
    let rotor = (|| {
        Some(Rotor {
            name: name?.to_owned(),
            position_m: Vector3::from(position_m?),
            axis: axis?,
            spin: spin?,
            torque_scale: torque_scale?,
            has_failed: has_failed?,
        })
    })();
    faults.finish(rotor)
}

/// The direction of a rotor's thrust, of which the length does not matter.
fn axis(section: &Section) -> Result<Vector3<f64>, Diagnostic> {
    let given = Vector3::from(section.vector("axis", PURE_NUMBER, &bounds::AXIS)?);
    // Not divided where it is that of the other rotors: it stays the same number.
    let axis = if given == Vector3::z() { given } else { given / given.norm() };
    // Not of a length that is 0, or whose square is too small to keep its digits.
    if given.norm_squared().is_normal() {
        return Ok(axis);
    }
    let expected = "a direction, such as [0, 0.2, 1]";
    let found = format!("[{}, {}, {}]", given.x, given.y, given.z);
    Err(section.doc.bad(&section.at_of("axis"), &section.key("axis"), expected, found))
}

/// A sense of rotation has a value and a source, but neither unit nor uncertainty.
fn spin(section: &Section) -> Result<f64, Diagnostic> {
    let mut faults = Faults::default();
    let spin = faults.keep(section.choice("value", &[("counter-clockwise", 1.0), ("clockwise", -1.0)]));
    let source = faults.keep(section.source());
    faults.keep(section.finish());
    let (spin, source) = faults.finish(spin.zip(source))?;
    section.note("seen from above", source, Uncertainty::OneSigma(0.0));
    Ok(spin)
}

fn motor(section: &Section) -> Result<MotorModel, Diagnostic> {
    let mut faults = Faults::default();
    let is_first = faults.keep(section.choice("model", &[("first-order", true), ("second-order", false)]));
    // Without a model, the numbers of both are read as far as the file has them.
    let is_needed = |name: &'static str, of_first: bool| match is_first {
        Some(is_first) => is_first == of_first,
        None => section.has(name),
    };
    let numbers = [
        ("time_constant", true, TIME, &bounds::TIME_CONSTANT),
        ("natural_frequency", false, SPEED, &bounds::NATURAL_FREQUENCY),
        ("damping_ratio", false, PURE_NUMBER, &bounds::DAMPING_RATIO),
    ];
    let [time_constant_s, natural_frequency_rad_s, damping_ratio] =
        numbers.map(|(name, of_first, dimension, bounds)| {
            let read = is_needed(name, of_first).then(|| section.bounded(name, dimension, bounds));
            read.and_then(|read| faults.keep(read))
        });
    faults.keep(section.finish());
    let first = time_constant_s.map(|time_constant_s| MotorModel::FirstOrder { time_constant_s });
    let second = natural_frequency_rad_s.zip(damping_ratio);
    let second = second.map(|(natural_frequency_rad_s, damping_ratio)| MotorModel::SecondOrder {
        natural_frequency_rad_s,
        damping_ratio,
    });
    faults.finish(if is_first == Some(true) { first } else { second })
}

fn command(section: &Section) -> Result<CommandMap, Diagnostic> {
    let mut faults = Faults::default();
    let [min, max, low, high] = [
        ("min", PURE_NUMBER, &bounds::COMMAND),
        ("max", PURE_NUMBER, &bounds::COMMAND),
        ("speed_at_min", SPEED, &bounds::ROTOR_SPEED),
        ("speed_at_max", SPEED, &bounds::ROTOR_SPEED),
    ]
    .map(|(name, dimension, bounds)| {
        faults.keep(section.quantity(name, dimension).and_then(|number| number.within(bounds)))
    });
    let commands = min.zip(max).and_then(|ends| {
        let expected = ["a command below `command.max`", "a command above `command.min`"];
        faults.keep(in_order(section, ends, expected))
    });
    let speeds = low.zip(high).and_then(|ends| {
        let expected = ["a speed below `command.speed_at_max`", "a speed above `command.speed_at_min`"];
        faults.keep(in_order(section, ends, expected))
    });
    let zero_is_off = faults.keep(flag_if_any(section, "zero_is_off"));
    faults.keep(section.finish());
    let map = (|| {
        let ([min, max], [speed_at_min_rad_s, speed_at_max_rad_s]) = (commands?, speeds?);
        Some(CommandMap { min, max, speed_at_min_rad_s, speed_at_max_rad_s, zero_is_off: zero_is_off? })
    })();
    faults.finish(map)
}

/// The ends of a range, the low one first. Of two that do not go together, that of this file is wrong, not that of its base.
fn in_order<'d, 't>(
    section: &Section<'d, 't>,
    (low, high): (Quantity<'d, 't>, Quantity<'d, 't>),
    [below, above]: [&str; 2],
) -> Result<[f64; 2], Diagnostic> {
    let ends = [low.si, high.si];
    let is_rising = high.si > low.si;
    let is_own = section.is_own(&high);
    let checked = if is_own { high.require(is_rising, above) } else { low.require(is_rising, below) };
    checked.map(|_| ends)
}

/// The flag `name` of `section`; false where the file has none.
fn flag_if_any<'d>(section: &Section<'d, '_>, name: &'d str) -> Result<bool, Diagnostic> {
    if section.has(name) { told(&section.section(name)?) } else { Ok(false) }
}

/// True or false, with a source.
fn told(section: &Section) -> Result<bool, Diagnostic> {
    let mut faults = Faults::default();
    let value = faults.keep(section.flag("value"));
    let source = faults.keep(section.source());
    faults.keep(section.finish());
    let (value, source) = faults.finish(value.zip(source))?;
    section.note("true or false", source, Uncertainty::OneSigma(0.0));
    Ok(value)
}
