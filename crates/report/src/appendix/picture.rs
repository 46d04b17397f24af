//! Pictures of the deformed points: their domains as polygons, coloured by a field, over the active cells of the grid;
//! in space, the visible faces of the domains.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::colour::{ColourMap, hex};
use super::error::ReportError;
use super::field::FieldChoice;
use super::number::html;
use super::page::escape;
use super::raster::{Raster, Rgba};
use super::scale::Scale;
use super::scene::{NOWHERE, Polygon, Scene, around};
use super::units::{Naming, Quantity};
use super::view::View;

/// Pixels of the raster per pixel of the screen: enough for print.
const DENSITY: f64 = 2.5;
/// Width of the page.
const PAGE: f64 = 720.0;
/// Width of a picture that shares its row with another.
const HALF: f64 = 352.0;
/// Largest height of the axes of a picture.
const HIGHEST: f64 = 520.0;
/// Margins left of, above and below the axes.
const MARGIN: [f64; 3] = [58.0, 24.0, 44.0];
/// Colour of outlines.
const OUTLINE: Rgba = [0, 0, 0, 90];
/// Outlines are drawn if the mean area of the polygons exceeds that of a square with this side, in pixels of the
/// raster.
const OUTLINED: f64 = 6.0;

/// Size of a picture on the page, and its axes.
struct Frame {
    extent: [[f64; 2]; 2],
    /// Size of the axes.
    size: [f64; 2],
    /// Width of the picture.
    width: f64,
}

impl Frame {
    /// Axes for an extent, with a small margin around it.
    fn new(extent: [[f64; 2]; 2], pictures: usize) -> Frame {
        let [low, high] = extent;
        let span = [high[0] - low[0], high[1] - low[1]];
        let air = 0.02 * span[0].max(span[1]).max(f64::MIN_POSITIVE);
        let extent = [low.map(|x| x - air), high.map(|x| x + air)];
        let span = span.map(|x| x + 2.0 * air);
        let width = if pictures > 1 && span[0] < 2.2 * span[1] { HALF } else { PAGE };
        let inside = width - MARGIN[0] - 14.0;
        let scale = (inside / span[0]).min(HIGHEST / span[1]);
        Frame { extent, size: span.map(|x| x * scale), width }
    }

    fn height(&self) -> f64 {
        self.size[1] + MARGIN[1] + MARGIN[2]
    }

    /// Converts a position to pixels of the raster, whose rows count from the top.
    fn pixel(&self, position: [f64; 2]) -> [f64; 2] {
        let scale = self.size[0] / (self.extent[1][0] - self.extent[0][0]) * DENSITY;
        [(position[0] - self.extent[0][0]) * scale, (self.extent[1][1] - position[1]) * scale]
    }
}

/// Pictures of several states with the same axes and colours.
pub(super) struct Gallery<'a> {
    scenes: &'a [Scene],
    field: &'a FieldChoice,
    map: ColourMap,
    /// For each end of the colour map, true if values lie beyond it.
    beyond: [bool; 2],
    /// Smallest and largest value of the field.
    range: [f64; 2],
}

