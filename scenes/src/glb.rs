//! Binary glTF: the triangles of a scene's nodes, each at its place.

use crate::triangles::Triangles;
use gltf::accessor::DataType;
use gltf::mesh::{Mode, Semantic};
use nalgebra::{Matrix4, Point3};

/// The triangles that `bytes` hold.
///
/// # Errors
/// In words: the fault of the bytes.
pub(crate) fn read(bytes: &[u8]) -> Result<Triangles, String> {
    check_head(bytes)?;
    let file = gltf::Gltf::from_slice(bytes).map_err(|error| error.to_string())?;
    let scene = file.default_scene().or_else(|| file.scenes().next()).ok_or("it holds no scene")?;
    let mut triangles = Triangles::default();
    let y_up_to_z_up = Matrix4::new(1., 0., 0., 0., 0., 0., -1., 0., 0., 1., 0., 0., 0., 0., 0., 1.);
    let mut nodes: Vec<_> = scene.nodes().map(|node| (node, y_up_to_z_up)).collect();
    let mut left = file.nodes().count();
    while let Some((node, above)) = nodes.pop() {
        left = left.checked_sub(1).ok_or("a node stands below itself, or below two others")?;
        let place = above * Matrix4::from(node.transform().matrix()).map(f64::from);
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            triangles.add_primitive(&primitive, &place, file.blob.as_deref())?;
        }
        nodes.extend(node.children().map(|child| (child, place)));
    }
    Ok(triangles)
}

/// Refuses a file that is shorter than its head states, and one of another format. A glTF in JSON begins with a brace.
fn check_head(bytes: &[u8]) -> Result<(), String> {
    if !bytes.starts_with(b"glTF") {
        let is_json = bytes.trim_ascii_start().starts_with(b"{");
        return if is_json {
            Ok(())
        } else {
            Err("it is no binary glTF, which begins with `glTF`".to_owned())
        };
    }
    let stated = bytes.get(8..12).and_then(|length| length.try_into().ok()).map_or(12, u32::from_le_bytes);
    if u64::from(stated) <= bytes.len() as u64 {
        return Ok(());
    }
    Err(format!("it is cut: its head states {stated} bytes, and it has {}", bytes.len()))
}

impl Triangles {
    fn add_primitive(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        place: &Matrix4<f64>,
        blob: Option<&[u8]>,
    ) -> Result<(), String> {
        if primitive.mode() != Mode::Triangles {
            return Err(format!("it holds {:?} where triangles are expected", primitive.mode()));
        }
        // The reader takes any corners for floats.
        let is_whole = |corners: gltf::Accessor<'_>| corners.data_type() != DataType::F32;
        if primitive.get(&Semantic::Positions).is_some_and(is_whole) {
            return Err(
                "its corners are whole numbers (KHR_mesh_quantization): export them as floats".to_owned()
            );
        }
        let reader = primitive.reader(|buffer| match buffer.source() {
            gltf::buffer::Source::Bin => blob,
            gltf::buffer::Source::Uri(_) => None,
        });
        let corners =
            reader.read_positions().ok_or("it keeps its corners in another file: export one .glb")?;
        let corners: Vec<[f64; 3]> = corners
            .map(|corner| place.transform_point(&Point3::from(corner.map(f64::from))).coords.into())
            .collect();
        let numbers: Vec<u32> = match reader.read_indices() {
            Some(numbers) => numbers.into_u32().collect(),
            None => (0..u32::try_from(corners.len()).unwrap_or(u32::MAX)).collect(),
        };
        let (faces, rest) = numbers.as_chunks::<3>();
        if !rest.is_empty() {
            return Err("a triangle has fewer than three corners".to_owned());
        }
        // A mirrored node turns its triangles the other way round (glTF 2.0 specification, section 3.7.4).
        let is_mirrored = place.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        let turned = |&[a, b, c]: &[u32; 3]| if is_mirrored { [a, c, b] } else { [a, b, c] };
        self.add(corners, &faces.iter().map(turned).collect::<Vec<_>>())
    }
}
