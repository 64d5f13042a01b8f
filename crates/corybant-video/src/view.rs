//! Computes which parts of a picture show the floor, its shadows and the dancers, so that each
//! shader runs only where it is needed.
//!
//! In: the camera, and points of the stage.
//! Out: rows and rectangles of pixels.
//! Thread: any.
//! Allocates: nothing.

use glam::{Mat4, Vec2, Vec3};

use crate::Size;
use crate::camera::Shot;

/// Least distance in front of the camera at which the place of a point in the picture is computed, in metres.
const NEAREST: f32 = 0.2;
/// Towards the edges of a picture, the image of a ball is longer than it is wide. This is the
/// greatest factor, for a direction of 48° from the middle of the picture.
const STRETCH_MAX: f32 = 1.5;

/// Which parts of a picture show the floor, its shadows and the dancers, in pixels from the upper
/// left corner of the picture. A rectangle is its left, top, right and bottom edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct View {
    /// Number of the first pixel row that shows the floor, counted from 0 at the top.
    pub horizon: u32,
    /// The rectangle in which the floor can have shadows.
    pub near: [u32; 4],
    /// The rectangle that contains all dancers.
    pub dancers: [u32; 4],
}

/// The camera of one picture, and the size of the picture.
pub struct Frame {
    view: Mat4,
    /// Width and height of the picture, in pixels.
    size: Vec2,
    /// Height of an object of 1 m at a distance of 1 m, in half heights of the picture.
    zoom: f32,
}

impl Frame {
    /// Creates the frame of a picture of the size `size` that the camera `shot` takes.
    pub fn new(shot: &Shot, size: Size) -> Self {
        let view = shot.view(size.width as f32 / size.height as f32);
        Self {
            view,
            size: Vec2::new(size.width as f32, size.height as f32),
            zoom: view.row(1).truncate().length(),
        }
    }

    /// Returns the number of the first pixel row that shows the floor, counted from 0 at the top.
    pub fn horizon(&self, shot: &Shot) -> u32 {
        let ahead = shot.target - shot.eye;
        let level = shot.eye + Vec3::new(ahead.x, 0.0, ahead.z);
        let row = self.pixel(self.view.project_point3(level)).y;
        row.clamp(0.0, self.size.y) as u32
    }

    /// Returns the smallest rectangle of pixels (left, top, right and bottom edge) that contains
    /// the balls `balls`, each with its middle and its radius in metres. It is the whole picture if
    /// a ball is beside or behind the camera, and empty if there are no balls.
    pub fn bounds(&self, balls: impl IntoIterator<Item = (Vec3, f32)>) -> [u32; 4] {
        let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for (middle, radius) in balls {
            let clip = self.view * middle.extend(1.0);
            let near = clip.w - radius;
            if near < NEAREST {
                (low, high) = (Vec2::ZERO, self.size);
                break;
            }
            let at = self.pixel(clip.truncate() / clip.w);
            let half_heights = STRETCH_MAX * radius * self.zoom / near;
            let around = Vec2::splat(0.5 * self.size.y * half_heights);
            (low, high) = (low.min(at - around), high.max(at + around));
        }
        let within = |edge: Vec2| edge.clamp(Vec2::ZERO, self.size);
        let (low, high) = (within(low), within(high + 1.0));
        [low.x, low.y, high.x, high.y].map(|edge| edge as u32)
    }

    /// Returns the place in the picture, in pixels, of a point with the coordinates `at`, of which
    /// x and y are -1 to 1 within the picture.
    fn pixel(&self, at: Vec3) -> Vec2 {
        Vec2::new(0.5 + 0.5 * at.x, 0.5 - 0.5 * at.y) * self.size
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 320,
        height: 180,
    };

    fn frame() -> Frame {
        let shot = Shot {
            eye: Vec3::new(0.0, 1.0, 4.0),
            target: Vec3::new(0.0, 1.0, 0.0),
        };
        Frame::new(&shot, SIZE)
    }

    #[test]
    fn the_rectangle_contains_the_edge_of_a_ball() {
        let frame = frame();
        for middle in [Vec3::new(0.3, 1.2, 0.0), Vec3::new(-0.8, 0.4, 1.0)] {
            let [left, top, right, bottom] = frame.bounds([(middle, 0.3)]);
            for (x, y) in [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3)] {
                let [l, t, r, b] = frame.bounds([(middle + Vec3::new(x, y, 0.0), 0.0)]);
                assert!(left <= l && top <= t && right >= r && bottom >= b);
            }
            assert!(right - left < 120, "{left} to {right}");
        }
    }

    #[test]
    fn a_ball_behind_the_camera_needs_the_whole_picture_and_no_ball_needs_none() {
        let frame = frame();
        let behind = frame.bounds([(Vec3::ZERO, 0.1), (Vec3::new(0.0, 1.0, 5.0), 0.1)]);
        assert_eq!(behind, [0, 0, SIZE.width, SIZE.height]);
        let [left, top, right, bottom] = frame.bounds([]);
        assert!(left >= right || top >= bottom);
    }
}
