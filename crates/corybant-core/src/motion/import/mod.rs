//! Reads motion files of all supported formats.
//!
//! In: bytes, and access to the files in the same folder.
//! Out: the clips of the file, not cleaned, and warnings.
//! Thread: any.
//! Allocates: freely; limited by the limits of each format.
//!
//! The first bytes decide the format. The file's name is used in messages and, without folder and
//! extension, as the clip's name.

pub mod beats;
pub mod bvh;
pub mod clean;
pub mod cut;
pub mod fbx;
pub mod gltf;
pub mod pipeline;
mod plant;
pub mod retarget;
pub mod vmd;

use thiserror::Error;

use self::bvh::BvhError;
use self::fbx::FbxError;
use self::gltf::GltfError;
use self::vmd::VmdError;
use super::Clip;
use glam::Quat;

/// The file name extensions of motion files, in lower case.
pub const ENDINGS: [&str; 7] = ["bvh", "glb", "gltf", "vrma", "vrm", "fbx", "vmd"];

/// One motion that was read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// The motion in the units of the file, not cleaned, and without a label.
    pub clip: Clip,
    /// Unusual properties of the file that did not prevent reading, one sentence each.
    pub warnings: Vec<String>,
    /// Number of the first `warnings` that are about the whole file instead of this motion.
    pub about_file: usize,
    /// The axes of the nodes in the rest pose; `None` for formats without such axes.
    pub axes: Option<NodeAxes>,
}

/// The rest pose of a clip as the file describes it. A joint of a clip has no rotation in the rest
/// pose, but the node of the file that moves it has one.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeAxes {
    /// `[joint]`: rotation of the joint's node in model space in the rest pose.
    pub turns: Vec<Quat>,
    /// True if the rest pose is that of a skin or of a VRM file. False if it is the pose in which the
    /// nodes were written, which may be any pose of the motion.
    pub is_bind_pose: bool,
}

/// A function that returns the bytes of another file in the same folder, or `None` if the file
/// cannot be read. Its argument is a relative path with `/` between its parts; it never contains
/// `..`.
pub type Siblings<'a> = &'a dyn Fn(&str) -> Option<Vec<u8>>;

/// The reasons why a motion file cannot be read; every message starts with the name of the file.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ReadError {
    /// A BVH file is faulty, or the file has an unknown format.
    #[error(transparent)]
    Bvh(#[from] BvhError),
    /// A glTF file is faulty, or it contains no animation that moves a skeleton.
    #[error(transparent)]
    Gltf(#[from] Box<GltfError>),
    /// An FBX file cannot be parsed, or it is too large.
    #[error(transparent)]
    Fbx(#[from] FbxError),
    /// A VMD file is faulty, or it does not move a body.
    #[error(transparent)]
    Vmd(#[from] VmdError),
}

/// Returns the extension of the file name `name` in lower case, or `None` if it is not the
/// extension of a motion file.
fn ending(name: &str) -> Option<&'static str> {
    let (_, ending) = name.rsplit_once('.')?;
    ENDINGS
        .into_iter()
        .find(|known| ending.eq_ignore_ascii_case(known))
}

/// Returns true if the file name `name` has the extension of a motion file.
pub fn is_motion(name: &str) -> bool {
    ending(name).is_some()
}

/// Returns the clip name for the file `name`: the file's name without folders and without the
/// extension of a motion file.
pub fn stem(name: &str) -> &str {
    let base = name.rsplit(['/', '\\']).next().unwrap_or(name);
    ending(base)
        .and_then(|ending| base.get(..base.len() - ending.len() - 1))
        .unwrap_or(base)
}

/// Reads a motion file of any supported format from its `bytes`. `name` is the name of the file;
/// `siblings` returns other files of the same folder. Returns at least one motion.
///
/// # Errors
/// [`ReadError`] with the place in the file and the cause.
pub fn read(name: &str, bytes: &[u8], siblings: Siblings) -> Result<Vec<Source>, ReadError> {
    if fbx::is_fbx(bytes) {
        return fbx::parse(name, bytes);
    }
    if vmd::is_vmd(bytes) {
        return Ok(vec![vmd::parse(name, bytes)?]);
    }
    if gltf::is_gltf(bytes) {
        return Ok(gltf::parse(name, bytes, siblings).map_err(Box::new)?);
    }
    // A file with the extension of another format goes to the reader of this format, because its
    // error message is more helpful than that of the BVH reader.
    if !bytes.starts_with(b"HIERARCHY") {
        match ending(name) {
            Some("glb" | "gltf" | "vrma" | "vrm") => {
                return Ok(gltf::parse(name, bytes, siblings).map_err(Box::new)?);
            }
            Some("fbx") => return fbx::parse(name, bytes),
            Some("vmd") => return Ok(vec![vmd::parse(name, bytes)?]),
            _ => {}
        }
    }
    let parsed = bvh::parse(name, bytes)?;
    Ok(vec![Source {
        clip: parsed.clip,
        warnings: parsed.warnings,
        about_file: 0,
        axes: None,
    }])
}
