//! The scene as physics and sensors see it: SI numbers only, immutable once read.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use crate::body::FreeBody;
use crate::joint::Joint;
use crate::mesh::Mesh;
use crate::rig::Rig;
use crate::surface::Surface;
use nalgebra::Vector3;
use vehicles::EffectEntry;

/// What stands around the vehicles, beside the ground at z = 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scene {
    /// What the scene is called.
    pub name: String,
    /// The boxes, in the file's order.
    pub boxes: Vec<Cuboid>,
    /// Things of other shapes, in the file's order.
    pub meshes: Vec<Mesh>,
    /// The balls, in the file's order.
    pub balls: Vec<Ball>,
    /// What ties free bodies, in the file's order.
    pub joints: Vec<Joint>,
    /// Effects on every vehicle in the scene, such as wind; they act after those of its own file.
    pub effects: Vec<EffectEntry>,
    /// What the vehicle hangs from, if anything.
    pub rig: Option<Rig>,
    /// How the ground, and all that has no surface of its own, answers to what touches it.
    pub surface: Surface,
}

impl Scene {
    /// All things, by their numbers: boxes first, then meshes, then balls.
    pub fn things(&self) -> impl Iterator<Item = Thing<'_>> {
        let boxes = self.boxes.iter().map(Thing::Cuboid);
        boxes.chain(self.meshes.iter().map(Thing::Mesh)).chain(self.balls.iter().map(Thing::Ball))
    }

    /// What the thing with this number is called; boxes are counted first, then meshes, then balls.
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

    /// How many things stand in the scene, the ground left out.
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
    /// What the file calls it, such as `wall +x`.
    pub name: String,
    /// Its centre, in the world.
    pub centre_W_m: Vector3<f64>,
    /// Half of its lengths along its own axes.
    pub half_extents_m: Vector3<f64>,
    /// How far its x axis is turned from that of the world, counter-clockwise from above.
    pub yaw_rad: f64,
    /// How it answers to what touches it.
    pub surface: Surface,
    /// How it moves; nothing where it stands still.
    pub body: Option<FreeBody>,
}

/// A solid ball.
#[derive(Debug, Clone, PartialEq)]
pub struct Ball {
    /// What the file calls it.
    pub name: String,
    /// Its centre, in the world.
    pub centre_W_m: Vector3<f64>,
    /// Its radius.
    pub radius_m: f64,
    /// How it answers to what touches it.
    pub surface: Surface,
    /// How it moves; nothing where it stands still.
    pub body: Option<FreeBody>,
}

/// What a thing needs to be drawn and met where it is.
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
    /// What the file calls it.
    #[must_use]
    pub fn name(&self) -> &'a str {
        match self {
            Self::Cuboid(cuboid) => &cuboid.name,
            Self::Mesh(mesh) => &mesh.name,
            Self::Ball(ball) => &ball.name,
        }
    }

    /// How it moves, if it does.
    #[must_use]
    pub fn body(&self) -> Option<&'a FreeBody> {
        match self {
            Self::Cuboid(cuboid) => cuboid.body.as_ref(),
            Self::Mesh(mesh) => mesh.body.as_ref(),
            Self::Ball(ball) => ball.body.as_ref(),
        }
    }
}
