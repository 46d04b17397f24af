//! Charts of curves as SVG, each curve with its name at its end.

use std::fmt::Write;

use mpm_files::shortest;

use super::page::escape;
use super::scale::Scale;
use super::units::{Naming, Quantity};

/// Width of a chart; this and the following lengths are in screen pixels.
const WIDTH: f64 = 720.0;
/// Space left of the axes.
const LEFT: f64 = 66.0;
/// Space above the axes.
const TOP: f64 = 26.0;
/// Space below the axes.
const BOTTOM: f64 = 48.0;
/// Smallest distance between the names of curves.
const LINE: f64 = 15.0;
/// Mean width of a letter.
const LETTER: f64 = 6.6;
/// Largest number of letters of a name that are shown.
const LONGEST_NAME: usize = 26;
/// Largest number of points drawn for a curve.
const MAX_POINTS: usize = 1600;

/// Style of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Look {
    /// The combination of colour and dashes with this number.
    Number(usize),
    /// A member of an ordered family: 0 is the first, 1 the last.
    Family(f64),
    /// The highlighted curve of an ordered family.
    Alarm,
}

/// A curve.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    /// Name of the curve in plain text; empty if the chart does not name the curve.
    pub name: String,
    /// Points of the curve.
    pub points: Vec<[f64; 2]>,
    /// Style of the curve.
    pub look: Look,
}

/// An axis.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    /// Name of the quantity, in plain text.
    pub name: String,
    /// The kind of quantity.
    pub quantity: Quantity,
    /// True for a logarithmic axis.
    pub logarithmic: bool,
    /// Values that the axis must contain.
    pub contains: Vec<f64>,
    /// True if the values on the axis are whole numbers.
    pub whole_numbers: bool,
}

impl Axis {
    /// A linear axis.
    pub fn new(name: &str, quantity: Quantity) -> Axis {
        Axis {
            name: name.to_owned(),
            quantity,
            logarithmic: false,
            contains: Vec::new(),
            whole_numbers: false,
        }
    }

    /// An axis of whole numbers.
    pub fn counting(name: &str) -> Axis {
        Axis { whole_numbers: true, ..Axis::new(name, Quantity::Number) }
    }

    /// The scale over the values of the curves, between two positions.
    fn scale(&self, values: impl Iterator<Item = f64>, places: [f64; 2], marks: usize) -> Scale {
        let usable = |v: &f64| v.is_finite() && (!self.logarithmic || *v > 0.0);
        let all = values.chain(self.contains.iter().copied()).filter(usable);
        let bounds = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
        if self.logarithmic {
            return Scale::logarithmic(bounds, places, marks);
        }
        let marks =
            if self.whole_numbers { marks.min((bounds[1] - bounds[0]).max(1.0) as usize) } else { marks };
        Scale::linear(bounds, places, marks, true)
    }
}

/// A named interval of an axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Band {
    /// Ends of the interval.
    pub ends: [f64; 2],
    /// Name of the interval in plain text.
    pub name: String,
}

/// A chart.
#[derive(Debug, Clone)]
pub(super) struct Chart {
    /// Description for screen readers.
    pub description: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The curves.
    pub curves: Vec<Curve>,
    /// Named values of y, drawn as horizontal lines.
    pub levels: Vec<(f64, String)>,
    /// Named, consecutive intervals of x, drawn as bands behind the curves.
    pub bands: Vec<Band>,
    /// Height of the chart.
    pub height: f64,
}

