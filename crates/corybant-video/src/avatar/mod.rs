//! VRM avatars (0.x and 1.0) in a video.
//!
//! In: the bytes of a VRM file; then the joints of a dancer in each picture.
//! Out: skinned triangles with their materials.
//! Thread: any except show and audio.
//! Allocates: in proportion to the file; per picture into buffers that are reused.
//! Source: glTF 2.0 (Khronos, 2021); VRM 0.x, VRMC_vrm-1.0 and VRMC_materials_mtoon-1.0 (VRM Consortium).
//!
//! The avatar gets poses as receivers of the Virtual Motion Capture protocol do: its bones get the rotations of
//! the dancer's bones relative to the T-pose, and its hips move with the dancer's, scaled by the
//! length of the legs. Vertices are skinned on the CPU, so that every graphics driver can draw them.

mod geometry;
mod material;
mod rig;

use std::sync::Arc;

use corybant_core::motion::import::gltf::{AvatarBone, GltfError, avatar};
use glam::{Affine3A, Mat4, Quat, Vec3};
use serde_json::Value;
use thiserror::Error;

pub use geometry::Part;
pub use material::{Material, Picture, Transparency};
pub use rig::Rig;

/// Number of floats of a vertex that change with the pose: position and normal.
pub const FLOATS_PER_VERTEX: usize = 6;
/// Largest VRM file that is read, in MiB.
pub const AVATAR_MIB_MAX: u64 = 200;
/// Largest number of vertices of an avatar.
pub const VERTICES_MAX: usize = 2_000_000;

/// The reasons why an avatar cannot be drawn.
#[derive(Debug, Error)]
pub enum AvatarError {
    /// The file is damaged, or it is no VRM file.
    #[error(transparent)]
    Gltf(#[from] GltfError),
    /// The file is not binary glTF.
    #[error("{name} is no binary glTF: export the avatar as one .vrm file (0.x or 1.0)")]
    NotBinary {
        /// Name of the file.
        name: String,
    },
    /// A part of the file cannot be read.
    #[error("{name}: {what}: {reason}")]
    Part {
        /// Name of the file.
        name: String,
        /// The part, such as `meshes[1].primitives[0]`.
        what: String,
        /// What is wrong, with the remedy.
        reason: String,
    },
}

/// An avatar as its file contains it.
pub struct Avatar {
    /// The nodes of the scene, parents before children.
    nodes: Vec<Node>,
    bones: Vec<AvatarBone>,
    /// What moves the vertices: pairs of an index in `nodes` and the transform from the mesh to that node in the
    /// rest pose.
    palette: Vec<(usize, Affine3A)>,
    /// The triangles, one part for each material.
    pub parts: Vec<Part>,
    /// The materials.
    pub materials: Vec<Material>,
    /// The pictures of the materials.
    pub pictures: Vec<Picture>,
}

/// The avatar of a dancer, and the dancer's home.
#[derive(Clone)]
pub struct Costume {
    /// The avatar.
    pub avatar: Arc<Avatar>,
    /// Home of the dancer on the stage: x and z, in metres.
    pub home: [f32; 2],
}

/// A node of the avatar's scene.
struct Node {
    /// Index of the node in the file.
    index: usize,
    /// Index of the parent in the list of nodes.
    parent: Option<usize>,
    local: Affine3A,
    /// The transform from the node to the scene in the rest pose. The avatar faces +Z.
    rest: Affine3A,
}

impl Avatar {
    /// Reads the VRM file with the content `bytes`; `name` is its name.
    ///
    /// # Errors
    /// [`AvatarError`] if the file is damaged, is no avatar, or needs an unknown extension of glTF.
    pub fn read(name: &str, bytes: &[u8]) -> Result<Self, AvatarError> {
        let part = |what: &str, reason: String| AvatarError::Part {
            name: name.into(),
            what: what.into(),
            reason,
        };
        if !bytes.starts_with(b"glTF") {
            return Err(AvatarError::NotBinary { name: name.into() });
        }
        let bones = avatar(name, bytes)?;
        let raw = gltf::Glb::from_slice(bytes).map_err(|error| part("file", error.to_string()))?;
        let json: Value =
            serde_json::from_slice(&raw.json).map_err(|error| part("JSON", error.to_string()))?;
        let file =
            gltf::Gltf::from_slice(bytes).map_err(|error| part("file", error.to_string()))?;
        let blob = raw.bin.as_deref().unwrap_or_default();
        let is_old = json["extensions"]["VRMC_vrm"].is_null();
        let nodes = nodes(&file, is_old).map_err(|reason| part("nodes", reason))?;
        let pictures = material::pictures(&file, &json, blob)
            .map_err(|(index, reason)| part(&format!("images[{index}]"), reason))?;
        let materials = material::materials(&file, &json);
        let geometry =
            geometry::read(&file, blob, &nodes).map_err(|(what, reason)| part(&what, reason))?;
        Ok(Self {
            nodes,
            bones,
            palette: geometry.palette,
            parts: geometry.parts,
            materials,
            pictures,
        })
    }

    /// Returns the number of vertices of all parts.
    pub fn vertices(&self) -> usize {
        self.parts.iter().map(|part| part.vertices.len()).sum()
    }
}

/// Returns the nodes of the scene of `file`, parents before children. `is_old` is true for VRM 0.x, whose
/// avatars face -Z.
fn nodes(file: &gltf::Gltf, is_old: bool) -> Result<Vec<Node>, String> {
    let scene = file
        .default_scene()
        .or_else(|| file.scenes().next())
        .ok_or("there is no scene")?;
    let turn = if is_old {
        Quat::from_rotation_y(std::f32::consts::PI)
    } else {
        Quat::IDENTITY
    };
    let mut nodes: Vec<Node> = Vec::new();
    let mut is_known = vec![false; file.nodes().len()];
    let mut waiting: Vec<(gltf::Node, Option<usize>)> =
        scene.nodes().map(|node| (node, None)).collect();
    while let Some((node, parent)) = waiting.pop() {
        if std::mem::replace(&mut is_known[node.index()], true) {
            return Err(format!("node {} has two parents", node.index()));
        }
        let local = Affine3A::from_mat4(Mat4::from_cols_array_2d(&node.transform().matrix()));
        let above = parent.map_or(
            Affine3A::from_rotation_translation(turn, Vec3::ZERO),
            |parent| nodes[parent].rest,
        );
        let rest = above * local;
        if !rest.is_finite() {
            return Err(format!("node {} has no finite transform", node.index()));
        }
        waiting.extend(node.children().map(|child| (child, Some(nodes.len()))));
        nodes.push(Node {
            index: node.index(),
            parent,
            local: if parent.is_none() { rest } else { local },
            rest,
        });
    }
    Ok(nodes)
}
