//! Homes and stages of dancers on their way to those of a scene. In: beats. Out: the place of each
//! dancer. Thread: show. Allocates: never after `new`.

use glam::Vec3;

use super::Scene;
use super::fade::Fade;

/// Greatest way of a home, and greatest change of the radius of a stage, in one beat, in metres. A
/// shorter fade takes longer.
const METRES_PER_BEAT_MAX: f32 = 0.25;

/// The home of a dancer, in metres (y is 0), and the radius of its stage in metres.
pub(super) type Place = (Vec3, f32);

/// The place of one dancer on its way.
#[derive(Clone, Copy, Debug)]
struct Way {
    fade: Fade,
    from: Place,
    to: Place,
}

/// The places of all dancers that are on their way.
pub(super) struct Places(Vec<Option<Way>>);

impl Places {
    /// Creates the places of `dancers` dancers, which stay where they are.
    pub(super) fn new(dancers: usize) -> Self {
        Self(vec![None; dancers])
    }

    /// Sends all dancers on their way to the homes and stages of `scene`. What the scene does not name
    /// goes on as before. `place(n)` returns the present place of the dancer with the index `n`.
    pub(super) fn begin(&mut self, scene: &Scene, place: impl Fn(usize) -> Place) {
        for (number, way) in self.0.iter_mut().enumerate() {
            let home = scene.home.get(number).copied().flatten();
            let stage = scene.stage_m.get(number).copied().flatten();
            if home.is_none() && stage.is_none() {
                continue;
            }
            let from = place(number);
            let end = way.map_or(from, |way| way.to);
            let to = (home.unwrap_or(end.0), stage.unwrap_or(end.1));
            let metres = from.0.distance(to.0).max((to.1 - from.1).abs());
            // In the middle of the way the speed is 1.5 times the mean.
            let beats = f64::from(1.5 * metres / METRES_PER_BEAT_MAX).max(scene.fade_beats);
            *way = Some(Way {
                fade: Fade::new(0.0, beats),
                from,
                to,
            });
        }
    }

    /// Moves all dancers that are on their way on by `beats` beats, and calls `set` with the index and
    /// the new place of each.
    pub(super) fn advance(&mut self, beats: f64, mut set: impl FnMut(usize, Place)) {
        for (number, place) in self.0.iter_mut().enumerate() {
            let Some(way) = place else { continue };
            way.fade.advance(beats);
            // The speed begins and ends at 0.
            let share = way.fade.value(1.0) as f32;
            let share = share * share * (3.0 - 2.0 * share);
            let radius = way.from.1 + (way.to.1 - way.from.1) * share;
            set(number, (way.from.0.lerp(way.to.0, share), radius));
            if way.fade.is_over() {
                *place = None;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dancer_reaches_its_place_in_the_beats_of_the_fade_or_later() {
        let scene = |home: f32, fade_beats| Scene {
            home: vec![None, Some(Vec3::X * home)],
            stage_m: vec![None, Some(1.0)],
            fade_beats,
            ..Scene::default()
        };
        for (home, fade, beats) in [(4.0, 2.0, 24), (1.0, 16.0, 16), (0.0, 0.0, 12)] {
            let mut places = Places::new(2);
            places.begin(&scene(home, fade), |_| (Vec3::ZERO, 3.0));
            let mut way = Vec::new();
            for _ in 0..30 {
                places.advance(1.0, |dancer, place| {
                    assert_eq!(dancer, 1);
                    way.push(place);
                });
            }
            assert_eq!(way.len(), beats, "{home} m in {fade} beats");
            assert_eq!(way.last(), Some(&(Vec3::X * home, 1.0)));
            let steps = way.windows(2).map(|pair| pair[1].0.distance(pair[0].0));
            assert!(steps.fold(0.0, f32::max) <= METRES_PER_BEAT_MAX);
        }
    }
}