impl Chart {
    /// The chart as an SVG element; unit names come from `naming`.
    pub fn svg(&self, naming: &Naming) -> String {
        let names = self.curves.iter().map(|curve| shown(&curve.name).chars().count()).max().unwrap_or(0);
        let right = WIDTH - if names == 0 { 18.0 } else { 26.0 + LETTER * names as f64 };
        let bottom = self.height - BOTTOM;
        let along = |axis: usize| self.curves.iter().flat_map(move |c| c.points.iter().map(move |p| p[axis]));
        let x = self.x.scale(along(0), [LEFT, right], 8);
        let levels = self.levels.iter().map(|(value, _)| *value);
        let y = self.y.scale(along(1).chain(levels), [bottom, TOP], ((bottom - TOP) / 42.0) as usize);

        let mut svg = format!(
            "<svg class=\"chart\" viewBox=\"0 0 {WIDTH} {}\" role=\"img\" aria-label=\"{}\">\n",
            self.height,
            escape(&self.description)
        );
        self.draw_bands(&mut svg, &x, [LEFT, right], bottom);
        self.draw_axes(&mut svg, naming, &x, &y, right, bottom);
        for (value, name) in &self.levels {
            let place = y.place(*value);
            let _ = writeln!(
                svg,
                "<line class=\"level\" x1=\"{LEFT}\" x2=\"{right:.1}\" y1=\"{place:.1}\" y2=\"{place:.1}\"/>\
                 <text class=\"level\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                LEFT + 6.0,
                place - 4.0,
                escape(name)
            );
        }
        let mut ends = Vec::new();
        for curve in &self.curves {
            let points = thinned(&curve.points);
            let places: Vec<[f64; 2]> = points.iter().map(|p| [x.place(p[0]), y.place(p[1])]).collect();
            draw_curve(&mut svg, curve, &points, &places);
            if let (Some(end), false) = (places.last(), curve.name.is_empty()) {
                ends.push((*end, curve));
            }
        }
        draw_names(&mut svg, ends, right, [TOP, bottom]);
        self.name_bands(&mut svg, &x, [LEFT, right], bottom);
        svg.push_str("<g class=\"readout\"><circle r=\"4\"/><text></text></g>\n</svg>\n");
        svg
    }

    /// Draws the bands, every second one shaded, with a line at the start of each but the first.
    fn draw_bands(&self, svg: &mut String, x: &Scale, sides: [f64; 2], bottom: f64) {
        for (number, Band { ends, name }) in self.bands.iter().enumerate() {
            let [left, right] = within(x, *ends, sides);
            let (width, height, name) = (right - left, bottom - TOP, escape(name));
            let class = if number % 2 == 0 { "band" } else { "band shaded" };
            let _ = writeln!(
                svg,
                "<rect class=\"{class}\" x=\"{left:.1}\" y=\"{TOP}\" width=\"{width:.1}\" height=\"{height:.1}\">\
                 <title>{name}</title></rect>"
            );
            if number > 0 {
                let _ = writeln!(svg, "<path class=\"band\" d=\"M{left:.1} {TOP}V{bottom:.1}\"/>");
            }
        }
    }

    /// Writes the name of each band along the top of the chart or, if there is no room, vertically. A name that fits
    /// neither way is shown only when the pointer is over the band.
    fn name_bands(&self, svg: &mut String, x: &Scale, sides: [f64; 2], bottom: f64) {
        for Band { ends, name } in &self.bands {
            let [left, right] = within(x, *ends, sides);
            let (width, height, length) = (right - left, bottom - TOP, LETTER * name.chars().count() as f64);
            let (middle, top, name) = (0.5 * (left + right), TOP + 12.0, escape(name));
            if length + 4.0 <= width {
                let _ = writeln!(svg, "<text class=\"band\" x=\"{middle:.1}\" y=\"{top}\">{name}</text>");
            } else if LINE <= width + 2.0 && length <= height - 8.0 {
                let (x, y) = (middle - 4.0, TOP + 5.0);
                let _ = writeln!(
                    svg,
                    "<text class=\"band down\" transform=\"translate({x:.1} {y}) rotate(90)\">{name}</text>"
                );
            }
        }
    }

    fn draw_axes(&self, svg: &mut String, naming: &Naming, x: &Scale, y: &Scale, right: f64, bottom: f64) {
        svg.push_str("<g class=\"axes\">\n");
        for tick in &y.ticks {
            let place = y.place(tick.value);
            let class = if tick.label.is_empty() { " class=\"small\"" } else { "" };
            let _ = writeln!(svg, "<path{class} d=\"M{LEFT} {place:.1}H{right:.1}\"/>");
            if !tick.label.is_empty() {
                let (at, line) = (LEFT - 8.0, place + 4.0);
                let _ = writeln!(svg, "<text class=\"y\" x=\"{at}\" y=\"{line:.1}\">{}</text>", tick.label);
            }
        }
        for tick in &x.ticks {
            let place = x.place(tick.value);
            let _ = writeln!(
                svg,
                "<path class=\"tick\" d=\"M{place:.1} {bottom}v5\"/><text class=\"x\" x=\"{place:.1}\" y=\"{}\">{}</text>",
                bottom + 19.0,
                tick.label
            );
        }
        let (x_name, y_name) = (
            escape(&naming.label(&self.x.name, self.x.quantity, x.power)),
            escape(&naming.label(&self.y.name, self.y.quantity, y.power)),
        );
        let _ = writeln!(
            svg,
            "<path class=\"base\" d=\"M{LEFT} {bottom}H{right:.1}\"/>\
             <text class=\"name x\" x=\"{:.1}\" y=\"{}\">{x_name}</text>\
             <text class=\"name\" x=\"2\" y=\"12\">{y_name}</text>\n</g>",
            0.5 * (LEFT + right),
            self.height - 8.0,
        );
    }
}

