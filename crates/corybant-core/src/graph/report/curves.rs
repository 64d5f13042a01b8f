//! Draws the beat curve of each clip (the curve in which its beats were found), with its extrema,
//! its beats and the times in which feet are planted.
//!
//! In: a graph and the report on it.
//! Out: HTML.
//! Thread: any except show and audio; pure.
//! Allocates: freely.
//!
//! A long clip is divided into several rows. If the rows are still long, only the lowest and the
//! highest value of the curve is drawn in each column of pixels, and marks that would overlap are
//! left out. So the size of a plot is limited.

use std::collections::{BTreeMap, HashMap};

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::ink::{
    AXIS, Area, BLUE, Chart, GREEN, GREY, INK, ORANGE, SCALE, WIDTH, colour, over_seconds, plot,
    writing,
};
use super::lanes::name;
use super::summary::{ClipReport, Report, counted, notes};
use super::text::{escaped, plain, short};
use super::{ReportError, key};
use crate::graph::{ClipInfo, Graph};
use crate::motion::{FootPart, MOTION_FPS};

/// The greatest number of clips for which plots are drawn; the other clips are listed in a table.
const DRAWN_MAX: usize = 200;
/// Limit of the size of all plots together, in bytes: once it is reached, no more clips are drawn,
/// and the other clips are listed in a table.
const BYTES_MAX: usize = 6 << 20;
/// Approximate duration of the part of a clip that one row of a plot shows, in seconds.
const ROW_S: f64 = 60.0;
/// Greatest number of plot rows that are drawn for one clip; a clip that needs more gets rows of
/// longer duration.
const ROWS_MAX: u32 = 10;
/// The greatest number of cleaning steps that are listed per clip. If there are more, the list ends
/// with the number of the others.
const STEPS_MAX: usize = 12;
/// The greatest number of joints per clip whose ground contacts are drawn. Contacts of further
/// joints are left out.
const FEET_MAX: usize = 8;

/// The width of the left margin of a plot, where the names of joints are written, in plot units
/// (see [`SCALE`]).
const MARGIN: i32 = 84 * SCALE;
/// Height of the beat curve in one row of a plot, in plot units (see [`SCALE`]).
const CURVE: i32 = 84 * SCALE;
/// Height of the space for the ground contacts of one joint in a plot, in plot units (see
/// [`SCALE`]).
const FOOT: i32 = 13 * SCALE;
/// The width of a drawn beat curve, in pixels of the page.
const COLUMNS: usize = ((WIDTH - MARGIN) / SCALE) as usize;
/// The smallest distance between two neighbouring marks (extrema or beats), in pixels of the page.
/// A mark nearer to the previous mark is left out.
const MARK_GAP: f64 = 3.0;
/// Length of the vertical lines that mark beats, as a multiple of the height of the beat curve. The
/// lines are a little longer than the curve is high.
const BEAT_HEIGHT: f64 = 1.15;

/// Returns the section of the HTML page that shows every clip, either as plots or, if there are too
/// many, as a row of a table.
pub fn section(graph: &Graph, report: &Report) -> Result<String, ReportError> {
    let images: HashMap<usize, &ClipReport> = report
        .clips
        .iter()
        .filter_map(|clip| Some((clip.mirror_of?, clip)))
        .collect();
    let (mut drawn, mut lines) = (String::new(), String::new());
    let mut count = 0;
    for (index, (info, clip)) in graph
        .clips
        .iter()
        .zip(&report.clips)
        .enumerate()
        .filter(|(_, (_, clip))| clip.mirror_of.is_none())
    {
        let notes = notes(clip, images.get(&index).copied());
        if count < DRAWN_MAX && drawn.len() < BYTES_MAX {
            drawn.push_str(&entry(graph, info, clip, &notes)?);
            count += 1;
        } else {
            lines.push_str(&line(clip, &notes));
        }
    }
    let left_out = report.clips.len() - images.len() - count;
    let mut html =
        "<h2 id=\"clips\">Clips</h2>\n<p>The curve in which the beats were found, a principal component of the body's movement, \
        over seconds. R is how regular its extrema are, from 0 to 1; m/s is the mean speed of the joints.</p>\n<p>"
            .to_string();
    let keys = [
        (BLUE, "curve"),
        (ORANGE, "extrema"),
        (GREEN, "beats: the graph's nodes"),
        (GREY, "planted feet"),
    ];
    keys.iter()
        .for_each(|&(colour, what)| html.push_str(&key(colour, what)));
    html.push_str("</p>\n");
    html.push_str(&drawn);
    if left_out > 0 {
        html.push_str(&format!(
            "<p>{} more, not drawn so that this page stays small:</p>\n<table><tr><th>clip</th><th>label</th><th>seconds</th>\
             <th>beats</th><th>interval</th><th>quality</th><th>notes</th></tr>\n{lines}</table>\n",
            counted(left_out, "clip")
        ));
    }
    Ok(html)
}

