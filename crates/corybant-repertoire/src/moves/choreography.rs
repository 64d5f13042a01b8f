//! A choreography: keys (values at beats) for each part of the body during a move.
//!
//! In: keys that the moves set.
//! Out: the values of all channels at any beat, for `body`.
//! Thread: any.
//! Allocates: keys and curves.

use std::ops::Range;

use super::arm::Arm;
use super::curve::Curve;
use super::feet::Steps;
use super::poses::READY;

/// A channel of a move: one movement of the body, such as a nod of the head, which is defined by
/// keys (values at beats). Angles are in degrees and positions in metres; "left" is the dancer's
/// left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// Heading of the whole dancer, in degrees; positive turns left.
    Turn,
    /// Distribution of the weight: 1 on the left foot, -1 on the right foot, 0 on both.
    Weight,
    /// Offset of the hips to the left, in metres, from the position that the weight distribution
    /// gives.
    HipX,
    /// Offset of the hips to the front, in metres, from the position that the weight distribution
    /// gives.
    HipZ,
    /// Height of the hips relative to a relaxed stance, in metres; positive is higher.
    Rise,
    /// Rotation of the hips about the vertical axis, in degrees; positive turns left.
    HipYaw,
    /// Tilt of the hips, in degrees; positive is forward.
    HipPitch,
    /// Sideways tilt of the hips, in degrees; positive raises the left hip.
    HipRoll,
    /// Rotation of the waist (the two lower joints of the spine) about the vertical axis, in
    /// degrees; positive turns left.
    WaistYaw,
    /// Bend of the waist (the two lower joints of the spine), in degrees; positive is forward.
    WaistPitch,
    /// Sideways bend of the waist (the two lower joints of the spine), in degrees; positive is to
    /// the left.
    WaistRoll,
    /// Rotation of the upper chest about the vertical axis, in degrees; positive turns left.
    ChestYaw,
    /// Bend of the upper chest, in degrees; positive is forward.
    ChestPitch,
    /// Sideways bend of the upper chest, in degrees; positive is to the left.
    ChestRoll,
    /// Rotation of the head about the vertical axis, in degrees; positive turns left.
    HeadYaw,
    /// Nod of the head, in degrees; positive is forward.
    HeadPitch,
    /// Sideways tilt of the head, in degrees; positive is to the left.
    HeadRoll,
    /// Angle by which the left shoulder is raised, in degrees.
    ShrugLeft,
    /// Angle by which the right shoulder is raised, in degrees.
    ShrugRight,
    /// Angle by which the left shoulder is drawn forward, in degrees.
    ReachLeft,
    /// Angle by which the right shoulder is drawn forward, in degrees.
    ReachRight,
    /// Angle by which the left knee is turned outwards, in degrees; negative is inwards. At 0, the
    /// knee follows the foot and the hips.
    KneeLeft,
    /// Angle by which the right knee is turned outwards, in degrees; negative is inwards. At 0, the
    /// knee follows the foot and the hips.
    KneeRight,
    /// Rotation of the left foot about its ball, in degrees; positive turns left.
    FootLeft,
    /// Rotation of the right foot about its ball, in degrees; positive turns left.
    FootRight,
}

/// Number of channels in [`Part`]. A channel is one movement with its own keys (values at beats). A
/// list of all channels contains these first, then those of the left arm, then those of the right
/// arm.
const PARTS: usize = Part::FootRight as usize + 1;
/// Number of channels of one arm, one for each field of [`Arm`] in the same order. A channel is one
/// movement with its own keys (values at beats).
const ARM_CHANNELS: usize = 6;
/// Number of all channels of a move: those of [`Part`], of the left arm and of the right arm. A
/// channel is one movement with its own keys (values at beats).
const CHANNELS: usize = PARTS + 2 * ARM_CHANNELS;

/// Greatest factor by which the energy of a move enlarges the movements of the arms. With more, hands
/// would pass in front of the face.
const ARM_ENERGY_MAX: f32 = 1.15;

/// The left or right side of the body, for an arm or a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Left,
    Right,
}

/// Both sides of the body, left first.
pub(super) const BOTH: [Side; 2] = [Side::Left, Side::Right];

