//! `mpm element`: drives one point of a material in a deck along a strain or stress path.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use crate::appendix::{self, ElementReport, Units};
use crate::deck::CellSize;
use crate::deck::diagnostic::render_all;
use crate::deck::load::{LoadedDeck, load};
use crate::deck::quoting::{list, quote};
use crate::deck::references::{Noun, known_names};
use crate::element_test::{self, ElementState, ElementTest, ElementTestError, Target};
use crate::material::{Material, MaterialError};
use crate::output::element_test::{FIRST_COLUMNS, Prescribed, infinite, read_history, table};
use crate::output::replace::replace_file;
use crate::program::commands::arguments::{LibraryArgs, assignment};
use crate::program::commands::overwriting::{REPORT, may_be_replaced};
use crate::program::exit::{DONE, FAILED, USAGE};
use crate::program::paths::real;
use crate::program::screen::print::print;
use crate::tensor::Sym3;
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};

/// Largest number of steps from one turning point, or row of a history, to the next.
const MAX_STEPS: u64 = 1_000_000;
/// Largest number of states in a test; all of them are held in memory.
const MAX_STATES: usize = 10_000_000;
/// Default number of steps from one turning point to the next.
const USUAL_STEPS: u64 = 200;

/// Arguments of `mpm element`.
#[derive(Args)]
pub struct ElementArgs {
    /// The deck, a YAML file.
    deck: PathBuf,
    /// Set a parameter of the deck; may be given several times.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    set: Vec<(String, String)>,
    #[command(flatten)]
    libraries: LibraryArgs,
    /// Material to test [default: the only material of the deck].
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// Path of the test; y is the axial direction.
    #[arg(long, value_name = "PATH")]
    path: PathName,
    /// Lateral Cauchy stress at the start, positive in compression; with --k0 1, the stress is isotropic.
    #[arg(long, value_name = "PRESSURE", default_value = "0", value_parser = finite, allow_hyphen_values = true)]
    confining: f64,
    /// Ratio of the lateral to the axial stress at the start.
    #[arg(long, value_name = "K", default_value = "1", value_parser = positive)]
    k0: f64,
    /// Final strain: axial compression, γ for simple shear, or −ln J for isotropic compression.
    #[arg(long, value_name = "STRAIN", value_parser = finite, allow_hyphen_values = true)]
    to: Option<f64>,
    /// Strain to reach after --to; may be given several times.
    #[arg(long, value_name = "STRAIN", requires = "to", value_parser = finite, allow_hyphen_values = true)]
    then: Vec<f64>,
    /// Number of equal steps to each strain [default: 200], or from each row of a history to the next [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_STEPS))]
    steps: Option<u64>,
    /// Original position of the point, for a material whose properties vary in space.
    #[arg(long, value_name = "X,Y[,Z]", value_parser = finite, value_delimiter = ',', allow_hyphen_values = true)]
    at: Option<Vec<f64>>,
    /// In simple shear, hold the normal stress along y constant instead of the height.
    #[arg(long)]
    constant_normal_stress: bool,
    /// History for the paths `strain` and `stress`: a CSV file with columns xx, yy, zz, yz, xz, xy.
    #[arg(long, value_name = "HISTORY.csv")]
    file: Option<PathBuf>,
    /// Table to write [default: DECK-MATERIAL-PATH.csv]; `-` means standard output.
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write stress-strain curves as a single HTML page [default name: DECK-MATERIAL-PATH.html].
    #[arg(long, value_name = "FILE.html", num_args = 0..=1)]
    report: Option<Option<PathBuf>>,
    /// The deck's units of length, force and time, to show on the page, for example m,kN,s.
    #[arg(long, value_name = "LENGTH,FORCE,TIME", requires = "report")]
    units: Option<Units>,
}

/// Name of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PathName {
    /// Axial compression without lateral strain.
    Oedometer,
    /// Equal strains in all directions.
    Isotropic,
    /// Axial compression at constant lateral stress.
    TriaxialDrained,
    /// Axial compression at constant volume.
    TriaxialUndrained,
    /// Axial compression in plane strain at constant stress along x.
    Biaxial,
    /// Simple shear at constant height, or at constant normal stress.
    SimpleShear,
    /// A history of strains from a file.
    Strain,
    /// A history of principal stresses from a file.
    Stress,
}

