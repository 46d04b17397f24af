//! A picture of filled polygons, as a PNG file.

use std::io;

/// Samples per pixel along each axis, which smooth edges without seams between polygons that share a side.
const SAMPLES: usize = 3;

/// A colour in sRGB with its opacity.
pub(super) type Rgba = [u8; 4];

/// A picture under construction; transparent where nothing has been drawn. Positions are in pixels from the upper left
/// corner.
pub(super) struct Raster {
    width: usize,
    height: usize,
    /// Row by row, `SAMPLES` rows and columns per pixel.
    samples: Vec<Rgba>,
}

impl Raster {
    /// An empty picture of at least one pixel.
    pub fn new(width: usize, height: usize) -> Raster {
        let (width, height) = (width.max(1), height.max(1));
        Raster { width, height, samples: vec![[0; 4]; width * height * SAMPLES * SAMPLES] }
    }

    /// Fills a polygon, given in either sense. A sample on a side shared with a neighbour belongs to exactly one of the
    /// two. A polygon that covers no sample marks the sample at its first corner.
    pub fn fill(&mut self, corners: &[[f64; 2]], colour: Rgba) {
        if corners.len() < 3 || corners.iter().flatten().any(|c| !c.is_finite()) {
            return;
        }
        let scaled = |k: usize| corners[k % corners.len()].map(|c| c * SAMPLES as f64);
        let (columns, rows) = (self.width * SAMPLES, self.height * SAMPLES);
        let heights = (0..corners.len()).map(|k| scaled(k)[1]);
        let top = heights.clone().fold(f64::INFINITY, f64::min);
        let bottom = heights.fold(f64::NEG_INFINITY, f64::max);
        let first = (top - 0.5).ceil().max(0.0) as usize;
        let last = ((bottom - 0.5).ceil().max(0.0) as usize).min(rows);
        let mut filled = false;
        let mut crossings: Vec<f64> = Vec::with_capacity(4);
        for row in first..last {
            let y = row as f64 + 0.5;
            crossings.clear();
            for k in 0..corners.len() {
                let (a, b) = (scaled(k), scaled(k + 1));
                if (a[1] <= y) != (b[1] <= y) {
                    crossings.push(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
                }
            }
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let begin = (pair[0] - 0.5).ceil().max(0.0) as usize;
                let end = ((pair[1] - 0.5).ceil().max(0.0) as usize).min(columns);
                for column in begin..end {
                    filled = true;
                    blend(&mut self.samples[row * columns + column], colour);
                }
            }
        }
        if !filled {
            let [x, y] = scaled(0);
            if x >= 0.0 && y >= 0.0 && (x as usize) < columns && (y as usize) < rows {
                blend(&mut self.samples[y as usize * columns + x as usize], colour);
            }
        }
    }

    /// Draws a straight line.
    pub fn line(&mut self, a: [f64; 2], b: [f64; 2], width: f64, colour: Rgba) {
        let along = [b[0] - a[0], b[1] - a[1]];
        let length = along[0].hypot(along[1]);
        if length > 0.0 {
            let side = [-along[1], along[0]].map(|c| 0.5 * width * c / length);
            let moved = |p: [f64; 2], s: f64| [p[0] + s * side[0], p[1] + s * side[1]];
            self.fill(&[moved(a, 1.0), moved(b, 1.0), moved(b, -1.0), moved(a, -1.0)], colour);
        }
    }

    /// Draws a closed line around a polygon.
    pub fn outline(&mut self, corners: &[[f64; 2]], width: f64, colour: Rgba) {
        for k in 0..corners.len() {
            self.line(corners[k], corners[(k + 1) % corners.len()], width, colour);
        }
    }

    /// Fills a circle.
    pub fn disc(&mut self, centre: [f64; 2], radius: f64, colour: Rgba) {
        const CORNERS: usize = 12;
        let corner = |k: usize| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / CORNERS as f64).sin_cos();
            [centre[0] + radius * cos, centre[1] + radius * sin]
        };
        let corners: [[f64; 2]; CORNERS] = std::array::from_fn(corner);
        self.fill(&corners, colour);
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// If it is too large to be encoded.
    pub fn png(&self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let too_large = |_| io::Error::other("the picture is too large");
        let size = |n: usize| u32::try_from(n).map_err(too_large);
        let mut encoder = png::Encoder::new(&mut bytes, size(self.width)?, size(self.height)?);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header().map_err(io::Error::other)?;
        writer.write_image_data(&self.pixels()).map_err(io::Error::other)?;
        writer.finish().map_err(io::Error::other)?;
        Ok(bytes)
    }

    /// Means of the samples of each pixel.
    fn pixels(&self) -> Vec<u8> {
        let mut pixels = Vec::with_capacity(4 * self.width * self.height);
        let columns = self.width * SAMPLES;
        for row in 0..self.height {
            for column in 0..self.width {
                let mut sum = [0u32; 4];
                for y in 0..SAMPLES {
                    let begin = (row * SAMPLES + y) * columns + column * SAMPLES;
                    for [r, g, b, a] in &self.samples[begin..begin + SAMPLES] {
                        let a = u32::from(*a);
                        sum[3] += a;
                        for (sum, channel) in sum.iter_mut().zip([r, g, b]) {
                            *sum += u32::from(*channel) * a;
                        }
                    }
                }
                let opacity = sum[3].max(1);
                pixels.extend(sum[..3].iter().map(|c| ((c + opacity / 2) / opacity) as u8));
                pixels.push((sum[3] / (SAMPLES * SAMPLES) as u32) as u8);
            }
        }
        pixels
    }
}

