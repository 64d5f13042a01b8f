//! Timecode leads a cue list, on a virtual clock: engaged or not, in reverse, standing, lost, and with
//! hostile readings. The sources are Art-Net packets, MIDI messages and OSC messages.
#![allow(clippy::unwrap_used)]

use corybant_core::cue::list::CueList;
use corybant_core::cue::list::lead::{SongBeats, TimecodeLead};
use corybant_core::cue::{Cue, DanceCommand};
use corybant_core::tempo::source::TempoMessage;
use corybant_core::time::Seconds;
use corybant_core::timecode::mtc::MtcReceiver;
use corybant_core::timecode::settings::Settings;
use corybant_core::timecode::{Place, Rate, Reading, State, TimecodeEvent, art_net};
use smpte_timecode::{Direction, FrameRate, MtcEncoder, Timecode};

const TICK_S: f64 = 1.0 / 120.0;

/// A list whose labels follow each other every ten seconds for 20 beats, at 120 beats a minute.
fn list() -> CueList {
    let labels = ["a", "b", "c", "d", "e"].map(String::from);
    let text = "10 a 20\n20 b 20\n30 c 20\n40 d 20\n50 e 20\n";
    CueList::parse(text, &labels).unwrap().in_order_of_time()
}

struct Desk {
    lead: TimecodeLead,
    list: CueList,
    now: f64,
    /// Labels that were launched, with the time of the launch.
    launched: Vec<(f64, u16)>,
    /// Beats of the song that were sent to the tempo source, with their times.
    beats: Vec<(f64, f64)>,
}

impl Desk {
    fn new(engage: bool) -> Self {
        let settings = Settings {
            source: "art-net".parse().unwrap(),
            offset: "01:00:00:00".parse().unwrap(),
            engage,
            ..Settings::default()
        };
        let beats = SongBeats::new((0..120).map(|n| f64::from(n) * 0.5).collect());
        Self {
            lead: TimecodeLead::new(&settings, beats),
            list: list(),
            now: 0.0,
            launched: Vec::new(),
            beats: Vec::new(),
        }
    }

    /// Advances by `seconds`; `readings` arrive at their times.
    fn run(&mut self, seconds: f64, readings: &[Reading]) {
        let mut next = readings.iter().peekable();
        let end = self.now + seconds;
        while self.now < end {
            self.now += TICK_S;
            while let Some(reading) = next.next_if(|reading| reading.at.0 <= self.now) {
                self.lead.receive(reading);
            }
            let Self {
                lead,
                list,
                now,
                launched,
                beats,
            } = self;
            lead.tick(Seconds(*now), Seconds(0.5), list, &mut |cue| match cue {
                Cue::Dance(DanceCommand::Launch(launch)) => launched.push((*now, launch.label)),
                Cue::TempoMessage(message) => {
                    let TempoMessage::Song { beat, .. } = message.message else {
                        panic!("{message:?}");
                    };
                    beats.push((message.at.0, beat));
                }
                _ => {}
            });
        }
    }

    fn labels(&mut self) -> Vec<u16> {
        self.launched.drain(..).map(|(_, label)| label).collect()
    }

    /// Returns the labels that were in force one after the other: of launches at the same time, the
    /// last one.
    fn newest(&mut self) -> Vec<u16> {
        let launches = std::mem::take(&mut self.launched);
        let is_last = |i: usize| {
            launches
                .get(i + 1)
                .is_none_or(|next| next.0 > launches[i].0)
        };
        let last = (0..launches.len()).filter(|&i| is_last(i));
        let mut labels: Vec<u16> = last.map(|i| launches[i].1).collect();
        labels.dedup();
        labels
    }

    fn state(&self) -> State {
        self.lead.status(Seconds(self.now)).position.state
    }

    fn song(&self) -> f64 {
        self.lead.status(Seconds(self.now)).song.unwrap()
    }