impl PathName {
    /// Name on the command line and in file names.
    fn word(self) -> &'static str {
        match self {
            PathName::Oedometer => "oedometer",
            PathName::Isotropic => "isotropic",
            PathName::TriaxialDrained => "triaxial-drained",
            PathName::TriaxialUndrained => "triaxial-undrained",
            PathName::Biaxial => "biaxial",
            PathName::SimpleShear => "simple-shear",
            PathName::Strain => "strain",
            PathName::Stress => "stress",
        }
    }
}

fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err("expected a number, for example 0.2 or 100e3".to_owned()),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    finite(text).and_then(|value| match value > 0.0 {
        true => Ok(value),
        false => Err("expected a number above 0".to_owned()),
    })
}

/// The route that the point follows.
enum Route {
    /// A path through turning points.
    Path(element_test::Path, Vec<f64>),
    /// The rows of a file.
    History(Vec<Target>),
}

/// Drives the point along the path, and writes the table and the page.
pub fn element(args: ElementArgs) -> anyhow::Result<u8> {
    let route = route(&args)?;
    let loaded = match load(&args.deck, &args.set) {
        Ok(mut loaded) => {
            args.libraries.allow(&mut loaded);
            loaded
        }
        Err(failure) => {
            message!("{}", failure.render(std::io::stderr().is_terminal()).trim_end());
            return Ok(USAGE);
        }
    };
    let name = material_name(&loaded, args.material.as_deref())?;
    let Some((law, history)) = beginning(&loaded, name, args.at.as_deref())? else { return Ok(USAGE) };
    let outputs = Outputs::chosen(&args, name)?;
    if let Some(note) = softening(&loaded, name) {
        message!("note: {note}");
    }

    let stress = Sym3([-args.confining, -args.confining / args.k0, -args.confining, 0.0, 0.0, 0.0]);
    let test = ElementTest::new(law.as_ref(), &history, &stress).map_err(initial_failure)?;
    if test.was_returned() {
        let [x, y, ..] = test.initial_stress().0;
        message!(
            "note: the initial stress is outside the yield surface; the test begins with σ_xx = σ_zz = {x:.6e} and σ_yy = \
             {y:.6e}"
        );
    }
    let (states, failure) = states(law.as_ref(), test, &route, args.steps)?;

    let text = table(law.as_ref(), &states)?;
    match &outputs.table {
        None => {
            print(&text)?;
        }
        Some(path) => {
            replace_file(path, |out| out.write_all(text.as_bytes()))
                .context("the table cannot be written")?;
            message!("the table is {}", path.display());
        }
    }
    if let Some(warning) = jumps(&states) {
        message!("{warning}");
    }
    if let Some(path) = &outputs.report {
        let page = appendix::element_page(&ElementReport {
            deck: &args.deck.display().to_string(),
            title: loaded.deck.title.as_deref().unwrap_or_default(),
            material: name,
            parameters: &loaded.deck.materials[name],
            law: law.as_ref(),
            path_name: args.path.word(),
            path: route.path(),
            states: &states,
            failure: failure.as_deref(),
            units: args.units.as_ref(),
        });
        appendix::write(path, &page)?;
        message!("the report is {}", path.display());
    }
    let Some(failure) = failure else { return Ok(DONE) };
    message!(
        "error: {failure}\n  the table has {}\n  help: the law may have no state beyond \
         this point of the path; otherwise, take more steps with `--steps`",
        match states.len() - 1 {
            0 => "only the initial state".to_owned(),
            1 => "the step before the failure".to_owned(),
            steps => format!("the {steps} steps before the failure"),
        }
    );
    Ok(FAILED)
}

/// A law, and the initial history variables of a point.
type Beginning = (Box<dyn Material>, Vec<f64>);

/// The law and the initial history variables of a material, at a position if its properties vary; `None` if it has
/// faults, which are then printed.
fn beginning(loaded: &LoadedDeck, material: &str, at: Option<&[f64]>) -> anyhow::Result<Option<Beginning>> {
    let stated =
        loaded.point_law(material).with_context(|| format!("there is no material {}", quote(material)))?;
    let stated = match stated {
        Ok(stated) => stated,
        Err(faults) => {
            let text = render_all(&loaded.source, &faults, std::io::stderr().is_terminal());
            message!("{}", text.trim_end());
            return Ok(None);
        }
    };
    let n = loaded.deck.dimensions();
    let position = match at {
        None if !stated.varying.is_empty() => {
            let key = &stated.varying[0].key;
            bail!(
                "`{key}` of the material {} varies in space, and the position of the point is unknown\n  help: give its \
                 coordinates, for example `--at {}`",
                quote(material),
                ["1,2", "1,2,3"][usize::from(n == 3)]
            );
        }
        Some(at) if at.len() != n => bail!(
            "`--at` has {}; the deck has {n} axes\n  help: give one coordinate for each axis, `--at {}`",
            match at.len() {
                1 => "1 coordinate".to_owned(),
                count => format!("{count} coordinates"),
            },
            ["1,2", "1,2,3"][usize::from(n == 3)]
        ),
        at => std::array::from_fn(|d| at.and_then(|at| at.get(d)).copied().unwrap_or(0.0)),
    };
    let law = stated.law(&[0.0; 3]);
    let history = law.initial_history_at(&position);
    let own = history.len() - stated.varying.len();
    if let Some(fault) = loaded.deck.materials[material].fault_at(&stated, &history[own..]) {
        bail!(
            "material {} at {:?}: {fault}\n  help: choose another position with `--at`, within the bodies, or change the \
             formula",
            quote(material),
            at.unwrap_or_default()
        );
    }
    Ok(Some((law, history)))
}