/// Blends a colour over another.
fn blend(under: &mut Rgba, over: Rgba) {
    if over[3] == 255 {
        *under = over;
        return;
    }
    let (front, back) = (f64::from(over[3]) / 255.0, f64::from(under[3]) / 255.0);
    let opacity = front + back * (1.0 - front);
    if opacity > 0.0 {
        for k in 0..3 {
            let mixed = f64::from(over[k]) * front + f64::from(under[k]) * back * (1.0 - front);
            under[k] = (mixed / opacity).round() as u8;
        }
        under[3] = (255.0 * opacity).round() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Rgba = [255, 0, 0, 255];
    const BLUE: Rgba = [0, 0, 255, 255];

    fn pixel(raster: &Raster, x: usize, y: usize) -> Vec<u8> {
        let begin = 4 * (y * raster.width + x);
        raster.pixels()[begin..begin + 4].to_vec()
    }

    #[test]
    fn polygons_fill_what_they_cover() {
        let mut raster = Raster::new(4, 2);
        raster.fill(&[[1.0, 0.0], [2.5, 0.0], [2.5, 2.0], [1.0, 2.0]], RED);
        assert_eq!(pixel(&raster, 0, 0), [0, 0, 0, 0]);
        assert_eq!(pixel(&raster, 1, 1), RED);
        assert_eq!(pixel(&raster, 2, 0)[3], 85, "one of three columns of samples");
        assert_eq!(pixel(&raster, 3, 0), [0, 0, 0, 0]);
    }

    #[test]
    fn neighbours_leave_no_seam_and_do_not_overlap() {
        // A fan of triangles around a point that lies on no sample, in either sense.
        let centre = [10.3, 9.7];
        let rim = |k: usize| {
            let (sin, cos) = (k as f64 * 0.7 + 0.1).sin_cos();
            [10.0 + 40.0 * cos, 10.0 + 40.0 * sin]
        };
        let mut raster = Raster::new(20, 20);
        for k in 0..9 {
            let next = if k == 8 { rim(0) } else { rim(k + 1) };
            // Half opaque: a sample covered twice would be darker, one not covered lighter.
            let corners = if k % 2 == 0 { [centre, rim(k), next] } else { [next, rim(k), centre] };
            raster.fill(&corners, [0, 0, 0, 128]);
        }
        assert!(raster.samples.iter().all(|sample| sample[3] == 128));
    }

    #[test]
    fn tiny_or_outside_polygons_are_harmless() {
        let mut raster = Raster::new(3, 3);
        raster.fill(&[[1.51, 1.51], [1.52, 1.51], [1.52, 1.52]], RED);
        assert_eq!(pixel(&raster, 1, 1)[3], 28, "one sample of nine");
        raster.fill(&[[-50.0, -50.0], [-40.0, -50.0], [-40.0, -40.0]], RED);
        raster.fill(&[[f64::NAN, 0.0], [1.0, 1.0], [0.0, 1.0]], RED);
        raster.fill(&[[-1e300, -1e300], [1e300, -1e300], [0.0, 1e300]], BLUE);
        raster.disc([1e9, 1e9], 2.0, RED);
        raster.outline(&[[0.0, 0.0], [0.0, 0.0]], 1.0, RED);
        assert!(raster.png().unwrap().starts_with(b"\x89PNG"));
    }

    #[test]
    fn colours_are_laid_over_each_other() {
        let mut under = BLUE;
        blend(&mut under, [255, 0, 0, 51]);
        assert_eq!(under, [51, 0, 204, 255]);
        let mut nothing = [0; 4];
        blend(&mut nothing, [10, 20, 30, 100]);
        assert_eq!(nothing, [10, 20, 30, 100]);
    }
}
