//! Cost of writing results.

use std::path::Path;

use mpm::output::vtu::{CellKind, Field, Kinds, Mesh, SYMMETRIC_TENSOR, TENSOR, VECTOR, Values, write};

use crate::clock::{exponent, least};
use crate::point::numbers;

/// Numbers per point in the file: position, displacement, stress, deformation gradient and volume.
const NUMBERS: usize = 3 + 3 + 6 + 9 + 1;

/// Prints the cost of writing points with their fields.
pub fn print(directory: &Path) -> std::io::Result<()> {
    println!(
        "\n## Output\n\n| Points | per point (µs) | MB/s before compression | growth |\n|---|---|---|---|"
    );
    let mut measured = Vec::new();
    for n in [1_000, 10_000, 100_000] {
        let seconds = seconds(directory, n)?;
        measured.push((n as f64, seconds));
        let speed = (n * NUMBERS * size_of::<f64>()) as f64 / seconds * 1e-6;
        let growth =
            if measured.len() > 1 { format!("{:.2}", exponent(&measured)) } else { "–".to_owned() };
        println!("| {n} | {:.2} | {speed:.0} | {growth} |", seconds / n as f64 * 1e6);
    }
    Ok(())
}

fn seconds(directory: &Path, n: usize) -> std::io::Result<f64> {
    let mut number = numbers();
    // Smooth fields whose digits are all significant, as in computed fields.
    let mut field = |components: usize| -> Vec<f64> {
        let phase = number();
        (0..n * components)
            .map(|k| (phase + (k / components) as f64 * 1e-3 + (k % components) as f64).sin())
            .collect()
    };
    let places: Vec<[f64; 3]> = field(3).as_chunks().0.to_vec();
    let fields = [
        ("displacement", &VECTOR[..]),
        ("cauchy_stress", &SYMMETRIC_TENSOR),
        ("f", &TENSOR),
        ("volume", &[]),
    ]
    .map(|(name, components)| (name, components, field(components.len().max(1))));
    let data: Vec<Field> = fields
        .iter()
        .map(|(name, components, values)| Field {
            name,
            components: components.len().max(1),
            component_names: components,
            values: Values::Float64(values),
        })
        .collect();
    let connectivity: Vec<i64> = (0..n as i64).collect();
    let mesh = Mesh { points: &places, kinds: Kinds::All(CellKind::Vertex), connectivity: &connectivity };
    let path = directory.join("points.vtu");
    let mut outcome = Ok(());
    let seconds = least(|| {
        if let Err(error) = write(&path, 0.0, 0, &mesh, &data, &[]) {
            outcome = Err(error);
        }
    });
    outcome.map(|()| seconds)
}