/// Returns the HTML table row of a clip for which no plots are drawn. The last cell of the row
/// shows `notes`.
fn line(clip: &ClipReport, notes: &[String]) -> String {
    format!(
        "<tr><td>{}</td><td>{}</td><td>{:.1}</td><td>{}</td><td>{:.3} s</td><td>R {:.2}</td><td>{}</td></tr>\n",
        escaped(&clip.name),
        escaped(clip.shown_label()),
        clip.seconds(),
        clip.beats,
        clip.interval_s,
        clip.quality,
        escaped(&notes.join(", "))
    )
}

/// Returns the HTML for a clip that is drawn: the heading, a line of facts that ends with the
/// `notes`, the plots and the cleaning steps.
fn entry(
    graph: &Graph,
    info: &ClipInfo,
    clip: &ClipReport,
    notes: &[String],
) -> Result<String, ReportError> {
    let mut facts = vec![
        format!("{:.1} s", clip.seconds()),
        counted(clip.beats as usize, "beat"),
        format!("interval {:.3} s", clip.interval_s),
        format!("R {:.2}", clip.quality),
        format!("{:.2} m/s", clip.energy_mps),
    ];
    facts.extend(notes.iter().map(|note| escaped(note)));
    let rows = ((clip.seconds() / ROW_S).ceil() as u32).clamp(1, ROWS_MAX);
    if clip.seconds() > 2.0 * ROW_S * f64::from(rows) {
        facts.push("too long to draw every mark".into());
    }
    let mut html = format!(
        "<h3>{}<small>{}</small></h3>\n<p>{}</p>\n",
        key(colour(info.attribute), &escaped(&clip.name)),
        name(graph, info.attribute),
        facts.join(" · ")
    );
    let seconds = last_s(info) / f64::from(rows);
    let feet = feet(graph, info, seconds / COLUMNS as f64);
    let height = CURVE + FOOT * feet.len() as i32 + AXIS;
    for row in 0..rows {
        let row = Row {
            from: f64::from(row) * seconds,
            to: f64::from(row + 1) * seconds,
        };
        html.push_str(&plot(&format!("curve of {}", clip.name), height, |area| {
            row.draw(area, graph, info, &feet)
        })?);
    }
    if !clip.steps.is_empty() {
        let mut steps: Vec<String> = clip
            .steps
            .iter()
            .take(STEPS_MAX)
            .map(|step| escaped(step))
            .collect();
        if clip.steps.len() > STEPS_MAX {
            steps.push(format!("and {} more", clip.steps.len() - STEPS_MAX));
        }
        html.push_str(&format!(
            "<p class=\"quiet\">Cleaned: {}.</p>\n",
            steps.join("; ")
        ));
    }
    Ok(html)
}

