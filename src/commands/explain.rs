//! `mpm explain`: the meaning of a message and its remedy.

use std::process::ExitCode;

use anyhow::bail;
use mpm::codes::{PAGES, page};

use crate::screen::print::print;

/// Prints the page of a code, or all codes with their titles.
pub fn explain(code: Option<&str>) -> anyhow::Result<ExitCode> {
    let Some(code) = code else {
        let list: String = PAGES.iter().map(|page| format!("{}  {}\n", page.code, page.title())).collect();
        return print(&list);
    };
    match page(code.trim()) {
        Some(page) => print(page.text),
        None => bail!("there is no code `{code}`; `mpm explain` lists all codes"),
    }
}
