//! `run.json`: the analysis, its deck and the machine, written before the first load step.

use std::fs;
use std::io;
use std::path::Path;

use serde_json::{Value, json};

use mpm_core::model::Model;

use super::replace::replace_file;
use super::summary::{Account, VERSION};

impl Account {
    /// Writes the file of a run with this number of points on this number of ranks.
    pub(super) fn write_start<const D: usize>(
        &self,
        path: &Path,
        model: &Model<D>,
        points: usize,
        ranks: usize,
    ) -> io::Result<()> {
        let began = jiff::Timestamp::now() - self.start.elapsed().wall;
        let mut document = json!({
            "title": model.title,
            "version": VERSION,
            "build": if cfg!(debug_assertions) { "debug" } else { "release" },
            "started": format!("{began:.0}"),
            "deck": {"file": self.deck_file, "text": self.deck_text},
            "deck_hash": self.deck_hash,
            "parameters": self.parameters,
            "idealisation": match (D, model.revolved) {
                (2, true) => "axisymmetric",
                (2, false) => "plane-strain",
                _ => "solid",
            },
            "points": points,
            "cells": model.grid.n_cells(),
            "steps_requested": model.steps_requested(),
            "threads": self.threads,
            "machine": machine(),
        });
        if let Some(units) = &self.units {
            document["units"] = units.document();
        }
        if ranks > 1 {
            document["ranks"] = json!(ranks);
        }
        if !self.law_libraries.is_empty() {
            document["law_libraries"] = json!(self.law_libraries);
        }
        if !self.messages.is_empty() {
            document["messages"] = json!(self.messages);
        }
        let mut text = serde_json::to_string_pretty(&document).map_err(io::Error::other)?;
        text.push('\n');
        replace_file(path, |out| out.write_all(text.as_bytes()))
    }
}

/// Description of the machine, from what the system provides.
fn machine() -> Value {
    let line = |path: &str, key: &str| {
        let text = fs::read_to_string(path).ok()?;
        let line = text.lines().find(|line| line.starts_with(key))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    };
    let kibibytes = |text: String| text.split_whitespace().next()?.parse::<u64>().ok();
    let kernel = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    let system = format!("{} {} {}", std::env::consts::OS, kernel.trim(), std::env::consts::ARCH);
    json!({
        "processor": line("/proc/cpuinfo", "model name"),
        "cores": std::thread::available_parallelism().ok(),
        "memory_bytes": line("/proc/meminfo", "MemTotal").and_then(kibibytes).map(|kib| kib * 1024),
        "system": system.split_whitespace().collect::<Vec<_>>().join(" "),
    })
}