impl<'a> Gallery<'a> {
    /// Prepares the pictures of these states.
    pub fn new(scenes: &'a [Scene], field: &'a FieldChoice) -> Gallery<'a> {
        let mut all: Vec<f64> =
            scenes.iter().flat_map(|scene| &scene.values).copied().filter(|v| v.is_finite()).collect();
        let range = all.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(*v), h.max(*v)]);
        let (range, most) = if all.is_empty() { ([0.0; 2], [0.0; 2]) } else { (range, middle(&mut all)) };
        // A few extreme points, such as those under a point force, must not use up the colours.
        let [low, high] =
            if range[1] - range[0] > 1.5 * (most[1] - most[0]) && most[1] > most[0] { most } else { range };
        let map = ColourMap::over(low, high);
        let [low, high] = map.bounds();
        Gallery { scenes, field, map, beyond: [range[0] < low, range[1] > high], range }
    }

    /// Caption of the pictures, in HTML.
    pub fn caption(&self, naming: &Naming) -> String {
        let (title, unit) = (escape(&self.field.title()), naming.unit(self.field.quantity()));
        let with_domains = self.scenes.iter().any(Scene::has_domains);
        let with_points = self.scenes.iter().any(|scene| scene.radii.iter().any(|radius| *radius > 0.0));
        let in_space = self.scenes.iter().any(|scene| scene.space.is_some());
        let shapes = match (with_domains, with_points) {
            (true, true) if in_space => "domains of material points, or cubes for points without a domain",
            (false, true) if in_space => "material points, as cubes of their volume",
            (true, true) => "domains of material points, or discs for points without a domain",
            (true, false) => "domains of the material points",
            _ => "material points",
        };
        let mut text = format!("Deformed {shapes}, coloured by {title}");
        if self.scenes.iter().any(|scene| !scene.sides.is_empty()) {
            text.push_str(", over the active cells of the grid");
        }
        let unit = if unit.is_empty() { String::new() } else { format!("\u{a0}{}", escape(&unit)) };
        let _ = write!(text, ". Values from {} to {}{unit}", html(self.range[0], 4), html(self.range[1], 4));
        if self.beyond != [false, false] {
            text.push_str(
                "; values beyond the ends of the scale, less than 1\u{a0}% of all, have the colours \
                 of its ends",
            );
        }
        text.push('.');
        if let Some([low, high]) = self.scenes.last().and_then(|scene| scene.space) {
            let place = |x: [f64; 3]| x.map(|x| html(x, 4)).join(", ");
            let unit = escape(&naming.unit(Quantity::Length));
            let _ = write!(
                text,
                " The {}picture shows the box from ({}) to ({})\u{a0}{unit}.",
                if self.scenes.len() > 1 { "last " } else { "" },
                place(low),
                place(high)
            );
        }
        text
    }

    /// The pictures and their colour bar; `id` must differ from figure to figure.
    pub fn html(&self, naming: &Naming, id: &str) -> Result<String, ReportError> {
        let extent = self.scenes.iter().fold(NOWHERE, |extent, scene| around(extent, scene.extent()));
        if !extent.iter().flatten().all(|x| x.is_finite()) {
            return Ok(String::new());
        }
        let frame = Frame::new(extent, self.scenes.len());
        let class = match (frame.width < PAGE, self.scenes.len().is_multiple_of(2)) {
            (false, _) => "pictures",
            (true, true) => "pictures halves",
            (true, false) => "pictures halves odd",
        };
        let mut html = format!("<div class=\"{class}\">\n");
        for scene in self.scenes {
            html.push_str(&self.picture(scene, &frame, naming)?);
        }
        html.push_str(&self.colour_bar(naming, id));
        html.push_str("</div>\n");
        Ok(html)
    }

    fn picture(&self, scene: &Scene, frame: &Frame, naming: &Naming) -> Result<String, ReportError> {
        let png = self.raster(scene, frame).png().map_err(ReportError::from_reader)?;
        let [left, top, _] = MARGIN;
        let [width, height] = frame.size;
        let title = escape(&scene.title);
        let mut svg = format!(
            "<svg class=\"picture\" viewBox=\"0 0 {} {:.1}\" role=\"img\" aria-label=\"{} at {title}\">\n\
             <text class=\"over\" x=\"{left}\" y=\"15\">{title}</text>\n\
             <rect class=\"ground\" x=\"{left}\" y=\"{top}\" width=\"{width:.1}\" height=\"{height:.1}\"/>\n\
             <image x=\"{left}\" y=\"{top}\" width=\"{width:.1}\" height=\"{height:.1}\" preserveAspectRatio=\"none\" \
             href=\"data:image/png;base64,{}\"/>\n<g class=\"axes\">\n",
            frame.width,
            frame.height(),
            escape(&self.field.title()),
            STANDARD.encode(png),
        );
        match &scene.space {
            None => axes_in_plane(&mut svg, frame, naming),
            Some(_) => axes_in_space(&mut svg, frame),
        }
        svg.push_str("</g>\n</svg>\n");
        Ok(svg)
    }

    fn raster(&self, scene: &Scene, frame: &Frame) -> Raster {
        let pixels = frame.size.map(|length| (length * DENSITY).round() as usize);
        let mut raster = Raster::new(pixels[0], pixels[1]);
        let on_raster = |corners: &[[f64; 2]]| corners.iter().map(|c| frame.pixel(*c)).collect::<Vec<_>>();
        for [a, b] in &scene.sides {
            raster.line(frame.pixel(*a), frame.pixel(*b), 1.2, [128, 128, 128, 150]);
        }
        let opaque = |value: f64, shade: f64| {
            let [r, g, b] = self.map.colour(value).map(|c| (shade * f64::from(c)).round() as u8);
            [r, g, b, 255]
        };
        let mut area = 0.0;
        for Polygon { corners, .. } in &scene.domains {
            area += area_of(&on_raster(corners)).abs();
        }
        let outlined = area > OUTLINED * OUTLINED * scene.domains.len() as f64;
        for Polygon { corners, point, shade } in &scene.domains {
            let corners = on_raster(corners);
            raster.fill(&corners, opaque(scene.values[*point], *shade));
            if outlined && scene.space.is_some() {
                raster.outline(&corners, 0.7, OUTLINE); // nearer faces cover it
            }
        }
        if outlined && scene.space.is_none() {
            for Polygon { corners, .. } in &scene.domains {
                raster.outline(&on_raster(corners), 0.7, OUTLINE);
            }
        }
        let unit = frame.pixel([1.0, 0.0])[0] - frame.pixel([0.0, 0.0])[0];
        for ((position, radius), value) in scene.positions.iter().zip(&scene.radii).zip(&scene.values) {
            if *radius > 0.0 {
                raster.disc(frame.pixel(*position), (radius * unit).max(0.6), opaque(*value, 1.0));
            }
        }
        raster
    }

    fn colour_bar(&self, naming: &Naming, id: &str) -> String {
        const STOPS: usize = 32;
        let (width, left, right) = (400.0, 30.0, 370.0);
        let [low, high] = self.map.bounds();
        let scale = Scale::linear([low, high], [left, right], 5, false);
        let mut svg = format!(
            "<svg class=\"colour-bar\" viewBox=\"0 0 {width} 56\" role=\"img\" aria-label=\"colours\">\n\
             <defs><linearGradient id=\"{id}\">"
        );
        for stop in 0..=STOPS {
            let share = stop as f64 / STOPS as f64;
            let colour = hex(self.map.colour(low + share * (high - low)));
            let _ = write!(svg, "<stop offset=\"{share:.4}\" stop-color=\"{colour}\"/>");
        }
        let _ = writeln!(
            svg,
            "</linearGradient></defs>\n<rect x=\"{left}\" y=\"16\" width=\"{}\" height=\"12\" fill=\"url(#{id})\"/>",
            right - left
        );
        for (is_beyond, at, tip) in [(self.beyond[0], left, -9.0), (self.beyond[1], right, 9.0)] {
            let colour = hex(self.map.colour(if tip < 0.0 { low } else { high }));
            if is_beyond {
                let _ = writeln!(svg, "<path fill=\"{colour}\" d=\"M{at} 16l{tip} 6l{} 6z\"/>", -tip);
            }
        }
        svg.push_str("<g class=\"axes\">\n");
        for tick in &scale.ticks {
            let place = scale.place(tick.value);
            let _ = writeln!(
                svg,
                "<path class=\"tick\" d=\"M{place:.1} 28v5\"/><text class=\"x\" x=\"{place:.1}\" y=\"46\">{}</text>",
                tick.label
            );
        }
        let label = escape(&naming.label(&self.field.title(), self.field.quantity(), scale.power));
        let _ = writeln!(
            svg,
            "<text class=\"name x\" x=\"{}\" y=\"11\">{label}</text>\n</g>\n</svg>",
            width / 2.0
        );
        svg
    }
}

