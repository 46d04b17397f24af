//! `mpm new`: example decks to start from.

use std::fs;
use std::path::{Path, PathBuf};

use crate::deck::schema::deck_schema;
use crate::program::commands::guides::with_commands;
use crate::program::screen::print::{json_text, print};
use anyhow::{Context, bail};
use clap::Args;

/// Arguments of `mpm new`.
#[derive(Args)]
pub struct NewArgs {
    /// Name of an example; if it is omitted, all examples are listed.
    name: Option<String>,
    /// Path of the deck to write [default: NAME.yaml].
    #[arg(long, value_name = "FILE", requires = "name")]
    out: Option<PathBuf>,
    /// Overwrite existing files.
    #[arg(long, requires = "name")]
    force: bool,
    /// List the examples.
    #[arg(long, conflicts_with = "name")]
    list: bool,
}

/// An example deck.
struct Example {
    name: &'static str,
    deck: &'static str,
    /// Names and contents of further files that the deck needs beside it.
    files: &'static [(&'static str, &'static [u8])],
}

macro_rules! example {
    ($name:literal $(, $file:literal)*) => {
        Example {
            name: $name,
            deck: include_str!(concat!("../../../inputs/new/", $name, ".yaml")),
            files: &[$(($file, include_bytes!(concat!("../../../inputs/new/", $file)))),*],
        }
    };
    (inputs: $name:literal $(, $file:literal)*) => {
        Example {
            name: $name,
            deck: include_str!(concat!("../../../inputs/", $name, ".yaml")),
            files: &[$(($file, include_bytes!(concat!("../../../inputs/", $file)))),*],
        }
    };
}

/// All examples, the simplest first.
const EXAMPLES: &[Example] = &[
    example!("column"),
    example!("beam"),
    example!("shear"),
    example!("collapse"),
    example!("footing"),
    example!("annulus", "annulus.msh", "annulus.geo"),
    example!(inputs: "excavation"),
    example!(inputs: "footing_stages"),
    example!(inputs: "slope"),
    example!(inputs: "bearing"),
    example!(inputs: "triaxial"),
    example!(inputs: "pipe"),
    example!(inputs: "cone"),
    example!(inputs: "plough"),
    example!(inputs: "flexible_footing"),
    example!(inputs: "boulder"),
    example!(inputs: "hertz"),
    example!(inputs: "runout"),
    Example { name: SAND, deck: include_str!("../../../inputs/column.yaml"), files: &[] },
    example!(inputs: "impact"),
    example!(inputs: "shaking", "shaking.csv"),
];

/// Name of the column of sand, which `column` does not leave free.
const SAND: &str = "sand_column";

/// The schema, for editors; the first line of every deck names it.
const SCHEMA: &str = "deck.schema.json";

impl Example {
    /// Title of the deck.
    fn title(&self) -> &'static str {
        self.deck.lines().find_map(|line| line.strip_prefix("title: ")).unwrap_or_default()
    }

    /// The text of the deck as written: it names the schema beside it, while the decks in `inputs` name the schema in
    /// another folder; pages are named by the command that prints them.
    fn text(&self) -> String {
        let text = with_commands(&self.deck.replacen("$schema=../schema/", "$schema=", 1));
        match self.name {
            SAND => text
                .replace(" column.yaml", " sand_column.yaml")
                .replace("results/column", "results/sand_column"),
            _ => text,
        }
    }
}

/// Writes an example, or lists all examples.
pub fn new(args: &NewArgs) -> anyhow::Result<u8> {
    let Some(name) = &args.name else { return print(&listing()) };
    let Some(example) = EXAMPLES.iter().find(|example| example.name == name) else {
        let all: Vec<String> = EXAMPLES.iter().map(|example| format!("`{}`", example.name)).collect();
        bail!("there is no example `{name}`; the examples are {}", all.join(", "));
    };
    let deck = args.out.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.yaml")));
    let folder = deck.parent().map(Path::to_owned).unwrap_or_default();
    let schema = json_text(&deck_schema())?;
    let text = example.text();
    let mut files = vec![(deck.clone(), text.as_bytes())];
    files.extend(example.files.iter().map(|(file, content)| (folder.join(file), *content)));
    files.push((folder.join(SCHEMA), schema.as_bytes()));
    let is_taken = |(path, _): &(PathBuf, &[u8])| path.file_name() == deck.file_name();
    if let Some((path, _)) = files[1..].iter().find(|file| is_taken(file)) {
        bail!(
            "`{}` is the name of another file of the example; choose another name with `--out`",
            path.display()
        );
    }
    write_all(&files, args.force)?;
    let names: Vec<String> = files.iter().map(|(path, _)| path.display().to_string()).collect();
    let deck = deck.display();
    print(&format!("wrote {}\nnext: read {deck}, then `mpm run {deck}`\n", names.join(", ")))
}

fn listing() -> String {
    let mut text = String::from("Examples to start from; `mpm new NAME` writes the deck:\n");
    let width = EXAMPLES.iter().map(|example| example.name.len()).max().unwrap_or(0);
    for example in EXAMPLES {
        text.push_str(&format!("  {:<width$}  {}\n", example.name, example.title()));
    }
    text
}

/// Writes all files, or none of them if one exists with other content and must not be overwritten.
fn write_all(files: &[(PathBuf, &[u8])], force: bool) -> anyhow::Result<()> {
    let mut missing = Vec::new();
    for (path, content) in files {
        // A device or a pipe would discard the deck, or block.
        if fs::metadata(path).is_ok_and(|about| !about.is_file()) {
            bail!("`{}` is not a regular file; choose another name with `--out`", path.display());
        }
        match fs::read(path) {
            Ok(found) if found == *content => {}
            Ok(found) if !force && !is_schema(path, &found) => {
                bail!(
                    "`{}` already exists; choose another name with `--out`, or overwrite it with `--force`",
                    path.display()
                )
            }
            _ => missing.push((path, content)),
        }
    }
    for (path, content) in missing {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)
                .with_context(|| format!("`{}` cannot be created", folder.display()))?;
        }
        fs::write(path, content).with_context(|| format!("`{}` cannot be written", path.display()))?;
    }
    Ok(())
}

/// True if a file is a schema, perhaps of another version of the program; users do not edit schemas.
fn is_schema(path: &Path, content: &[u8]) -> bool {
    let schema: Option<serde_json::Value> = serde_json::from_slice(content).ok();
    path.ends_with(SCHEMA) && schema.is_some_and(|schema| schema["title"] == "Deck")
}
