//! Prints the positions of the joints of the motions in a file, as read, in the file's unit:
//! `cargo run -p corybant-core --example joint_positions -- MOTION.fbx`
//!
//! One line of JSON for each motion: its name, its frame rate, the names of its joints, and
//! `positions[frame][joint]` as `[x, y, z]`, Y up. `scripts/compare-fbx` compares them with
//! Blender's.
use std::error::Error;

use corybant_core::motion::import::read;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("usage: joint_positions MOTION.fbx")?;
    for source in read(&path, &std::fs::read(&path)?, &|_| None)? {
        let clip = source.clip;
        let joints = clip.skeleton.joints.iter();
        let names: Vec<&str> = joints.map(|joint| joint.name.as_str()).collect();
        let positions = clip.joint_positions();
        let frames: Vec<Vec<[f32; 3]>> = positions
            .chunks(names.len())
            .map(|frame| frame.iter().map(|at| at.to_array()).collect())
            .collect();
        let motion = serde_json::json!({
            "name": clip.name, "fps": clip.fps, "joints": names, "positions": frames,
        });
        println!("{motion}");
    }
    Ok(())
}
