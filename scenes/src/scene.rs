//! The scene as physics and sensors see it: SI numbers only, immutable once read.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::body::FreeBody;
use crate::joint::Joint;
use crate::mesh::Mesh;
use crate::rig::Rig;
use crate::surface::Surface;
use nalgebra::Vector3;
use vehicles::EffectEntry;

/// Things around the vehicles, beside the ground at z = 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scene {
    /// Name of the scene.
    pub name: String,
    /// The boxes, in the file's order.
    pub boxes: Vec<Cuboid>,
    /// Things of other shapes, in the file's order.
    pub meshes: Vec<Mesh>,
    /// The balls, in the file's order.
    pub balls: Vec<Ball>,
    /// Joints that tie free bodies, in the file's order.
    pub joints: Vec<Joint>,
    /// Effects on every vehicle in the scene, such as wind; they act after those of its own file.
    pub effects: Vec<EffectEntry>,
    /// Rig that the vehicle hangs from, if there is one.
    pub rig: Option<Rig>,
    /// Surface of the ground, and of all things that have none of their own.
    pub surface: Surface,
}

impl Scene {
    /// Iterates over the things, by their numbers: boxes first, then meshes, then balls.
    pub fn things(&self) -> impl Iterator<Item = Thing<'_>> {
        let boxes = self.boxes.iter().map(Thing::Cuboid);
        boxes.chain(self.meshes.iter().map(Thing::Mesh)).chain(self.balls.iter().map(Thing::Ball))
    }

    /// Returns the name of the thing with this number; boxes are counted first, then meshes, then balls.
    ///
    /// ```
    /// let room = scenes::Scene::parse(scenes::reference::ROOM, "room.toml")?;
    /// assert_eq!((room.name_of(0), room.name_of(4)), (Some("wall +x"), None));
    /// # Ok::<(), diagnostics::Diagnostic>(())
    /// ```
    #[must_use]
    pub fn name_of(&self, number: usize) -> Option<&str> {
        self.things().nth(number).map(|thing| thing.name())
    }

    /// Returns the number of things in the scene, the ground left out.
    #[must_use]
    pub fn thing_count(&self) -> usize {
        self.boxes.len() + self.meshes.len() + self.balls.len()
    }

    /// The free bodies, with their numbers among all things.
    pub fn bodies(&self) -> impl Iterator<Item = (usize, &FreeBody)> {
        self.things().enumerate().filter_map(|(number, thing)| Some((number, thing.body()?)))
    }
}

/// A solid box.
#[derive(Debug, Clone, PartialEq)]
pub struct Cuboid {
    /// Its name in the file, such as `wall +x`.
    pub name: String,
    /// Its centre, in the world.
    pub centre_W_m: Vector3<f64>,
    /// Half of its lengths along its own axes.
    pub half_extents_m: Vector3<f64>,
    /// Angle of its x axis from that of the world, counter-clockwise from above.
    pub yaw_rad: f64,
    /// Friction and restitution of its surface.
    pub surface: Surface,
    /// Its mass and motion; nothing where it stands still.
    pub body: Option<FreeBody>,
}

/// A solid ball.
#[derive(Debug, Clone, PartialEq)]
pub struct Ball {
    /// Its name in the file.
    pub name: String,
    /// Its centre, in the world.
    pub centre_W_m: Vector3<f64>,
    /// Its radius.
    pub radius_m: f64,
    /// Friction and restitution of its surface.
    pub surface: Surface,
    /// Its mass and motion; nothing where it stands still.
    pub body: Option<FreeBody>,
}

/// A thing of the scene, with all that drawing and contacts need.
#[derive(Debug, Clone, Copy)]
pub enum Thing<'a> {
    /// A box.
    Cuboid(&'a Cuboid),
    /// Triangles.
    Mesh(&'a Mesh),
    /// A ball.
    Ball(&'a Ball),
}

impl<'a> Thing<'a> {
    /// Returns its name in the file.
    #[must_use]
    pub fn name(&self) -> &'a str {
        match self {
            Self::Cuboid(cuboid) => &cuboid.name,
            Self::Mesh(mesh) => &mesh.name,
            Self::Ball(ball) => &ball.name,
        }
    }

    /// Returns its mass and motion, if it moves.
    #[must_use]
    pub fn body(&self) -> Option<&'a FreeBody> {
        match self {
            Self::Cuboid(cuboid) => cuboid.body.as_ref(),
            Self::Mesh(mesh) => mesh.body.as_ref(),
            Self::Ball(ball) => ball.body.as_ref(),
        }
    }
}