/// Ticks and names of x and y.
fn axes_in_plane(svg: &mut String, frame: &Frame, naming: &Naming) {
    let [left, top, _] = MARGIN;
    let ([width, height], [low, high]) = (frame.size, frame.extent);
    let (right, bottom) = (left + width, top + height);
    let x = Scale::linear([low[0], high[0]], [left, right], (width / 55.0) as usize, false);
    let y = Scale::linear([low[1], high[1]], [bottom, top], (height / 45.0) as usize, false);
    for tick in &x.ticks {
        let (place, line) = (x.place(tick.value), bottom + 18.0);
        let _ = writeln!(
            svg,
            "<path class=\"tick\" d=\"M{place:.1} {bottom:.1}v5\"/>\
             <text class=\"x\" x=\"{place:.1}\" y=\"{line:.1}\">{}</text>",
            tick.label
        );
    }
    for tick in &y.ticks {
        let place = y.place(tick.value);
        let _ = writeln!(
            svg,
            "<path class=\"tick\" d=\"M{left} {place:.1}h-5\"/><text class=\"y\" x=\"{}\" y=\"{:.1}\">{}</text>",
            left - 8.0,
            place + 4.0,
            tick.label
        );
    }
    let _ = writeln!(
        svg,
        "<text class=\"name x\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\
         <text class=\"name y\" transform=\"translate(13 {:.1}) rotate(-90)\">{}</text>",
        0.5 * (left + right),
        bottom + 36.0,
        escape(&naming.label("x", Quantity::Length, x.power)),
        0.5 * (top + bottom),
        escape(&naming.label("y", Quantity::Length, y.power)),
    );
}