    /// Returns the packets of a source that runs from the song time `song` on, from now on.
    fn packets(&self, song: f64, speed: f64, seconds: f64) -> Vec<Reading> {
        let first = Timecode::parse("01:00:00:00", FrameRate::FPS_25).unwrap();
        let frame = 0.04 / speed.abs();
        let step = if speed < 0.0 { -1 } else { 1 };
        let read = |n: i64| {
            let timecode = first.wrapping_add_frames((song * 25.0).round() as i64 + step * n);
            let place = art_net::parse(&art_net::packet(timecode)).unwrap().unwrap();
            self.reading(n as f64 * frame, place)
        };
        (0..(seconds / frame) as i64).map(read).collect()
    }

    fn reading(&self, after: f64, place: Place) -> Reading {
        Reading {
            at: Seconds(self.now + after),
            place,
            frame: None,
            jitter: Seconds(0.005),
            is_locate: false,
        }
    }
}

#[test]
fn cues_are_sent_at_their_song_times_and_after_a_locate_only_that_of_the_place() {
    let mut desk = Desk::new(true);
    let readings = desk.packets(0.0, 1.0, 22.0);
    desk.run(22.0, &readings);
    let times: Vec<f64> = desk.launched.iter().map(|(time, _)| *time).collect();
    assert!(
        (times[0] - 10.0).abs() < 0.01 && (times[1] - 20.0).abs() < 0.01,
        "{times:?}"
    );
    assert_eq!(desk.labels(), [0, 1]);
    let (time, beat) = *desk.beats.last().unwrap();
    assert!((beat - 2.0 * time).abs() < 0.01, "beat {beat} at {time} s");
    // A locate over the cue at 30 s into the cue at 40 s, and one back to 12 s.
    let readings = desk.packets(45.0, 1.0, 3.0);
    desk.run(3.0, &readings);
    assert_eq!(desk.labels(), [3]);
    let readings = desk.packets(12.0, 1.0, 9.0);
    desk.run(9.0, &readings);
    assert_eq!(
        desk.labels(),
        [0, 1],
        "the label of the place, then the next cue"
    );
}

#[test]
fn a_list_waits_while_timecode_is_not_engaged() {
    let mut desk = Desk::new(false);
    let readings = desk.packets(8.0, 1.0, 5.0);
    desk.run(5.0, &readings);
    assert_eq!((desk.labels().len(), desk.beats.len()), (0, 0));
    assert_eq!(desk.state(), State::Locked);
    desk.lead.engage(None);
    let readings = desk.packets(13.0, 1.0, 2.0);
    desk.run(2.0, &readings);
    assert_eq!(desk.labels(), [0], "the label of the place");
    desk.lead.engage(Some(false));
    desk.lead.engage(Some(false));
    let readings = desk.packets(15.0, 1.0, 10.0);
    desk.run(10.0, &readings);
    assert_eq!(desk.labels(), [0u16; 0]);
    let events: Vec<_> = std::iter::from_fn(|| desk.lead.next_event()).collect();
    let engaged = |on| {
        events
            .iter()
            .filter(|it| **it == TimecodeEvent::Engaged(on))
            .count()
    };
    assert_eq!((engaged(true), engaged(false)), (1, 1), "{events:?}");
}

#[test]
fn in_reverse_the_labels_come_back_and_a_standing_source_keeps_its_label() {
    let mut desk = Desk::new(true);
    let readings = desk.packets(42.0, -1.0, 15.0);
    desk.run(15.0, &readings);
    assert_eq!(desk.newest(), [3, 2, 1], "at 42 s, 40 s and 30 s");
    assert!(desk.beats.is_empty(), "the music does not run in reverse");
    let still: Vec<Reading> = desk.packets(27.0, 1.0, 10.0);
    let still: Vec<Reading> = still
        .iter()
        .map(|it| Reading {
            place: still[0].place,
            ..*it
        })
        .collect();
    desk.run(10.0, &still);
    assert_eq!((desk.state(), desk.labels()), (State::Standing, vec![1]));
    assert!((desk.song() - 27.0).abs() < 0.05, "{}", desk.song());
}

