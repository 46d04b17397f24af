//! Tables of element tests: the histories that they follow, and their states.

use std::io;
use std::path::Path;

use mpm_core::element_test::{ElementState, Target};
use mpm_core::material::Material;
use mpm_core::tensor::Sym3;

use super::table::{Columns, Entry, text_of};

/// Beginning of the first line of a table of states, by which it is recognised.
pub const FIRST_COLUMNS: &str = "step,strain_xx,strain_yy,strain_zz,strain_xy,";

/// Components of a symmetric tensor in a history, in the Mandel order.
const COMPONENTS: [&str; 6] = ["xx", "yy", "zz", "yz", "xz", "xy"];

/// The quantity that a history prescribes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prescribed {
    /// e in F = exp(e), measured from the start, [-].
    Strain,
    /// Principal Cauchy stresses along the axes, positive in tension, [stress].
    Stress,
}

impl Prescribed {
    fn name(self) -> &'static str {
        match self {
            Prescribed::Strain => "strain",
            Prescribed::Stress => "stress",
        }
    }
}

/// Reads a history, one row per target. The columns `xx`, `yy`, `zz`, `yz`, `xz` and `xy` may be in any order;
/// components without a column are zero.
///
/// # Errors
/// A file-system error; `InvalidData`, naming the file and, if known, the line, if the table is damaged or has no rows,
/// if a column is not listed above or occurs twice, if an entry is missing, or if a shear stress in a stress history is
/// not zero.
pub fn read_history(path: &Path, prescribed: Prescribed) -> io::Result<Vec<Target>> {
    let table = Columns::read_foreign(path)?;
    targets(&table, prescribed)
        .map_err(|what| io::Error::new(io::ErrorKind::InvalidData, format!("{}: {what}", path.display())))
}

fn targets(table: &Columns, prescribed: Prescribed) -> Result<Vec<Target>, String> {
    let name = prescribed.name();
    for (index, column) in table.names().iter().enumerate() {
        let known = "the columns are `xx`, `yy`, `zz`, `yz`, `xz` and `xy`, separated by commas";
        if !COMPONENTS.contains(&column.as_str()) {
            return Err(format!("line 1: the {name} has no component {column:?}; {known}"));
        }
        if table.names()[..index].contains(column) {
            return Err(format!("line 1: there are two columns `{column}`; remove one"));
        }
    }
    if table.rows() == 0 {
        return Err(format!("there are no rows; give one per target of the {name}"));
    }
    (0..table.rows()).map(|row| target(table, prescribed, row)).collect()
}

fn target(table: &Columns, prescribed: Prescribed, row: usize) -> Result<Target, String> {
    let line = row + 2;
    let mut values = [0.0; 6];
    for (value, component) in values.iter_mut().zip(COMPONENTS) {
        if let Some(column) = table.column(component) {
            *value = column[row];
        }
        if value.is_nan() {
            return Err(format!("line {line}: there is no value of `{component}`; give a number"));
        }
    }
    let [xx, yy, zz, shears @ ..] = values;
    match prescribed {
        Prescribed::Strain => Ok(Target { shears, ..Target::strain(&Sym3([xx, yy, zz, 0.0, 0.0, 0.0])) }),
        Prescribed::Stress if shears == [0.0; 3] => Ok(Target::stress([xx, yy, zz])),
        Prescribed::Stress => {
            Err(format!("line {line}: shear stresses must be 0; give the principal stresses along the axes"))
        }
    }
}

/// The table of states of an element test: step, strain and stress, invariants, history variables and energies. The
/// components yz and xz are included if one of these strains is non-zero in any state. If a jump has led to one
/// or more of the states, a column `jump` is added, which is 1 for these states.
///
/// # Errors
/// `InvalidInput` if a history variable of the law has the name of another column, or if a number is not finite.
pub fn table(law: &dyn Material, states: &[ElementState]) -> io::Result<String> {
    let has_shear = |state: &ElementState| state.strain.0[3] != 0.0 || state.strain.0[4] != 0.0;
    let in_space = states.iter().any(has_shear);
    let jumps = states.iter().any(|state| state.has_jumped);
    let mut columns = columns(law, in_space);
    columns.extend(jumps.then(|| "jump".to_owned()));
    let rows = states.iter().enumerate().map(|(step, state)| {
        let mut entries = row(law, step, state, in_space);
        entries.extend(jumps.then(|| Entry::from(i64::from(state.has_jumped))));
        entries
    });
    text_of(&columns, rows)
}