/// Returns the joints of `clip` with ground contacts, at most [`FEET_MAX`]. Contacts with a gap of
/// less than `gap` seconds are joined to one bar, because such a gap is too small to see.
fn feet(graph: &Graph, clip: &ClipInfo, gap: f64) -> Vec<Foot> {
    let mut feet: BTreeMap<(u16, FootPart), Vec<(f64, f64)>> = BTreeMap::new();
    for contact in &clip.contacts {
        let (first, last) = (
            f64::from(contact.first) / MOTION_FPS,
            f64::from(contact.last) / MOTION_FPS,
        );
        let bars = feet.entry((contact.joint, contact.part)).or_default();
        match bars.last_mut() {
            Some(before) if (before.1..before.1 + gap).contains(&first) => before.1 = last,
            _ => bars.push((first, last)),
        }
    }
    let name = |joint: u16, part: FootPart| {
        let joint = graph.skeleton.joints.get(usize::from(joint));
        let name = joint.map_or(String::new(), |joint| plain(&joint.name));
        match part {
            FootPart::Heel => name,
            FootPart::Toe => format!("{name} (toes)"),
        }
    };
    feet.into_iter()
        .take(FEET_MAX)
        .map(|((joint, part), bars)| Foot {
            name: name(joint, part),
            bars,
        })
        .collect()
}

/// A joint that touches the ground, with the bars that show its contacts in a plot.
struct Foot {
    /// The name of the joint.
    name: String,
    /// Start and end of each bar (one or more ground contacts), in seconds from the start of the
    /// clip.
    bars: Vec<(f64, f64)>,
}

/// Returns the time of the last frame of a clip, in seconds from the start of the clip; at least
/// the duration of one frame.
fn last_s(clip: &ClipInfo) -> f64 {
    f64::from(clip.frames.saturating_sub(1).max(1)) / MOTION_FPS
}

/// The part of a clip that one row of its plot shows. A long clip has several rows.
struct Row {
    /// Time in the clip at which this row of the plot starts, in seconds.
    from: f64,
    /// Time in the clip at which this row of the plot ends, in seconds.
    to: f64,
}

impl Row {
    /// Draws this row of the plot on `area`: the beats, the beat curve with its extrema, and the
    /// bars of ground contacts of the joints `feet`.
    fn draw(
        &self,
        area: &Area,
        graph: &Graph,
        clip: &ClipInfo,
        feet: &[Foot],
    ) -> Result<(), ReportError> {
        let high = 2.0 * BEAT_HEIGHT * f64::from(FOOT) / f64::from(CURVE);
        let floor = -BEAT_HEIGHT - high * feet.len() as f64;
        let mut chart = over_seconds(area, MARGIN, self.from..self.to, floor..BEAT_HEIGHT)?;
        let beats = &graph.nodes[clip.first_node as usize..(clip.first_node + clip.nodes) as usize];
        let beats = self.apart(beats.iter().map(|node| f64::from(node.frame)));
        // One path for all beats takes a quarter of the bytes of one path per beat.
        let comb = beats
            .iter()
            .flat_map(|&at| [-BEAT_HEIGHT, BEAT_HEIGHT, -BEAT_HEIGHT].map(|height| (at, height)));
        chart.draw_series([PathElement::new(
            comb.collect::<Vec<_>>(),
            GREEN.mix(0.6).stroke_width(SCALE as u32),
        )])?;
        let first = clip.first_frame as usize;
        self.draw_curve(
            &mut chart,
            graph
                .curves
                .get(first..first + clip.frames as usize)
                .unwrap_or_default(),
            &clip.extrema,
        )?;
        for (i, foot) in feet.iter().enumerate() {
            let top = -BEAT_HEIGHT - high * (i as f64 + 0.2);
            let within = foot
                .bars
                .iter()
                .filter(|(from, to)| *from < self.to && *to > self.from);
            let bar = |&(from, to): &(f64, f64)| {
                [
                    (from.max(self.from), top),
                    (to.min(self.to), top - 0.6 * high),
                ]
            };
            chart.draw_series(within.map(|stretch| Rectangle::new(bar(stretch), GREY.filled())))?;
            let (left, middle) = chart.backend_coord(&(self.from, top - 0.3 * high));
            area.draw(&Text::new(
                short(&foot.name, 12).into_owned(),
                (left - 6 * SCALE, middle),
                writing(INK, HPos::Right),
            ))?;
        }
        Ok(())
    }