#[test]
fn a_drop_out_is_bridged_and_after_a_loss_the_list_goes_on_at_the_new_place() {
    let mut desk = Desk::new(true);
    let readings = desk.packets(17.0, 1.0, 2.5);
    // The cue at 20 s falls into the freewheel of one second.
    desk.run(3.3, &readings);
    assert_eq!(
        (desk.state(), desk.labels()),
        (State::Freewheel, vec![0, 1])
    );
    desk.run(20.0, &[]);
    assert_eq!((desk.state(), desk.labels()), (State::Lost, vec![]));
    let readings = desk.packets(52.0, 1.0, 2.0);
    desk.run(2.0, &readings);
    assert_eq!((desk.state(), desk.labels()), (State::Locked, vec![4]));
}

#[test]
fn wrong_frames_neither_move_the_list_nor_stop_it() {
    let mut desk = Desk::new(true);
    let mut readings = desk.packets(5.0, 1.0, 30.0);
    let mut random = 7u32;
    let wrong = art_net::parse(b"Art-Net\0\x00\x97\x00\x0e\0\0\x01\x17\x3b\x17\x01")
        .unwrap()
        .unwrap();
    let mut count = 0;
    for reading in readings.iter_mut().skip(20) {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        match random >> 28 {
            0 => reading.place = wrong,
            1 => reading.place = Place::Seconds(f64::from(random % 90_000)),
            2 => reading.at = Seconds(f64::NAN),
            _ => continue,
        }
        count += 1;
    }
    readings.retain(|it| {
        it.at.0.is_finite() || {
            desk.lead.receive(it);
            false
        }
    });
    desk.run(30.0, &readings);
    assert_eq!(desk.labels(), [0, 1, 2]);
    assert!((desk.song() - 35.0).abs() < 0.01);
    let ignored = desk.lead.ignored();
    assert!(
        ignored > count / 2 && ignored <= count,
        "{ignored} of {count} wrong readings"
    );
    let located = std::iter::from_fn(|| desk.lead.next_event())
        .filter(|event| matches!(event, TimecodeEvent::Located(_)));
    assert_eq!(located.count(), 0);
}

#[test]
fn midi_timecode_locates_by_a_full_frame_and_runs_by_quarter_frames() {
    let mut desk = Desk::new(true);
    let mut receiver = MtcReceiver::new(Rate::Auto);
    let place = Timecode::parse("01:00:32:00", FrameRate::FPS_25).unwrap();
    let full = MtcEncoder::full_frame(place).unwrap();
    let reading = receiver.receive(&full, Seconds(0.1)).unwrap().unwrap();
    desk.run(1.0, &[reading]);
    assert_eq!((desk.state(), desk.labels()), (State::Standing, vec![2]));
    let quarters = MtcEncoder::new(place, Direction::Forward)
        .unwrap()
        .take(900);
    let readings: Vec<Reading> = quarters
        .enumerate()
        .filter_map(|(n, bytes)| {
            receiver
                .receive(&bytes, Seconds(1.0 + n as f64 * 0.01))
                .unwrap()
        })
        .collect();
    desk.run(9.0, &readings);
    assert_eq!((desk.state(), desk.labels()), (State::Locked, vec![2, 3]));
    assert!(
        (desk.song() - 41.0).abs() < 0.005 + TICK_S,
        "{}",
        desk.song()
    );
}

#[test]
fn osc_seconds_lead_a_list() {
    let mut desk = Desk::new(true);
    let readings: Vec<Reading> = (0..100)
        .map(|n| f64::from(n) * 0.05)
        .map(|after| desk.reading(after, Place::Seconds(3_618.0 + after)))
        .collect();
    desk.run(5.0, &readings);
    assert_eq!(desk.labels(), [0, 1]);
    assert!(
        (desk.song() - 23.0).abs() < 0.005 + TICK_S,
        "{}",
        desk.song()
    );
}
