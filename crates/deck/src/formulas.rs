//! Turns the expressions of a deck into formulas: the names that each may contain, and the order in which intermediate
//! values are computed.

use std::collections::BTreeMap;

use super::span::escape;
use super::{AXES, Expression, Parameter};
use mpm_core::formula::{Formula, FormulaError, MAX_INTERMEDIATE, names};
use mpm_core::model::VectorFormula;

/// Help for a name that formulas cannot contain.
pub(crate) const NAMES: &str = "use letters, digits and `_`, with a letter or `_` first";

/// Names of the variables of a formula for points or grid nodes, in the order of their values.
fn variables(dimensions: usize) -> Vec<&'static str> {
    let n = dimensions.min(3);
    [&["x", "y", "z"][..n], &["X", "Y", "Z"][..n], &["factor"]].concat()
}

/// Names of the variables of formulas; no parameter may have one of these names.
pub const VARIABLES: [&str; 8] = ["x", "y", "z", "X", "Y", "Z", "factor", "time"];

/// A fault in a formula: the key under the entry of the deck (`force/0`, `where/q`), the text, and the error.
pub struct Fault {
    /// Key, relative to the entry of the deck that has the formula.
    pub key: String,
    /// Text of the formula.
    pub text: String,
    /// The error.
    pub error: FormulaError,
}

/// Numeric parameters, as constants of a formula.
fn constants(parameters: &BTreeMap<String, Parameter>) -> Vec<(&str, f64)> {
    parameters
        .iter()
        .filter_map(|(name, parameter)| match parameter {
            Parameter::Number(value) => Some((name.as_str(), *value)),
            Parameter::Word(_) => None,
        })
        .collect()
}

fn parse(
    expression: &Expression,
    variables: &[&str],
    parameters: &BTreeMap<String, Parameter>,
) -> Result<Formula, FormulaError> {
    let text = match expression {
        Expression::Number(value) => return Ok(Formula::constant(*value)),
        Expression::Formula(text) => text,
    };
    let formula = Formula::parse_with_constants(text, variables, &constants(parameters))?;
    match formula.as_constant() {
        Some(value) if !value.is_finite() => Err(FormulaError {
            message: format!("the formula `{text}` has no finite value"),
            offset: 0,
            length: text.len(),
            help: Some(
                "write one that does not divide by zero and stays within the domains of its functions".into(),
            ),
        }),
        _ => Ok(formula),
    }
}

fn text_of(expression: &Expression) -> String {
    match expression {
        Expression::Number(value) => value.to_string(),
        Expression::Formula(text) => text.clone(),
    }
}

/// Intermediate values, and the components of a vector that may use them, as formulas of the same variables; each
/// intermediate value may use the ones before it.
type Parsed = (Vec<Formula>, Vec<Formula>);

/// # Errors
/// The first fault of each formula, names that already have a meaning, and values that depend on themselves.
fn parse_all<'a>(
    components: &[(String, &Expression)],
    intermediate: &'a BTreeMap<String, Expression>,
    mut variables: Vec<&'a str>,
    parameters: &BTreeMap<String, Parameter>,
) -> Result<Parsed, Vec<Fault>> {
    let mut faults = Vec::new();
    let ordered = in_order(intermediate, parameters, &mut faults);
    if !faults.is_empty() {
        return Err(faults); // formulas that use these names have no faults of their own
    }
    let mut read = |key: String, expression: &Expression, variables: &[&str]| {
        parse(expression, variables, parameters).unwrap_or_else(|error| {
            faults.push(Fault { key, text: text_of(expression), error });
            Formula::constant(0.0)
        })
    };
    let mut given = Vec::new();
    for name in ordered {
        given.push(read(format!("where/{}", escape(name)), &intermediate[name], &variables));
        variables.push(name);
    }
    let vector = components.iter().map(|(key, part)| read(key.clone(), part, &variables)).collect();
    if faults.is_empty() { Ok((given, vector)) } else { Err(faults) }
}

/// A displacement that a boundary condition prescribes by a key other than `fix`.
pub struct Displacement<'a> {
    /// Key of the displacement, relative to the boundary condition.
    pub key: &'static str,
    /// Index of the direction, or of the axis if the condition states no direction of its own.
    pub direction: usize,
    /// Number or formula.
    pub value: &'a Expression,
}

/// The displacements that a boundary condition prescribes along each axis, or along each direction that it states
/// itself, as formulas of the coordinates x, y, z of a grid node, the original position X, Y, Z of the material there,
/// and `factor`; z and Z only in three dimensions.
///
/// # Errors
/// As for [`at_points`].
pub fn at_nodes(
    mut displacements: Vec<Displacement>,
    intermediate: &BTreeMap<String, Expression>,
    parameters: &BTreeMap<String, Parameter>,
    dimensions: usize,
) -> Result<[Option<Formula>; AXES.len()], Vec<Fault>> {
    displacements.retain(|given| given.direction < dimensions);
    let components: Vec<(String, &Expression)> =
        displacements.iter().map(|given| (given.key.to_owned(), given.value)).collect();
    let (given, vector) = parse_all(&components, intermediate, variables(dimensions), parameters)?;
    let mut all = [const { None }; AXES.len()];
    for (displacement, formula) in displacements.iter().zip(vector) {
        all[displacement.direction] = Some(formula.with_intermediate(&given));
    }
    Ok(all)
}