/// How the softening of a material is adapted to the cell size; `None` for a material without a localisation band.
fn softening(loaded: &LoadedDeck, material: &str) -> Option<String> {
    let band = loaded.deck.materials.get(material)?.softening()??;
    Some(match loaded.cell_size() {
        CellSize::Even(size) | CellSize::Mean(size) => format!(
            "the softening strain is multiplied by {:.3}, the ratio of the band width {band} to the cell size \
             {size:.3}",
            band / size
        ),
        CellSize::Graded(_) => format!(
            "the softening strain is multiplied by the ratio of the band width {band} to the cell size at the point"
        ),
        CellSize::Unknown => format!(
            "the softening strain is that of a band of width {band}; the cell size of the mesh is not considered"
        ),
    })
}

/// The name of the material to test.
fn material_name<'a>(loaded: &'a LoadedDeck, wanted: Option<&str>) -> anyhow::Result<&'a str> {
    let names: Vec<&str> = loaded.deck.materials.keys().map(String::as_str).collect();
    match (wanted, &names[..]) {
        (None, [only]) => Ok(only),
        (None, _) => {
            bail!("choose a material with `--material`; the materials of the deck are {}", list(names))
        }
        (Some(wanted), _) => match names.iter().find(|name| **name == wanted) {
            Some(found) => Ok(found),
            None => {
                let help = known_names(Noun::new("material", "materials"), wanted, &names);
                bail!("there is no material {}; {help}", quote(wanted))
            }
        },
    }
}

/// The route that the point follows; an error if the arguments do not fit together.
fn route(args: &ElementArgs) -> anyhow::Result<Route> {
    use element_test::Path as Way;
    let (word, constant_normal_stress) = (args.path.word(), args.constant_normal_stress);
    if constant_normal_stress && args.path != PathName::SimpleShear {
        bail!("`--constant-normal-stress` needs `--path simple-shear`; it does not apply to the path {word}");
    }
    let way = match args.path {
        PathName::Strain => return history(args, Prescribed::Strain),
        PathName::Stress => return history(args, Prescribed::Stress),
        PathName::Oedometer => Way::Oedometer,
        PathName::Isotropic => Way::Isotropic,
        PathName::TriaxialDrained => Way::TriaxialDrained,
        PathName::TriaxialUndrained => Way::TriaxialUndrained,
        PathName::Biaxial => Way::Biaxial,
        PathName::SimpleShear => Way::SimpleShear { constant_normal_stress },
    };
    if args.file.is_some() {
        bail!(
            "`--file` needs `--path strain` or `--path stress`; the path {word} ends at the strain given by `--to`"
        );
    }
    let Some(to) = args.to else {
        bail!("{word} needs `--to`, the final strain, for example `--to 0.1`");
    };
    let turning_points: Vec<f64> = std::iter::once(to).chain(args.then.iter().copied()).collect();
    Ok(Route::Path(way, turning_points))
}

/// The history in a file.
fn history(args: &ElementArgs, prescribed: Prescribed) -> anyhow::Result<Route> {
    let word = args.path.word();
    if args.to.is_some() {
        bail!("`--to` does not apply to the path {word}, whose targets are the rows of `--file`");
    }
    let Some(file) = &args.file else {
        bail!(
            "the path {word} needs `--file`, a CSV file of its history with columns xx, yy, zz, yz, xz, xy"
        );
    };
    let targets = read_history(file, prescribed).map_err(|error| match error.kind() {
        std::io::ErrorKind::InvalidData => anyhow::anyhow!("{error}"),
        _ => anyhow::anyhow!("the history `{}` cannot be read: {error}", file.display()),
    })?;
    Ok(Route::History(targets))
}