/// A move of the built-in repertoire: keys (values at beats) for each part of the body. `finish`
/// computes smooth curves through the keys.
#[derive(Clone, Debug)]
pub(super) struct Choreography {
    /// Length of the move in beats, after which it repeats.
    pub beats: f32,
    /// Number of frames in each beat of the exported BVH motion, which has 60 frames per second.
    pub frames_per_beat: u32,
    /// Sharpness of the movement, from 0 to 1. At 0 the body moves evenly from beat to beat; at 1
    /// it holds the pose of each beat and then changes quickly to the next pose.
    pub snap: f32,
    /// Delay, in beats, between successive joints from the hips up through the waist and the chest
    /// to the head.
    pub lag: f32,
    /// Delay of the lower arm after the upper arm, in beats. The hand follows the lower arm with
    /// 1.3 times this delay.
    pub arm_lag: f32,
    /// Degree to which the head stays level and faces forward while the chest moves: 0 is not at
    /// all, 1 is completely.
    pub level_head: f32,
    /// Degree to which shoulders, chest, head and hands give way to the movement of the arms and of
    /// the weight: 0 is not at all (a hard style), 1 is naturally.
    pub ease: f32,
    /// Size of the movement of trunk, head and arms: 1 is as the keys say. The angles and offsets
    /// are multiplied by it; those of the arms as differences from the pose [`READY`].
    pub energy: f32,
    /// Steps of the left foot and of the right foot, in this order.
    pub feet: [Steps; 2],
    keys: Vec<Vec<(f32, f32)>>,
    pulses: Vec<Vec<Curve>>,
    curves: Vec<Curve>,
}

impl Choreography {
    /// Creates a move of `beats` beats without keys, exported with `frames_per_beat` frames per
    /// beat. Both feet stand; `width` is the distance between the balls of the feet in metres.
    pub(super) fn new(beats: f32, frames_per_beat: u32, width: f32) -> Self {
        let feet = [
            Steps::standing(beats, width / 2.0, 0.0, 12.0),
            Steps::standing(beats, -width / 2.0, 0.0, -12.0),
        ];
        Self {
            beats,
            frames_per_beat,
            snap: 0.0,
            lag: 0.035,
            arm_lag: 0.04,
            level_head: 0.55,
            ease: 1.0,
            energy: 1.0,
            feet,
            keys: vec![Vec::new(); CHANNELS],
            pulses: vec![Vec::new(); CHANNELS],
            curves: Vec::new(),
        }
    }

    /// Adds `keys`, pairs of a beat and a value, to the channel `part`.
    pub(super) fn set(&mut self, part: Part, keys: &[(f32, f32)]) -> &mut Self {
        self.keys[part as usize].extend_from_slice(keys);
        self
    }

    /// Adds `keys` to the channel `part` repeatedly: once every `period` beats in the range
    /// `during` (in beats). Each key is a beat, counted from the start of its repetition, and a
    /// value. For variety, each repetition multiplies all its values by one factor, from 0.93 to
    /// 1.07.
    pub(super) fn cycle(
        &mut self,
        part: Part,
        during: Range<f32>,
        period: f32,
        keys: &[(f32, f32)],
    ) -> &mut Self {
        let mut start = during.start;
        while start < during.end - 1e-3 {
            let life = 1.0 + 0.07 * wobble(part as usize, start);
            let fitting = keys.iter().filter(|key| start + key.0 < during.end - 1e-3);
            self.keys[part as usize]
                .extend(fitting.map(|&(beat, value)| (start + beat, value * life)));
            start += period;
        }
        self
    }

    /// Adds a movement to the channel `part` that repeats every `period` beats during the whole
    /// move. `keys` are pairs of a beat and a value. At each beat, the value of this movement is
    /// added to the value of the channel's other keys.
    pub(super) fn pulse(&mut self, part: Part, period: f32, keys: &[(f32, f32)]) -> &mut Self {
        self.pulses[part as usize].push(Curve::through(period, keys));
        self
    }

    /// Adds `keys`, pairs of a beat and an arm pose, to the arm on `side`.
    pub(super) fn arm(&mut self, side: Side, keys: &[(f32, Arm)]) -> &mut Self {
        let first = PARTS + side as usize * ARM_CHANNELS;
        for &(beat, arm) in keys {
            for (channel, value) in arm.channels().into_iter().enumerate() {
                self.keys[first + channel].push((beat, value));
            }
        }
        self
    }