/// The vector formula of a body force and its intermediate values.
///
/// # Errors
/// The first fault of each formula, names that already have a meaning, and values that depend on themselves.
pub fn at_points<const D: usize>(
    components: &[Expression],
    intermediate: &BTreeMap<String, Expression>,
    parameters: &BTreeMap<String, Parameter>,
) -> Result<VectorFormula<D>, Vec<Fault>> {
    at_places::<D, D>("force", components, intermediate, parameters)
}

/// A formula with `C` components on material points or surfaces, and its intermediate values. `key` is the key of the
/// components, which form a list unless there is only one.
///
/// # Errors
/// As for [`at_points`].
pub fn at_places<const D: usize, const C: usize>(
    key: &str,
    components: &[Expression],
    intermediate: &BTreeMap<String, Expression>,
    parameters: &BTreeMap<String, Parameter>,
) -> Result<VectorFormula<D, C>, Vec<Fault>> {
    let key_of = |axis: usize| if C == 1 { key.to_owned() } else { format!("{key}/{axis}") };
    let components: Vec<(String, &Expression)> =
        components.iter().take(C).enumerate().map(|(axis, part)| (key_of(axis), part)).collect();
    let (given, vector) = parse_all(&components, intermediate, variables(D), parameters)?;
    let mut vector = vector.into_iter();
    let vector = std::array::from_fn(|_| vector.next().unwrap_or(Formula::constant(0.0)));
    Ok(VectorFormula::new(given, vector))
}

/// A formula in the load factor, `factor`, and `time`, in this order.
///
/// # Errors
/// The fault of the formula, with an empty key.
pub fn at_time(value: &Expression, parameters: &BTreeMap<String, Parameter>) -> Result<Formula, Fault> {
    parse(value, &["factor", "time"], parameters).map_err(|error| Fault {
        key: String::new(),
        text: text_of(value),
        error,
    })
}

/// Expressions, each with its key, as formulas of the original position: X, Y and, in three dimensions, Z.
///
/// # Errors
/// The first fault of each formula.
pub fn at_start(
    components: Vec<(String, &Expression)>,
    parameters: &BTreeMap<String, Parameter>,
    dimensions: usize,
) -> Result<Vec<Formula>, Vec<Fault>> {
    let variables = ["X", "Y", "Z"][..dimensions.min(3)].to_vec();
    let (_, formulas) = parse_all(&components, &BTreeMap::new(), variables, parameters)?;
    Ok(formulas)
}

