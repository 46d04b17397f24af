//! Checks of the named parts of the tools of a deck, and of the columns of `history.csv` for tools and their parts.

use super::Check;
use crate::LoadDeck;
use crate::quoting::quote;
use crate::span::escape;
use crate::tools::{ToolDeck, ToolPartDeck};

/// Columns of `history.csv`: `<name>_r…`, `<name>_f…`, `<name>_m…` and `<name>_u…`.
struct Columns {
    name: String,
    /// The letters after the name.
    letters: &'static str,
    /// The owner of these columns, as messages name it.
    owner: String,
}

impl Columns {
    fn new(name: impl Into<String>, letters: &'static str, owner: String) -> Self {
        Columns { name: name.into(), letters, owner }
    }

    /// A letter that both sets of columns have after the same name.
    fn shared_with(&self, other: &Columns) -> Option<char> {
        let is_shared = |letter: &char| other.letters.contains(*letter);
        self.letters.chars().find(is_shared).filter(|_| self.name == other.name)
    }
}

impl Check<'_> {
    /// Checks the parts of a tool.
    pub(super) fn parts_of_tool(&mut self, pointer: &str, tool: &ToolDeck) {
        for (name, part) in &tool.parts {
            let at = format!("{pointer}/parts/{}", escape(name));
            if name.trim().is_empty() {
                let help = "write a name of letters, digits, `_` and `-`";
                self.error("D026", &at, "a name must not be empty", help);
            } else {
                self.column_name(&at, name);
            }
            self.part_of_tool(&at, tool, part);
        }
    }

    fn part_of_tool(&mut self, pointer: &str, tool: &ToolDeck, part: &ToolPartDeck) {
        if part.edges.is_none() && part.within.is_none() {
            let message = "a part of a tool must be selected by its edges, by a box, or by both";
            self.error("D019", pointer, message, "give `edges`, `box`, or both");
        }
        if let Some(within) = &part.within {
            self.ordered(&format!("{pointer}/box"), &within.min, &within.max);
        }
        let Some(edges) = &part.edges else { return };
        let word = tool.shape.word();
        let Some(n) = tool.shape.edges() else {
            let message = format!("a tool of type `{word}` has no numbered edges");
            self.error("D069", &format!("{pointer}/edges"), message, "select the part by `box`");
            return;
        };
        for (index, edge) in edges.iter().enumerate() {
            let at = format!("{pointer}/edges/{index}");
            if *edge as usize >= n {
                let message = format!("the tool {} of type `{word}` has no edge {edge}", quote(&tool.name));
                self.error("D069", &at, message, format!("its edges have the numbers 0 to {}", n - 1));
            } else if edges[..index].contains(edge) {
                self.error("D017", &at, format!("the edge {edge} is listed twice"), "remove one of them");
            }
        }
    }

    /// Reports tools and parts whose columns in `history.csv` would have the same names as other columns.
    pub(super) fn columns_of_tools(&mut self) {
        let deck = self.deck;
        let mut known: Vec<Columns> = Vec::new();
        for condition in &deck.boundary_conditions {
            let name = &condition.name;
            known.push(Columns::new(name, "rm", format!("the boundary condition {}", quote(name))));
        }
        for name in deck.loads.iter().map(LoadDeck::name) {
            known.push(Columns::new(name, "f", format!("the load {}", quote(name))));
        }
        for name in deck.output.probes.iter().map(|probe| &probe.name) {
            known.push(Columns::new(name, "u", format!("the probe {}", quote(name))));
        }
        for (index, tool) in deck.tools.iter().enumerate() {
            let pointer = format!("/tools/{index}");
            let name = &tool.name;
            let owner = format!("the tool {}", quote(name));
            // Tools of the same name have been reported.
            if !deck.tools[..index].iter().any(|other| other.name == *name) {
                let columns = Columns::new(name, "fmu", owner.clone());
                self.new_columns(&format!("{pointer}/name"), columns, &mut known);
            }
            for part in tool.parts.keys() {
                let at = format!("{pointer}/parts/{}", escape(part));
                let owner = format!("the part {} of {owner}", quote(part));
                self.new_columns(&at, Columns::new(format!("{name}_{part}"), "fm", owner), &mut known);
            }
        }
    }

    fn new_columns(&mut self, pointer: &str, columns: Columns, known: &mut Vec<Columns>) {
        let clash = known.iter().find_map(|other| Some((columns.shared_with(other)?, other)));
        if let Some((letter, other)) = clash {
            let message = format!(
                "{} and {} would both have columns `{}_{letter}…` in `history.csv`",
                columns.owner, other.owner, columns.name
            );
            self.error("D017", pointer, message, "give one of the two another name");
        }
        known.push(columns);
    }
}
