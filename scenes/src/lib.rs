//! Scene files: the things around the vehicles; and the distances that rays measure there.
//!
//! The ground is the plane z = 0 of the world, solid below. Boxes, meshes and balls stand still, turned about the vertical
//! only, or are free bodies that start so.
//!
//! | room | what it holds |
//! |---|---|
//! | [`scene`] | the immutable [`Scene`] that plants and range finders use |
//! | [`mesh`] | things of any shape: triangles |
//! | [`body`] | what makes a thing a free body: its mass, its inertia, how it starts |
//! | [`joint`] | what ties free bodies to the world, to each other and to the vehicle |
//! | [`drive`] | motors in joints |
//! | `tied` | what hangs from what, by joints |
//! | [`ray`] | the distance from a point along a direction to what is met first |
//! | [`surface`] | friction and restitution |
//! | [`rig`] | the test rigs that a vehicle hangs from |
//! | [`mod@reference`] | the scene files of this crate, as text |
//! | `file` | which keys a scene file has |
//! | `mesh_file`, `triangles`; `obj`, `stl`, `glb` | triangles of mesh files; of each format |
//!
//! ```
//! let scene = scenes::Scene::parse(scenes::reference::ROOM, "room.toml")?;
//! assert_eq!(scene.boxes.len(), 4);
//! # Ok::<(), diagnostics::Diagnostic>(())
//! ```
#![forbid(unsafe_code)]

pub mod body;
pub mod drive;
mod file;
mod glb;
pub mod joint;
pub mod mesh;
mod mesh_file;
mod obj;
pub mod ray;
pub mod reference;
pub mod rig;
pub mod scene;
mod stl;
pub mod surface;
mod tied;
mod triangles;

pub use body::{BodyPose, FreeBody};
pub use drive::{Drive, Mode, Target};
pub use file::{BODIES_MAX, FILE};
pub use joint::{Axis, End, Freedom, Joint};
pub use mesh::{Mesh, Solidity};
pub use ray::RayCaster;
pub use rig::Rig;
pub use scene::{Ball, Cuboid, Scene, Thing};
pub use surface::Surface;
