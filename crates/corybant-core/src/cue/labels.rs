//! Names of labels and scenes in cues and in OSC addresses. In: labels of a graph. Out: parts of OSC
//! addresses. Thread: any.

use crate::graph::LabelId;

/// The names that cues of one show use.
#[derive(Clone, Copy, Debug, Default)]
pub struct CueNames<'a> {
    /// The names of the labels, indexed by label number.
    pub labels: &'a [String],
    /// The names of the scenes, indexed by scene number.
    pub scenes: &'a [String],
}

impl<'a, T: AsRef<[String]> + ?Sized> From<&'a T> for CueNames<'a> {
    /// Creates the names of a show with these labels and without scenes.
    fn from(labels: &'a T) -> Self {
        Self {
            labels: labels.as_ref(),
            scenes: &[],
        }
    }
}

/// Returns the form of `label` that OSC addresses contain: in lower case, with `_` in place of each
/// character except `a-z 0-9 _ -`.
///
/// ```
/// assert_eq!(corybant_core::cue::osc_name("Hip Hop"), "hip_hop");
/// ```
pub fn osc_name(label: &str) -> String {
    label
        .to_lowercase()
        .chars()
        .map(|c| match c {
            'a'..='z' | '0'..='9' | '_' | '-' => c,
            _ => '_',
        })
        .collect()
}

/// Returns, for each label, its name in OSC addresses ([`osc_name`]). If several labels have the
/// same name, the second one gets the suffix `_2`, the third one `_3` and so on.
pub fn osc_names(labels: &[String]) -> Vec<String> {
    let mut names: Vec<String> = Vec::with_capacity(labels.len());
    for label in labels {
        let plain = osc_name(label);
        let mut name = plain.clone();
        let mut n = 2;
        while names.contains(&name) {
            name = format!("{plain}_{n}");
            n += 1;
        }
        names.push(name);
    }
    names
}

/// Returns the index in `labels` of the label that is spelled exactly like `text`. If there is
/// none, returns the index of the label whose name in OSC addresses ([`osc_names`]) is `text`;
/// `None` if there is no such label either.
pub fn find_label(labels: &[String], text: &str) -> Option<LabelId> {
    let position = |names: &[String]| names.iter().position(|name| name == text);
    position(labels)
        .or_else(|| position(&osc_names(labels)))
        .and_then(|i| LabelId::try_from(i).ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn osc_names_are_safe_and_unique() {
        let labels = ["Hip Hop", "hip/hop", "Ça va", "k-pop"].map(String::from);
        assert_eq!(
            osc_names(&labels),
            ["hip_hop", "hip_hop_2", "_a_va", "k-pop"]
        );
    }

    #[test]
    fn a_label_is_found_by_its_spelling_or_its_osc_name() {
        let labels = ["Hip Hop", "hip/hop", "hip_hop"].map(String::from);
        let found = [
            "Hip Hop",
            "hip/hop",
            "hip_hop",
            "hip_hop_2",
            "hip_hop_3",
            "hip_hop_4",
        ]
        .map(|text| find_label(&labels, text));
        assert_eq!(found, [Some(0), Some(1), Some(2), Some(1), Some(2), None]);
    }
}
