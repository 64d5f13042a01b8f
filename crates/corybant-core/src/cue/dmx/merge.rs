//! Merges the levels of several sources of one universe. In: frames, with their times of arrival.
//! Out: the levels of the universe. Thread: any. Allocates: when a source appears.
//!
//! - The sources with the highest priority count; the others are stored.
//! - Of these sources, the latest change of a channel counts. A new source changes only the channels
//!   that are not 0.
//! - A frame that arrives after a later one of its source is ignored, by the rule of E1.31: its
//!   sequence number is 0 to 19 behind.
//! - When the last source ends or is lost, the levels stay.

use super::CHANNELS;
use crate::time::Seconds;

/// Greatest number of sources of a universe at one time. Frames of further ones are ignored.
pub const SOURCES_MAX: usize = 16;
/// A frame whose sequence number is less than this far behind the last one is late.
const LATE_MAX: i8 = 20;

/// One frame of levels from one source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Identifier of the source.
    pub source: [u8; 16],
    /// Name of the source, in UTF-8 as sent; empty if the protocol has none.
    pub name: &'a [u8],
    /// Priority of the source, 0 to 200.
    pub priority: u8,
    /// Number of the frame, which increases by 1 from frame to frame; `None` if the source does not
    /// count.
    pub sequence: Option<u8>,
    /// True if the source ends its stream; then the levels have no meaning.
    pub is_terminated: bool,
    /// The levels of the channels from channel 1 on, at most [`CHANNELS`].
    pub levels: &'a [u8],
}

/// What [`Merge::receive`] did with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// The frame is merged.
    Merged,
    /// The frame is older than the last one of its source, or of one source too many.
    Ignored,
}

/// A source that sends.
#[derive(Clone, Debug)]
struct Source {
    id: [u8; 16],
    priority: u8,
    sequence: Option<u8>,
    /// Time of the last frame.
    latest: Seconds,
    /// The number of the latest change among all changes of the universe.
    changed: u64,
    levels: [u8; CHANNELS],
}

/// The sources and the merged levels of one universe.
///
/// ```
/// use corybant_core::cue::dmx::{Frame, Merge};
/// use corybant_core::time::Seconds;
///
/// let mut merge = Merge::new(Seconds(2.5));
/// let frame = Frame {
///     source: [1; 16],
///     name: b"desk",
///     priority: 100,
///     sequence: Some(0),
///     is_terminated: false,
///     levels: &[0, 255],
/// };
/// merge.receive(Seconds(0.0), &frame);
/// assert_eq!(merge.levels()[1], 255);
/// assert_eq!(merge.expire(Seconds(3.0)), 1);
/// assert_eq!(merge.levels()[1], 255);
/// ```
#[derive(Clone, Debug)]
pub struct Merge {
    lost_after: Seconds,
    sources: Vec<Source>,
    /// Number of changes so far.
    changes: u64,
    levels: [u8; CHANNELS],
}

impl Merge {
    /// Creates a universe without sources, all of whose levels are 0. A source is lost if no frame
    /// has arrived for `lost_after`.
    pub fn new(lost_after: Seconds) -> Self {
        Self {
            lost_after,
            sources: Vec::new(),
            changes: 0,
            levels: [0; CHANNELS],
        }
    }

    /// Returns the level of each channel, from channel 1 on.
    pub fn levels(&self) -> &[u8; CHANNELS] {
        &self.levels
    }

    /// Returns the number of sources that send.
    pub fn sources(&self) -> usize {
        self.sources.len()
    }

    /// Merges a frame that arrived at the time `now`.
    pub fn receive(&mut self, now: Seconds, frame: &Frame) -> Received {
        let known = self
            .sources
            .iter()
            .position(|source| source.id == frame.source);
        let index = match known {
            Some(index) if is_late(self.sources[index].sequence, frame.sequence) => {
                return Received::Ignored;
            }
            Some(index) if frame.is_terminated => {
                let others = self.highest_of_others(index);
                let ended = self.sources.remove(index);
                if others.is_some_and(|highest| ended.priority >= highest) {
                    self.take_over();
                }
                return Received::Merged;
            }
            Some(index) => index,
            None if frame.is_terminated => return Received::Ignored,
            None if self.sources.len() >= SOURCES_MAX => return Received::Ignored,
            None => self.add(frame),
        };
        self.update(index, now, frame);
        Received::Merged
    }

    /// Removes the sources that have sent nothing for too long before the time `now`. Returns their
    /// number.
    pub fn expire(&mut self, now: Seconds) -> usize {
        let lost_after = self.lost_after;
        let (before, highest) = (self.sources.len(), self.highest());
        self.sources
            .retain(|source| now - source.latest <= lost_after);
        let lost = before - self.sources.len();
        if lost > 0 && self.highest() != highest {
            self.take_over();
        }
        lost
    }

    /// Adds the source of `frame` with levels of 0. Returns its index.
    fn add(&mut self, frame: &Frame) -> usize {
        self.sources.push(Source {
            id: frame.source,
            priority: frame.priority,
            sequence: None,
            latest: Seconds(0.0),
            changed: 0,
            levels: [0; CHANNELS],
        });
        self.sources.len() - 1
    }

