//! The limit load of a run.

use serde_json::Value;

use super::number::html;
use super::run::Run;
use super::sections::with_unit;
use super::units::{Naming, Quantity};

/// The limit load of the last stage that runs until its limit, as a key number, and a remark, both in HTML; `None` if no
/// stage does.
pub(super) fn key_number(run: &Run, naming: &Naming) -> Option<(String, String)> {
    let found = run.summary["limit_loads"].as_array()?.last()?;
    let is_force = found["kind"] == "force";
    let shown =
        |value: f64| if is_force { with_unit(value, Quantity::Force, naming) } else { html(value, 5) };
    let load = found["load"].as_f64()?;
    if found["reached"] != Value::Bool(true) {
        return Some((
            format!("above {}", shown(load)),
            "the load still grew at the end of the run".to_owned(),
        ));
    }
    let [low, high] = ["/bracket/0", "/bracket/1"].map(|end| found.pointer(end).and_then(Value::as_f64));
    let what = if is_force { "force along the largest prescribed displacement" } else { "load factor" };
    let remark = format!(
        "{what}; between {} (the last load) and {} (the largest expected)",
        shown(low?),
        shown(high?)
    );
    Some((shown(load), remark))
}