    /// Draws the part of the beat curve that belongs to this row, with its extrema. `values` and
    /// `extrema` are those of the whole clip. The lowest value is drawn at -1, and the highest at
    /// 1.
    fn draw_curve(
        &self,
        chart: &mut Chart,
        values: &[f32],
        extrema: &[f32],
    ) -> Result<(), ReportError> {
        let (low, high) = values
            .iter()
            .fold((f32::MAX, f32::MIN), |(low, high), &value| {
                (low.min(value), high.max(value))
            });
        if low >= high {
            return Ok(());
        }
        let (middle, half) = (
            (f64::from(low) + f64::from(high)) / 2.0,
            (f64::from(high) - f64::from(low)) / 2.0,
        );
        let height =
            |frame: usize| (f64::from(values[frame.min(values.len() - 1)]) - middle) / half;
        let (from, to) = (
            (self.from * MOTION_FPS).round() as usize,
            (self.to * MOTION_FPS).round() as usize + 1,
        );
        let frames = extremes(&values[from.min(values.len())..to.min(values.len())])
            .into_iter()
            .map(|frame| from + frame);
        let points = frames.map(|frame| (frame as f64 / MOTION_FPS, height(frame)));
        chart.draw_series(LineSeries::new(points, BLUE.stroke_width(SCALE as u32)))?;
        let extrema = self.apart(extrema.iter().map(|&at| f64::from(at)));
        let dot = |&at: &f64| {
            Circle::new(
                (at, height((at * MOTION_FPS).round() as usize)),
                3 * SCALE,
                ORANGE.filled(),
            )
        };
        chart.draw_series(extrema.iter().map(dot))?;
        Ok(())
    }

    /// Returns the times of those `frames` that are within this row of the plot, in seconds. A time
    /// too close to the previous time to be drawn as a separate mark is left out.
    fn apart(&self, frames: impl Iterator<Item = f64>) -> Vec<f64> {
        let gap = MARK_GAP * (self.to - self.from) / COLUMNS as f64;
        let mut kept: Vec<f64> = Vec::new();
        for at in frames
            .map(|frame| frame / MOTION_FPS)
            .filter(|at| (self.from..=self.to).contains(at))
        {
            if kept.last().is_none_or(|&before| at - before >= gap) {
                kept.push(at);
            }
        }
        kept
    }
}

/// Returns the indices of those `values` of a curve that are drawn, in ascending order. A short
/// curve is drawn with all values. A long curve is drawn with the lowest and the highest value in
/// each column of pixels, and with the values at both ends.
fn extremes(values: &[f32]) -> Vec<usize> {
    if values.len() <= 2 * COLUMNS {
        return (0..values.len()).collect();
    }
    let mut frames = vec![0];
    for column in 0..COLUMNS {
        let range = column * values.len() / COLUMNS..(column + 1) * values.len() / COLUMNS;
        let by_value = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
        let (low, high) = (range.clone().min_by(by_value), range.max_by(by_value));
        frames.extend(low.min(high));
        frames.extend(low.max(high));
    }
    frames.push(values.len() - 1);
    frames.dedup();
    frames
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maths;

    #[test]
    fn a_long_curve_keeps_its_peaks() {
        let mut values: Vec<f32> = (0..100_000).map(|i| maths::sin(i as f32 * 0.01)).collect();
        (values[777], values[90_001]) = (5.0, -7.0);
        let frames = extremes(&values);
        assert!(
            frames.len() <= 2 * COLUMNS + 2 && frames.contains(&777) && frames.contains(&90_001)
        );
        assert!(frames.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(extremes(&values[..50]).len(), 50);
    }
}
