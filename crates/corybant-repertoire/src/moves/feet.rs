//! Positions of the feet: standing, or moving from one place to the next.
//!
//! In: steps, in beats.
//! Out: position, heading and pitch of a foot at any beat.
//! Thread: any.
//! Allocates: when steps are added.
//!
//! A foot is controlled by its ball (the joint of the toes). While the foot stands, the ball stays
//! in place; the heel may rise and the foot may pivot.

use glam::Vec3;

use super::curve::Curve;

/// Position and orientation of one foot at one time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foothold {
    /// Position of the ball of the foot in stage space, in metres. The height `ball.y` is 0 while
    /// the foot stands.
    pub ball: Vec3,
    /// Heading of the foot in degrees; 0 faces +Z, positive values turn left.
    pub yaw: f32,
    /// Pitch of the foot in degrees: positive raises the heel, negative raises the toes.
    pub pitch: f32,
}

/// The steps and pivots of one foot during a move.
#[derive(Clone, Debug)]
pub(super) struct Steps {
    length: f32,
    home: Vec3,
    home_yaw: f32,
    swings: Vec<Swing>,
    pitch_keys: Vec<(f32, f32)>,
    pitch: Curve,
}

#[derive(Clone, Copy, Debug)]
struct Swing {
    start: f32,
    end: f32,
    to: Vec3,
    yaw: f32,
    lift: f32,
    /// Greatest sideways distance of the foot's path from the straight line of the step, in metres.
    /// Positive is to the left, seen in the direction of the step.
    bow: f32,
    /// Largest pitch of the foot during the step (how far the heel is raised), in degrees; 0 for a
    /// pivot and for a slide.
    peak: f32,
}

/// Height to which the foot rises above the floor in a normal step, in metres.
const LIFT: f32 = 0.075;
/// Pitch of a foot that is held in the air after a step, in degrees: its heel is higher than its
/// toes.
const HANGING: f32 = 35.0;
/// Longest pause between two steps of one foot, in beats, in which the heel stays up.
const QUICK: f32 = 0.3;

impl Steps {
    /// Creates the steps of a foot that stands still during a move of `length` beats. The ball of
    /// the foot is at `x`, `z` (metres); `yaw` is its heading in degrees.
    pub(super) fn standing(length: f32, x: f32, z: f32, yaw: f32) -> Self {
        let home = Vec3::new(x, 0.0, z);
        Self {
            length,
            home,
            home_yaw: yaw,
            swings: Vec::new(),
            pitch_keys: Vec::new(),
            pitch: Curve::default(),
        }
    }

    /// Adds a step that lasts from the beat `beats.0` to the beat `beats.1`. The ball of the foot
    /// lands at `x`, `z` (metres) with the heading `yaw` (degrees).
    pub(super) fn step(&mut self, beats: (f32, f32), x: f32, z: f32, yaw: f32) -> &mut Self {
        self.arc(beats, LIFT, Vec3::new(x, 0.0, z), yaw)
    }

    /// Adds a step that lasts from the beat `beats.0` to the beat `beats.1`. The ball of the foot
    /// moves to `to` (metres) in an arc that rises up to `lift` metres; `yaw` is the foot's heading
    /// at the end, in degrees. If `to.y > 0`, the foot stays in the air.
    pub(super) fn arc(&mut self, beats: (f32, f32), lift: f32, to: Vec3, yaw: f32) -> &mut Self {
        let (start, end) = beats;
        let travel = (to - self.last().0).length();
        let peak = (60.0 * travel + 80.0 * lift).clamp(6.0, 30.0);
        self.swings.push(Swing {
            start,
            end,
            to,
            yaw,
            lift,
            bow: 0.0,
            peak,
        });
        self
    }

