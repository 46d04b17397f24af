//! The tools and the contacts between bodies of a run as documents.

use mpm::model::{Model, Tool};
use mpm::output::history::name_of_pair;
use mpm::terms::{ContactPoint, Mode, PairState, ToolState};
use serde_json::{Map, Value, json};

/// The tools at the end of a step, keyed by name.
pub fn tools_document<const D: usize>(model: &Model<D>, tools: &[ToolState<D>]) -> Value {
    let entries =
        model.tools.iter().zip(tools).map(|(tool, state)| (tool.name.clone(), document(tool, state)));
    Value::Object(entries.collect::<Map<_, _>>())
}

fn document<const D: usize>(tool: &Tool<D>, state: &ToolState<D>) -> Value {
    let parts = tool.parts.iter().zip(&state.parts).map(|(part, acting)| {
        let document =
            json!({"force": acting.force.to_vec(), "moment": acting.moment, "n_contacts": acting.contacts});
        (part.name.clone(), document)
    });
    json!({
        "position": state.pose.position().to_vec(),
        "displacement": state.displacement.to_vec(),
        "rotation": state.rotation,
        "force": state.force.to_vec(),
        "moment": state.moment,
        "overlap": state.overlap,
        "allowed_overlap": state.allowed_overlap,
        "parts": Value::Object(parts.collect::<Map<_, _>>()),
        "contacts": contacts(&state.contacts),
    })
}

/// The contacts between bodies at the end of a step, keyed by the names under which `history.csv` has their forces.
pub fn pairs_document<const D: usize>(model: &Model<D>, pairs: &[PairState<D>]) -> Value {
    let entries = model.contacts.iter().zip(pairs).map(|(contact, state)| {
        let points: Vec<ContactPoint<D>> = state.contacts.iter().map(|found| found.contact.clone()).collect();
        let document = json!({
            "force": state.force.to_vec(),
            "area": state.area,
            "overlap": state.overlap,
            "slip": state.slip,
            "contacts": contacts(&points),
            "gaps": state.contacts.iter().map(|found| found.gap).collect::<Vec<_>>(),
            "slips": state.contacts.iter().map(|found| found.slip).collect::<Vec<_>>(),
        });
        (name_of_pair(model, contact), document)
    });
    Value::Object(entries.collect::<Map<_, _>>())
}

/// The contact points of a tool, one list for each of their quantities.
fn contacts<const D: usize>(contacts: &[ContactPoint<D>]) -> Value {
    let vectors = |quantity: &dyn Fn(&ContactPoint<D>) -> [f64; D]| -> Vec<Vec<f64>> {
        contacts.iter().map(|contact| quantity(contact).to_vec()).collect()
    };
    let numbers =
        |quantity: &dyn Fn(&ContactPoint<D>) -> f64| -> Vec<f64> { contacts.iter().map(quantity).collect() };
    let counts = |quantity: &dyn Fn(&ContactPoint<D>) -> usize| -> Vec<usize> {
        contacts.iter().map(quantity).collect()
    };
    json!({
        "position": vectors(&|contact| contact.position),
        "normal": vectors(&|contact| contact.normal),
        "force": vectors(&|contact| contact.force),
        "shear": vectors(&|contact| contact.shear),
        "pressure": numbers(&|contact| contact.pressure),
        "area": numbers(&|contact| contact.area),
        "state": contacts.iter().map(|contact| word(contact.mode)).collect::<Vec<_>>(),
        "point": counts(&|contact| contact.point as usize),
        "body": counts(&|contact| contact.body),
        "edge": counts(&|contact| contact.part),
    })
}

fn word(mode: Mode) -> &'static str {
    match mode {
        Mode::Stick => "stick",
        Mode::Slip => "slip",
        Mode::Parting => "parting",
    }
}