impl Route {
    /// The path, if it is not a history.
    fn path(&self) -> Option<element_test::Path> {
        match self {
            Route::Path(path, _) => Some(*path),
            Route::History(_) => None,
        }
    }
}

/// The initial state and the states at the end of each step, and the error that ended the test early.
fn states(
    law: &dyn Material,
    test: ElementTest,
    route: &Route,
    steps: Option<u64>,
) -> anyhow::Result<(Vec<ElementState>, Option<String>)> {
    let initial = *test.initial_stress();
    let (targets, usual): (Vec<Target>, u64) = match route {
        Route::Path(path, points) => {
            (points.iter().map(|point| path.target(*point, &initial)).collect(), USUAL_STEPS)
        }
        Route::History(targets) => (targets.clone(), 1),
    };
    let steps = usize::try_from(steps.unwrap_or(usual))?;
    if targets.len().saturating_mul(steps) > MAX_STATES {
        bail!("the test would have more than {MAX_STATES} steps; lower `--steps`");
    }
    let mut states = vec![test.state().clone()];
    for state in test.follow(targets, steps) {
        let number = states.len();
        let found = state.map_err(|error| error.to_string()).and_then(|state| match infinite(law, &state) {
            None => Ok(state),
            Some(column) => Err(format!("step {number}: {} is not finite", quote(&column))),
        });
        match found {
            Ok(state) => states.push(state),
            Err(failure) => return Ok((states, Some(failure))),
        }
    }
    Ok((states, None))
}

/// A warning if the stress of the point jumps within a step.
fn jumps(states: &[ElementState]) -> Option<String> {
    let steps: Vec<usize> = (0..states.len()).filter(|step| states[*step].has_jumped).collect();
    let first = *steps.first()?;
    let [before, after] = [first - 1, first].map(|step| states[step].deviatoric_stress());
    let others = match steps.len() {
        1 => String::new(),
        count => format!(", the first of {count} such steps"),
    };
    Some(format!(
        "warning: in step {first}{others}, the point jumps: the deviatoric stress changes from {before:.6e} to {after:.6e} at \
         once, however small the steps are\n  help: the material softens faster than the point can unload elastically along \
         this path (snap-back), and no test can follow the states in between; a larger softening strain or a larger \
         stiffness avoids the jump. The column `jump` of the table marks the step"
    ))
}

/// The error of a test that cannot begin, with a remedy.
fn initial_failure(error: ElementTestError) -> anyhow::Error {
    let help = match error {
        ElementTestError::Initial(MaterialError::NoInverse) => "start from zero stress with `--confining 0`",
        _ => "choose another initial stress with `--confining` and `--k0`",
    };
    anyhow::anyhow!("{error}; {help}")
}

/// The files to write.
struct Outputs {
    /// The table; `None` is standard output.
    table: Option<PathBuf>,
    /// The page, if one is wanted.
    report: Option<PathBuf>,
}

impl Outputs {
    /// Chooses the output files from the arguments; refuses to overwrite a file that the command did not write.
    fn chosen(args: &ElementArgs, material: &str) -> anyhow::Result<Outputs> {
        let deck = args.deck.file_stem().unwrap_or_default().to_string_lossy();
        // A material name may have characters that a file name cannot have.
        let is_plain = |c: char| c.is_alphanumeric() || "-_.+".contains(c);
        let material: String = material.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
        let named =
            |extension: &str| PathBuf::from(format!("{deck}-{material}-{}.{extension}", args.path.word()));
        let table = match &args.output {
            Some(path) if path == Path::new("-") => None,
            Some(path) => Some(path.clone()),
            None => Some(named("csv")),
        };
        let report = args.report.as_ref().map(|path| path.clone().unwrap_or_else(|| named("html")));
        if table.as_deref().zip(report.as_deref()).is_some_and(|(table, page)| real(table) == real(page)) {
            bail!("the table and the page cannot be the same file; choose another name with `--report`");
        }
        if let Some(path) = table.as_ref().filter(|path| !may_be_replaced(path, FIRST_COLUMNS)) {
            bail!(
                "`{}` exists, but is not the table of an element test; choose another name with `--output`",
                path.display()
            );
        }
        if let Some(path) = report.as_ref().filter(|path| !may_be_replaced(path, REPORT)) {
            bail!(
                "`{}` exists, but is not an mpm report; choose another name with `--report`",
                path.display()
            );
        }
        Ok(Outputs { table, report })
    }
}
