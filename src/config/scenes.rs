//! Checks of the sections `[[scene]]` of a show file. In: settings. Out: problems. Pure.

use super::Config;
use corybant_core::cue::scene;
use corybant_core::dance::{HOME_MAX, STAGE_RANGE};

impl Config {
    /// Adds a sentence to `problems` for every value of `[[scene]]` that is not allowed.
    pub(super) fn check_scenes(&self, problems: &mut Vec<String>) {
        scene::check(&self.scene, &self.dancer_names(), problems);
        let sources = self.tempo.sources();
        for (i, scene) in self.scene.iter().enumerate() {
            let key = format!("scene {}", i + 1);
            let homes = scene.home.iter();
            for (name, home) in homes.filter(|(_, it)| !it.iter().all(|m| m.abs() <= HOME_MAX)) {
                problems.push(format!(
                    "{key}.home.{name} is {home:?}: two numbers of metres from -{HOME_MAX} to {HOME_MAX} are allowed"
                ));
            }
            let (least, most) = STAGE_RANGE;
            let stages = scene.stage_m.iter();
            for (name, radius) in stages.filter(|(_, it)| !(least..=most).contains(*it)) {
                problems.push(format!(
                    "{key}.stage_m.{name} is {radius}: {least} to {most} metres are allowed"
                ));
            }
            if let Some(source) = scene.tempo_source.filter(|&it| !sources.has(it)) {
                problems.push(format!(
                    "scene {}.tempo_source is \"{}\", which the show does not open: set it up in [tempo], such as link = \"follow\" or midi_clock",
                    i + 1,
                    source.name()
                ));
            }
        }
    }
}