/// The first column of the table in which a state has a number that is not finite; `None` if all are finite.
pub fn infinite(law: &dyn Material, state: &ElementState) -> Option<String> {
    let is_infinite = |entry: &Entry| matches!(entry, Entry::Number(value) if !value.is_finite());
    let column = row(law, 0, state, true).iter().position(is_infinite)?;
    columns(law, true).into_iter().nth(column)
}

fn columns(law: &dyn Material, in_space: bool) -> Vec<String> {
    let tensor =
        |symbol: &str| components(in_space).map(|(name, _)| format!("{symbol}_{name}")).collect::<Vec<_>>();
    let named = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<String>>();
    let mut columns = named(&["step"]);
    columns.extend(tensor("strain"));
    columns.extend(named(&["volumetric_strain", "J"]));
    columns.extend(tensor("stress"));
    columns.extend(named(&["pressure", "deviatoric_stress"]));
    columns.extend(named(&["axial_strain", "shear_strain", "deviatoric_strain"]));
    columns.extend(law.state_fields().iter().map(|field| field.name.clone().into_owned()));
    if !has_plastic_work(law) {
        columns.extend(named(&["plastic_work"]));
    }
    columns.extend(named(&["energy"]));
    columns
}

/// True if the plastic work is a history variable of the law and therefore already has a column.
fn has_plastic_work(law: &dyn Material) -> bool {
    law.state_fields().iter().any(|field| field.name == "plastic_work")
}

fn row(law: &dyn Material, step: usize, state: &ElementState, in_space: bool) -> Vec<Entry> {
    let entries = |tensor: Sym3| components(in_space).map(move |(_, (i, j))| tensor.component(i, j));
    let mut values: Vec<f64> = entries(state.logarithmic_strain()).collect();
    values.extend([state.log_volume_ratio(), state.volume_ratio()]);
    values.extend(entries(state.cauchy_stress()));
    values.extend([state.pressure(), state.deviatoric_stress()]);
    values.extend([-state.strain.0[1], state.shear, state.deviatoric_strain()]);
    values.extend(&state.history);
    if !has_plastic_work(law) {
        values.push(law.plastic_work(&state.history));
    }
    values.push(law.energy(&state.elastic_strain, &state.history));
    // Adding 0 removes the sign of zeros.
    let numbers = values.into_iter().map(|value| Entry::Number(value + 0.0));
    std::iter::once(Entry::from(step as i64)).chain(numbers).collect()
}

