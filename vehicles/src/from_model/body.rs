//! Mass, centre of mass and tensor of inertia of all links together.

use diagnostics::{Diagnostic, ParameterError};
use nalgebra::{Matrix3, Point3, Vector3};

use super::model::{Inertial, Link, Model};
use super::text::plain;
use crate::bounds;
use crate::file::is_rigid;

/// Violation of the triangle inequality that the principal moments of a link may have, relative to their sum:
/// files print few digits.
const TRIANGLE_SLACK: f64 = 1e-3;

/// The links of a model as one rigid body.
pub struct Body {
    /// Sum of the masses.
    pub mass_kg: f64,
    /// Centre of mass in the model's frame.
    pub centre: Point3<f64>,
    /// Tensor about the centre of mass, in the axes of the model's frame.
    pub inertia_kg_m2: Matrix3<f64>,
    /// Names of the links that have mass.
    pub links: Vec<String>,
}

/// Joins all links by any joints, at the joints' zero.
///
/// # Errors
/// If a mass or tensor is not physical or not within bounds, a link is far away, or no link has mass.
pub fn of(model: &Model) -> Result<Body, Diagnostic> {
    let mut parts = Vec::new();
    for link in &model.links {
        if let Some(inertial) = &link.inertial
            && has_mass(model, link, inertial)?
        {
            require_near(model, &(link, inertial))?;
            parts.push((link, inertial));
        }
    }
    let mass_kg: f64 = parts.iter().map(|(_, inertial)| inertial.mass_kg).sum();
    if parts.is_empty() {
        let error = model.source.whole("expected links with mass, found none");
        return Err(error.help("add <inertial> with <mass> and <inertia> to a link"));
    }
    let moment: Vector3<f64> = parts.iter().map(|part| place(part).coords * part.1.mass_kg).sum();
    let centre = Point3::from(moment / mass_kg);
    let inertia_kg_m2: Matrix3<f64> = parts.iter().map(|part| about(part, &centre)).sum();
    require_bounds(model, &parts, mass_kg, &inertia_kg_m2)?;
    let links = parts.iter().map(|(link, _)| link.name.clone()).collect();
    Ok(Body { mass_kg, centre, inertia_kg_m2, links })
}

/// The centre of mass of a link in the model's frame.
fn place((link, inertial): &(&Link, &Inertial)) -> Point3<f64> {
    link.pose * inertial.pose * Point3::origin()
}

/// Refuses a centre of mass that is farther from the model's origin than any vehicle reaches.
fn require_near(model: &Model, part: &(&Link, &Inertial)) -> Result<(), Diagnostic> {
    let (place, max) = (place(part), bounds::HUB.max);
    if place.coords.amax() <= max {
        return Ok(());
    }
    let key = format!("centre of mass of link {}", plain(&part.0.name));
    let found = format!("[{:.4e}, {:.4e}, {:.4e}] m", place.x, place.y, place.z);
    let expected = format!("within {max} m of the model's origin along each axis");
    Err(model
        .source
        .fault(part.1.at.clone(), ParameterError::value(key, expected, found))
        .help("give lengths in metres, and poses from the model's own frame"))
}

/// Refuses a mass and a tensor of all links that no vehicle has; the place is that of the heaviest link.
fn require_bounds(
    model: &Model,
    parts: &[(&Link, &Inertial)],
    mass_kg: f64,
    inertia_kg_m2: &Matrix3<f64>,
) -> Result<(), Diagnostic> {
    let heaviest = parts.iter().max_by(|a, b| a.1.mass_kg.total_cmp(&b.1.mass_kg));
    let at = heaviest.map_or(0..0, |part| part.1.at.clone());
    let moments = inertia_kg_m2.diagonal();
    bounds::MASS
        .check("mass of all links", mass_kg)
        .and_then(|()| bounds::INERTIA.check("least moment of inertia of all links", moments.min()))
        .and_then(|()| bounds::INERTIA.check("largest moment of inertia of all links", moments.max()))
        .map_err(|error| {
            model.source.fault(at, error).help("give masses in kg and moments of inertia in kg*m^2")
        })
}

/// The tensor of a link in the axes of the model's frame, about the link's own centre of mass.
pub fn turned(link: &Link, inertial: &Inertial) -> Matrix3<f64> {
    let axes = (link.pose.rotation * inertial.pose.rotation).to_rotation_matrix();
    axes * inertial.tensor_kg_m2 * axes.transpose()
}

/// The tensor of a link about `centre`: the theorem of parallel axes.
fn about(part: &(&Link, &Inertial), centre: &Point3<f64>) -> Matrix3<f64> {
    let offset = place(part) - centre;
    let steiner = Matrix3::from_diagonal_element(offset.norm_squared()) - offset * offset.transpose();
    turned(part.0, part.1) + steiner * part.1.mass_kg
}

/// True if a link has mass; false for a mere frame, whose mass and inertia are all 0.
fn has_mass(model: &Model, link: &Link, inertial: &Inertial) -> Result<bool, Diagnostic> {
    let fault = |error: ParameterError| Err(model.source.fault(inertial.at.clone(), error));
    let (mass, tensor) = (inertial.mass_kg, &inertial.tensor_kg_m2);
    if mass == 0.0 && tensor.amax() == 0.0 {
        return Ok(false);
    }
    let key = |what: &str| format!("{what} of link {}", plain(&link.name));
    if mass <= 0.0 || mass > bounds::MASS.max {
        let expected = format!("above 0 and at most {} kg", bounds::MASS.max);
        return fault(ParameterError::value(key("mass"), expected, format!("{mass} kg")));
    }
    let scale = tensor.amax().max(f64::MIN_POSITIVE);
    let moments = (tensor / scale).symmetric_eigenvalues() * scale;
    let found = format!("{:.4e}, {:.4e}, {:.4e} kg*m^2", moments[0], moments[1], moments[2]);
    if moments.min() <= 0.0 || tensor.amax() > bounds::INERTIA.max {
        let expected =
            format!("a tensor with principal moments above 0 and at most {:e}", bounds::INERTIA.max);
        return fault(ParameterError::value(key("inertia"), expected, found));
    }
    if !is_rigid(&(tensor + Matrix3::from_diagonal_element(TRIANGLE_SLACK * tensor.trace()))) {
        let expected = "a tensor of which no principal moment is larger than the sum of the other two";
        return fault(ParameterError::value(key("inertia"), expected, found));
    }
    Ok(true)
}
