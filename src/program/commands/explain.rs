//! `mpm explain`: the meaning of a message and its remedy.

use crate::codes::{PAGES, page};
use crate::program::commands::guides::guide;
use crate::program::screen::print::print;
use anyhow::bail;

/// Prints the page of a code or of an example, or all codes with their titles.
pub fn explain(code: Option<&str>) -> anyhow::Result<u8> {
    let Some(code) = code else {
        let list: String = PAGES.iter().map(|page| format!("{}  {}\n", page.code, page.title())).collect();
        return print(&list);
    };
    match page(code.trim()) {
        Some(page) => print(page.text),
        None => match guide(code.trim()) {
            Some(text) => print(text),
            None => bail!("there is no code `{code}`; `mpm explain` lists all codes"),
        },
    }
}