/// The positions of the ends of a band, limited to the sides of a chart.
fn within(x: &Scale, ends: [f64; 2], sides: [f64; 2]) -> [f64; 2] {
    ends.map(|end| x.place(end).clamp(sides[0], sides[1]))
}

/// A name, shortened for display.
fn shown(name: &str) -> String {
    if name.chars().count() <= LONGEST_NAME {
        return name.to_owned();
    }
    name.chars().take(LONGEST_NAME - 1).chain(['…']).collect()
}

fn class_of(look: Look) -> String {
    match look {
        Look::Number(number) => format!("c{}", number % 8),
        Look::Family(_) => "family".to_owned(),
        Look::Alarm => "alarm".to_owned(),
    }
}

fn draw_curve(svg: &mut String, curve: &Curve, points: &[[f64; 2]], places: &[[f64; 2]]) {
    let class = class_of(curve.look);
    let style = match curve.look {
        Look::Family(share) => {
            let percent = (100.0 * share.clamp(0.0, 1.0)).round();
            format!(" style=\"stroke:color-mix(in oklab,var(--late) {percent}%,var(--early))\"")
        }
        Look::Number(_) | Look::Alarm => String::new(),
    };
    let joined = |values: &mut dyn Iterator<Item = String>| values.collect::<Vec<String>>().join(" ");
    let path = joined(&mut places.iter().map(|[x, y]| format!("{x:.1},{y:.1}")));
    let value = |axis: usize| joined(&mut points.iter().map(|p| compact(p[axis])));
    let _ = writeln!(
        svg,
        "<polyline class=\"curve {class}\"{style} points=\"{path}\" data-name=\"{}\" data-x=\"{}\" data-y=\"{}\"/>",
        escape(&curve.name),
        value(0),
        value(1)
    );
    // Each point is marked if there are only a few.
    if points.len() <= 60 && matches!(curve.look, Look::Number(_)) {
        let dots: String = places.iter().map(|[x, y]| format!("M{x:.1} {y:.1}h0")).collect();
        let _ = writeln!(svg, "<path class=\"dots {class}\" d=\"{dots}\"/>");
    }
}

/// A number with at most six significant digits, as short as possible.
fn compact(value: f64) -> String {
    shortest(format!("{value:.5e}").parse().unwrap_or(value))
}

/// Writes the names of curves to the right of their ends, without overlap.
fn draw_names(svg: &mut String, mut ends: Vec<([f64; 2], &Curve)>, right: f64, [top, bottom]: [f64; 2]) {
    ends.sort_by(|a, b| a.0[1].total_cmp(&b.0[1]));
    let wanted: Vec<f64> = ends.iter().map(|(end, _)| end[1]).collect();
    for ((end, curve), place) in ends.iter().zip(apart(&wanted, LINE, [top, bottom])) {
        let (x, class) = (right + 12.0, class_of(curve.look));
        let name = shown(&curve.name);
        let title = if name == curve.name {
            String::new()
        } else {
            format!("<title>{}</title>", escape(&curve.name))
        };
        let _ = writeln!(
            svg,
            "<path class=\"leader {class}\" d=\"M{:.1} {:.1}L{:.1} {place:.1}\"/>\
             <text class=\"of {class}\" x=\"{x:.1}\" y=\"{:.1}\">{}{title}</text>",
            end[0] + 3.0,
            end[1],
            x - 3.0,
            place + 4.0,
            escape(&name)
        );
    }
}

/// Positions close to the wanted ones, which are in ascending order, but at least `distance` apart and, if there is
/// room, between two bounds.
fn apart(wanted: &[f64], distance: f64, [low, high]: [f64; 2]) -> Vec<f64> {
    let mut places = wanted.to_vec();
    let mut least = low;
    for place in &mut places {
        *place = place.max(least);
        least = *place + distance;
    }
    let mut most = high;
    for place in places.iter_mut().rev() {
        *place = place.min(most);
        most = *place - distance;
    }
    places
}