/// The directions of the axes in the picture.
fn axes_in_space(svg: &mut String, frame: &Frame) {
    const LENGTH: f64 = 26.0;
    let view = View::new();
    let [left, top, _] = MARGIN;
    let foot = top + frame.size[1];
    let origin = [0.5 * left, foot];
    for (name, axis) in [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])] {
        let [u, v] = view.project(axis).map(|c| c * LENGTH);
        let _ = writeln!(
            svg,
            "<path class=\"tick\" d=\"M{:.1} {:.1}l{u:.1} {:.1}\"/>\
             <text class=\"x\" x=\"{:.1}\" y=\"{:.1}\">{name}</text>",
            origin[0],
            origin[1],
            -v,
            origin[0] + 1.35 * u,
            origin[1] - 1.35 * v + 4.0,
        );
    }
}

/// Signed area by the shoelace formula.
fn area_of(corners: &[[f64; 2]]) -> f64 {
    let cross = |k: usize| {
        let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
        a[0] * b[1] - a[1] * b[0]
    };
    0.5 * (0..corners.len()).map(cross).sum::<f64>()
}

/// Smallest and largest value after half a percent of all values is left out at each end.
fn middle(values: &mut [f64]) -> [f64; 2] {
    let last = values.len() - 1;
    let at = |share: f64| (share * last as f64).round() as usize;
    let (low, high) = (at(0.005), at(0.995));
    let low = *values.select_nth_unstable_by(low, f64::total_cmp).1;
    let high = *values.select_nth_unstable_by(high, f64::total_cmp).1;
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(values: Vec<f64>) -> Scene {
        let n = values.len();
        Scene {
            title: "step 1".to_owned(),
            positions: (0..n).map(|i| [i as f64, 0.0]).collect(),
            radii: vec![0.5; n],
            values,
            domains: Vec::new(),
            sides: vec![[[-0.5, -0.5], [9.5, -0.5]], [[9.5, -0.5], [9.5, 0.5]]],
            space: None,
        }
    }

    #[test]
    fn a_few_extreme_values_do_not_take_all_the_colours() {
        let field: FieldChoice = "von_mises_stress".parse().unwrap();
        let mut values: Vec<f64> = (0..1000).map(|i| f64::from(i) / 999.0).collect();
        values.push(50.0);
        let scenes = [scene(values)];
        let gallery = Gallery::new(&scenes, &field);
        assert_eq!(gallery.beyond, [true, true]);
        let [low, high] = gallery.map.bounds();
        assert!(low < 0.01 && (0.99..1.01).contains(&high), "{low} {high}");
        assert!(gallery.caption(&Naming::default()).contains("from 0 to 50\u{a0}stress; values beyond"));
        let scenes = [scene(vec![1.0, 2.0, 4.0])];
        let gallery = Gallery::new(&scenes, &field);
        assert_eq!((gallery.map.bounds(), gallery.beyond), ([1.0, 4.0], [false, false]));
    }

    #[test]
    fn pictures_have_equal_scales_along_both_axes() {
        let frame = Frame::new([[0.0, 0.0], [10.0, 1.0]], 1);
        let [a, b, c] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|p| frame.pixel(p));
        assert!(((b[0] - a[0]) - (a[1] - c[1])).abs() < 1e-9);
        assert_eq!(frame.width, PAGE);
        assert_eq!(Frame::new([[0.0, 0.0], [1.0, 1.0]], 3).width, HALF);
        let tall = Frame::new([[0.0, 0.0], [1.0, 100.0]], 1);
        assert!(tall.size[1] <= HIGHEST && tall.size[0] > 1.0);
    }

    #[test]
    fn a_picture_without_extent_is_left_out() {
        let field: FieldChoice = "von_mises_stress".parse().unwrap();
        let empty = Scene { sides: Vec::new(), ..scene(Vec::new()) };
        let scenes = [empty];
        assert_eq!(Gallery::new(&scenes, &field).html(&Naming::default(), "g").unwrap(), "");
    }

    #[test]
    fn points_and_cells_are_on_the_raster() {
        let field: FieldChoice = "von_mises_stress".parse().unwrap();
        let scenes = [scene((0..10).map(f64::from).collect())];
        let gallery = Gallery::new(&scenes, &field);
        let html = gallery.html(&Naming::default(), "g1").unwrap();
        assert!(html.contains("data:image/png;base64,iVBOR") && html.contains("url(#g1)"));
        assert!(html.contains(">von Mises stress [stress]</text>") && html.contains(">x [length]</text>"));
    }
}