/// Names and indices of the components of a tensor in the table.
fn components(in_space: bool) -> impl Iterator<Item = (&'static str, (usize, usize))> {
    let all =
        [("xx", (0, 0)), ("yy", (1, 1)), ("zz", (2, 2)), ("xy", (0, 1)), ("yz", (1, 2)), ("xz", (0, 2))];
    all.into_iter().take(if in_space { 6 } else { 4 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mpm_core::element_test::{Control, ElementTest};
    use mpm_core::material::{MaterialError, Response, StateField, VonMises};

    fn read(text: &str, prescribed: Prescribed) -> Result<Vec<Target>, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("history.csv");
        std::fs::write(&path, text).unwrap();
        read_history(&path, prescribed).map_err(|error| error.to_string())
    }

    #[test]
    fn histories_have_named_components() {
        let strains = read("xy,yy\n0.1,-0.2\n0,0", Prescribed::Strain).unwrap();
        assert_eq!(strains[0].shears, [0.0, 0.0, 0.1]);
        assert_eq!(strains[0].axes, [0.0, -0.2, 0.0].map(Control::Strain));
        assert_eq!(strains[1], Target::strain(&Sym3::ZERO));
        let stresses = read("zz, xx ,yy, xy\r\n-3,-1,-2,0\r\n", Prescribed::Stress).unwrap();
        assert_eq!(stresses, [Target::stress([-1.0, -2.0, -3.0])]);
    }

    #[test]
    fn faults_of_a_history_name_the_line() {
        for (text, complaint) in [
            ("time,yy\n1,2\n", "line 1: the stress has no component \"time\"; the columns are `xx`"),
            ("xx,xx\n1,2\n", "line 1: there are two columns `xx`"),
            ("xx,yy\n", "there are no rows"),
            ("", "the file is empty"),
            ("xx,yy\n1,2\n1,\n", "line 3: there is no value of `yy`"),
            ("xx,yy\n1,inf\n", "line 2: \"inf\" is not a number"),
            ("xx,xy\n1,0\n1,2\n", "line 3: shear stresses must be 0"),
        ] {
            let error = read(text, Prescribed::Stress).unwrap_err();
            assert!(error.contains("history.csv: ") && error.contains(complaint), "{text:?}: {error}");
        }
    }

    #[test]
    fn a_table_has_one_value_per_column() {
        let law = VonMises::new(1e6, 0.3, 20e3);
        let states = |e: Sym3| {
            let test = ElementTest::new(&law, &[0.0], &Sym3::ZERO).unwrap();
            let start = test.state().clone();
            [start, test.follow([Target::strain(&e)], 1).next().unwrap().unwrap()]
        };
        let plane = table(&law, &states(Sym3([0.0, -0.1, 0.0, 0.0, 0.0, 0.01]))).unwrap();
        assert!(plane.starts_with(FIRST_COLUMNS));
        let header = "step,strain_xx,strain_yy,strain_zz,strain_xy,volumetric_strain,J,stress_xx,stress_yy,stress_zz,\
                      stress_xy,pressure,deviatoric_stress,axial_strain,shear_strain,deviatoric_strain,\
                      equivalent_plastic_strain,plastic_work,energy";
        assert_eq!(plane.lines().next(), Some(header));
        assert_eq!(plane.lines().nth(1), Some("0,0,0,0,0,0,1,0,0,0,0,0,0,0,0,0,0,0,0"));
        assert_eq!(plane.lines().count(), 3);
        let space = table(&law, &states(Sym3([0.0, -0.1, 0.0, 0.01, 0.0, 0.0]))).unwrap();
        assert!(space.starts_with("step,strain_xx,strain_yy,strain_zz,strain_xy,strain_yz,strain_xz,vol"));
        assert!(space.lines().all(|line| line.split(',').count() == 23));
    }
    /// A law that accumulates its plastic work.
    #[derive(Debug)]
    struct Accumulating(VonMises, [StateField; 2]);

    impl Material for Accumulating {
        fn state_fields(&self) -> &[StateField] {
            &self.1
        }

        fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
            let response = self.0.update(trial, &old[..1], &mut new[..1])?;
            new[1] = self.0.plastic_work(&new[..1]);
            Ok(response)
        }

        fn elastic_strain(&self, tau: &Sym3, history: &[f64]) -> Result<Sym3, MaterialError> {
            self.0.elastic_strain(tau, history)
        }

        fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64 {
            self.0.energy(elastic_strain, history)
        }
    }

    #[test]
    fn a_plastic_work_in_the_history_has_one_column() {
        let fields =
            ["equivalent_plastic_strain", "plastic_work"].map(|name| StateField::new(name, "-", 0.0));
        let law = Accumulating(VonMises::new(1e6, 0.3, 20e3), fields);
        let test = ElementTest::new(&law, &[0.0; 2], &Sym3::ZERO).unwrap();
        let e = Sym3([0.0, -0.1, 0.0, 0.0, 0.0, 0.0]);
        let state = test.follow([Target::strain(&e)], 1).next().unwrap().unwrap();
        let text = table(&law, std::slice::from_ref(&state)).unwrap();
        let (names, values) = text.trim_end().split_once('\n').unwrap();
        assert!(names.ends_with(",equivalent_plastic_strain,plastic_work,energy"), "{names}");
        let work = values.split(',').nth_back(1).unwrap().parse::<f64>().unwrap();
        assert!(work > 1e3 && work == state.history[1], "{values}");
    }
}