/// The intermediate values, ordered so that each uses only earlier ones.
fn in_order<'a>(
    intermediate: &'a BTreeMap<String, Expression>,
    parameters: &BTreeMap<String, Parameter>,
    faults: &mut Vec<Fault>,
) -> Vec<&'a str> {
    let fault = |name: &str, message: String, help: &str| Fault {
        key: format!("where/{}", escape(name)),
        text: text_of(&intermediate[name]),
        error: FormulaError { message, offset: 0, length: 0, help: Some(help.to_owned()) },
    };
    if intermediate.len() > MAX_INTERMEDIATE {
        if let Some(name) = intermediate.keys().next() {
            let message = format!("at most {MAX_INTERMEDIATE} intermediate values are possible");
            faults.push(fault(name, message, "write some of them out where they are used"));
        }
        return Vec::new();
    }
    let mut waiting: Vec<&str> = Vec::new();
    for name in intermediate.keys() {
        let first = name.chars().next().unwrap_or(' ');
        let is_name =
            (first.is_alphabetic() || first == '_') && name.chars().all(|c| c.is_alphanumeric() || c == '_');
        if !is_name {
            faults.push(fault(name, format!("`{name}` cannot be a name in a formula"), NAMES));
        } else if VARIABLES.contains(&name.as_str()) || mpm_core::formula::is_reserved(name) {
            faults.push(fault(
                name,
                format!("`{name}` already has a meaning in formulas"),
                "choose another name",
            ));
        } else if parameters.contains_key(name) {
            let help = "choose another name, or use the parameter";
            faults.push(fault(name, format!("`{name}` is already a parameter"), help));
        } else {
            waiting.push(name);
        }
    }
    let needs = |name: &str| -> Vec<&str> {
        match &intermediate[name] {
            Expression::Formula(text) => names(text).into_iter().map(|(_, used)| used).collect(),
            Expression::Number(_) => Vec::new(),
        }
    };
    let mut ordered: Vec<&str> = Vec::new();
    while !waiting.is_empty() {
        let ready = |name: &&str| !needs(name).iter().any(|used| waiting.contains(used));
        let Some(place) = waiting.iter().position(ready) else {
            // Values that depend on themselves are at fault; values that only use such values fail as a consequence.
            for name in &waiting {
                let mut reached: Vec<&str> = needs(name);
                let mut next = 0;
                while let Some(&used) = reached.get(next) {
                    next += 1;
                    if waiting.contains(&used) {
                        let further: Vec<&str> =
                            needs(used).into_iter().filter(|n| !reached.contains(n)).collect();
                        reached.extend(further);
                    }
                }
                if reached.contains(name) {
                    let help = "write it in terms of coordinates, parameters and values that do not use it";
                    faults.push(fault(name, format!("`{name}` depends on itself"), help));
                }
            }
            break;
        };
        ordered.push(waiting.remove(place));
    }
    ordered
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BoundaryConditionDeck;

    fn formulas(pairs: &[(&str, &str)]) -> BTreeMap<String, Expression> {
        pairs.iter().map(|(n, t)| (n.to_string(), Expression::Formula(t.to_string()))).collect()
    }

    fn text(text: &str) -> Expression {
        Expression::Formula(text.into())
    }

    #[test]
    fn intermediate_values_are_found_in_any_order() {
        let parameters = BTreeMap::from([("E".to_string(), Parameter::Number(10.0))]);
        let values = formulas(&[("a", "b + 1"), ("b", "c*2"), ("c", "X + Y")]);
        let force = at_points(&[text("E*a + x"), text("factor*b")], &values, &parameters).ok().unwrap();
        // c = 7, b = 14, a = 15; the first component is scaled by the factor, the second contains it.
        assert_eq!(force.evaluate(&[1.0, 2.0], &[3.0, 4.0], 0.5), [0.5 * 151.0, 7.0]);
    }

    #[test]
    fn a_factor_inside_an_intermediate_value_is_found() {
        let values = formulas(&[("q", "factor^2"), ("r", "q + 1")]);
        let force = at_points(&[text("r"), text("1")], &values, &BTreeMap::new()).ok().unwrap();
        assert_eq!(force.evaluate(&[0.0; 2], &[0.0; 2], 3.0), [10.0, 3.0]);
    }

    #[test]
    fn faults_are_reported_with_their_key() {
        let faults = |values: &[(&str, &str)], force: &str| -> Vec<(String, String)> {
            match at_points::<2>(&[text(force), text("0")], &formulas(values), &BTreeMap::new()) {
                Ok(_) => vec![],
                Err(faults) => faults.into_iter().map(|f| (f.key, f.error.message)).collect(),
            }
        };
        assert_eq!(faults(&[("a", "b"), ("b", "a")], "1").len(), 2);
        assert_eq!(faults(&[("sin", "1")], "1")[0].0, "where/sin");
        assert_eq!(faults(&[("a", "1 +")], "1")[0].0, "where/a");
        assert_eq!(faults(&[], "unknown")[0].0, "force/0");
        assert!(faults(&[("a", "1")], "a").is_empty());
        assert_eq!(faults(&[], "z")[0].0, "force/0");
    }

    #[test]
    fn space_has_a_third_coordinate() {
        let force = [text("x + 10*y + 100*z"), text("Z"), text("factor*X")];
        let force = at_points::<3>(&force, &BTreeMap::new(), &BTreeMap::new()).ok().unwrap();
        assert_eq!(force.evaluate(&[1.0, 2.0, 3.0], &[4.0, 5.0, 6.0], 2.0), [642.0, 12.0, 8.0]);
        let moved = |ux: &str, dimensions: usize| {
            let condition = serde_json::json!(
                {"name": "a", "nodes": {"x": 0.0}, "where": {"b": "c + y", "c": "2*x"}, "ux": ux}
            );
            let condition: BoundaryConditionDeck = serde_json::from_value(condition).unwrap();
            let BoundaryConditionDeck { intermediate, .. } = &condition;
            at_nodes(condition.displacements(), intermediate, &BTreeMap::new(), dimensions)
        };
        let [ux, uy, uz] = moved("z*factor + b", 3).ok().unwrap();
        assert_eq!(ux.unwrap().evaluate(&[1.0, 2.0, 3.0, 7.0, 8.0, 9.0, 0.5]), 1.5 + 4.0);
        assert!(uy.is_none() && uz.is_none());
        let fault = moved("z", 2).err().unwrap().remove(0);
        assert_eq!((fault.key.as_str(), fault.error.message.as_str()), ("ux", "unknown name `z`"));
        let [ux, ..] = moved("X + 10*Y", 2).ok().unwrap();
        assert_eq!(ux.unwrap().evaluate(&[1.0, 2.0, 7.0, 8.0, 0.5]), 87.0);
    }
}