    /// Adds a slide from the beat `beats.0` to the beat `beats.1`: the foot stays flat and low. The ball
    /// of the foot ends at `to` (metres) with the heading `yaw` (degrees).
    pub(super) fn slide(&mut self, beats: (f32, f32), to: Vec3, yaw: f32) -> &mut Self {
        self.arc(beats, 0.03, to, yaw);
        if let Some(swing) = self.swings.last_mut() {
            swing.peak = 0.0;
        }
        self
    }

    /// Bends the path of the last added step sideways by `metres`, for example around the other
    /// foot. Positive is to the left, seen in the direction of the step.
    pub(super) fn bow(&mut self, metres: f32) -> &mut Self {
        if let Some(swing) = self.swings.last_mut() {
            swing.bow = metres;
        }
        self
    }

    /// Adds a hop that lasts from the beat `beats.0` to the beat `beats.1` and rises `lift` metres.
    /// The ball of the foot lands at `x`, `z` (metres). The other foot must hop at the same time.
    pub(super) fn hop(&mut self, beats: (f32, f32), lift: f32, x: f32, z: f32) -> &mut Self {
        let yaw = self.last().1;
        self.arc(beats, lift, Vec3::new(x, 0.0, z), yaw)
    }

    /// Adds a pivot on the ball of the foot from the beat `beats.0` to the beat `beats.1`. `yaw` is
    /// the heading of the foot at the end of the pivot, in degrees. The foot does not leave the
    /// floor.
    pub(super) fn pivot(&mut self, beats: (f32, f32), yaw: f32) -> &mut Self {
        let to = self.last().0;
        self.swings.push(Swing {
            start: beats.0,
            end: beats.1,
            to,
            yaw,
            lift: 0.0,
            bow: 0.0,
            peak: 0.0,
        });
        self
    }

    /// Adds a key for the pitch of the foot at the beat `beat`. Positive `degrees` raise the heel,
    /// negative ones raise the toes.
    pub(super) fn pitch(&mut self, beat: f32, degrees: f32) -> &mut Self {
        self.pitch_keys.push((beat, degrees));
        self
    }

    /// Computes the curve of the foot's pitch. Call this function once, after the last step has
    /// been added.
    pub(super) fn finish(&mut self) {
        let mut keys = self.rolling();
        keys.extend_from_slice(&self.pitch_keys);
        self.pitch = Curve::through(self.length, &keys);
    }

    /// Returns keys (beat and degrees) for the natural pitch of the foot: the heel leaves the floor
    /// first and comes down last. Between two steps in quick succession the heel stays raised.
    fn rolling(&self) -> Vec<(f32, f32)> {
        let mut keys = Vec::new();
        let swings: Vec<&Swing> = self
            .swings
            .iter()
            .filter(|swing| swing.peak > 0.0)
            .collect();
        for (i, swing) in swings.iter().enumerate() {
            let before = swings[(i + swings.len() - 1) % swings.len()];
            let after = swings[(i + 1) % swings.len()];
            let (rested, rests) = (
                self.gap(before.end, swing.start) > QUICK,
                self.gap(swing.end, after.start) > QUICK,
            );
            if rested {
                keys.push((
                    swing.start - 0.15,
                    if before.to.y > 0.0 { HANGING } else { 0.0 },
                ));
            }
            keys.push((swing.start + 0.3 * (swing.end - swing.start), swing.peak));
            match (swing.to.y > 0.0, rests) {
                (true, _) => keys.push((swing.end, HANGING)),
                (false, true) => keys.extend([(swing.end - 0.04, 9.0), (swing.end + 0.12, 0.0)]),
                (false, false) => keys.push((swing.end, 14.0)),
            }
        }
        keys
    }

    /// Returns the number of beats from `end`, the end of a step, to `start`, the start of the next
    /// step. The next step may be in the next repetition of the move.
    fn gap(&self, end: f32, start: f32) -> f32 {
        (start - end).rem_euclid(self.length)
    }

