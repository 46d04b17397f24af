//! Colours for values: perceptually uniform maps, so that equal differences of a value look equally large.

/// A colour in sRGB.
pub(super) type Rgb = [u8; 3];

/// viridis, by Stéfan van der Walt and Nathaniel Smith (CC0), at 33 equally spaced values.
const VIRIDIS: [u32; 33] = [
    0x440154, 0x470d60, 0x48186a, 0x482374, 0x472d7b, 0x453781, 0x424086, 0x3e4989, 0x3b528b, 0x375b8d,
    0x33638d, 0x2f6b8e, 0x2c728e, 0x297a8e, 0x26828e, 0x23898e, 0x21918c, 0x1f988b, 0x1fa088, 0x22a785,
    0x28ae80, 0x32b67a, 0x3fbc73, 0x4ec36b, 0x5ec962, 0x70cf57, 0x84d44b, 0x98d83e, 0xaddc30, 0xc2df23,
    0xd8e219, 0xece51b, 0xfde725,
];

/// A map from values to colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ColourMap {
    low: f64,
    high: f64,
    diverging: bool,
}

impl ColourMap {
    /// A map over a range of values. If the range has a negative and a positive part, and the shorter is more than 5 %
    /// of the longer, negative values are blue, positive ones red, and the range is made symmetric.
    pub fn over(low: f64, high: f64) -> ColourMap {
        let diverging = low < 0.0 && high > 0.0 && low.abs().min(high) > 0.05 * low.abs().max(high);
        let (low, high) = if diverging { (-high.max(-low), high.max(-low)) } else { (low, high) };
        ColourMap { low, high, diverging }
    }

    /// The values at the ends of the map.
    pub fn bounds(&self) -> [f64; 2] {
        [self.low, self.high]
    }

    /// The colour of a value; values beyond the ends have the colours of the ends.
    pub fn colour(&self, value: f64) -> Rgb {
        let span = self.high - self.low;
        let share = if span > 0.0 { ((value - self.low) / span).clamp(0.0, 1.0) } else { 0.5 };
        if self.diverging { blue_to_red(2.0 * share - 1.0) } else { viridis(share) }
    }
}

fn viridis(share: f64) -> Rgb {
    let place = share * (VIRIDIS.len() - 1) as f64;
    let below = (place as usize).min(VIRIDIS.len() - 2);
    let weight = place - below as f64;
    let channel = |colour: u32, shift: u32| f64::from(colour >> shift & 0xff);
    [16, 8, 0].map(|shift| {
        let (a, b) = (channel(VIRIDIS[below], shift), channel(VIRIDIS[below + 1], shift));
        (a + weight * (b - a)).round() as u8
    })
}

/// From blue at −1 through a pale grey at 0 to red at 1: lightness falls evenly towards both ends, in OkLab.
fn blue_to_red(side: f64) -> Rgb {
    let strength = side.abs();
    let (hue, chroma) = if side < 0.0 { (255f64, 0.135) } else { (32.0, 0.165) };
    let hue = hue.to_radians();
    // The colours in between must stay inside sRGB, which is narrow near white.
    let chroma = chroma * (1.6 * strength - 0.6 * strength * strength);
    from_oklab([0.93 - 0.48 * strength, chroma * hue.cos(), chroma * hue.sin()])
}

/// OkLab (Björn Ottosson, 2020) to sRGB.
fn from_oklab([l, a, b]: [f64; 3]) -> Rgb {
    let cones = [
        l + 0.396_337_777_4 * a + 0.215_803_757_3 * b,
        l - 0.105_561_345_8 * a - 0.063_854_172_8 * b,
        l - 0.089_484_177_5 * a - 1.291_485_548 * b,
    ]
    .map(|c| c * c * c);
    let linear = |r: [f64; 3]| r[0] * cones[0] + r[1] * cones[1] + r[2] * cones[2];
    [
        linear([4.076_741_662_1, -3.307_711_591_3, 0.230_969_929_2]),
        linear([-1.268_438_004_6, 2.609_757_401_1, -0.341_319_396_5]),
        linear([-0.004_196_086_3, -0.703_418_614_7, 1.707_614_701]),
    ]
    .map(|c| {
        let coded = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        (255.0 * coded).round().clamp(0.0, 255.0) as u8
    })
}

/// A colour in the notation of HTML.
pub(super) fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE lightness L*, 0 to 100.
    fn lightness(colour: Rgb) -> f64 {
        let linear = colour.map(|c| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        });
        let y = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
        if y > 0.008_856 { 116.0 * y.cbrt() - 16.0 } else { 903.3 * y }
    }

    /// Asserts that lightness changes by about the same amount in each of `steps` steps.
    fn assert_even(colour: impl Fn(f64) -> Rgb, steps: usize) {
        let at = |index: usize| lightness(colour(index as f64 / steps as f64));
        let mean = (at(steps) - at(0)) / steps as f64;
        for index in 0..steps {
            let change = at(index + 1) - at(index);
            assert!((change / mean - 1.0).abs() < 0.35, "{index}: {change} of {mean}");
        }
    }

    #[test]
    fn lightness_is_even() {
        assert_even(viridis, 16);
        assert_even(blue_to_red, 12);
        assert_even(|share| blue_to_red(-share), 12);
        let ends = [blue_to_red(-1.0), blue_to_red(1.0)].map(lightness);
        assert!((ends[0] - ends[1]).abs() < 5.0, "{ends:?}");
    }

    #[test]
    fn maps_fit_the_values() {
        let stress = ColourMap::over(-2.0, 1.0);
        assert_eq!(stress.bounds(), [-2.0, 2.0]);
        let [r, g, b] = stress.colour(0.0);
        assert!(r.abs_diff(g) < 12 && g.abs_diff(b) < 12, "zero is grey");
        let [r, _, b] = stress.colour(-2.0);
        assert!(b > r);
        assert_eq!(stress.colour(9.0), stress.colour(2.0));
        let positive = ColourMap::over(-0.01, 1.0);
        assert_eq!(positive.bounds(), [-0.01, 1.0]);
        assert_eq!(hex(positive.colour(1.0)), "#fde725");
        assert_eq!(hex(positive.colour(-0.01)), "#440154");
        // A range of a single value.
        assert_eq!(ColourMap::over(3.0, 3.0).colour(3.0), viridis(0.5));
    }
}
