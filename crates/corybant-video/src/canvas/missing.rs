//! Replaces the canvas (the renderer) in a build without the Cargo feature `gpu`; it cannot be
//! opened.
//!
//! In: a size. Out: [`VideoError::NotBuilt`]. Thread: any.

use std::sync::Arc;

use crate::avatar::Avatar;
use crate::scene::Scene;
use crate::{Background, Size, VideoError};

/// The pixels of a picture: rows from the top, four bytes per pixel (red, green, blue, 255).
pub type Pixels = Arc<Vec<u8>>;

/// The renderer of a build without GPU support. It cannot be created.
pub enum Canvas {}

/// Returns an error, because this build has no GPU support.
///
/// # Errors
/// Always [`VideoError::NotBuilt`].
pub fn adapter() -> Result<String, VideoError> {
    Err(VideoError::NotBuilt)
}

impl Canvas {
    /// Returns an error, because this build has no GPU support.
    ///
    /// # Errors
    /// Always [`VideoError::NotBuilt`].
    pub fn open(_: Size, _: Background) -> Result<Self, VideoError> {
        Err(VideoError::NotBuilt)
    }

    /// Returns the name of the renderer. This function is never called, because no `Canvas` can
    /// exist.
    pub fn name(&self) -> &str {
        match *self {}
    }

    /// Copies avatars to the GPU. This function is never called, because no `Canvas` can exist.
    ///
    /// # Errors
    /// None, because no `Canvas` can exist.
    pub fn dress(&mut self, _: &[Arc<Avatar>]) -> Result<(), VideoError> {
        match *self {}
    }

    /// Returns true if no further picture can be started. This function is never called, because no
    /// `Canvas` can exist.
    pub fn is_full(&self) -> bool {
        match *self {}
    }

    /// Begins to render a picture. This function is never called, because no `Canvas` can exist.
    ///
    /// # Errors
    /// None, because no `Canvas` can exist.
    pub fn begin(&mut self, _: &Scene, _: f32) -> Result<(), VideoError> {
        match *self {}
    }

    /// Returns the pixels of the oldest picture that is being rendered. This function is never
    /// called, because no `Canvas` can exist.
    ///
    /// # Errors
    /// None, because no `Canvas` can exist.
    pub fn finish(&mut self) -> Result<Option<Pixels>, VideoError> {
        match *self {}
    }
}