    /// Stores `frame` in the source with this index, and merges what has changed.
    fn update(&mut self, index: usize, now: Seconds, frame: &Frame) {
        let others = self.highest_of_others(index);
        let source = &mut self.sources[index];
        let is_first = source.changed == 0;
        let was_top = !is_first && others.is_none_or(|highest| source.priority >= highest);
        let is_top = others.is_none_or(|highest| frame.priority >= highest);
        let is_alone = others.is_none_or(|highest| frame.priority > highest);
        let is_new = is_first || source.priority != frame.priority;
        (source.latest, source.sequence) = (now, frame.sequence);
        source.priority = frame.priority;
        let mut is_changed = is_first;
        let levels = frame.levels.iter().take(CHANNELS);
        for ((level, old), merged) in levels.zip(&mut source.levels).zip(&mut self.levels) {
            if *level != *old {
                (*old, is_changed) = (*level, true);
                if is_top {
                    *merged = *level;
                }
            }
        }
        if is_changed {
            self.changes += 1;
            source.changed = self.changes;
        }
        if is_new && (is_alone || was_top && !is_top) {
            self.take_over();
        }
    }

    /// Returns the highest priority of all sources; `None` without sources.
    fn highest(&self) -> Option<u8> {
        self.sources.iter().map(|source| source.priority).max()
    }

    /// Returns the highest priority of all sources but the one with this index; `None` if there is
    /// no other source.
    fn highest_of_others(&self, index: usize) -> Option<u8> {
        let others = self.sources.iter().enumerate();
        let others = others.filter(|(other, _)| *other != index);
        others.map(|(_, source)| source.priority).max()
    }

    /// Sets all levels to those of the source that counts: the one with the latest change among
    /// those with the highest priority. Without sources the levels stay.
    fn take_over(&mut self) {
        let winner = self
            .sources
            .iter()
            .max_by_key(|source| (source.priority, source.changed));
        if let Some(winner) = winner {
            self.levels = winner.levels;
        }
    }
}

/// Returns true if a frame with the number `new` is older than the one with the number `last`, by
/// the rule of E1.31, section 6.7.2.
fn is_late(last: Option<u8>, new: Option<u8>) -> bool {
    let (Some(last), Some(new)) = (last, new) else {
        return false;
    };
    let ahead = new.wrapping_sub(last) as i8;
    ahead <= 0 && ahead > -LATE_MAX
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOST_AFTER: Seconds = Seconds(2.5);

    fn frame(source: u8, priority: u8, levels: &[u8]) -> Frame<'_> {
        Frame {
            source: [source; 16],
            name: b"",
            priority,
            sequence: None,
            is_terminated: false,
            levels,
        }
    }

    fn numbered(sequence: u8, levels: &[u8]) -> Frame<'_> {
        Frame {
            sequence: Some(sequence),
            ..frame(1, 100, levels)
        }
    }

    #[test]
    fn the_highest_priority_counts_and_then_the_latest_change() {
        let mut merge = Merge::new(LOST_AFTER);
        let mut send = |frame: &Frame| {
            assert_eq!(merge.receive(Seconds(0.0), frame), Received::Merged);
            [merge.levels()[0], merge.levels()[1]]
        };
        assert_eq!(send(&frame(1, 100, &[10, 20])), [10, 20]);
        assert_eq!(send(&frame(2, 100, &[0, 30])), [10, 30], "0 is no change");
        assert_eq!(send(&frame(1, 100, &[10, 20])), [10, 30], "nothing new");
        assert_eq!(send(&frame(1, 100, &[11, 20])), [11, 30]);
        assert_eq!(send(&frame(3, 150, &[0, 0])), [0, 0]);
        assert_eq!(send(&frame(1, 100, &[12, 22])), [0, 0], "lower priority");
        assert_eq!(send(&frame(3, 150, &[7])), [7, 0], "fewer levels");
        let end = Frame {
            is_terminated: true,
            ..frame(3, 150, &[])
        };
        assert_eq!(send(&end), [12, 22], "the latest of the others");
        assert_eq!(send(&frame(2, 200, &[0, 30])), [0, 30], "raised priority");
        assert_eq!(send(&frame(2, 50, &[0, 30])), [12, 22], "lowered priority");
        assert_eq!(merge.sources(), 2);
    }

    #[test]
    fn a_lost_source_keeps_its_levels_until_another_one_sends() {
        let mut merge = Merge::new(LOST_AFTER);
        merge.receive(Seconds(0.0), &frame(1, 100, &[10]));
        assert_eq!(merge.expire(Seconds(2.5)), 0);
        assert_eq!(merge.expire(Seconds(2.6)), 1);
        assert_eq!((merge.sources(), merge.levels()[0]), (0, 10));
        merge.receive(Seconds(3.0), &frame(2, 1, &[0]));
        assert_eq!(merge.levels()[0], 0);
    }

    #[test]
    fn late_frames_are_ignored_by_their_sequence_numbers() {
        let mut merge = Merge::new(LOST_AFTER);
        let mut send = |sequence, level| {
            let received = merge.receive(Seconds(0.0), &numbered(sequence, &[level]));
            (received == Received::Merged, merge.levels()[0])
        };
        assert_eq!(send(250, 1), (true, 1));
        assert_eq!(send(249, 2), (false, 1));
        assert_eq!(send(250, 2), (false, 1));
        assert_eq!(send(231, 2), (false, 1), "19 behind");
        assert_eq!(send(230, 3), (true, 3), "20 behind is a new start");
        assert_eq!(send(231, 4), (true, 4));
        assert_eq!(send(5, 5), (true, 5), "beyond 255 it begins again");
    }

    #[test]
    fn a_flood_of_sources_is_bounded() {
        let mut merge = Merge::new(LOST_AFTER);
        for source in 0..=255 {
            merge.receive(Seconds(0.0), &frame(source, 100, &[source]));
        }
        assert_eq!((merge.sources(), merge.levels()[0]), (SOURCES_MAX, 15));
        assert_eq!(merge.expire(Seconds(9.0)), SOURCES_MAX);
        let received = merge.receive(Seconds(9.0), &frame(99, 100, &[9]));
        assert_eq!(received, Received::Merged);
    }
}