/// The points of a curve, thinned so that it looks the same.
fn thinned(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let finite: Vec<[f64; 2]> = points.iter().copied().filter(|p| p.iter().all(|c| c.is_finite())).collect();
    if finite.len() <= MAX_POINTS {
        return finite;
    }
    let group = finite.len().div_ceil(MAX_POINTS / 4);
    let mut kept = Vec::with_capacity(MAX_POINTS);
    for points in finite.chunks(group) {
        let extreme = |sign: f64| {
            let order = |(_, a): &(usize, &[f64; 2]), (_, b): &(usize, &[f64; 2])| {
                (sign * a[1]).total_cmp(&(sign * b[1]))
            };
            points.iter().enumerate().min_by(order).map_or(0, |(index, _)| index)
        };
        let mut indices = [0, extreme(1.0), extreme(-1.0), points.len() - 1];
        indices.sort_unstable();
        for (place, index) in indices.iter().enumerate() {
            if place == 0 || indices[place - 1] != *index {
                kept.push(points[*index]);
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(curves: Vec<Curve>) -> Chart {
        Chart {
            description: "a & b".to_owned(),
            x: Axis::new("load factor", Quantity::Number),
            y: Axis::new("reaction", Quantity::Force),
            curves,
            levels: vec![(2.0, "limit <2>".to_owned())],
            bands: Vec::new(),
            height: 300.0,
        }
    }

    #[test]
    fn a_chart_names_axes_curves_and_levels() {
        let points = (0..=10).map(|i| [0.1 * f64::from(i), 1e5 * f64::from(i)]).collect();
        let name = "a name that is far too long to stand beside a curve".to_owned();
        let svg =
            chart(vec![Curve { name: name.clone(), points, look: Look::Number(9) }]).svg(&Naming::default());
        for part in [
            "aria-label=\"a &amp; b\"",
            ">load factor</text>",
            ">reaction [10⁶ force]</text>",
            "limit &lt;2&gt;",
            "class=\"curve c1\"",
            "data-y=\"0 100000 200000",
            "…<title>a name that is far too long",
        ] {
            assert!(svg.contains(part), "{part} is not in\n{svg}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn bands_are_named_where_there_is_room() {
        let points = vec![[0.0, 0.0], [100.0, 1.0]];
        let band = |ends, name: &str| Band { ends, name: name.to_owned() };
        let bands = vec![band([0.0, 50.0], "dig"), band([50.0, 53.0], "prop"), band([53.0, 53.5], "a & b")];
        let curve = Curve { name: String::new(), points, look: Look::Number(0) };
        let svg = Chart { bands, ..chart(vec![curve]) }.svg(&Naming::default());
        assert_eq!(svg.matches("<rect class=\"band").count(), 3);
        assert_eq!(svg.matches("<path class=\"band\"").count(), 2);
        assert!(svg.contains("<text class=\"band\"") && svg.contains(">dig</text>"));
        assert!(svg.contains("rotate(90)\">prop</text>"));
        assert!(svg.contains("<title>a &amp; b</title>") && !svg.contains(">a &amp; b</text>"));
    }

    #[test]
    fn a_chart_without_points_is_still_a_chart() {
        let svg =
            chart(vec![Curve { name: String::new(), points: vec![[f64::NAN, 1.0]], look: Look::Alarm }]);
        let svg = svg.svg(&Naming::default());
        assert!(svg.ends_with("</svg>\n") && !svg.contains("NaN"));
    }

    #[test]
    fn names_stand_apart_within_the_chart() {
        assert_eq!(apart(&[10.0, 50.0], 15.0, [0.0, 100.0]), [10.0, 50.0]);
        assert_eq!(apart(&[10.0, 10.0, 12.0], 15.0, [0.0, 100.0]), [10.0, 25.0, 40.0]);
        assert_eq!(apart(&[95.0, 99.0], 15.0, [0.0, 100.0]), [85.0, 100.0]);
    }

    #[test]
    fn long_curves_keep_their_peaks() {
        let mut points: Vec<[f64; 2]> = (0..100_000).map(|i| [f64::from(i), 0.0]).collect();
        points[54_321][1] = 7.0;
        points[54_322][1] = -7.0;
        let thin = thinned(&points);
        assert!(thin.len() <= MAX_POINTS);
        assert!(thin.contains(&points[54_321]) && thin.contains(&points[54_322]));
        assert_eq!((thin[0], thin[thin.len() - 1]), (points[0], points[99_999]));
        assert!(thin.windows(2).all(|pair| pair[0][0] < pair[1][0]));
    }
}