    /// Adds `poses` to the arm on `side`: the first pose at the beat `start`, and one pose on each
    /// following beat.
    pub(super) fn arm_beats(&mut self, side: Side, start: f32, poses: &[Arm]) -> &mut Self {
        for (i, &pose) in poses.iter().enumerate() {
            self.arm(side, &[(start + i as f32, pose)]);
        }
        self
    }

    /// Adds `keys`, pairs of a beat and an arm pose, to both arms.
    pub(super) fn arms(&mut self, keys: &[(f32, Arm)]) -> &mut Self {
        self.arm(Side::Left, keys).arm(Side::Right, keys)
    }

    /// Adds `keys` to the arm on `side` repeatedly: once every `period` beats in the range `during`
    /// (in beats). Each key is a beat, counted from the start of its repetition, and an arm pose.
    /// The angles `fwd` and `side` of each key are changed by up to 5 %, for variety.
    pub(super) fn arm_cycle(
        &mut self,
        side: Side,
        during: Range<f32>,
        period: f32,
        keys: &[(f32, Arm)],
    ) -> &mut Self {
        let mut start = during.start;
        while start < during.end - 1e-3 {
            for &(beat, arm) in keys.iter().filter(|key| start + key.0 < during.end - 1e-3) {
                let life = 1.0 + 0.05 * wobble(77 + side as usize, start + beat);
                self.arm(
                    side,
                    &[(
                        start + beat,
                        Arm {
                            fwd: arm.fwd * life,
                            side: arm.side * life,
                            ..arm
                        },
                    )],
                );
            }
            start += period;
        }
        self
    }

    /// Computes the curves through the keys of all channels, and returns the finished move. Call
    /// this function once, after the last key has been added.
    pub(super) fn finish(mut self) -> Self {
        self.feet.iter_mut().for_each(Steps::finish);
        self.curves = self
            .keys
            .iter()
            .map(|keys| Curve::through(self.beats, keys))
            .collect();
        self
    }

    /// Returns the value of the channel `part` at the beat position `beat`.
    pub(super) fn at(&self, part: Part, beat: f32) -> f32 {
        self.value(part as usize, beat)
    }

    /// Returns the pose of the arm on `side`. The angles of the upper arm, of the elbow and of the
    /// hand are evaluated at different beat positions: `upper`, `lower` and `hand`.
    pub(super) fn arm_at(&self, side: Side, upper: f32, lower: f32, hand: f32) -> Arm {
        let first = PARTS + side as usize * ARM_CHANNELS;
        Arm {
            fwd: self.value(first, upper),
            side: self.value(first + 1, upper),
            twist: self.value(first + 2, upper),
            elbow: self.value(first + 3, lower),
            roll: self.value(first + 4, hand),
            wrist: self.value(first + 5, hand),
        }
    }

    fn value(&self, channel: usize, beat: f32) -> f32 {
        let added: f32 = self.pulses[channel]
            .iter()
            .map(|pulse| pulse.at(beat))
            .sum();
        let value = self.curves[channel].at(self.snapped(beat)) + added;
        let rest = channel
            .checked_sub(PARTS)
            .map_or(0.0, |arm| READY.channels()[arm % ARM_CHANNELS]);
        let energy = match channel {
            0..PARTS => self.energy,
            _ => self.energy.min(ARM_ENERGY_MAX),
        };
        rest + energy * (value - rest)
    }

    /// Returns the position on the curves that gives the pose at `beat`. If `snap` is 0, this is
    /// `beat` itself. A greater `snap` holds the position back after each beat and lets it catch up
    /// before the next beat.
    fn snapped(&self, beat: f32) -> f32 {
        let (whole, part) = (beat.floor(), beat - beat.floor());
        let hurried = ((part - 0.42) / 0.58).max(0.0);
        whole + part + self.snap * (super::feet::smooth(hurried) - part)
    }
}

/// Returns a pseudo-random number in -1..1 that depends only on `channel` and `beat`. It varies the
/// repetitions of a movement.
fn wobble(channel: usize, beat: f32) -> f32 {
    let mixed = (channel as u32).wrapping_mul(0x9E37_79B9)
        ^ ((beat * 4.0) as i32 as u32).wrapping_mul(0x85EB_CA6B);
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x2C1B_3C6D);
    ((mixed >> 8) & 0xFFFF) as f32 / 32_767.5 - 1.0
}