    /// Returns the position and orientation of the foot at the beat position `beat`.
    pub(super) fn at(&self, beat: f32) -> Foothold {
        let beat = beat.rem_euclid(self.length);
        let pitch = self.pitch.at(beat);
        let done = self.swings.partition_point(|swing| swing.start <= beat);
        let Some(swing) = done.checked_sub(1).map(|i| self.swings[i]) else {
            return Foothold {
                ball: self.home,
                yaw: self.home_yaw,
                pitch,
            };
        };
        let (from, from_yaw) = done.checked_sub(2).map_or((self.home, self.home_yaw), |i| {
            (self.swings[i].to, self.swings[i].yaw)
        });
        let u = ((beat - swing.start) / (swing.end - swing.start)).min(1.0);
        let ball = swing.ball(from, u);
        Foothold {
            ball,
            yaw: from_yaw + (swing.yaw - from_yaw) * smooth(u),
            pitch,
        }
    }

    fn last(&self) -> (Vec3, f32) {
        self.swings
            .last()
            .map_or((self.home, self.home_yaw), |swing| (swing.to, swing.yaw))
    }
}

impl Swing {
    /// Returns the position of the ball of the foot during this step, in metres. The step starts at
    /// the position `from`, and the fraction `u` (0..1) of the step is done. The foot first rises
    /// from the floor, then moves across, then comes down.
    fn ball(&self, from: Vec3, u: f32) -> Vec3 {
        let leave = if from.y > 0.0 { 0.0 } else { 0.14 };
        let land = if self.to.y > 0.0 { 1.0 } else { 0.86 };
        let across = smooth(((u - leave) / (land - leave)).clamp(0.0, 1.0));
        let way = self.to - from;
        let left = Vec3::new(way.z, 0.0, -way.x).normalize_or_zero();
        let mut ball = from + way * across + left * self.bow * 4.0 * across * (1.0 - across);
        let rise = match (from.y > 0.0, self.to.y > 0.0) {
            (false, true) => 0.5 * (1.0 - (1.0 - u) * (1.0 - u) + smooth(u)),
            (true, false) => 0.5 * (u * u + smooth(u)),
            _ => smooth(u),
        };
        // The mean of a parabola, which starts with a jerk, and of its square, which is too low
        // when the foot starts to move.
        let parabola = 4.0 * u * (1.0 - u);
        let hump = parabola * parabola.sqrt();
        ball.y = from.y + (self.to.y - from.y) * rise + self.lift * hump;
        ball
    }
}

/// Returns the smoothstep function of `u` (0..1): a curve from 0 to 1 with zero slope at both ends.
pub(super) fn smooth(u: f32) -> f32 {
    u * u * (3.0 - 2.0 * u)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planted_foot_stays_and_a_step_lands_at_its_target() {
        let mut steps = Steps::standing(8.0, 0.1, 0.0, 10.0);
        steps
            .step((1.5, 2.0), 0.4, 0.1, 0.0)
            .step((5.0, 5.5), 0.1, 0.0, 10.0);
        steps.finish();
        assert!(steps.at(1.4).ball.distance(Vec3::new(0.1, 0.0, 0.0)) < 1e-6);
        assert!(steps.at(1.75).ball.y > 0.07);
        assert!(steps.at(3.0).ball.distance(Vec3::new(0.4, 0.0, 0.1)) < 1e-6);
        assert!(steps.at(7.9).ball.distance(steps.at(0.0).ball) < 1e-6);
        assert_eq!(steps.at(3.0).pitch, 0.0);
    }

    #[test]
    fn a_step_is_off_the_floor_before_it_moves_across() {
        let mut steps = Steps::standing(4.0, 0.0, 0.0, 0.0);
        steps.step((1.0, 1.5), 0.3, 0.0, 0.0);
        steps.finish();
        for i in 0..100 {
            let ball = steps.at(1.0 + i as f32 / 200.0).ball;
            let moved = ball.x.min(0.3 - ball.x);
            assert!(ball.y > 0.01 || moved < 0.005, "{ball}");
        }
    }
}
