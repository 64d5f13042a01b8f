//! Computes the mesh of a capsule (a cylinder with round ends), with which the shader draws all
//! limbs. Each vertex has a direction and the number of the end to which it belongs.
//!
//! In: nothing.
//! Out: numbers for the vertex shader.
//! Thread: any.
//! Allocates: freely.

use std::f32::consts::{FRAC_PI_2, TAU};

/// Number of vertices in each circle of vertices around the axis of the capsule.
const AROUND: u16 = 16;
/// Number of rows of triangles in each round end of the capsule, from its edge to its tip.
const UP: u16 = 3;

/// Returns the vertices of a capsule, four floats for each: the direction from the centre of its
/// hemispherical end as a unit vector, and the number of that end, 0 or 1.
pub fn vertices() -> Vec<f32> {
    let mut numbers = Vec::new();
    for row in 0..2 * (UP + 1) {
        let end = row / (UP + 1);
        let step = if end == 0 {
            f32::from(row) - f32::from(UP)
        } else {
            f32::from(row - UP - 1)
        };
        let (height, out) = (FRAC_PI_2 * step / f32::from(UP)).sin_cos();
        for n in 0..AROUND {
            let (side, front) = (TAU * f32::from(n) / f32::from(AROUND)).sin_cos();
            numbers.extend([out * side, height, out * front, f32::from(end)]);
        }
    }
    numbers
}

/// Returns the triangles of the capsule: for each, the indices of its three vertices,
/// counter-clockwise as seen from outside.
pub fn triangles() -> Vec<u16> {
    let mut found = Vec::new();
    for row in 0..2 * UP + 1 {
        for n in 0..AROUND {
            let (low, high) = (row * AROUND, (row + 1) * AROUND);
            let next = (n + 1) % AROUND;
            found.extend([
                low + n,
                low + next,
                high + next,
                low + n,
                high + next,
                high + n,
            ]);
        }
    }
    found
}
